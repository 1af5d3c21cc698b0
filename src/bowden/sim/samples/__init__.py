"""Simulated recordings with which every command can be tried, and the truth behind each."""
