"""CAN buses: opening them, and one between processes."""
