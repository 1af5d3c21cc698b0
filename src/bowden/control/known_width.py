"""A dead zone that was measured before a run, as a law's first guess."""

from typing import Any

from bowden.control.law import Law

DOUBT = 0.5
"""Of a law's first guesses where the preflight measured the width; 1 is nothing known, 0.1 an identified model [–]."""
WIDEST = 0.5
"""Largest dead zone that is believed [rad]."""


def told(law: Law, width: float) -> Any:
    """A law's gains with this width as first guess, if it takes one and does not know better, as from a model.

    Args:
        law: one that learns a dead zone has the gains `width` and `doubt`.
        width: [rad]; NaN where nothing was measured.
    """
    gains: Any = law.gains
    if not ({"width", "doubt"} <= set(gains._fields) and gains.doubt > DOUBT and width > 0.0):
        return gains
    return gains._replace(width=min(float(width), law.limits.get("width", (0.0, WIDEST))[1]), doubt=DOUBT)
