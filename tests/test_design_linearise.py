"""The numerical linear model of a law against the one by hand, and which states are found to be estimates."""

from typing import NamedTuple

import control
import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.stability import adaptive_model, margins, response, servo_model
from bowden.core.kernel import kernel, power
from bowden.core.nested import flat, names
from bowden.core.signals import Reference, Sample
from bowden.design.linearise import NoNumberError, find_estimates, linearise
from bowden.models.drive.servo import Servo
from bowden.plants.presets.bench import default_bench

DT = 1e-3
COUNT = default_bench().joint_encoder.resolution
OMEGA = np.geomspace(0.1, 3000.0, 60)


@pytest.mark.parametrize("law", [LAWS["adaptive"], LAWS["adaptive"].preset("paper")], ids=["default", "paper"])
@pytest.mark.parametrize(("slope_inverse", "bound"), [(0.0, 0.0), (1.1, 0.0), (0.7, 0.3)])
def test_the_adaptive_law_has_its_model(law: Law, slope_inverse: float, bound: float) -> None:
    found = linearise(law, DT, width=COUNT, estimates={"slope_inverse": slope_inverse, "bound": bound})
    by_hand = adaptive_model(law.gains, DT, slope_inverse, bound)
    np.testing.assert_allclose(response(found.by_joint, OMEGA, DT), response(by_hand, OMEGA, DT), rtol=5e-3)
    assert not response(found.by_motor, OMEGA, DT).any()


def test_a_steep_curve_counts_as_one_encoder_count_sees_it() -> None:
    law = LAWS["adaptive"].with_gains(smoothing=1e-6)
    estimates = {"slope_inverse": 1.0, "bound": 0.1}
    seen = linearise(law, DT, width=COUNT, estimates=estimates).d[0]
    tangent = linearise(law, DT, width=1e-9, estimates=estimates).d[0]
    lam = law.gains.error_gain + DT
    assert tangent == pytest.approx(adaptive_model(law.gains, DT, 1.0, 0.1).d, rel=1e-3)
    chord = 0.1 * np.tanh(lam * COUNT / 1e-6) / COUNT
    assert seen - linearise(LAWS["adaptive"], DT, width=COUNT, estimates=estimates | {"bound": 0.0}).d[0] == (
        pytest.approx(chord, rel=1e-6)
    )


@pytest.mark.parametrize("name", [name for name in LAWS if LAWS[name].deadband == 0.0])  # the others have no tangent
def test_the_model_of_any_law_predicts_the_law(name: str) -> None:
    """From rest, a small random motion of both angles: the model's command is the law's."""
    law = LAWS[name]
    size = 1e-7
    state = law.start(Sample(0.0, 0.0))
    begun = dict(zip(names(state), flat(state), strict=True))
    frozen = {estimate: begun[estimate] for estimate in find_estimates(law, state, DT)}
    model = linearise(law, DT, width=size, estimates=frozen)
    x = np.zeros((len(model.a), 1))
    signals = size * np.cumsum(np.random.default_rng(4).standard_normal((30, 2)) * 0.1, axis=0)
    rest = law.step(state, Sample(0.0, 0.0), Reference(0.0, 0.0, 0.0), DT)[1]
    errors, sizes = [], []
    for joint, motor in signals:
        state, command = law.step(state, Sample(joint, motor), Reference(0.0, 0.0, 0.0), DT)
        output = float((model.c @ x)[0, 0] + model.d @ [joint, motor])
        x = model.a @ x + model.b @ [[joint], [motor]]
        errors.append(abs(output + command - rest))
        sizes.append(abs(command - rest))
    assert max(errors) <= 0.02 * max(sizes) + 1e-3 * size


def test_estimates_are_told_from_integrals_and_filters() -> None:
    law = LAWS["adaptive"]
    visited = law.start(Sample(0.0, 0.0))._replace(
        integral=-0.01, slope_inverse=0.7, bound=0.2, joint=1.0, joint_rate=0.1, filtered_error=0.01
    )
    assert find_estimates(law, visited, DT) == ["slope_inverse", "bound"]
    observer = LAWS["observer"]
    assert find_estimates(observer, type(observer.start(Sample(0.0, 0.0)))(0.3, 1.0), DT) == []


def test_a_law_without_feedback_has_no_margins_and_is_stable() -> None:
    model = linearise(LAWS["uncompensated"], DT)
    found = margins(servo_model(Servo(), DT, 1, 1.0), model.seen_through(0.938), DT)
    assert found.stable
    assert (found.gain_margin_db, found.phase_margin_deg, found.delay_margin_s) == (None, None, None)


def test_a_long_model_has_the_response_of_its_poles() -> None:
    """Twelve poles near one: a polynomial would lose them, python-control's solve does not."""
    poles = 1.0 - np.geomspace(1e-5, 1e-2, 12)
    a = np.diag(poles) + np.diag(np.full(11, 1e-3), 1)
    model = linearise(LAWS["uncompensated"], DT).by_joint._replace(a=a, b=np.ones((12, 1)), c=np.ones((1, 12)), d=0.1)
    truth = control.ss(a, np.ones((12, 1)), np.ones((1, 12)), [[0.1]], DT)(np.exp(1j * OMEGA * DT))
    np.testing.assert_allclose(response(model, OMEGA, DT), truth, rtol=1e-9)


class Nothing(NamedTuple):
    gain: float = 1.0


class Kept(NamedTuple):
    before: float


@kernel
def begin(gains: Nothing, sample: Sample) -> Kept:
    return Kept(0.0)


@kernel
def heedless(gains: Nothing, state: Kept, sample: Sample, reference: Reference, dt: float) -> tuple[Kept, float]:
    unheeded = gains.gain / reference.velocity if reference.velocity != 0.0 else 0.0
    return state, reference.position - gains.gain * sample.joint + unheeded


@kernel
def rooted(gains: Nothing, state: Kept, sample: Sample, reference: Reference, dt: float) -> tuple[Kept, float]:
    return state, reference.position - gains.gain * power(sample.joint, 0.5)


@kernel
def spoilt(gains: Nothing, state: Kept, sample: Sample, reference: Reference, dt: float) -> tuple[Kept, float]:
    return Kept(sample.joint / reference.velocity), reference.position


def test_a_division_that_is_guarded_is_none_by_zero() -> None:
    model = linearise(Law("heedless", Nothing(2.0), begin, heedless, source=""), DT)
    assert model.d == pytest.approx([2.0, 0.0])


@pytest.mark.parametrize(("step", "what"), [(rooted, "its command"), (spoilt, "its state before")])
def test_a_law_that_gives_no_number_at_rest_has_no_model(step: object, what: str) -> None:
    law = Law("mine", Nothing(), begin, step, source="")  # type: ignore[arg-type]
    with pytest.raises(NoNumberError, match=f"mine has no linear model: {what} is no finite number at rest at 0°"):
        linearise(law, DT)
