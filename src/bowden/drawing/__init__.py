"""How figures and screens look: colours, axes, lines of one screen."""
