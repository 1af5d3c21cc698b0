"""Any plant: measurements agree with formulas, a plant of one's own runs everywhere, what cannot be is told."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.design.check import STROKE, check
from bowden.design.limit_cycle import MEASURED, describing_function
from bowden.identify.cable.identification import identify
from bowden.identify.log.read import read_log
from bowden.models.cable.backlash import Play
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.bouc_wen_static import StaticTerms
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath, constant_bend, random_bend, scripted_bend
from bowden.models.drive.servo import Servo
from bowden.plants import cables
from bowden.plants.bench import Bench
from bowden.plants.bends import Bend, ConstantBend, RandomBend, ScriptedBend
from bowden.plants.cable import bouc_wen
from bowden.plants.plant import Plant
from bowden.plants.plant_file import load
from bowden.plants.suit_parts import Suit
from bowden.plants.transmission import measured_response, transmission
from bowden.plants.user_plant import UserPlant
from bowden.records.metrics import is_stable
from bowden.rig.rig import Rig
from bowden.sim.many import simulate_many
from bowden.sim.run import Case, simulate
from support.sensors import PAPER_ENCODER

EXAMPLE = Path(__file__).parents[1] / "examples" / "my_plant.py"
MOTION = PeriodicMinimumJerk(0.0, 1.0, 5.0)
BENCH = Bench(joint_encoder=PAPER_ENCODER, motor_encoder=PAPER_ENCODER)


def round_its_cable(bench: Bench) -> Bench:
    """The same, of whose cable no formula is known."""
    return bench._replace(cable=bench.simulated_cable)


@pytest.mark.parametrize("bend", [np.pi, 1.4 * np.pi])
def test_what_is_measured_of_a_plant_is_what_the_benchs_formula_says(bend: float) -> None:
    bench = BENCH._replace(sheath=Sheath(loss=0.2))
    known, measured = transmission(bench, bend, STROKE), transmission(round_its_cable(bench), bend, STROKE)
    assert measured.slope == pytest.approx(known.slope, rel=1e-6)
    assert measured.steepest == pytest.approx(known.steepest, rel=1e-6)
    assert measured.dead_zone == pytest.approx(known.dead_zone, rel=1e-3)
    assert measured.reversal < 0.0  # the printed cable first moves the wrong way
    calculated = describing_function(bench, bend, STROKE, MEASURED)[1]
    np.testing.assert_allclose(measured_response(round_its_cable(bench), bend, STROKE, MEASURED), calculated, atol=5e-3)


def test_a_play_has_no_slope_right_after_a_reversal() -> None:
    found = transmission(Bench(cables.play(Play(0.9, 0.05, 0.0))), np.pi, STROKE)
    assert found.slope == pytest.approx(0.9)
    assert found.reversal == pytest.approx(0.0, abs=1e-9)
    assert found.dead_zone == pytest.approx(2.0 * 0.9 * 0.05, rel=1e-3)
    like = transmission(Bench(cable=cables.bouc_wen_like(cables.play(Play(0.9, 0.05, 0.0)))), np.pi, STROKE)
    assert (like.slope, like.dead_zone) == pytest.approx((0.9, 2.0 * 0.9 * 0.05))


def test_a_response_is_that_about_the_middle_of_the_stroke() -> None:
    """joint = w·motor + c·T₂(u): the parabola's own harmonic is the second, and its slope that where the motor is."""
    terms = StaticTerms(np.array([0.06]), np.zeros(0), 0.5, 2.0)
    plant = Bench(bouc_wen(BoucWen(slope=0.9, hysteresis_gain=0.0), terms), servo=Servo(400.0))
    low, high = 0.2, 0.8
    centre = plant.resting_motor(0.5 * (low + high))
    slope = 0.9 + 0.06 * 4.0 * (centre - 0.5) / 2.0**2
    found = measured_response(plant, np.pi, (low, high), np.array([0.01, 0.1]))
    np.testing.assert_allclose(found, slope, rtol=1e-6)
    seen, ends = transmission(plant, np.pi, (low, high)), [plant.resting_motor(angle) for angle in (low, high)]
    assert seen.dead_zone == pytest.approx(0.0, abs=1e-9)
    assert seen.steepest == pytest.approx(0.9 + 0.06 * 4.0 * (ends[1] - 0.5) / 4.0, rel=5e-3)
    assert seen.reversal == pytest.approx(0.9 + 0.06 * 4.0 * (ends[0] - 0.5) / 4.0, rel=5e-3)


