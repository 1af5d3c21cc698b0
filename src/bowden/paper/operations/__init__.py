"""The paper's own operations."""
