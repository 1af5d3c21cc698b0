"""What tests inject into a cycle beside what sensors say: at clock, operator, recorder, EMG and law.

What a sensor or the drive says is misread by `bowden.sim.injected`, as in a simulation.
"""

from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.core.kernel import kernel, placeholder
from bowden.core.signals import Reference, Sample
from bowden.safety.state import Observed, Request
from bowden.sim.injected import Injected

NANOSECOND = 1e-9
"""[s]"""
HOUR = 3600.0
"""By which a clock steps [s]."""


@kernel
def aged(age: float, cycles: int, dt: float) -> float:
    """An age so many cycles later [s], by a clock that counts nanoseconds."""
    return in_seconds(np.floor(age / NANOSECOND + 0.5) + cycles * np.floor(dt / NANOSECOND + 0.5))


@kernel
def in_seconds(nanoseconds: float) -> float:
    """As the live loop makes seconds of its clock [s]."""
    return nanoseconds * NANOSECOND


@kernel
def disturbed(kind: int, since: int, observed: Observed, dt: float) -> Observed:
    """What a cycle observes of clock, operator, recorder and EMG with a fault that began `since` cycles ago.

    A clock that steps forward stays there; one cycle's reading of it may be an hour back. All ages are by that clock.
    """
    lateness, elapsed, request = observed.lateness, observed.elapsed, observed.request
    operator_age, recorder, emg_age = observed.operator_age, observed.recorder, observed.emg_age
    step = 0.0
    if kind == Injected.CLOCK_BACK:
        step = -HOUR if since == 0 else 0.0
        elapsed += HOUR if since == 1 else 0.0
    elif kind == Injected.CLOCK_FORWARD:
        step = HOUR if since == 0 else 0.0
        recorder = recorder and since != 0  # an hour without a sign of life
    elif kind == Injected.OPERATOR_LOST:
        operator_age = aged(operator_age, since, dt)
    elif kind == Injected.RECORDER_LOST:
        recorder = False
    elif kind == Injected.STOP:
        request = Request.STOP if since == 0 else request
    elif kind == Injected.EMG_SILENT:
        emg_age = aged(emg_age, since, dt)
    elif kind == Injected.EMG_TIMELESS:
        emg_age = np.nan
    return Observed(
        observed.reading,
        lateness + step,
        elapsed + step,
        request,
        operator_age + step,
        recorder,
        observed.preflight,
        emg_age + step,
        observed.others,
        observed.neighbour,
        observed.reference,
    )


@kernel
def asleep(kind: int, since: int) -> int:
    """Cycles that the loop misses after this one."""
    if kind == Injected.OVERRUN and since == 0:
        return 22
    return 3 if kind == Injected.OVERRUNS else 0


@kernel
def misled(kind: int, since: int, requested_target: float, dt: float) -> float:
    """The law's requested target with a fault."""
    if kind == Injected.LAW_NAN:
        return np.nan
    if kind == Injected.LAW_STEP:
        return requested_target + 0.6
    if kind == Injected.LAW_BEYOND:
        return 3.0 + requested_target
    if kind == Injected.LAW_RAMP:
        return requested_target + 60.0 * dt * since
    if kind == Injected.LAW_SHAKES:
        return requested_target + (0.07 + 0.002 * since) * (1.0 if since % 2 else -1.0)
    return requested_target


class Misled(NamedTuple):
    """The gains of a law that goes wrong."""

    gains: Any
    """Of the law itself."""
    kinds: NDArray[np.int64]
    """What is injected (n,)."""
    onsets: NDArray[np.int64]
    """Cycles from which on (n,)."""
    now: NDArray[np.int64]
    """This cycle (1,); the loop writes it."""


@kernel
def misled_command(gains: Misled, command: float, dt: float) -> float:
    """The command with all that is injected into it by this cycle."""
    for i in range(len(gains.kinds)):
        if gains.now[0] >= gains.onsets[i]:
            command = misled(gains.kinds[i], gains.now[0] - gains.onsets[i], command, dt)
    return command


@placeholder
def sound_start(gains: Any, sample: Sample) -> Any:
    """Placeholder for the start of the law that is to go wrong."""
    raise NotImplementedError  # always replaced


@placeholder
def sound_step(gains: Any, state: Any, sample: Sample, reference: Reference, dt: float) -> Any:
    """Placeholder for its step."""
    raise NotImplementedError  # always replaced


@kernel
def misled_start(gains: Misled, sample: Sample) -> Any:
    """A law that goes wrong begins as the law does."""
    return sound_start(gains.gains, sample)


@kernel
def misled_step(gains: Misled, state: Any, sample: Sample, reference: Reference, dt: float) -> Any:
    """The law's own step, and what is injected into its command."""
    state, command = sound_step(gains.gains, state, sample, reference, dt)
    return state, misled_command(gains, command, dt)


def misled_kernels(law: Law) -> tuple[Any, Any]:
    """`misled_start` and `misled_step` of a law as kernels of their own, which run interpreted too."""
    around = globals() | {"sound_start": law.start_kernel, "sound_step": law.step_kernel}
    start, step = (kernel(FunctionType(one.__code__, around, one.__name__)) for one in (misled_start, misled_step))
    return start, step


def misled_gains(law: Law, injected: tuple[tuple[Injected, float], ...], dt: float) -> Misled:
    """The law's gains with the faults that are injected, and when they begin [s]."""
    faults = injected or ((Injected.NOTHING, 1e6),)
    kinds, onsets = ([int(kind) for kind, _ in faults], [round(onset / dt) for _, onset in faults])
    return Misled(law.gains, np.array(kinds), np.array(onsets), np.zeros(1, dtype=np.int64))
