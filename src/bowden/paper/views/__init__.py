"""Views of their results."""
