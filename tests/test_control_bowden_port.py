"""Our law ported by hand: the code on its page, run beside the law."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.signals import Reference, Sample
from bowden.models.cable.backlash import push
from test_docs import blocks

PAGE = Path(__file__).parents[1] / "docs" / "background" / "our_law.md"
(PORT,) = blocks(PAGE, "python")


def ported() -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(PORT, PAGE.name, "exec"), names)
    return names


@pytest.mark.parametrize(
    ("gains", "arm", "tremor", "friction"),
    [
        ({}, 50.0, 0.02, 0.0),
        ({}, 3.0, 0.0, 0.3),
        ({"lag": 0.05, "width": 0.1, "servo_integral": 2.0, "slope": 0.8}, 3.0, 0.02, 0.1),
    ],
)
def test_the_port_on_the_page_is_the_law(gains: dict[str, float], arm: float, tremor: float, friction: float) -> None:
    """10 000 cycles behind a dead zone, on an arm that swings at `arm` [Hz] with a tremor from 6 s on [rad].

    The motor sticks until its command is further away than `friction` [rad].
    """
    law, port, random = LAWS["bowden"].with_gains(**gains), ported(), np.random.default_rng(2026)
    told = law.gains
    known = {"omega": told.servo_frequency, "zeta": told.servo_damping, "k": told.servo_integral, "tau": told.delay}
    g = SimpleNamespace(**known, s=1 / told.slope, width=told.width, sigma=told.noise, lag=told.lag, c=told.bandwidth)
    state, record = law.start(Sample(0.0, 0.0)), port["start"](g, 0.0, 0.0)
    motor = speed = tendon = joint = rate = command = 0.0
    seen = set()
    for time in np.arange(0.0, 10.0, 1e-3).tolist():
        pull = push(motor, command, friction) - motor
        speed += 1e-3 * (53.6**2 * pull - 2.0 * 53.6 * speed)
        motor += 1e-3 * speed
        tendon = push(tendon, motor, 0.05)
        swings = 2.0 * math.pi * arm
        rate += 1e-3 * (swings**2 * (0.9 * tendon - joint) - 0.2 * swings * rate)
        joint += 1e-3 * rate
        phase = math.pi * min(time, 8.0)
        asked = (0.4 * (1.0 - math.cos(phase)), 0.4 * math.pi * math.sin(phase), 0.4 * math.pi**2 * math.cos(phase))
        reference = Reference(*asked) if time < 8.0 else Reference(asked[0], 0.0, 0.0)
        aside = tremor * math.sin(10.0 * math.pi * time) * (time > 6.0)
        sample = Sample(joint + aside + random.normal(0.0, 1e-4), motor + random.normal(0.0, 1e-4))
        state, command = law.step(state, sample, reference, 1e-3)
        assert port["step"](g, record, sample.joint, sample.motor, *reference, 1e-3) == pytest.approx(command, abs=1e-9)
        seen |= {("crossing", bool(state.deadzone.crossing)), ("trial", state.oscillation.half_waves < 0.0)}
    assert len(seen) == 4
    assert (state.drive.stick > 0.1) == (friction > 0.1)


def test_the_port_is_short() -> None:
    assert len(PORT.splitlines()) <= 120