@pytest.mark.parametrize(
    ("bend", "same"),
    [
        (ConstantBend(2.5), constant_bend(2.5)),
        (ConstantBend(), constant_bend(1.5)),
        (ScriptedBend((1.0, 4.0), (2.0, 3.0)), scripted_bend([1.0, 4.0], [2.0, 3.0])),
        (RandomBend(1.0, 4.0, 2.0), random_bend(1.0, 4.0, 2.0, 30.0, 7)),
    ],
)
def test_a_bend_of_a_rig_is_the_path_of_its_kind(bend: Bend, same: BendPath) -> None:
    time = np.linspace(0.0, 40.0, 400)
    np.testing.assert_array_equal(bend.path(Sheath(bend=1.5), 30.0, 7)(time), same(time))


def test_the_check_says_of_a_plant_round_the_benchs_cable_what_it_says_of_the_bench() -> None:
    law = LAWS["adaptive"]
    bench, other = check(BENCH, law), check(round_its_cable(BENCH), law)
    assert other.verdict == bench.verdict == "holds"
    assert other.gain_margin_db == pytest.approx(bench.gain_margin_db, rel=1e-6)
    assert other.phase_margin_deg == pytest.approx(bench.phase_margin_deg, rel=1e-6)
    assert bench.cycle is not None
    assert other.cycle is not None
    assert other.cycle.amplitude == pytest.approx(bench.cycle.amplitude, rel=0.05)


def test_a_plant_from_a_file_runs_in_simulation_batch_and_check() -> None:
    plant, law = load(str(EXAMPLE)), LAWS["adaptive"]
    trace = simulate(plant, law, MOTION, duration=10.0, seed=3)
    assert trace.stable
    assert np.sqrt(np.mean(trace.error[5000:] ** 2)) < 1.0 * RADIANS
    assert trace.settings["plant"]["kind"] == "my_plant"
    ((found,),) = simulate_many([Case(plant, (law,), MOTION, constant_bend(np.pi), 3)], 10.0)
    assert found.rmse == float(np.sqrt(np.mean(np.square(trace.error))))
    assert plant.resting_motor(0.3) == pytest.approx(0.3 / 0.95)
    assert check(plant, law).verdict == "holds"


def test_a_file_may_define_a_whole_plant(tmp_path: Path) -> None:
    text = EXAMPLE.read_text() + '\nQUICK = UserPlant("quick", Parameters(120.0), rest, advance, sample_time=5e-4)\n'
    (tmp_path / "own.py").write_text("from bowden.plants.user_plant import UserPlant\n" + text.split('"""', 2)[2])
    plant = load("own.py:QUICK", tmp_path)
    assert isinstance(plant, UserPlant)
    assert (plant.name, plant.sample_time) == ("quick", 5e-4)
    assert simulate(plant, LAWS["uncompensated"], MOTION, duration=2.0).stable


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("    end = max", "    oops\n    end = max", r"own.py, line 4\d: NameError: name 'oops'"),
        (
            "Body(given.slope * end, motor, speed)",
            "Body(given.slope * end, (1e308 * 10.0) * 0.0, speed)",
            "motor from advance",
        ),
        ("Body(given.slope * end, motor, speed)", "(given.slope * end, motor, speed)", "begins with joint, motor"),
        ("    joint: float\n", "    place: float\n", "begins with joint, motor, motor_velocity"),
        ("@kernel\ndef advance", "def advance", "not a kernel"),
        ("slope: float = 0.95", "slope: float = float('nan')", "own.slope is nan"),
        ("def rest(", "def stays(", "no UserPlant and no rest"),
    ],
)
def test_a_mistake_in_a_plants_file_is_told_with_its_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = EXAMPLE.read_text()
    assert old in text
    (tmp_path / "own.py").write_text(text.replace(old, new))
    with pytest.raises(ParameterError, match=said) as caught:
        load("own.py", tmp_path)
    assert "own" in str(caught.value)


