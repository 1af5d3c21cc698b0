"""What is made of sensors' readings before a law sees them."""
