"""The reference as a law is shown it: a motion with its derivatives, whatever the source gives.

A law goes by position, velocity and acceleration of its reference. Many a source has only the position, holds it
between its own ticks, gives a noisy velocity, or lets the set point jump. One conditioner stands between source and
law, for all laws and in every loop. In each cycle it does one of three things.

**Pass.** Where the reference is a motion, that is where it leads on from what was shown last,

    |φ − Ts·φ̇ + ½·Ts²·φ̈ − φ_before| ≤ Ts·(STRAY + 0.6·Ts·|φ̈ − φ̈_before| + 0.01·Ts·|φ̈|),

it is shown as it is, to the bit. Steps by Euler, whose error is ½·Ts²·φ̈ either way, count as motion too. The last term
is for where a fast motion turns: at the peak of φ̈ a sine's derivatives miss each other by Ts·(ω·Ts)²/12·|φ̈|, which it
allows down to 18 samples a period.

**Follow.** After a jump, what is shown goes over to the reference as the servo could, critically damped: with
e = shown − reference, ë = −2β·ė − β²·e, β = `PACE`/(1/ω + τ). A jump itself would cost the servo 1.25/ω + τ (∫e²dt over
its square, damping 1). What is shown takes 1.25/β, less than that, so that no law that goes by the derivatives is
slower for it; one that goes by the position alone is, by that much.

**Estimate.** Where the reference contradicts its own derivatives more than once within `SLOWEST`, they are not
believed. They are estimated of the position alone, by a filter of three states with its poles at θ (fading memory of
second order; Morrison 1969, Brookner 1998), which is corrected only when a value comes, T after the one before: where
the position changes, and where it stands still, as often as it changed before:

    p ← p + (1 − θ³)·m,  v ← v + 3/2·(1 − θ)²·(1 + θ)·m/T,  a ← a + (1 − θ)³·m/T²,   m = given − expected
    θ = max(1/(1 + x + x²/2), Ts/T),  x = `SHARPNESS`·ω·T

A position that moves in each cycle is so differentiated as sharply as the servo can use. One that is held for T is
taken for the mean of its stairs, (T − Ts)/2 late, with the velocity of the motion under them; Ts/T is how well the time
of a change is known. A miss that no servo could follow, beyond `LEAP`·max(ω·T, 1/`SHARPNESS`)², counts for the position
alone.

Once the position has not changed for `SLOWEST`, its next change is a jump, not a motion.
"""

from typing import Annotated, NamedTuple

from bowden.core.kernel import floor, kernel
from bowden.core.nested import columns
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample

SLOWEST = 0.06
"""Longest time between two values of a source that streams a motion, 20 a second at least; one that is slower gives set
points [s]."""

STRAY = 1e-3
"""Velocity by which a reference may contradict itself: through a lag of 0.1 s no more than 0.006° [rad/s]."""

PACE = 1.5
"""Bandwidth at which a jump is followed, over that of servo and delay, 1/(1/ω + τ) [–]."""

SHARPNESS = 4.0
"""Bandwidth of the estimated derivatives, over the servo's natural frequency [–]."""

LEAP = 0.1
"""How far the command may be led ahead of the reference by the acceleration of one correction [rad]."""

_LARGEST = 1e9
"""A number beyond it is none."""


class Conditioning(NamedTuple):
    """Knowledge of the rig for the conditioner."""

    servo_frequency: float = 53.58
    """ω, natural frequency of the servo [rad/s]."""
    delay: float = 0.0015
    """τ, from a sample to the middle of the time for which its command is held [s]."""


class Conditioned(NamedTuple):
    """The reference that the law was last given, and the conditioner's state."""

    position: Annotated[float, Quantity("joint angle that the law was shown", "rad")]
    velocity: Annotated[float, Quantity("its rate that the law was shown", "rad/s")]
    acceleration: Annotated[float, Quantity("its acceleration that the law was shown", "rad/s²")]
    given: Annotated[float, Quantity("position that the source gave", "rad")]
    unchanged: Annotated[float, Quantity("time since that changed; −1 before the first cycle", "s")]
    between: Annotated[float, Quantity("time between its last two changes", "s")]
    doubt: Annotated[
        float, Quantity("time for which a contradiction still counts; the source is used as it is below 0.06", "s")
    ]


@kernel
def condition_start(settings: Conditioning, sample: Sample) -> Conditioned:
    """Before the first cycle, which shows the reference as it is; where it is no number, the joint at rest."""
    return Conditioned(sample.joint, 0.0, 0.0, sample.joint, -1.0, 0.0, 0.0)


@kernel
def number_or(value: float, default: float) -> float:
    """The value, or `default` where it is no number.

    >>> number_or(1.0, 0.0), number_or(float("nan"), 0.0)
    (1.0, 0.0)
    """
    return value if abs(value) < _LARGEST else default


@kernel
def departs(before: float, given: Reference, most: float, dt: float) -> bool:
    """True if a reference is more than `most` [rad] from leading on from a position one cycle before; by the trapezoid
    or by Euler.

    >>> [departs(0.0, Reference(0.5, 1.0, 2.0), most, 1.0) for most in (0.4, 0.5)]
    [True, False]
    """
    bend = dt * dt * given.acceleration
    gone = given.position - before - dt * given.velocity
    return not (abs(gone + 0.5 * bend) <= most or abs(gone) <= most or abs(gone + bend) <= most)


