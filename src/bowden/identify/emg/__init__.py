"""Recordings of EMG: reading, levels, scores."""
