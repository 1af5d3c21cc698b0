"""Units as recordings name them, in a column's name or in a line of their own."""

UNITS = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("rad", "rads", "radian", "radians"), "rad"),
    **dict.fromkeys(("mdeg", "millidegrees"), "mdeg"),
    **dict.fromkeys(("mrad", "milliradians"), "mrad"),
    **dict.fromkeys(("turn", "turns", "rev", "revs", "revolutions", "rotations"), "turns"),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "µs", "μs", "usec", "usecs", "micros", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanos", "nanoseconds"), "ns"),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("count", "counts", "cnt", "cnts", "tick", "ticks", "inc", "increments", "pulses"), "counts"),
}
"""Word → the unit that is meant."""
_OTHERS = ("v", "mv", "uv", "µv", "μv", "n", "nm", "n·m", "mnm", "a", "ma", "hz", "%", "deg/s", "rad/s", "°/s", "°c")
"""Words that are units too, of what is not read by its unit."""


def unit_of(text: str) -> str | None:
    """The unit that a cell of its own names, or None.

    >>> unit_of("[deg]"), unit_of("rad"), unit_of("motor")
    ('deg', 'rad', None)
    """
    return UNITS.get(_plain(text))


def is_unit(text: str) -> bool:
    """True if a cell of a line of units may say that.

    >>> is_unit("[mV]"), is_unit("-"), is_unit("emg")
    (True, True, False)
    """
    return _plain(text) in ("", "-", "1", *UNITS, *_OTHERS)


def _plain(text: str) -> str:
    return text.strip().strip("[]()").strip().lower()
