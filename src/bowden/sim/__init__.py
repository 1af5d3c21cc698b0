"""Simulation: plants, the closed loop, and how the sheath moves."""
