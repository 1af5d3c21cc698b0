"""Sets of logs that are drawn from a number."""

SETS = {"development": 1, "judging": 2}
"""Set → its key, which goes into every draw: no two sets share a seed."""
