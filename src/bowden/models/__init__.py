"""Models of the things in the way of the motion: geometry, cable, sheath, servo, motor and encoder."""
