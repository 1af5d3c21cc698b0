"""The suit as a port at the elbow, linear and sampled, with a virtual elbow behind it and a wearer before it.

About rest, with the elbow at φ, the spool at θ behind the drive's PD loop, and the cables' springs (each in series with
its fabric) k_f, k_e at the levers r_f, r_e of the spools and E', R of the elbow,

    J·θ̈ = J·ω²·(target − θ) − 2ζωJ·θ̇ − k_θ·θ + k_x·φ        k_θ = r_f²k_f + r_e²k_e,  k_x = r_f·E'·k_f + r_e·R·k_e
    τ = k_s·φ − k_x·θ                                       k_s = E'²k_f + R²k_e: what the wearer feels of the suit
    target = E'/r_f·(q + lead·q̇ + lead₂·q̈)                  `delay` cycles late and held over each; q: the admittance's
    I·φ̈ = −τ − (K_h + K)·φ − (B_h + B)·φ̇                     the wearer's forearm, muscles and relaxed elbow

Friction in drive and sheath is left out: it only takes energy, as long as less of it is made up for than there is. So
is the flesh's damping, which would help, and the law: it is one that sends the motor where the admittance says.
"""

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.admittance.virtual_elbow import Admittance
from bowden.models.suit.arm import Arm

Array = NDArray[np.float64]


class Port(NamedTuple):
    """The suit at one angle of the elbow, linear, seen from the elbow."""

    inertia: float
    """J, at the spool [kg·m²]."""
    frequency: float
    """ω of the drive's PD loop [rad/s]."""
    ratio: float
    """ζ of it [–]."""
    spool_stiffness: float
    """k_θ [N·m/rad]."""
    across: float
    """k_x [N·m/rad]."""
    joint_stiffness: float
    """k_s [N·m/rad]."""
    gear: float
    """E'/r_f, spool's angle per angle of the motor in the joint's coordinate [–]."""
    lead: float
    """[s]"""
    lead_square: float
    """[s²]"""
    dt: float
    """Ts [s]."""
    delay: int
    """Cycles from a sample to the moment its command reaches the drive [–]."""


class Body(NamedTuple):
    """A wearer at the port."""

    inertia: float
    """I, of forearm and hand [kg·m²]."""
    stiffness: float
    """K_h + K [N·m/rad]."""
    damping: float
    """B_h + B [N·m·s/rad]."""


def bodies(
    arms: list[Arm],
    stiffnesses: tuple[float, ...] = (0.0, 5.0, 30.0, 200.0),
    dampings: tuple[float, ...] = (0.0, 10.0),
) -> list[Body]:
    """Wearers from limp to stiff.

    Args:
        arms: whose inertia and relaxed elbow they have.
        stiffnesses: K_h of the muscles [N·m/rad].
        dampings: B_h of the muscles [N·m·s/rad].
    """
    return [
        Body(arm.inertia, arm.stiffness + k, arm.damping + d)
        for arm, k, d in itertools.product(arms, stiffnesses, dampings)
    ]


class Held(NamedTuple):
    """Spool and wearers over one cycle with the target held; the same for every virtual elbow."""

    port: Port
    a: Array
    """From the states to the states (m, n, n)."""
    b: Array
    """From the target (m, n)."""
    torque_input: Array
    """Torque of the wearer on the suit, of the states (n,)."""


def held_loops(port: Port, wearers: list[Body]) -> list[Held]:
    """The suit with each of the wearers, and with an elbow that is held."""
    from scipy.linalg import expm  # a fifth of a second, which only a check need wait for

    drive = _drive(port)
    still = expm(np.delete(np.delete(drive, 2, 0), 2, 1) * port.dt)
    held = Held(port, still[None, :2, :2], still[None, :2, 2], np.array([-port.across, 0.0]))
    whole = np.zeros((len(wearers), 5, 5))
    whole[:, :2, :3], whole[:, :2, 4], whole[:, 2, 3] = drive[:2, :3], drive[:2, 3], 1.0
    for i, body in enumerate(wearers):
        pull = (port.across, 0.0, -port.joint_stiffness - body.stiffness, -body.damping, 0.0)
        whole[i, 3] = np.array(pull) / body.inertia
    moved = expm(whole * port.dt)
    torque_input = np.array([-port.across, 0.0, port.joint_stiffness, 0.0])
    return [held, Held(port, moved[:, :4, :4], moved[:, :4, 4], torque_input)] if wearers else [held]


