"""The paper's nonlinear adaptive law (Eqs 9–14).

The plant is seen as joint = αφ·motor + D with |D| ≤ Dm and β = 1/αφ. With e = joint − reference,

    s = λ·e + ∫e dt
    φr = reference − λ·ė
    φ̄ = φr − D̂m·tanh(s/ε)
    command = β̂·φ̄ − κ·s
    dβ̂/dt = −δ1·φ̄·s − δ1·σ1·β̂
    dD̂m/dt = δ2·β̂·tanh(s/ε)·s − δ2·σ2·D̂m

Two readings of ours (reading 4): Eq. 14 is taken with φ̄, which the paper writes like the motor command, and the
unknown β in the second adaptation law is replaced by its estimate β̂. The derivative ė is the joint's measured rate,
low-pass filtered with the time constant τ, minus the reference's exact velocity; the paper does not say how it
differentiates. τ = 0 is a plain difference.

Linearised, the law is a PID around the servo (gains κλ, κ and β̂λ); the printed gains λ = 2, κ = 10 diverge at 1 kHz
around a servo of more than 20.6 rad/s (reading 7). They are kept as the preset ``paper``.

The law's own λ, κ and ε are those of the default bench. On another rig they follow from servo, delay and sample time:
`error_gain`, `feedback_gain` and `smoothing` below.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.knowledge import Knowledge
from bowden.control.law import Law, UltimateBounds
from bowden.core.kernel import kernel, tanh
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample


class AdaptiveGains(NamedTuple):
    """Gains of the law; the adaptation gains are the paper's, λ, κ and τ are chosen for margin on the bench."""

    error_gain: float = 0.035
    """λ [s]."""
    feedback_gain: Annotated[float, Quantity("κ", "1/s", live=True)] = 40.0
    smoothing: float = 0.01
    """ε, width of tanh's transition [rad·s]."""
    slope_adaptation: float = 2.0
    """δ1 [1/(rad²·s²)]."""
    bound_adaptation: float = 2.0
    """δ2 [1/s²]."""
    slope_leakage: float = 0.005
    """σ1 [rad²·s]."""
    bound_leakage: float = 0.005
    """σ2 [s]."""
    derivative_time: float = 0.005
    """τ, time constant of the derivative's filter, which is not in the paper [s]."""


class AdaptiveState(NamedTuple):
    """State of the law from one cycle to the next."""

    integral: Annotated[float, Quantity("∫e dt", "rad·s")]
    slope_inverse: Annotated[float, Quantity("β̂", "rad/rad")]
    bound: Annotated[float, Quantity("D̂m", "rad")]
    joint: Annotated[float, Quantity("last measured joint angle", "rad")]
    joint_rate: Annotated[float, Quantity("filtered rate of the joint", "rad/s")]
    filtered_error: Annotated[float, Quantity("s", "rad·s")]


@kernel
def start(gains: AdaptiveGains, sample: Sample) -> AdaptiveState:
    """Begin with all estimates at zero, as the paper does."""
    return AdaptiveState(0.0, 0.0, 0.0, sample.joint, 0.0, 0.0)


@kernel
def step(
    gains: AdaptiveGains, state: AdaptiveState, sample: Sample, reference: Reference, dt: float
) -> tuple[AdaptiveState, float]:
    """Eqs 10, 11 and 14, stepped once by `dt`."""
    error = sample.joint - reference.position
    integral = state.integral + error * dt
    difference = (sample.joint - state.joint) * (1.0 / dt)
    joint_rate = state.joint_rate + (difference - state.joint_rate) * (dt / (gains.derivative_time + dt))
    error_rate = joint_rate - reference.velocity

    s = gains.error_gain * error + integral
    switch = tanh(s * (1.0 / gains.smoothing))
    wanted = reference.position - gains.error_gain * error_rate - state.bound * switch
    command = state.slope_inverse * wanted - gains.feedback_gain * s

    slope_inverse = state.slope_inverse - dt * gains.slope_adaptation * (
        wanted * s + gains.slope_leakage * state.slope_inverse
    )
    bound = state.bound + dt * gains.bound_adaptation * (
        state.slope_inverse * switch * s - gains.bound_leakage * state.bound
    )
    return AdaptiveState(integral, slope_inverse, bound, sample.joint, joint_rate, s), command


def settling(gains: AdaptiveGains) -> float:
    """Four time constants 1/(δ·σ) of the slower leakage [s]: what an estimate began with is down to 2 %."""
    slower = min(gains.slope_adaptation * gains.slope_leakage, gains.bound_adaptation * gains.bound_leakage)
    return 4.0 / slower if slower > 0.0 else math.inf


