"""Repetitive control of a periodic motion, plugged into the disturbance observer (Hara 1988; Bodson 1994).

What goes wrong in one stroke goes wrong in the next. A model of anything of the period T, put before a loop that is
stable by itself, learns it (Hara, Yamamoto, Omata, Nakano). In place of a delay line of a period, whose poles lie at
all multiples of 2π/T, this law has the first six of them, each a pair of numbers (adaptive feed-forward: Bodson,
Sacks, Khosla), which is a delay line with a Q filter that lets six harmonics through:

    w = Σ aₖ·cos kθ + bₖ·sin kθ,     k = 1…6,   θ the phase of the reference
    daₖ/dt = −μ/T·qₖ·e·cos kθ,   dbₖ/dt = −μ/T·qₖ·e·sin kθ,   qₖ = 1/(1 + (k·2π/(T·ω_q))⁴)
    the disturbance observer is asked for reference + w, with the derivatives of w

e = joint − reference. The lead that repetitive control needs is in the loop already: asked for a motion with its
derivatives, the observer's command is ahead by servo and delay, so that w comes to the joint at its own phase. qₖ takes
out the harmonics for which that does not hold. Memory is 12 numbers, whatever T and the sample time are.

T is taken from the reference: θ is 0 where it turns upwards and π where it turns downwards, and goes on with the time
of the last stroke. Two strokes after each other that last and reach the same (within `sameness`) make a period; a
third that does not, or is late, ends it: then nothing is learnt and w fades within `fading`. A motion that does not
repeat itself has w = 0, and this law is the disturbance observer.
"""

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from bowden.control.knowledge import Knowledge
from bowden.control.law import Law
from bowden.control.law_parts import clamp, update_direction
from bowden.control.laws import disturbance_observer
from bowden.control.laws.disturbance_observer import DisturbanceObserverGains, DisturbanceObserverState
from bowden.core.kernel import cos, kernel, sin
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample

_OWN = DisturbanceObserverGains()

observer_start: Callable[[Any, Sample], DisturbanceObserverState] = disturbance_observer.start
observer_step: Callable[
    [Any, DisturbanceObserverState, Sample, Reference, float], tuple[DisturbanceObserverState, float]
] = disturbance_observer.step
"""The observer's kernels find its gains among this law's, which have the same names."""


class RepetitiveGains(NamedTuple):
    """Those of the disturbance observer, and of what is learnt."""

    slope: float = _OWN.slope
    """α̂, joint motion per motor motion; negative where the cable runs the other way [rad/rad]."""
    natural_frequency: float = _OWN.natural_frequency
    """ω of the servo [rad/s]."""
    damping: float = _OWN.damping
    """ζ of the servo [–]."""
    delay: float = _OWN.delay
    """τ [s]."""
    bandwidth: Annotated[float, Quantity("q, of the observer's filter", "rad/s", live=True)] = _OWN.bandwidth
    rate_limit: Annotated[float, Quantity("how fast the disturbance may change, at most", "rad/s", live=True)] = (
        _OWN.rate_limit
    )
    half_width: float = _OWN.half_width
    """r, half of what the feed-forward crosses at a reversal, in motor travel; 0 where no width is known [rad]."""
    jump_bandwidth: float = _OWN.jump_bandwidth
    """With which it crosses [rad/s]."""
    velocity_band: float = _OWN.velocity_band
    """Reference speed below which the direction is kept [rad/s]."""
    lead: float = _OWN.lead
    """Lag of servo and delay that is taken away [s]."""
    lead_square: float = _OWN.lead_square
    """The same to second order [s²]."""
    learning: Annotated[
        float, Quantity("μ: a harmonic comes to 1 − exp(−μ/2) of what it should be in a period", live=True)
    ] = 1.0
    cutoff: float = 6.7
    """ω_q [rad/s]."""
    largest: float = 0.1
    """Largest size of each aₖ and bₖ [rad]."""
    sameness: float = 0.02
    """Share by which strokes that count as the same may differ in time and way [–]."""
    fading: float = 0.2
    """Time constant with which w fades where nothing repeats itself [s]."""


class Harmonic(NamedTuple):
    """One harmonic of what is learnt."""

    even: Annotated[float, Quantity("aₖ", "rad")]
    odd: Annotated[float, Quantity("bₖ", "rad")]


class Harmonics(NamedTuple):
    """w, by its harmonics."""

    first: Harmonic
    second: Harmonic
    third: Harmonic
    fourth: Harmonic
    fifth: Harmonic
    sixth: Harmonic


class Stroke(NamedTuple):
    """Where the reference is in its strokes."""

    direction: Annotated[float, Quantity("the last direction of motion, −1, 0 or 1")]
    since: Annotated[float, Quantity("time since the last turn", "s")]
    begin: Annotated[float, Quantity("reference at the last turn", "rad")]
    length: Annotated[float, Quantity("time that the stroke before took; 0 where there was none", "s")]
    way: Annotated[float, Quantity("how far it went", "rad")]
    repeated: Annotated[bool, Quantity("the motion repeats itself")]


class RepetitiveState(NamedTuple):
    """State of the law from one cycle to the next."""

    observer: DisturbanceObserverState
    stroke: Stroke
    learned: Harmonics


@kernel
def start(gains: RepetitiveGains, sample: Sample) -> RepetitiveState:
    """Begin with nothing learnt."""
    none = Harmonic(0.0, 0.0)
    stroke = Stroke(0.0, 0.0, 0.0, 0.0, 0.0, False)
    begun = observer_start(gains, sample)
    return RepetitiveState(begun, stroke, Harmonics(none, none, none, none, none, none))


