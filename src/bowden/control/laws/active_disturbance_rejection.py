"""Active disturbance rejection (Han 2009), with the bandwidths of Gao (2003) and a current discrete observer.

Through the servo the joint is seen as of second order, pushed by the command and by all that is not known,

    d²joint/dt² = b₀·command − ω²·joint − 2ζω·d(joint)/dt + f,   b₀ = α̂·ω²

f holding the hysteresis, every change of the cable, and what is wrong with ω, ζ and b₀. An extended-state observer
(ESO) of the bandwidth ωo estimates z = (joint, its rate, f); the command cancels f and puts the error's poles at −ωc:

    z⁻ = Φ·z + Γ·command that acted;   z = z⁻ + L·(joint − z⁻₁)
    command = φa/α̂ + ((ωc² − ω²)·(φ_d − z₁) + (2ωc − 2ζω)·(φ̇_d − z₂) − z₃)/b₀

Φ and Γ hold the servo to second order in the sample time T. L puts all three poles of the current observer, the
eigenvalues of (I − L·C)·Φ, at β = exp(−ωo·T); `observer_gains` has it in closed form. For ω = 0 this is the observer
of Miklosovic, Radke and Gao (2006). Han and Gao leave the plant's own stiffness to f as well; through a servo it is
large and known, and an observer slow enough for the encoder's noise would follow it with a lag of 3/ωo. The
model-assisted form is taken instead, with φa, the reference with the servo's lag and the delay taken away.

The observer is given the command that acts, so that what the law itself has on its way is no disturbance to it. One
cycle of the delay is exact; what a rig has beyond that, τ − 1.5·Ts, is two first-order lags of half of it each.

ωo follows from the rig (`fitting_bandwidth`): no faster than servo, delay and noise allow.
"""

import math
from typing import Annotated, NamedTuple

from bowden.control.knowledge import Knowledge
from bowden.control.law import Law
from bowden.control.law_parts import LEAD, LEAD_SQUARE, LIMITS, SERVO, clamp, compensate_lag, quiet_bandwidth
from bowden.core.kernel import exp, kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample


class ActiveDisturbanceRejectionGains(NamedTuple):
    """The known part of the plant, and the two bandwidths."""

    slope: float = 0.938
    """α̂, joint motion per motor motion; negative where the cable runs the other way [rad/rad]."""
    natural_frequency: float = 53.58
    """ω of the servo [rad/s]."""
    damping: float = 1.0
    """ζ of the servo [–]."""
    observer_bandwidth: Annotated[float, Quantity("ωo", "rad/s", live=True)] = 190.0
    control_bandwidth: Annotated[
        float, Quantity("ωc; the servo's ω, so that the command only cancels f", "rad/s", live=True)
    ] = 53.58
    lead: float = LEAD
    """Lag of servo and delay that is taken away [s]."""
    lead_square: float = LEAD_SQUARE
    """The same to second order [s²]."""
    arrival: float = 1.0
    """Share of what is left that each of the two lags makes up for in a cycle that stand for the delay beyond one; 1
    where there is none [–]."""


class ActiveDisturbanceRejectionState(NamedTuple):
    """State of the law from one cycle to the next."""

    joint: Annotated[float, Quantity("z₁, estimated joint angle", "rad")]
    joint_rate: Annotated[float, Quantity("z₂, its rate", "rad/s")]
    disturbance: Annotated[float, Quantity("z₃, all acceleration that is not b₀·command", "rad/s²")]
    command: Annotated[float, Quantity("the last command", "rad")]
    command_between: Annotated[float, Quantity("the command behind the first of the delay's two lags", "rad")]
    command_before: Annotated[float, Quantity("the command behind both, which acted over the last cycle", "rad")]


class Prediction(NamedTuple):
    """One cycle of the known plant, (joint, rate)⁺ from (joint, rate, f): the first two rows of Φ."""

    xx: float
    xv: float
    xf: float
    vx: float
    vv: float
    vf: float


@kernel
def prediction(natural_frequency: float, damping: float, dt: float) -> Prediction:
    """Φ to second order in `dt`; Γ is its last column times b₀."""
    stiffness, friction = natural_frequency * natural_frequency, 2.0 * damping * natural_frequency
    half = 0.5 * dt * dt
    xv = dt - friction * half
    return Prediction(
        1.0 - stiffness * half,
        xv,
        half,
        -stiffness * xv,
        1.0 - friction * dt + (friction * friction - stiffness) * half,
        xv,
    )


