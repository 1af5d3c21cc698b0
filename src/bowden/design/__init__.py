"""Gains against plants: whether a loop holds, and which gains to give it."""
