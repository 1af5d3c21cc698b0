"""The suit's geometry and cables, the wearer's arm, sensors on it."""