def _drive(port: Port) -> Array:
    """d(θ, θ̇)/dt from θ, θ̇, φ and the target, with two empty rows for the last."""
    stiff = port.frequency**2
    rates = np.zeros((4, 4))
    rates[0, 1] = 1.0
    rates[1] = [
        -stiff - port.spool_stiffness / port.inertia,
        -2.0 * port.ratio * port.frequency,
        port.across / port.inertia,
        stiff,
    ]
    return rates


def sampled_loops(held: Held, settings: Admittance) -> Array:
    """The closed loops from one sample to the next, x⁺ = A·x (m, k, k); stable with all eigenvalues in the unit circle.

    The states are the suit's and the wearer's, q and q̇ of the admittance, and the targets on their way.

    Args:
        held: suit and wearers.
        settings: of the virtual elbow; its limits and its dead band do not count.
    """
    port, n = held.port, held.a.shape[1]
    dt, d = port.dt, port.delay
    below = settings.inertia + dt * (settings.damping + dt * settings.stiffness)
    velocity = np.zeros(n + 2 + d)  # q̇⁺ as a row of the state
    velocity[:n] = dt / below * held.torque_input
    velocity[n], velocity[n + 1] = -dt * settings.stiffness / below, settings.inertia / below
    position, acceleration = dt * velocity, velocity / dt
    position[n] += 1.0
    acceleration[n + 1] -= 1.0 / dt
    target = port.gear * (position + port.lead * velocity + port.lead_square * acceleration)
    whole = np.zeros((len(held.a), n + 2 + d, n + 2 + d))
    whole[:, :n, :n], whole[:, n], whole[:, n + 1] = held.a, position, velocity
    if d:
        whole[:, :n, n + 2] = held.b
        whole[:, np.arange(n + 2, n + 1 + d), np.arange(n + 3, n + 2 + d)] = 1.0
        whole[:, -1] = target
    else:
        whole[:, :n] += held.b[:, :, None] * target
    return whole


def impedance(port: Port, settings: Admittance, omega: Array) -> NDArray[np.complex128]:
    """Z = τ/φ̇ at the sampling instants, for an elbow moved as a sine (n,) [N·m·s/rad]."""
    held = held_loops(port, [])[0]
    drive, dt = _drive(port), port.dt
    rates, pushed = drive[:2, :2], drive[:2, 2]
    loop = sampled_loops(held, settings)[0]
    # what φ itself brings in: as torque into the admittance, and as load of the spool between two samples
    silent, driven = (
        sampled_loops(held._replace(torque_input=np.array([h, 0.0])), settings)[0, :, 0] for h in (0.0, 1.0)
    )
    by_torque = port.joint_stiffness * (driven - silent)
    answer = np.empty(len(omega), dtype=np.complex128)
    for i, w in enumerate(omega):
        z = np.exp(1j * w * dt)
        carried = (z * np.eye(2) - held.a[0]) @ np.linalg.solve(1j * w * np.eye(2) - rates, pushed)
        into = by_torque.astype(np.complex128)
        into[:2] += carried
        x = np.linalg.solve(z * np.eye(len(loop)) - loop, into)
        answer[i] = (port.joint_stiffness - port.across * x[0]) / (1j * w)
    return answer


def passive_to(port: Port, settings: Admittance) -> float:
    """The frequency up to which Re Z ≥ 0; the Nyquist frequency where it is everywhere [rad/s]."""
    omega = np.geomspace(0.1, np.pi / port.dt * 0.999, 300)
    negative = np.flatnonzero(np.real(impedance(port, settings, omega)) < 0.0)
    return float(omega[negative[0]] if len(negative) else np.pi / port.dt)
