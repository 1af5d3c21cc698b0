"""The protocol of a control law, and the registry that names them.

A law is two kernels and a NamedTuple of gains:

    start(gains, sample) -> state
    step(gains, state, sample, reference, dt) -> (state, command)

Both are written in the portable subset (see ``docs/kernels.md``), and the state is a NamedTuple of floats and of
further NamedTuples, so that one source runs interpreted, compiled in simulation and in the live loop, and exported as
C99, and every state variable can be recorded.
"""

import difflib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.nested import columns
from bowden.core.signals import Reference, Sample

Gains = Any  # a NamedTuple of floats (nested ones allowed), one type a law
State = Any  # a NamedTuple of floats (nested ones allowed), one type a law


@kernel
def law_start(gains: Any, sample: Sample) -> Any:
    """Stand-in for a law's ``start`` in a loop's source; `specialise` puts the law's own in its place."""
    raise NotImplementedError  # never compiled: always replaced


@kernel
def law_step(gains: Any, state: Any, sample: Sample, reference: Reference, dt: float) -> Any:
    """Stand-in for a law's ``step``."""
    raise NotImplementedError  # never compiled: always replaced


@dataclass(frozen=True)
class Law:
    """A control law with its gains: usable alone, interpreted, with nothing else around it.

    >>> from bowden.control import LAWS
    >>> law = LAWS["uncompensated"]
    >>> state = law.start(Sample(joint=0.0, motor=0.0))
    >>> state, command = law.step(state, Sample(0.0, 0.0), Reference(0.2, 0.0, 0.0), 0.001)
    >>> float(command)
    0.2
    """

    name: str
    """Its key in `LAWS`."""
    gains: Gains
    """NamedTuple handed to the kernels."""
    start_kernel: Callable[[Gains, Sample], State]
    """``start(gains, sample) -> state``."""
    step_kernel: Callable[[Gains, State, Sample, Reference, float], tuple[State, float]]
    """``step(gains, state, sample, reference, dt) -> (state, command)``."""
    source: str
    """Where the law comes from."""
    presets: dict[str, Gains] = field(default_factory=dict)
    """Other named sets of gains, such as the ones a paper printed."""
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Gain → the smallest and the largest value that makes sense; `with_gains` refuses others."""
    state_units: Mapping[str, str] = field(default_factory=dict)
    """Field of the state, or its column (``part.field``) → unit for the record, where the state's type does not say."""

    def columns(self) -> dict[str, str]:
        """Column → unit of its state, as traces and logs have it: ``law.<field>``, ``law.<part>.<field>``."""
        return columns(self.start(Sample(0.0, 0.0)), "law", self.state_units)

    def start(self, sample: Sample) -> State:
        """The state with which the law begins at this sample."""
        return self.start_kernel(self.gains, sample)

    def step(self, state: State, sample: Sample, reference: Reference, dt: float) -> tuple[State, float]:
        """The next state and the motor's target angle [rad] for one cycle of `dt` [s]."""
        return self.step_kernel(self.gains, state, sample, reference, dt)

    def with_gains(self, **changes: Any) -> "Law":
        """The same law with some gains changed.

        Raises:
            ParameterError: a name that is not a gain of this law, or a value outside its limits.
        """
        for name, value in changes.items():
            if name not in self.gains._fields:
                alike = difflib.get_close_matches(name, self.gains._fields, 1)
                raise ParameterError(
                    f"law {self.name!r} has no gain {name!r}",
                    expected=f"one of {', '.join(self.gains._fields)}",
                    do=f"did you mean {alike[0]}?" if alike else "name one of them",
                )
            low, high = self.limits.get(name, (-math.inf, math.inf))
            if not low <= value <= high:
                raise ParameterError(
                    f"gain {name} of law {self.name!r} is {value:g}",
                    expected=f"a number from {low:g} to {high:g}",
                    do="correct it",
                )
        return replace(self, gains=self.gains._replace(**changes))

    def preset(self, name: str) -> "Law":
        """The same law with a named set of gains.

        Raises:
            ParameterError: a name that is not a preset of this law.
        """
        if name not in self.presets:
            raise ParameterError(
                f"law {self.name!r} has no preset {name!r}",
                expected=f"one of {', '.join(self.presets) or 'none'}",
                do="name another, or leave the preset out",
            )
        return replace(self, gains=self.presets[name])
