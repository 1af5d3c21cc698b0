"""A rig: rig.toml, and what it describes."""