@kernel
def observer_gains(known: Prediction, beta: float) -> tuple[float, float, float]:
    """L that puts the three eigenvalues of (I − L·C)·Φ at `beta`, C = (1 0 0).

    The determinant gives 1 − L₁ = β³/det Φ; the trace and the sum of the principal minors are linear in L₂ and L₃.
    """
    determinant = known.xx * known.vv - known.xv * known.vx
    kept = beta * beta * beta / determinant
    on_f = (1.0 - beta) * (1.0 - beta) * (1.0 - beta) / (known.xf + known.xv * known.vf - known.xf * known.vv)
    on_rate = (kept * known.xx + known.vv + 1.0 - 3.0 * beta - on_f * known.xf) / known.xv
    return 1.0 - kept, on_rate, on_f


@kernel
def start(gains: ActiveDisturbanceRejectionGains, sample: Sample) -> ActiveDisturbanceRejectionState:
    """Begin at rest, with the motor held where it is: f is what keeps the joint where it is then."""
    stiffness = gains.natural_frequency * gains.natural_frequency
    held = stiffness * (sample.joint - gains.slope * sample.motor)
    return ActiveDisturbanceRejectionState(sample.joint, 0.0, held, sample.motor, sample.motor, sample.motor)


@kernel
def step(
    gains: ActiveDisturbanceRejectionGains,
    state: ActiveDisturbanceRejectionState,
    sample: Sample,
    reference: Reference,
    dt: float,
) -> tuple[ActiveDisturbanceRejectionState, float]:
    """Predict over the last cycle, correct by the sample, cancel and steer."""
    omega, wanted = gains.natural_frequency, gains.control_bandwidth
    stiffness = omega * omega
    input_gain = gains.slope * stiffness
    known = prediction(omega, gains.damping, dt)
    on_joint, on_rate, on_f = observer_gains(known, exp(-gains.observer_bandwidth * dt))

    push = state.disturbance + input_gain * state.command_before
    expected = known.xx * state.joint + known.xv * state.joint_rate + known.xf * push
    expected_rate = known.vx * state.joint + known.vv * state.joint_rate + known.vf * push
    surprise = clamp(sample.joint - expected, -1e3, 1e3, 0.0)
    joint = expected + on_joint * surprise
    joint_rate = expected_rate + on_rate * surprise
    disturbance = state.disturbance + on_f * surprise

    steer = (wanted * wanted - stiffness) * (reference.position - joint)
    damp = 2.0 * (wanted - gains.damping * omega) * (reference.velocity - joint_rate)
    command = (
        compensate_lag(reference, gains.lead, gains.lead_square) / gains.slope
        + (steer + damp - disturbance) / input_gain
    )
    between = state.command_between + gains.arrival * (state.command - state.command_between)
    acting = state.command_before + gains.arrival * (between - state.command_before)
    return ActiveDisturbanceRejectionState(joint, joint_rate, disturbance, command, between, acting), command


DELAY_SHARE = 1.0
"""ωo times the delay τ, at most [–]."""


def fitting_bandwidth(known: Knowledge) -> float:
    """ωo, no faster than servo, delay and the joint's noise allow [rad/s]."""
    return quiet_bandwidth(known, DELAY_SHARE, (known.joint_noise, known.joint_step / math.sqrt(12.0)))


def arrival(known: Knowledge) -> float:
    """Share of the two lags that stand for the delay beyond one cycle [–].

    1/(1 + (τ/Ts − 1.5)/2), and 1 for a delay of up to one cycle.
    """
    return 1.0 / (1.0 + 0.5 * max(0.0, known.delay / known.sample_time - 1.5))


LAW = Law(
    name="active_disturbance_rejection",
    gains=ActiveDisturbanceRejectionGains(),
    start_kernel=start,
    step_kernel=step,
    source="Han, IEEE Transactions on Industrial Electronics 56(3), 2009; Gao, ACC 2003; Miklosovic et al., ACC 2006",
    from_rig={
        **SERVO,
        "observer_bandwidth": fitting_bandwidth,
        "control_bandwidth": "servo_frequency",
        "arrival": arrival,
    },
    feeds_back=frozenset({"joint"}),
    compensates_lag=True,
    tunable=frozenset({"observer_bandwidth", "control_bandwidth"}),
    limits={
        **LIMITS,
        "observer_bandwidth": (1e-3, 1e5),
        "control_bandwidth": (0.0, 1e4),
        "arrival": (1e-3, 1.0),
    },
)
