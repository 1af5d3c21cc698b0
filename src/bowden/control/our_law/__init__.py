"""Our own law and the estimates that it is made of."""
