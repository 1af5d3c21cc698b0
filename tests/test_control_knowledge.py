"""What a rig tells a law: one rule, by which every command that runs a law goes."""

import contextlib
import dataclasses
import importlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command

from bowden.app import main
from bowden.control import LAWS, Law
from bowden.control.knowledge import Knowledge, configured, informed
from bowden.control.law_parts import contact_bandwidth, half_width, lag
from bowden.core.errors import BowdenError, ParameterError, UnknownNameError
from bowden.core.signals import Reference, Sample
from bowden.export import modules as exported
from bowden.live.live_run import live_run
from bowden.live.log_rig import law_of
from bowden.live.mcap_read import Recording
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.drive.encoder import Encoder
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import default_bench
from bowden.plants.presets.paper import minimum_jerk
from bowden.plants.presets.suit import suit
from bowden.plants.transmission import transmission
from bowden.rig.rig import Rig
from bowden.sim.run import simulate
from bowden.study.load import load

BENCH = default_bench()
COMMANDS = get_command(main.application())
MODEL = """
best = "bouc_wen"
[models.bouc_wen.parameters]
slope = 0.8
hysteresis_gain = -0.11
rate = 10.0
shape = 9.0
exponent = 2.5
offset = 0.02
initial_h = 0.0
"""
SERVOS, DAMPINGS, DELAYS, CLOCKS = (3.0, 4.0, 8.5, 15.0), (0.5, 1.0), (1, 3), (1.0, 2.0)
CABLES = ("slope = 0.6\n", "slope = 0.94\n", "slope = 1.2\noffset_deg = 3.0\n", 'model = "model.toml"\n')


def rigs() -> Iterator[tuple[float, float, int, float, str]]:
    """Four rigs, with every two of dampings, delays and clocks."""
    for i, (servo, cable) in enumerate(zip(SERVOS, CABLES, strict=True)):
        yield servo, DAMPINGS[i % 2], DELAYS[i // 2], CLOCKS[(i + i // 2) % 2], cable


class Caught(Exception):
    """Ends a command where it hands its law on."""


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Law]]:
    """Command → the laws that it handed to what works with them."""
    for module in ("study.tune_law", "design.advice", "design.joint_check"):  # so that none keeps what is put in place
        importlib.import_module(f"bowden.{module}")
    found: dict[str, list[Law]] = {}

    def catching(command: str, of: Any) -> Any:
        def caught(*given: Any, **_: Any) -> Any:
            found[command] = of(*given)
            raise Caught

        return caught

    monkeypatch.setattr(
        "bowden.design.verdict.verdicts", catching("simulate", lambda joint, laws, *_: [own for (own,) in laws])
    )
    monkeypatch.setattr("bowden.design.check.check", catching("check", lambda bench, law: [law]))
    monkeypatch.setattr("bowden.study.tune_law.search", catching("tune", lambda bench, law: [law]))
    monkeypatch.setattr(exported, "law_module", catching("export", lambda law, *_: [law]))
    monkeypatch.setattr("bowden.study.tune_law.two_workers", lambda *_, **__: contextlib.nullcontext(map))
    return found


def written(tmp_path: Path, servo: float, damping: float, delay: int, clock: float, cable: str, law: str) -> Path:
    (tmp_path / "model.toml").write_text(MODEL)
    path = tmp_path / "rig.toml"
    path.write_text(
        f"[bench]\nsample_time_ms = {clock}\ndelay_cycles = {delay}\n"
        f"[servo]\nnatural_frequency_hz = {servo}\ndamping = {damping}\n[cable]\n{cable}[control]\nlaw = '{law}'\n"
    )
    return path


def recorded(rig: dict[str, Any]) -> Recording:
    """A log of another law, as far as a replay looks at it for its law."""
    recording: Recording = object.__new__(Recording)
    object.__setattr__(recording, "settings", {"law": "other", "rig": rig})
    return recording


