"""Streams of EMG."""
