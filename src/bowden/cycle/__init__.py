"""One cycle of the loop: sense, reference, law, supervisor."""