@pytest.mark.parametrize("rig", list(rigs()), ids=lambda rig: " ".join(str(part).strip() for part in rig))
def test_every_command_gives_every_law_the_same_gains(
    rig: tuple[float, float, int, float, str],
    tmp_path: Path,
    handed: dict[str, list[Law]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in LAWS:
        path = written(tmp_path, *rig, law=name)
        for command in (["simulate"], ["check"], ["tune", "--dry-run"], ["export", "--to", "out"]):
            with pytest.raises(Caught):
                COMMANDS([command[0], str(path), *command[1:]], standalone_mode=False)
        rig_of = Rig.read(path)
        handed["run"] = [live_run(Rig.unpack(rig_of.pack())).law]
        (tmp_path / "study.toml").write_text(f'rig = "rig.toml"\nlaws = ["{name}"]\nruns = 4\n')
        study = load(tmp_path / "study.toml")
        handed["campaign"] = [*study.nominal, *study.run(3)[1]]
        handed["replay"] = [law_of(recorded(rig_of.document()), name)[0]]
        gains = {command: [law.gains for law in laws] for command, laws in handed.items()}
        assert set(gains) == {"simulate", "check", "tune", "export", "run", "campaign", "replay"}
        expected = configured(LAWS[name], rig_of.knowledge).gains
        assert gains == {command: [expected] * len(found) for command, found in gains.items()}, name


def test_an_observer_is_as_quick_as_servo_delay_and_noise_let_it() -> None:
    """q is 3.55·ω, 1.5/τ, or lets 0.1° of the encoders' noise into the command, σ·(q/ω)²·√(q·Ts): the least of them."""
    slow, late = Knowledge(servo_frequency=10.0, delay=1e-3), Knowledge(servo_frequency=1e3, delay=0.05)
    assert contact_bandwidth(slow) / 10.0 == contact_bandwidth(slow._replace(delay=0.0)) / 10.0 == 190.0 / 53.58
    assert contact_bandwidth(late) * 0.05 == 1.5
    noisy = Knowledge(60.0, 1.0, 1.5e-3, 1e-3, joint_step=0.01, joint_noise=0.02, motor_step=0.03, motor_noise=0.04)
    q, noise = contact_bandwidth(noisy), math.hypot(0.02, 0.04, 0.01 / math.sqrt(12.0), 0.03 / math.sqrt(12.0))
    assert noise * (q / 60.0) ** 2 * math.sqrt(q * 1e-3) == pytest.approx(math.radians(0.1))
    for unknown in (noisy._replace(servo_frequency=math.nan), noisy._replace(delay=math.nan)):
        assert math.isnan(contact_bandwidth(unknown))


def test_what_a_bench_knows() -> None:
    bench = BENCH._replace(delay=3, sample_time=2e-3, joint_encoder=Encoder(0.01, 0.02), motor_encoder=Encoder(0.03))
    bench = bench._replace(cable=BoucWen(slope=0.5, offset=0.1), sheath=bench.sheath._replace(gap=0.5))
    known = knowledge_of(bench)
    assert known.servo_frequency == BENCH.servo.natural_frequency
    assert known.servo_damping == BENCH.servo.damping
    assert known.delay == 3.5 * 2e-3, "three cycles, and half of the one for which the command is held"
    assert (known.sample_time, known.cable, known.motor_zero) == (2e-3, bench.cable, -0.2)
    assert (known.joint_step, known.joint_noise, known.motor_step, known.motor_noise) == (0.01, 0.02, 0.03, 0.0)
    assert math.isnan(known.slope)
    assert math.isnan(known.width)
    assert known.doubt == 1.0
    identified = knowledge_of(bench, identified=True)
    assert (identified.slope, identified.doubt) == (0.5, 0.1)
    assert identified.width == pytest.approx(transmission(bench, bench.sheath.bend, (0.0, 1.2)).dead_zone / 0.5), (
        "at the joint and the motor"
    )


def test_of_a_plant_round_any_other_cable_nothing_is_known_of_the_cable() -> None:
    bench, plant = knowledge_of(BENCH), knowledge_of(BENCH._replace(cable=BENCH.simulated_cable))
    assert plant._replace(cable=bench.cable, motor_zero=bench.motor_zero).__repr__() == bench.__repr__()
    assert np.isnan(plant.cable).all()
    assert math.isnan(plant.motor_zero)
    for name in ("observer", "uncompensated", "adaptive"):
        assert informed(LAWS[name], plant) == LAWS[name]


def test_on_a_suit_a_law_begins_with_its_preset_and_is_told_the_rest() -> None:
    worn = suit()
    faster = worn._replace(motor=worn.motor._replace(servo=worn.motor.servo._replace(natural_frequency=80.0)))
    law = configured(LAWS["bowden"], knowledge_of(faster))
    preset = LAWS["bowden"].presets["suit"]
    assert law.gains == preset._replace(servo_frequency=80.0, servo_damping=faster.motor.servo.damping)
    assert configured(LAWS["adaptive"], knowledge_of(worn)).gains == LAWS["adaptive"].presets["suit"]
    assert configured(LAWS["adaptive"], knowledge_of(worn), preset="paper").gains == LAWS["adaptive"].presets["paper"]
    own = configured(LAWS["adaptive"], knowledge_of(worn), gains={"feedback_gain": 2.0}).gains
    assert own == LAWS["adaptive"].gains._replace(feedback_gain=2.0)


def test_the_order_is_own_told_preset_and_the_rigs_own() -> None:
    known = Knowledge(servo_frequency=20.0, servo_damping=0.7, delay=0.004, slope=0.8, width=0.05, doubt=0.1)
    law = dataclasses.replace(
        LAWS["bowden"], suit_preset=None, presets={"mine": LAWS["bowden"].gains._replace(delay=0.002, lag=0.01)}
    )
    told = configured(law, known)
    assert told.gains == law.gains._replace(
        servo_frequency=20.0, servo_damping=0.7, delay=0.004, slope=0.8, width=pytest.approx(0.8 * 0.05)
    ), "of the width its lower end"
    preset = configured(law, known, preset="mine")
    assert preset.gains == told.gains._replace(delay=0.002, lag=0.01)
    own = configured(law, known, preset="mine", gains={"delay": 0.003, "slope": 1.1})
    assert own.gains == preset.gains._replace(delay=0.003, slope=1.1)
    assert informed(own, known) == own, "telling again changes nothing"
    later = informed(own, known._replace(servo_frequency=30.0))
    assert later.gains == own.gains._replace(servo_frequency=30.0), "another rig is told in place of the first"
    assert informed(later, Knowledge()).gains == law.preset("mine").with_gains(delay=0.003, slope=1.1).gains, "nothing"
    assert informed(law.with_gains(servo_frequency=9.0), known).gains.servo_frequency == 9.0


def test_what_was_chosen_reaches_another_process() -> None:
    """Also a value that is the law's own, which a rig would tell otherwise; what another rig told does not count."""
    told = Rig(servo=BENCH.servo._replace(natural_frequency=20.0), law="bowden").fitted()
    for law in (LAWS["bowden"].with_gains(servo_frequency=LAWS["bowden"].gains.servo_frequency, bandwidth=3.0), told):
        rig = Rig(law=law, servo=BENCH.servo._replace(natural_frequency=30.0))
        assert Rig.unpack(rig.pack()).fitted().gains == rig.fitted().gains
        chosen = "servo_frequency" in law.overridden_gains
        assert rig.fitted().gains.servo_frequency == (LAWS["bowden"].gains.servo_frequency if chosen else 30.0)


def test_a_preset_takes_the_place_of_another() -> None:
    law = LAWS["adaptive"]
    assert law.preset("suit").preset("paper").gains == law.presets["paper"]
    assert law.with_gains(feedback_gain=3.0).preset("paper").gains == law.presets["paper"]


def test_what_is_told_stays_inside_the_gains_limits() -> None:
    known = Knowledge(servo_frequency=0.1, servo_damping=99.0, delay=3.0)
    gains = informed(LAWS["bowden"], known).gains
    assert (gains.servo_frequency, gains.servo_damping, gains.delay) == (1.0, 10.0, 0.1)


def test_parts_of_what_is_known_tell_only_what_they_suffice_for() -> None:
    known = Knowledge(servo_frequency=20.0, delay=0.004)
    assert informed(LAWS["offset_inverse"], known) == LAWS["offset_inverse"], "its lead takes the damping too"
    gains = informed(LAWS["bowden"], known).gains
    assert gains == LAWS["bowden"].gains._replace(servo_frequency=20.0, delay=0.004)
    assert math.isnan(lag(known))
    assert half_width(Knowledge(width=0.2)) == 0.1


def test_what_a_rig_knows_of_servo_delay_cable_and_encoders_is_no_choice() -> None:
    """A gain that goes the whole way with a fact of the rig is told it, whichever law it belongs to."""
    facts = {"slope", "width", "delay", "noise", "damping", "natural_frequency", "lead", "lead_square", "half_width"}
    facts |= {"servo_frequency", "servo_damping", "motor_zero", "arrival", *BoucWen._fields}
    for name, law in LAWS.items():
        assert not facts & set(law.choices), name
        assert set(law.choices) or name == "uncompensated"
    assert LAWS["bowden"].choices == ["lag", "bandwidth"]
    assert LAWS["bowden"].with_gains(lag=0.1).choices == ["lag", "bandwidth"]


def test_a_law_that_does_not_say_has_what_no_rig_tells_as_a_choice() -> None:
    law = LAWS["cascaded_pid"]
    undeclared = dataclasses.replace(law, tunable=None)
    assert set(undeclared.choices) == set(law.gains._fields) - set(law.from_rig)
    assert dataclasses.replace(LAWS["observer"], tunable=frozenset()).choices == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"from_rig": {"slop": "slope"}},
            "from_rig of law 'uncompensated' names 'slop'; expected slope (did you mean this?)",
        ),
        ({"feeds_back": frozenset({"current"})}, "feeds_back of law 'uncompensated' names 'current'"),
        ({"tunable": frozenset({"slopes"})}, "tunable of law 'uncompensated' names 'slopes'"),
        ({"tunable": "slope"}, "tunable of law 'uncompensated' is 'slope'"),
        ({"suit_preset": "suit"}, "suit_preset of law 'uncompensated' names 'suit'"),
    ],
)
def test_a_law_cannot_declare_what_is_not_there(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError) as caught:
        dataclasses.replace(LAWS["uncompensated"], **changes)
    assert said in str(caught.value)


