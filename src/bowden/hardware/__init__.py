"""Drives and buses: CiA 402 over CANopen, and a digital twin that speaks it."""