def test_a_body_that_changes_its_shape_is_told(tmp_path: Path) -> None:
    other = "\n\nclass Other(NamedTuple):\n    joint: float\n    motor: float\n    motor_velocity: float\n"
    text = EXAMPLE.read_text().replace("    return Body(given.slope", "    return Other(given.slope") + other
    (tmp_path / "own.py").write_text(text)
    with pytest.raises(ParameterError, match="advance changes the body's shape"):
        load("own.py", tmp_path)


@pytest.mark.parametrize(
    ("plant", "said"),
    [
        (Bench(cable=BoucWen(slope=math.nan)), "bench.cable.slope is nan"),
        (Bench(cable=BoucWen(rate=-1.0)), "rate is -1"),
        (Bench(sheath=Sheath(gap=math.inf)), "bench.sheath.gap is inf"),
        (Bench(servo=Servo(damping=math.nan)), "bench.servo.damping is nan"),
        (Bench(cables.play(Play(offset=math.nan))), "offset is nan"),
        (Bench(cables.play(), servo=Servo(math.inf)), "natural_frequency is inf"),
        (Suit(posture=math.nan), "suit.posture is nan"),
    ],
)
def test_a_plant_with_what_is_no_number_is_refused(plant: Plant, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        simulate(plant, LAWS["uncompensated"], MOTION, duration=1.0)
    case: Any = Case(plant, (LAWS["uncompensated"],), MOTION, constant_bend(np.pi), 0)
    with pytest.raises(ParameterError, match=said):
        next(simulate_many([case], 1.0))


def test_a_joint_that_runs_off_is_not_stable_though_it_ends() -> None:
    """A cable that turns the joint the wrong way: every number is finite, and the joint is beyond sense."""
    backwards = Bench(cable=BoucWen(slope=-0.938, hysteresis_gain=0.129))
    trace = simulate(backwards, LAWS["uncompensated"], MOTION, duration=5.0)
    assert trace.ended
    assert not trace.stable
    assert not is_stable(trace["reference"], trace["joint"])
    ((found,),) = simulate_many([Case(backwards, (LAWS["uncompensated"],), MOTION, constant_bend(np.pi), 0)], 5.0)
    assert (found.ended, found.stable) == (1.0, 0.0)


def test_a_rig_simulates_the_model_that_identification_recommends(shared_data: Path) -> None:
    """On a real log's second half the rig's plant is no worse than the recommended model is said to be."""
    log = read_log(shared_data / "cable" / "L_Pitch_1_000.csv.gz")
    fit = identify([log])
    rig = Rig(cable=fit)
    assert isinstance(rig.moved, Bench)
    assert rig.moved.simulated_cable.name == fit.best.name == "generalised_play"

    def error(plant: Bench) -> float:
        """RMS in degrees of its cable under the log's own motor, which runs backwards."""
        cable, motor, joints = plant.simulated_cable, (-log.motor).tolist(), []
        memory, before = cable.start(cable.prepared, motor[0], 1.0, 1.0), motor[0]
        for angle in motor:
            memory, before = cable.advance(cable.prepared, memory, before, angle, angle - before, 1.0, 1e-3), angle
            joints.append(cable.look(cable.prepared, memory, angle, 1.0, 1.0).joint)
        half = len(joints) // 2
        return float(np.degrees(np.sqrt(np.mean((np.array(joints) - log.joint)[half:] ** 2))))

    assert error(rig.moved) < 1.05 * np.degrees(fit.chosen.test_rms) < 0.1
    assert error(round_its_cable(rig.bench)) < 1.05 * np.degrees(fit.models["bouc_wen"].test_rms)
    trace = simulate(rig.moved, rig.fitted("bowden"), rig.trajectory, duration=5.0, initial_motor=rig.start_motor)
    assert trace.settings["plant"]["cable"]["kind"] == "generalised_play"
    assert trace["joint"][0] == pytest.approx(rig.begin, abs=1e-9)