@pytest.mark.parametrize("what", ["servo_freqency", "cable.slop", "cable"])
def test_a_law_cannot_be_told_what_no_rig_knows(what: str) -> None:
    law = dataclasses.replace(LAWS["uncompensated"], from_rig={"slope": what})
    with pytest.raises(
        ParameterError, match=f"gain slope of law 'uncompensated' takes '{what}' from the rig; expected "
    ):
        informed(law, Knowledge())


@pytest.mark.parametrize("name", LAWS)
def test_a_law_feeds_back_the_angles_that_it_declares(name: str) -> None:
    """The command is another where one of the two angles moves otherwise, and only where it is declared so."""
    law = LAWS[name]

    def commands(joint: float, motor: float) -> list[float]:
        state, found = law.start(Sample(0.0, 0.0)), []
        for k in range(600):
            reference = Reference(0.3 + 0.3 * math.sin(0.01 * k), 3.0 * math.cos(0.01 * k), -30.0 * math.sin(0.01 * k))
            way = 0.2 * math.sin(0.013 * k)
            state, command = law.step(state, Sample(joint * way, motor * way), reference, 1e-3)
            found.append(command)
        return found

    usual = commands(1.0, 1.0)
    assert (commands(0.9, 1.0) != usual) == ("joint" in law.feeds_back)
    assert (commands(1.0, 0.9) != usual) == ("motor" in law.feeds_back)


