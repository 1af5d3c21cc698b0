"""Processing of sensors' readings before a law sees them."""
