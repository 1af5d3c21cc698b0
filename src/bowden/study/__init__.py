"""Campaigns of thousands of runs."""
