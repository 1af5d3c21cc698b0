"""The wearer's push as a reference."""
