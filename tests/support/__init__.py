"""Apparatus of tests and benchmarks: the fault matrix, the live loop under its faults, inputs of every kind."""