@kernel
def followed(stroke: Stroke, reference: Reference, band: float, sameness: float, dt: float) -> Stroke:
    """The strokes after one cycle of the reference."""
    direction = update_direction(stroke.direction, reference.velocity, band, 0.0, dt)
    since = stroke.since + dt
    if direction == stroke.direction:
        repeated = stroke.repeated and since <= (1.0 + sameness) * stroke.length + dt
        return Stroke(direction, since, stroke.begin, stroke.length, stroke.way, repeated)
    way = abs(reference.position - stroke.begin)
    as_long = abs(since - stroke.length) <= sameness * stroke.length
    as_far = abs(way - stroke.way) <= sameness * stroke.way
    if stroke.direction == 0.0:  # the first
        since, way = 0.0, 0.0
    return Stroke(direction, 0.0, reference.position, since, way, as_long and as_far)


@kernel
def learnt(
    before: Harmonic, c: float, s: float, speed: float, error: float, gains: RepetitiveGains, kept: float
) -> Harmonic:
    """One harmonic after one cycle; `error` has the rate of learning in it, `kept` is what is left of it."""
    share = speed / gains.cutoff
    part = error / (1.0 + share * share * share * share)
    most = gains.largest
    even = clamp(kept * before.even - part * c, -most, most, before.even)
    return Harmonic(even, clamp(kept * before.odd - part * s, -most, most, before.odd))


@kernel
def added(requested: Reference, harmonic: Harmonic, c: float, s: float, speed: float) -> Reference:
    """The reference with one harmonic and its derivatives."""
    position = harmonic.even * c + harmonic.odd * s
    velocity = speed * (harmonic.odd * c - harmonic.even * s)
    return Reference(
        requested.position + position, requested.velocity + velocity, requested.acceleration - speed * speed * position
    )


@kernel
def step(
    gains: RepetitiveGains, state: RepetitiveState, sample: Sample, reference: Reference, dt: float
) -> tuple[RepetitiveState, float]:
    """Follow the strokes, learn, and have the observer follow the reference with what was learnt."""
    stroke = followed(state.stroke, reference, gains.velocity_band, gains.sameness, dt)
    period, kept, error = 1e3, gains.fading / (gains.fading + dt), 0.0
    if stroke.repeated and stroke.length > dt:
        period, kept = 2.0 * stroke.length, 1.0
        error = gains.learning / period * clamp(sample.joint - reference.position, -1.0, 1.0, 0.0) * dt

    speed = 2.0 * math.pi / period
    angle = speed * stroke.since + (0.0 if stroke.direction > 0.0 else math.pi)
    c1, s1 = cos(angle), sin(angle)
    c2, s2 = c1 * c1 - s1 * s1, 2.0 * c1 * s1
    c3, s3 = c2 * c1 - s2 * s1, s2 * c1 + c2 * s1
    c4, s4 = c2 * c2 - s2 * s2, 2.0 * c2 * s2
    c5, s5 = c4 * c1 - s4 * s1, s4 * c1 + c4 * s1
    c6, s6 = c3 * c3 - s3 * s3, 2.0 * c3 * s3

    before = state.learned
    first = learnt(before.first, c1, s1, speed, error, gains, kept)
    second = learnt(before.second, c2, s2, 2.0 * speed, error, gains, kept)
    third = learnt(before.third, c3, s3, 3.0 * speed, error, gains, kept)
    fourth = learnt(before.fourth, c4, s4, 4.0 * speed, error, gains, kept)
    fifth = learnt(before.fifth, c5, s5, 5.0 * speed, error, gains, kept)
    sixth = learnt(before.sixth, c6, s6, 6.0 * speed, error, gains, kept)

    requested = added(reference, first, c1, s1, speed)
    requested = added(requested, second, c2, s2, 2.0 * speed)
    requested = added(requested, third, c3, s3, 3.0 * speed)
    requested = added(requested, fourth, c4, s4, 4.0 * speed)
    requested = added(requested, fifth, c5, s5, 5.0 * speed)
    requested = added(requested, sixth, c6, s6, 6.0 * speed)
    observer, command = observer_step(gains, state.observer, sample, requested, dt)
    return RepetitiveState(observer, stroke, Harmonics(first, second, third, fourth, fifth, sixth)), command


CUTOFF_SHARE = 0.125
"""ω_q over ω [–]."""


def cutoff(known: Knowledge) -> float:
    """ω_q, an eighth of ω [rad/s]."""
    return CUTOFF_SHARE * known.servo_frequency


LAW = Law(
    name="repetitive",
    gains=RepetitiveGains(),
    start_kernel=start,
    step_kernel=step,
    source="Hara, Yamamoto, Omata, Nakano, IEEE Trans. Automatic Control 33(7), 1988; Bodson, Sacks, Khosla 1994",
    from_rig={**disturbance_observer.LAW.from_rig, "cutoff": cutoff},
    compensates_lag=True,
    tunable=frozenset({*disturbance_observer.LAW.choices, "learning", "cutoff", "largest", "sameness", "fading"}),
    limits={
        **disturbance_observer.LAW.limits,
        "learning": (0.0, 100.0),
        "cutoff": (1e-3, 1e5),
        "largest": (0.0, math.inf),
        "sameness": (0.0, 1.0),
        "fading": (0.0, 1e6),
    },
)