@pytest.mark.parametrize("name", LAWS)
def test_only_a_law_that_makes_up_for_the_lag_follows_without_one(name: str) -> None:
    trace = simulate(BENCH, informed(LAWS[name], knowledge_of(BENCH)), minimum_jerk(), duration=20.0, seed=1)
    late = trace.metrics().delay_s
    assert late is not None
    assert (late < 0.005) == LAWS[name].compensates_lag, late


def test_a_file_of_the_folder_is_a_law_of_its_name() -> None:
    folder = Path(str(LAWS["adaptive"].step_kernel.__code__.co_filename)).parent
    assert sorted(LAWS) == sorted(file.stem for file in folder.glob("*.py") if file.stem != "__init__")
    assert all(name == law.name for name, law in LAWS.items())
    assert len(LAWS) == len(list(LAWS))
    assert "bowden" in repr(LAWS)


def test_a_law_that_is_not_there_is_a_key_error_with_the_likely_name() -> None:
    with pytest.raises(UnknownNameError, match=r"there is no law 'adaptiv'; expected adaptive \(did you mean this\?\)"):
        LAWS["adaptiv"]
    for kind in (KeyError, ParameterError, BowdenError):
        with pytest.raises(kind):
            LAWS["adaptiv"]
    assert LAWS.get("adaptiv") is None
    assert "adaptiv" not in LAWS
