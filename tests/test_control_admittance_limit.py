"""The limit of the virtual elbow: the sampled loop against its own simulation, and what follows from it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bowden.control.admittance.passivity import limit_of
from bowden.control.admittance.port import Body, Port, bodies, held_loops, impedance, passive_to, sampled_loops
from bowden.control.admittance.virtual_elbow import Admittance, admittance_start, admittance_step
from bowden.core.errors import ParameterError
from bowden.models.suit.arm import arm_of

PORT = Port(
    inertia=1.6e-3,
    frequency=54.0,
    ratio=1.0,
    spool_stiffness=4.3,
    across=10.7,
    joint_stiffness=26.8,
    gear=2.6,
    lead=0.038,
    lead_square=3.4e-4,
    dt=1e-3,
    delay=1,
)
ROCK = PORT._replace(inertia=1e3, across=PORT.joint_stiffness / PORT.gear)
"""A drive that no cable moves, and spools in proportion to the levers."""
ARM = Body(0.07, 5.0, 0.3)
FREE = Admittance(inertia=0.015, damping=0.25, stiffness=1.0, rest=0.0, dead_band=0.0, low=-99.0, high=99.0,
                  torque_limit=1e9, speed_limit=1e9, acceleration_limit=1e15)  # fmt: skip


def simulated(port: Port, settings: Admittance, cycles: int) -> np.ndarray:
    """θ, θ̇, φ, φ̇ of each cycle (n, 4), by an integrator and the kernel itself, of an arm let go at 0.1 rad."""
    x, states, target = np.array([0.0, 0.0, 0.1, 0.0]), admittance_start(settings, 0.0), [0.0] * (port.delay + 1)

    def rates(_: float, x: np.ndarray, u: float) -> list[float]:
        spool = port.frequency**2 * (u - x[0]) - 2.0 * port.ratio * port.frequency * x[1]
        spool += (port.across * x[2] - port.spool_stiffness * x[0]) / port.inertia
        torque = port.joint_stiffness * x[2] - port.across * x[0]
        return [x[1], spool, x[3], (-torque - ARM.stiffness * x[2] - ARM.damping * x[3]) / ARM.inertia]

    rows = []
    for _ in range(cycles):
        rows.append(x)
        torque = port.joint_stiffness * x[2] - port.across * x[0]
        states, asked = admittance_step(settings, states, torque, port.dt)
        lead = port.lead * asked.velocity + port.lead_square * asked.acceleration
        target = [*target[1:], port.gear * (asked.position + lead)]
        x = solve_ivp(rates, (0.0, port.dt), x, args=(target[0],), rtol=1e-10, atol=1e-13).y[:, -1]
    return np.array(rows)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_matrix_is_the_loop(delay: int) -> None:
    port = PORT._replace(delay=delay)
    (loop,) = sampled_loops(held_loops(port, [ARM])[1], FREE)
    state = np.zeros(len(loop))
    state[2] = 0.1
    for row in simulated(port, FREE, 80):
        assert state[:4] == pytest.approx(row, abs=1e-8)
        state = loop @ state


def test_the_wearer_feels_the_virtual_elbow_behind_the_cables_springs() -> None:
    omega = np.array([0.5, 2.0, 5.0])
    virtual = 0.25 + 1j * (0.015 * omega - 1.0 / omega)
    wanted = 1.0 / (1.0 / virtual + 1j * omega / ROCK.joint_stiffness)
    assert np.max(np.abs(impedance(ROCK, FREE, omega) / wanted - 1.0)) < 0.005


def test_the_impedance_is_that_of_a_moved_elbow() -> None:
    """Force the elbow as a sine in simulation, by an arm that nothing stops, and compare torque and speed."""
    omega, heavy = 12.0, PORT
    body = Body(1e6, 1e6 * omega**2, 0.0)  # a flywheel that swings at omega, whatever the suit does
    (loop,) = sampled_loops(held_loops(heavy, [body])[1], FREE)
    state, rows = np.zeros(len(loop)), []
    state[2] = 0.1
    for _ in range(12000):
        rows.append(heavy.joint_stiffness * state[2] - heavy.across * state[0])
        state = loop @ state
    time, torque = 1e-3 * np.arange(12000), np.array(rows)
    part = time >= 12.0 - 8.0 * 2.0 * np.pi / omega
    phasor = 2.0 * np.mean(torque[part] * np.exp(-1j * omega * time[part]))
    assert phasor / (1j * omega * 0.1) == pytest.approx(complex(impedance(heavy, FREE, np.array([omega]))[0]), rel=0.02)


def test_passive_it_is_up_to_where_the_impedance_first_gives_energy_and_a_spring_alone_is_at_all() -> None:
    for port in (PORT, PORT._replace(delay=5), PORT._replace(dt=2e-3)):
        end = passive_to(port, FREE)
        assert np.min(impedance(port, FREE, np.linspace(0.1, 0.95 * end, 200)).real) >= 0.0
        assert impedance(port, FREE, np.array([end])).real < 0.0
        assert passive_to(port._replace(across=0.0), FREE) == np.pi / port.dt
    assert passive_to(PORT, FREE._replace(damping=-0.1)) == pytest.approx(0.1), "it looks from 0.1 rad/s on"


def test_lighter_and_later_is_less_passive() -> None:
    heavier = FREE._replace(inertia=0.1)
    assert passive_to(PORT, FREE) < passive_to(PORT, heavier)
    assert passive_to(PORT._replace(delay=5), FREE) < passive_to(PORT, FREE)


def test_the_least_inertia_is_the_least() -> None:
    limit = limit_of([PORT], bodies([arm_of(75.0, 1.75)], (0.0, 30.0), (0.0,)))
    light = Admittance(damping=0.1)
    least = limit.least(light, "inertia")
    assert least is not None
    assert 1e-3 < least < 0.1
    assert limit.holds(light._replace(inertia=least))
    assert not limit.holds(light._replace(inertia=0.95 * least))
    damping = limit.least(Admittance(inertia=0.002), "damping")
    assert damping is not None
    assert not limit.holds(Admittance(inertia=0.002, damping=0.95 * damping))


def test_beyond_the_limit_is_refused_with_what_would_hold_or_clamped() -> None:
    limit = limit_of([PORT], bodies([arm_of(75.0, 1.75)], (0.0, 30.0), (0.0,)))
    light = Admittance(inertia=0.001, damping=0.05)
    with pytest.raises(ParameterError, match=r"inertia 0.001 .* swings up .* an inertia of at least 0.0") as caught:
        limit.refuse(light)
    assert "\n" not in str(caught.value)
    heavier = limit.clamped(light)
    assert limit.holds(heavier)
    assert heavier.inertia / heavier.damping == pytest.approx(light.inertia / light.damping)
    assert heavier.inertia > light.inertia
    assert limit.clamped(Admittance()) == Admittance()
