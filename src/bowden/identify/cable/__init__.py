"""From a log of a cable to a model of it."""
