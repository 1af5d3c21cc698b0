"""A digital twin of a rig's drive."""
