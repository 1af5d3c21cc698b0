"""The live loop: clock, cycle, ring buffer, recorder."""
