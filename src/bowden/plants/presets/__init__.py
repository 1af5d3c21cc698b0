"""The bench and the suit of the paper."""
