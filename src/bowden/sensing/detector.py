"""The protocol of a detector of contractions in surface EMG, which `bowden.sensing.detectors` names.

A detector is a NamedTuple of settings and these functions, the last two of them kernels in the portable subset:

    prepare(rate, settings) -> prepared           the settings at this many samples a second, a NamedTuple of numbers
    start(prepared, first) -> state               before the first sample, which may be NaN
    step(prepared, state, value) -> (state, contracts, trouble)
    rest(state) -> size                           of the signal at rest, in its own unit

`contracts` is a bool, `trouble` a `Trouble`. One source runs sample by sample in the live loop, over a recording, in
simulation, and exported as C99.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.kernel import placeholder


class Trouble(IntEnum):
    """Kinds of trouble with a signal."""

    NONE = 0
    DEAD = 1
    """Flat or missing."""
    MOVEMENT_OR_MAINS = 2


@placeholder
def detector_step(prepared: Any, state: Any, value: float) -> tuple[Any, bool, Trouble]:
    """Placeholder for a detector's ``step``; `specialise` puts the detector's own in its place."""
    raise NotImplementedError  # always replaced


@placeholder
def detector_rest(state: Any) -> float:
    """Placeholder for a detector's ``rest``."""
    raise NotImplementedError  # always replaced


@dataclass(frozen=True)
class Detector:
    """A detector of contractions with its settings."""

    name: str
    """Its key in `DETECTORS`, as ``[emg] detector`` has it."""
    settings: Any
    """NamedTuple; its field ``shortest`` is the length below which contractions are left out, and by which all others
    are reported later [s]."""
    prepare: Callable[[float, Any], Any]
    start: Callable[[Any, float], Any]
    step: Callable[[Any, Any, float], Any]
    rest: Callable[[Any], float]
    of_wearer: Callable[[float, float], Any]
    """Settings for a wearer of whom `rest` and the envelope of the maximum contraction are known, in the signal's unit;
    0 where one is not. Rest's must not be the envelope: that is of another band, and what bounds rest from below would
    hide weak contractions."""
    slowest: float
    """Smallest rate that it takes [Hz]."""
    safe: float
    """Smallest rate at which it may move somebody [Hz]."""
    quickest: float
    """Largest rate that it takes [Hz]."""
    source: str
    """Where it comes from."""

    def prepared(self, rate: float, settings: Any = None) -> Any:
        """The detector at a rate [Hz], with its own settings or others.

        Raises:
            ParameterError: a rate that it does not take.
        """
        if not self.slowest <= rate <= self.quickest:
            raise ParameterError(
                f"the detector {self.name!r} is given {rate:g} samples a second",
                expected=f"from {self.slowest:g} to {self.quickest:g}",
                do="take another rate, or another detector",
            )
        return self.prepare(rate, self.settings if settings is None else settings)