@kernel
def leads_on(state: Conditioned, given: Reference, stray: float, dt: float) -> bool:
    """True if a reference leads on from what was shown last, in position and velocity."""
    off_rate = state.velocity - (given.velocity - dt * given.acceleration)
    return not departs(state.position, given, stray * dt, dt) and abs(off_rate) <= stray


@kernel
def follow_reference(settings: Conditioning, state: Conditioned, given: Reference, dt: float) -> Reference:
    """The conditioned reference one cycle later, for a consistent source that it was off: by backward Euler, whose
    poles are 1/(1 + β·Ts) for any Ts."""
    rate = PACE * settings.servo_frequency / (1.0 + settings.servo_frequency * settings.delay)
    off = state.position - (given.position - dt * (given.velocity - 0.5 * dt * given.acceleration))
    off_rate = state.velocity - (given.velocity - dt * given.acceleration)
    falls = 1.0 / (1.0 + rate * dt)
    next_rate = (off_rate - rate * rate * dt * off) * falls * falls
    next_off = off + dt * next_rate
    return Reference(
        given.position + next_off,
        given.velocity + next_rate,
        given.acceleration - rate * (2.0 * next_rate + rate * next_off),
    )


@kernel
def estimate_reference(
    settings: Conditioning, state: Conditioned, given: float, changed: bool, since: float, dt: float
) -> Reference:
    """The conditioned reference one cycle later, from the position alone.

    It is corrected where the position changes, and where it stands still, at each tick at which it ought to have
    changed.

    Args:
        settings: of the rig.
        state: before.
        given: position that the source gives [rad].
        changed: whether that is another one than in the cycle before.
        since: time since it changed before [s].
        dt: the cycle [s].
    """
    position = state.position + dt * (state.velocity + 0.5 * dt * state.acceleration)
    velocity, acceleration = state.velocity + dt * state.acceleration, state.acceleration
    tick = max(dt, state.between)
    due = floor(since / tick + 0.5)  # ticks that it ought to have changed at; one that is late by half counts
    again = due > floor((since - dt) / tick + 0.5) and due > 1.5
    if not (changed or again):
        return Reference(position, velocity, acceleration)
    span = max(dt, since if changed else tick)
    late = 0.5 * (span - dt)
    x = SHARPNESS * settings.servo_frequency * span
    theta = 1.0 / (1.0 + x + 0.5 * x * x)
    if span > 1.5 * dt:
        theta = max(dt / span, theta)
    kept = 1.0 - theta
    miss = given - (position + late * (velocity + 0.5 * late * acceleration))
    reach = max(1.0 / SHARPNESS, settings.servo_frequency * span)  # the filter waits this long, or for a value
    most = LEAP * reach * reach
    felt = max(-most, min(most, miss)) / span
    by_acceleration = kept * kept * kept * felt / span
    by_velocity = 1.5 * kept * kept * (1.0 + theta) * felt - late * by_acceleration
    by_position = (1.0 - theta * theta * theta) * miss - late * (by_velocity + 0.5 * late * by_acceleration)
    return Reference(position + by_position, velocity + by_velocity, acceleration + by_acceleration)


@kernel
def update_doubt(before: float, contradicts: bool, jumps: bool, dt: float) -> float:
    """Time for which a contradiction still counts [s]; a jump after a rest is a set point, and contradicts nothing."""
    doubt = max(0.0, before - dt)
    if contradicts:
        doubt = 2.0 * SLOWEST if before > 0.0 else SLOWEST
    return min(SLOWEST, doubt) if jumps else doubt


@kernel
def condition_step(
    settings: Conditioning, state: Conditioned, reference: Reference, dt: float
) -> tuple[Conditioned, Reference]:
    """One cycle: in: what the source gives; out: what the law is shown."""
    begun = state.unchanged >= 0.0 and abs(state.position) < _LARGEST
    given = Reference(
        number_or(reference.position, state.given),
        number_or(reference.velocity, 0.0),
        number_or(reference.acceleration, 0.0),
    )
    before = state.given if begun else given.position
    since = state.unchanged + dt if begun else 0.0
    changed = given.position != before
    stray = STRAY + dt * (0.6 * abs(given.acceleration - state.acceleration) + 0.01 * abs(given.acceleration))

    contradicts = departs(before, given, stray * dt, dt)
    doubt = update_doubt(state.doubt, contradicts, changed and since > SLOWEST, dt)
    if begun and doubt > SLOWEST:
        shown = estimate_reference(settings, state, given.position, changed, since, dt)
    elif not begun or leads_on(state, given, stray, dt):
        shown = given
    else:
        shown = follow_reference(settings, state, given, dt)
    after = Conditioned(
        shown.position,
        shown.velocity,
        shown.acceleration,
        given.position,
        0.0 if changed else since,
        since if changed else state.between,
        doubt,
    )
    return after, shown


COLUMNS = columns(condition_start(Conditioning(), Sample(0.0, 0.0)), "conditioned")
"""Column → unit of its state, as traces and logs have it."""
