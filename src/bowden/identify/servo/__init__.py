"""From a log of a servo to its parameters."""