def ultimate_bounds(gains: AdaptiveGains, slope: float, uncertainty: float) -> UltimateBounds:
    """|s| ≤ √(2f/(β·ϱ)) and |e| ≤ (2/λ)·√(2f/(β·ϱ)), with the paper's ϱ and f.

        ϱ = min(2κ/β, σ1·δ1, σ2·δ2),    f = σ1·β²/2 + σ2·Dm²/2 + 0.2785·ε

    From Eq. 20 to 22 the last term lost its factor β·Dm, which is below 1 here (reading 9); it is taken as printed.

    Args:
        gains: of the law.
        slope: the cable's αφ = 1/β [rad/rad].
        uncertainty: Dm, bound of the hysteresis' height [rad].
    """
    beta = 1.0 / slope
    rate = min(
        2.0 * gains.feedback_gain / beta,
        gains.slope_leakage * gains.slope_adaptation,
        gains.bound_leakage * gains.bound_adaptation,
    )
    f = 0.5 * gains.slope_leakage * beta**2 + 0.5 * gains.bound_leakage * uncertainty**2 + 0.2785 * gains.smoothing
    s = math.sqrt(2.0 * f / (beta * rate))
    return UltimateBounds(s, 2.0 * s / gains.error_gain)


def proven(gains: AdaptiveGains, slope: float, uncertainty: float) -> UltimateBounds | None:
    """`ultimate_bounds`, for gains by which the proof divides."""
    named = (gains.error_gain, gains.feedback_gain, gains.slope_leakage, gains.bound_leakage)
    fine = min(*named, gains.slope_adaptation, gains.bound_adaptation) > 0.0
    return ultimate_bounds(gains, slope, uncertainty) if fine else None


PRINTED = AdaptiveGains(error_gain=2.0, feedback_gain=10.0, derivative_time=0.0)
"""The gains of Section 5.1.2, as printed."""

BENCH_FREQUENCY = 53.5767
"""ω of the servo for which the law's own gains were chosen; its ζ is 1 [rad/s]."""

BENCH_DELAY, BENCH_SAMPLE_TIME = 0.0015, 0.001
"""τ and Ts of the default bench [s]."""

DELAY_SHARE = 1.25
"""κ on a rig whose delay bounds it, in shares of the bench's κ times the ratio of latencies [–]."""

LARGEST_BOUND = 0.4
"""D̂m up to which tanh's steepest slope may at most double κ, as it does on the bench [rad]."""


def _latency(delay: float, sample_time: float) -> float:
    """Lag after a sample besides the servo's: delay, the derivative's filter, and its difference [s]."""
    return delay + AdaptiveGains().derivative_time + sample_time


def _prompter(known: Knowledge) -> float:
    """The bench's latency over that of the rig [–]."""
    return _latency(BENCH_DELAY, BENCH_SAMPLE_TIME) / _latency(known.delay, known.sample_time)


def _servo_shares(known: Knowledge) -> tuple[float, float]:
    """2ζ/ω, and the λ at which λ·ω²·latency is the bench's, both over those of the bench [–]."""
    slower = BENCH_FREQUENCY / known.servo_frequency
    return slower * known.servo_damping, slower**2 * _prompter(known)


def error_gain(known: Knowledge) -> float:
    """λ, the less of what cancels the servo's lag and what the delay allows [s].

    κ + κ·λ·s of the command is the first part of (s² + 2ζω·s + ω²)/ω², the servo's inverse, where λ = 2ζ/ω. The
    derivative β̂·λ·s through the servo crosses one at λ·ω², which must stay well below 1/latency.
    """
    return AdaptiveGains().error_gain * min(_servo_shares(known))


def feedback_gain(known: Knowledge) -> float:
    """κ, the less of what servo and delay allow [1/s].

    Around the servo the sum alone has the gain margin 2ζω/κ; where the delay takes a part of λ away, less is left.
    """
    cancels, allowed = _servo_shares(known)
    by_servo = known.servo_damping * known.servo_frequency / BENCH_FREQUENCY * math.sqrt(min(1.0, allowed / cancels))
    return AdaptiveGains().feedback_gain * min(by_servo, DELAY_SHARE * _prompter(known))


def smoothing(known: Knowledge) -> float:
    """ε, so that β̂·D̂m/ε, which adds to κ near s = 0, is to κ what it is on the bench [rad·s]."""
    return LARGEST_BOUND / feedback_gain(known)


SUIT = AdaptiveGains(error_gain=0.05, feedback_gain=3.0, smoothing=0.2)
"""λ, κ and ε chosen for margin on the suit, where a forearm hangs in springs (docs/background/suit.md)."""

LAW = Law(
    name="adaptive",
    gains=AdaptiveGains(),
    start_kernel=start,
    step_kernel=step,
    source="Dinh et al. 2017, Eqs 9–14; adaptation gains of Section 5.1.2",
    presets={"paper": PRINTED, "suit": SUIT},
    suit_preset="suit",
    from_rig={"error_gain": error_gain, "feedback_gain": feedback_gain, "smoothing": smoothing},
    feeds_back=frozenset({"joint"}),
    settling=settling,
    proven=proven,
    tunable=frozenset(AdaptiveGains._fields),
    limits={
        "error_gain": (0.0, 1e3),
        "feedback_gain": (0.0, 1e4),
        "smoothing": (1e-9, 1e3),
        "slope_adaptation": (0.0, 1e4),
        "bound_adaptation": (0.0, 1e4),
        "slope_leakage": (0.0, 1e3),
        "bound_leakage": (0.0, 1e3),
        "derivative_time": (0.0, 10.0),
    },
)
