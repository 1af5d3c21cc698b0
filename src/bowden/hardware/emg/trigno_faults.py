"""What can be wrong with a Trigno server, for tests and for trying what happens then."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from bowden.core.errors import ParameterError

_WORDS = {"garbage": ("greeting", "data", "values"), "refuse": ("START", "EMG", "questions", "sensors")}


@dataclass(frozen=True)
class TrignoFaults:
    """Faults of a server; without any it does as the guide says."""

    late: float = 0.0
    """One frame in 20 is held back by up to this much, and with it all after it [s]."""
    torn: bool = False
    """Frames are sent in pieces of 1 to 97 bytes."""
    missing: float = 0.0
    """Share of frames that are never sent."""
    disconnect: float = 0.0
    """All connections are closed this long after each START [s]; 0 for never."""
    silent: float = 0.0
    """Nothing is sent any more this long after each START [s]; 0 for never."""
    garbage: str = ""
    """``greeting``: random bytes in its place. ``data``: random bytes in place of samples, in the second and third
    second. ``values``: one sample in ten has NaN, infinity or 1e30 in it."""
    refuse: str = ""
    """``START``: CANNOT COMPLETE. ``EMG``: nobody listens at its port. ``questions``: INVALID COMMAND to all of them
    but PAIRED?. ``sensors``: none is paired."""


def read_faults(texts: Sequence[str]) -> TrignoFaults:
    """Faults from texts such as ``late=0.1``, ``torn``, ``garbage=data``.

    Raises:
        ParameterError: there is no such fault, or none of this size.

    >>> read_faults(["late=0.1", "torn"]).late
    0.1
    """
    kinds = {field.name: type(field.default) for field in dataclasses.fields(TrignoFaults)}
    found: dict[str, float | bool | str] = {}
    for text in texts:
        name, _, value = text.partition("=")
        kind = kinds.get(name)
        try:
            if kind is bool and not value:
                found[name] = True
            elif kind is str and value in _WORDS[name]:
                found[name] = value
            elif kind is float and 0.0 <= float(value) <= (1.0 if name == "missing" else 1e4):
                found[name] = float(value)
            else:
                raise ValueError
        except ValueError:
            said = "torn, late=SECONDS, missing=SHARE (0 to 1), disconnect=SECONDS, silent=SECONDS, "
            words = ", ".join(f"{key}={'|'.join(choices)}" for key, choices in _WORDS.items())
            raise ParameterError(f"--fault is {text!r}", expected=said + words) from None
    return TrignoFaults(**found)  # type: ignore[arg-type] # each was read by its field's type
