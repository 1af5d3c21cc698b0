"""Servo, motors, heat and encoders."""
