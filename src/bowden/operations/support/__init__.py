"""What operations are made of: parameters from a signature, results as JSON and its schema, rigs and laws as given."""
