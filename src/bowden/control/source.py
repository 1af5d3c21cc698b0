"""Where a loop's reference comes from: a table that was made beforehand, or the wearer's push, cycle by cycle.

    start(settings, measured) -> state
    step(settings, state, measured, scheduled, dt) -> (state, reference, added)

`scheduled` is the table's reference at this instant; `added` is an angle of the motor that is added to the law's
command. As laws are, sources are kernels, and `specialise` puts them in a loop.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from bowden.core.kernel import kernel, placeholder
from bowden.core.nested import columns
from bowden.core.signals import Reference


class Measurement(NamedTuple):
    """Inputs of a source."""

    joint: float
    """Measured angle of the elbow [rad]."""
    motor: float
    """Measured angle of the motor, in the joint's coordinate [rad]."""
    current: float
    """Measured current of the motor [A]."""
    load: float
    """Torque of the suit on the elbow as a load cell says, flexing positive; NaN where there is none [N·m]."""
    joint_age: float = math.nan
    """As in `Sample` [s]."""
    joint_std: float = math.nan
    """As in `Sample` [rad]."""


@placeholder
def source_start(settings: Any, measured: Measurement) -> Any:
    """Placeholder for a source's ``start`` in a loop's source; `specialise` puts the source's own in its place."""
    raise NotImplementedError  # always replaced


@placeholder
def source_step(settings: Any, state: Any, measured: Measurement, scheduled: Reference, dt: float) -> Any:
    """Placeholder for a source's ``step``."""
    raise NotImplementedError  # always replaced


@dataclass(frozen=True)
class Source:
    """A source of references with its settings."""

    name: str
    """For the record."""
    settings: Any
    """NamedTuple handed to the kernels."""
    start_kernel: Callable[[Any, Measurement], Any]
    step_kernel: Callable[[Any, Any, Measurement, Reference, float], tuple[Any, Reference, float]]
    state_units: Mapping[str, str] = field(default_factory=dict)
    """Field of the state → its unit, where the state's type does not say."""
    conditioned: bool = True
    """True if its reference goes through the conditioner; False where its derivatives differ on purpose."""

    def columns(self) -> dict[str, str]:
        """Column → unit of its state, as traces and logs have it: ``<name>.<field>``."""
        return columns(self.start(Measurement(0.0, 0.0, 0.0, 0.0)), self.name, self.state_units)

    def start(self, measured: Measurement) -> Any:
        """The state with which the source begins."""
        return self.start_kernel(self.settings, measured)

    def step(self, state: Any, measured: Measurement, scheduled: Reference, dt: float) -> tuple[Any, Reference, float]:
        """The next state, the reference, and what is added to the law's command [rad]."""
        return self.step_kernel(self.settings, state, measured, scheduled, dt)


class Nothing(NamedTuple):
    """Settings and state of the table: none; one number, since compiled code knows no empty tuple of them."""

    unused: float = 0.0


@kernel
def table_start(settings: Nothing, measured: Measurement) -> Nothing:
    """A table remembers nothing."""
    return settings


@kernel
def table_step(
    settings: Nothing, state: Nothing, measured: Measurement, scheduled: Reference, dt: float
) -> tuple[Nothing, Reference, float]:
    """The reference is what was scheduled."""
    return state, scheduled, 0.0


TABLE = Source("table", Nothing(), table_start, table_step)
"""The reference as it was made beforehand."""
