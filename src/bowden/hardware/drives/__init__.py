"""Drives on a bus."""
