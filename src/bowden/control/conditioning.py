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

import numpy as np

from bowden.core.extremes import larger, smaller
from bowden.core.kernel import kernel, sel
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
    """What the conditioner knows of the rig."""

    servo_frequency: float = 53.58
    """ω, natural frequency of the servo [rad/s]."""
    delay: float = 0.0015
    """τ, from a sample to the middle of the time for which its command is held [s]."""


class Conditioned(NamedTuple):
    """What was shown to the law last, and what the conditioner remembers."""

    position: Annotated[float, Quantity("joint angle that the law was shown", "rad")]
    velocity: Annotated[float, Quantity("its rate that the law was shown", "rad/s")]
    acceleration: Annotated[float, Quantity("its acceleration that the law was shown", "rad/s²")]
    given: Annotated[float, Quantity("position that the source gave", "rad")]
    unchanged: Annotated[float, Quantity("time since that changed; −1 before the first cycle", "s")]
    between: Annotated[float, Quantity("time between its last two changes", "s")]
    doubt: Annotated[
        float, Quantity("time for which a contradiction still counts; the source is believed below 0.06", "s")
    ]


@kernel
def condition_start(settings: Conditioning, sample: Sample) -> Conditioned:
    """Before the first cycle, which shows the reference as it is; where it is no number, the joint at rest."""
    return Conditioned(sample.joint, 0.0, 0.0, sample.joint, -1.0, 0.0, 0.0)


@kernel
def number_or(value: float, refused: float) -> float:
    """The value, or `refused` where it is no number.

    >>> number_or(1.0, 0.0), number_or(float("nan"), 0.0)
    (1.0, 0.0)
    """
    return sel(np.abs(value) < _LARGEST, value, refused)


@kernel
def contradiction(before: float, given: Reference, dt: float) -> float:
    """How far a reference is from leading on from a position one cycle before [rad]; by the trapezoid or by Euler.

    >>> float(contradiction(0.0, Reference(0.5, 1.0, 2.0), 1.0))
    0.5
    """
    way, bend = dt * given.velocity, dt * dt * given.acceleration
    gone = given.position - before - way
    return smaller(np.abs(gone + 0.5 * bend), smaller(np.abs(gone), np.abs(gone + bend)))


@kernel
def followed(settings: Conditioning, state: Conditioned, given: Reference, dt: float) -> Reference:
    """What is shown one cycle later of a reference that is believed, from which it was off: by backward Euler, whose
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
def estimated(
    settings: Conditioning, state: Conditioned, given: float, span: float, corrects: float, dt: float
) -> Reference:
    """What is shown one cycle later where the position alone is believed.

    Args:
        settings: of the rig.
        state: before.
        given: position that the source gives [rad].
        span: time since it was given before [s].
        corrects: 1 where it is given now, changed, or as before at a tick where it ought to have changed; else 0.
        dt: the cycle [s].
    """
    position = state.position + dt * (state.velocity + 0.5 * dt * state.acceleration)
    velocity, acceleration = state.velocity + dt * state.acceleration, state.acceleration
    late = 0.5 * (span - dt)
    x = SHARPNESS * settings.servo_frequency * span
    smooth = 1.0 / (1.0 + x + 0.5 * x * x)
    theta = sel(span > 1.5 * dt, larger(smooth, dt / span), smooth)
    kept = 1.0 - theta
    miss = given - (position + late * (velocity + 0.5 * late * acceleration))
    reach = larger(settings.servo_frequency * span, 1.0 / SHARPNESS)  # the filter waits this long, or for a value
    most = LEAP * reach * reach
    felt = larger(smaller(miss, most), 0.0 - most) / span
    by_acceleration = kept * kept * kept * felt / span
    by_velocity = 1.5 * kept * kept * (1.0 + theta) * felt - late * by_acceleration
    by_position = (1.0 - theta * theta * theta) * miss - late * (by_velocity + 0.5 * late * by_acceleration)
    return Reference(
        position + sel(corrects > 0.5, by_position, 0.0),
        velocity + sel(corrects > 0.5, by_velocity, 0.0),
        acceleration + sel(corrects > 0.5, by_acceleration, 0.0),
    )


@kernel
def condition_step(
    settings: Conditioning, state: Conditioned, reference: Reference, dt: float
) -> tuple[Conditioned, Reference]:
    """One cycle: in: what the source gives; out: what the law is shown."""
    begun = (state.unchanged >= 0.0) * (np.abs(state.position) < _LARGEST)
    given = Reference(
        number_or(reference.position, state.given),
        number_or(reference.velocity, 0.0),
        number_or(reference.acceleration, 0.0),
    )
    before = sel(begun, state.given, given.position)
    since = sel(begun, state.unchanged + dt, 0.0)
    changed = given.position != before
    stray = STRAY + dt * (0.6 * np.abs(given.acceleration - state.acceleration) + 0.01 * np.abs(given.acceleration))

    # believed or not
    contradicts = contradiction(before, given, dt) > stray * dt
    doubt = sel(contradicts, sel(state.doubt > 0.0, 2.0 * SLOWEST, SLOWEST), larger(state.doubt - dt, 0.0))
    jumps = changed * (since > SLOWEST)
    doubt = sel(jumps, smaller(doubt, SLOWEST), doubt)
    doubted = begun * (doubt > SLOWEST)

    # shown
    off_rate = state.velocity - (given.velocity - dt * given.acceleration)
    leads_on = (contradiction(state.position, given, dt) <= stray * dt) * (np.abs(off_rate) <= stray)
    passes = sel(begun, leads_on, 1.0 == 1.0)
    follows = followed(settings, state, given, dt)
    tick = larger(state.between, dt)
    due = np.floor(since / tick + 0.5)  # ticks that it ought to have changed at; one that is late by half counts
    again = (due > np.floor((since - dt) / tick + 0.5)) * (due > 1.5)
    span = larger(sel(changed, since, tick), dt)
    guess = estimated(settings, state, given.position, span, sel(changed + again > 0.0, 1.0, 0.0), dt)
    shown = Reference(
        sel(doubted, guess.position, sel(passes, given.position, follows.position)),
        sel(doubted, guess.velocity, sel(passes, given.velocity, follows.velocity)),
        sel(doubted, guess.acceleration, sel(passes, given.acceleration, follows.acceleration)),
    )
    after = Conditioned(
        shown.position,
        shown.velocity,
        shown.acceleration,
        given.position,
        sel(changed, 0.0, since),
        sel(changed, since, state.between),
        doubt,
    )
    return after, shown


COLUMNS = columns(condition_start(Conditioning(), Sample(0.0, 0.0)), "conditioned")
"""Column → unit of its state, as traces and logs have it."""
