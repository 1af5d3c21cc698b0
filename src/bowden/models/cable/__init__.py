"""Cables, friction and sheath."""
