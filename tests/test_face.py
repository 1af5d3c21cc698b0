"""What ``import bowden`` offers: quick to import, documented, shown on one screen, and refusals that say what to do."""

import copy
import inspect
import pickle
import re
import subprocess
import sys
import traceback
import warnings
from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import bowden
from bowden.control import LAWS
from bowden.core.errors import BowdenError, ParameterError
from bowden.hardware.ports import TorqueLeft
from bowden.live.ended import Ended, EndedMotor
from bowden.live.figures import RunStop
from bowden.live.log_rig import rig_of_log
from bowden.live.mcap_read import Damage, Recording
from bowden.live.outcome import RunState, outcome, outcome_of
from bowden.live.preflight import REASONS, Reason
from bowden.live.ring import RecorderState
from bowden.operations.support.given import in_turn
from bowden.operations.support.progress import reported
from bowden.safety.faults import Fault
from bowden.safety.state import Mode
from live_runs import SHARED_LIMITS, tries
from support.command import Command

T = np.arange(0.0, 20.0, 0.01)
MOTOR = 0.5 * np.sin(2.0 * T)
JOINT = 0.9 * MOTOR + 0.1
HEAVY = ("numpy", "numba", "scipy", "matplotlib", "pyarrow", "pydantic", "typer")


def fresh(code: str) -> str:
    """What a new process prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_importing_the_package_loads_nothing_heavy_and_little_else() -> None:
    loaded = fresh("import sys; before = set(sys.modules); import bowden; print(*set(sys.modules) - before)").split()
    assert "bowden" in loaded
    assert not {name.split(".")[0] for name in loaded} & set(HEAVY)
    assert len(loaded) < 60


@pytest.mark.parametrize("name", [name for name in bowden.__all__ if name != "__version__"])
def test_every_name_is_there_and_has_a_docstring_with_an_example(name: str) -> None:
    thing = getattr(bowden, name)
    assert name in dir(bowden)
    text = inspect.getdoc(thing if inspect.isroutine(thing) or inspect.isclass(thing) else type(thing))
    text = inspect.getdoc(thing) if name in ("identify", "export") else text
    assert text
    assert ">>>" in text


TRACE = bowden.Trace({"time": T, "joint": JOINT, "reference": MOTOR}, {"time": "s", "joint": "rad", "reference": "rad"})
CABLE = bowden.CableModel("line", {"slope": 0.9, "offset": 0.1})


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        ("bowden.simulat", "bowden has no 'simulat': did you mean simulate?"),
        ("bowden.fit", "bowden has no 'fit': bowden.identify(log)"),
        ("Rig().save", "Rig has no 'save': rig.write(path)"),
        ("TRACE.joint", "Trace has no 'joint': trace['joint'], in its unit; trace.array('joint', 'deg') in degrees"),
        ("TRACE.joint_deg", "Trace has no 'joint_deg': trace.array('joint', 'deg')"),
        ("TRACE.to_frame", "Trace has no 'to_frame': trace.to_pandas() or trace.to_polars()"),
        ("TRACE.metrics().rmse", "Metrics has no 'rmse': did you mean rmse_deg?"),
        ("CABLE.predict", "CableModel has no 'predict': model.joint_angle(motor)"),
        ("Rig().limits.joint_high_deg", "Limits has no 'joint_high_deg': joint_high, in rad"),
        (
            "Rig().limits.joint_max",
            "Limits has no 'joint_max'; it has joint_low, joint_high, joint_speed, joint_still, estimates_joint, "
            f"joint_std and {len(bowden.Rig().limits._fields) - 6} others",
        ),
        ("LAWS['adaptive'].set_gains", "Law has no 'set_gains': law.with_gains(name=value)"),
    ],
)
def test_a_name_that_is_not_there_is_answered_with_the_likely_one(asked: str, answered: str) -> None:
    with pytest.raises(AttributeError) as caught:
        eval(asked, {**globals(), "Rig": bowden.Rig})
    assert str(caught.value) == answered
    assert not hasattr(bowden, "__wrapped__")


def test_what_a_table_of_guesses_names_is_there() -> None:
    """Nobody is sent to the next name that is not there."""
    fit = bowden.identify(T, MOTOR, JOINT)
    objects = {"trace": TRACE, "fit": fit, "model": fit.best, "rig": bowden.Rig(), "law": LAWS["adaptive"]}
    made = bowden.init(fit)
    objects |= {
        "bowden": bowden,
        "numpy": np,
        "log": fit.log,
        "recalibration": bowden.identify(T, MOTOR, JOINT, model=fit).recalibration,
        "made": made,
        "Rig": bowden.Rig,
        "CableModel": bowden.CableModel,
        "check": bowden.check(bowden.Rig()),
    }
    tables = [getattr(type(one), "_guesses", {}) for one in objects.values()] + [bowden._GUESSES]
    for text in {text for table in tables for text in table.values()}:
        for name in re.findall(r"\b(?:\w+\.)+\w+", text):
            first, *rest = name.split(".")
            found = objects[first]
            for word in rest:
                found = getattr(found, word)
    assert sum(map(len, tables)) > 50


def test_a_rig_does_not_change_and_says_how_another_is_made() -> None:
    rig = bowden.Rig()
    with pytest.raises(FrozenInstanceError, match=r"^a Rig does not change: rig\.replace\(duration=5\)$"):
        rig.duration = 5  # type: ignore[misc]
    with pytest.raises(AttributeError, match="Rig has no 'durtion': did you mean duration"):
        rig.durtion = 5  # type: ignore[attr-defined]
    assert pickle.loads(pickle.dumps(rig)) == copy.deepcopy(rig) == rig
    assert pickle.loads(pickle.dumps(bowden.simulate)) is bowden.simulate


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("simulate(Rig(), gains={})", r"simulate has no 'gains': rig\.replace\(gains="),
        ("identify(T, MOTOR, JOINT, units='deg')", "identify has no 'units': unit="),
        ("check()", "check: missing a required argument: 'rig'"),
        ("simulate('no.toml')", "cannot read no.toml"),
        ("Rig.read('no.toml')", "cannot read no.toml"),
        ("Rig(gains={'x': 1.0})", "has no gain 'x'"),
        ("simulate(Rig(duration=2.0), 'adaptive', preset='paper')", "or run it anyway with force=True"),
        ("init('no.toml')", "no.toml cannot be read"),
        ("read_trace('no.csv')", "cannot read no.csv"),
        ("identify('no.csv')", "cannot read no.csv: no such file"),
    ],
)
def test_an_error_is_one_line_without_a_chain(call: str, said: str) -> None:
    with pytest.raises(BowdenError, match=said) as caught:
        eval(f"bowden.{call}", {**globals(), "Rig": bowden.Rig})
    text = "".join(traceback.format_exception(caught.value))
    assert text.count("Traceback (most recent call last)") == 1
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "code",
    [
        "import bowden; f = bowden.identify",
        "import bowden.identify.log.read; import bowden; f = bowden.identify",
        "from bowden import identify as f; import bowden.plants.identified",
        "import bowden.identify.log.read as module; assert module.read_log; import bowden; f = bowden.identify",
    ],
)
def test_identify_is_a_function_and_a_folder_in_whatever_order_they_are_imported(code: str) -> None:
    code += "; import inspect; print(callable(f), f.__name__, *inspect.signature(f).parameters)"
    assert fresh(code).startswith("True bowden.identify log motor joint")


# traces


def example(**columns: np.ndarray) -> bowden.Trace:
    values = {"time": T, "reference": MOTOR, "joint": 0.99 * MOTOR, **columns}
    return bowden.Trace(values, {name: "s" if name == "time" else "rad" for name in values}, {"law": "adaptive"})


def test_arrays_come_by_name_in_the_unit_asked_for() -> None:
    trace = example()
    assert trace["joint"] is trace.columns["joint"]
    assert np.allclose(trace.array("joint", "deg"), np.degrees(0.99 * MOTOR), rtol=1e-15)
    assert trace.array("joint", "rad") is trace["joint"]
    assert np.array_equal(trace.array("time", "ms"), T * 1e3)
    assert "joint" in trace
    assert list(trace) == ["time", "reference", "joint"]
    with pytest.raises(ParameterError, match=r"joint in 'mm'; expected rad or deg"):
        trace.array("joint", "mm")
    with pytest.raises(KeyError, match=r"no column 'jiont'; expected joint \(did you mean this\?\)"):
        _ = trace["jiont"]


def test_a_trace_is_one_screen_of_text_however_many_columns_it_has() -> None:
    columns = {f"law.state_{i}": np.zeros(len(T)) for i in range(200)}
    for trace in (example(), example(**columns), example(joint=np.where(T > 3.0, np.nan, 0.0))):
        lines = repr(trace).splitlines()
        assert len(lines) < 24
        assert max(map(len, lines)) <= 100
    assert "RMSE 0.2" in repr(example())
    assert "ran away 3.01 s after its start" in repr(example(joint=np.where(T > 3.0, np.nan, 0.0)))
    assert "joint is not a number in 100 of 2000" in repr(example(joint=np.where(T < 1.0, np.nan, 0.0)))


def test_a_notebook_gets_the_figures_and_the_picture_and_pyplot_is_left_alone() -> None:
    said = fresh(
        "import numpy as np, sys, bowden; t = np.arange(0, 9, 0.01); c = dict(time=t, reference=t, joint=t); "
        "html = bowden.Trace(c, dict.fromkeys(c, 'rad'))._repr_html_(); "
        "print('<svg' in html, '<table>' in html, 'matplotlib.pyplot' in sys.modules)"
    )
    assert said == "True True False"


def test_a_trace_is_drawn_on_axes_that_are_handed_in_or_made() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    one, two = figure.subplots(2)
    assert example().plot([one, two]) == [one, two]
    assert len(one.lines) == 2
    assert len(two.lines) == 1
    (alone,) = example().plot(Figure().subplots())
    assert alone.get_xlabel() == "time [s]"
    made = example().plot()
    assert len(made) == 2
    with pytest.raises(ParameterError, match=r"axes is a str; expected matplotlib axes"):
        example().plot("here")  # type: ignore[arg-type]


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_a_frame_has_the_columns_and_without_the_library_the_error_says_what_to_do(library: str) -> None:
    make: Callable[..., Any] = getattr(example(), f"to_{library}")
    try:
        __import__(library)
    except ImportError:
        with pytest.raises(ParameterError, match=rf"needs {library}.*pip install {library}"):
            make()
        return
    assert list(make().columns) == ["time", "reference", "joint"]
    assert np.allclose(make("deg")["joint"].to_numpy(), np.degrees(0.99 * MOTOR))


# fits


def test_a_fit_shows_itself_and_its_best_is_a_model() -> None:
    fit = bowden.identify(T, MOTOR, JOINT)
    assert fit.best.name == "line"
    assert repr(fit).startswith("Fit of log: use line, ")
    assert len(repr(fit).splitlines()) < 24
    assert "<svg" in fit._repr_html_()
    assert len(fit.plot()) == 2


def test_a_fit_comes_from_a_trace_a_log_and_a_file_alike(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    np.savetxt(
        path, np.column_stack([T, MOTOR, JOINT]), delimiter=",", header="time_s,motor_rad,joint_rad", comments=""
    )
    parameters = [
        bowden.identify(given).best.parameters["slope"]
        for given in (path, str(path), bowden.read_log(path), example(motor=MOTOR, joint=JOINT))
    ]
    assert np.allclose(parameters, 0.9)
    assert np.allclose(bowden.identify(time=T, motor=MOTOR, joint=JOINT).best.parameters["slope"], 0.9)


# the four tasks


def test_a_rig_is_simulated_with_one_law_or_several(recwarn: pytest.WarningsRecorder) -> None:
    rig = bowden.Rig(duration=6.0)
    trace = bowden.simulate(rig)
    assert trace.settings["law"] == rig.law_name
    assert trace.settings["rig"] == rig.hash
    mine = replace(bowden.LAWS["adaptive"], name="mine")
    several = bowden.simulate(rig, ["adaptive", mine, "adaptive"])
    assert list(several) == ["adaptive", "mine", "adaptive-2"]
    assert np.array_equal(several["adaptive"]["joint"], several["adaptive-2"]["joint"])
    assert not recwarn.list


def test_a_law_that_does_not_hold_is_refused_and_forced_with_a_warning() -> None:
    rig = bowden.Rig(duration=6.0, law="adaptive", gains={"feedback_gain": 2000.0})
    with pytest.raises(ParameterError, match=r"adaptive fails the check on this rig.*force=True"):
        bowden.simulate(rig)
    with pytest.warns(UserWarning, match="fails the check"):
        trace = bowden.simulate(rig, force=True)
    assert trace.metrics().rmse_deg > 10.0
    assert bowden.check(rig).verdict == "does_not_hold"


def test_a_cable_that_runs_backwards_is_turned_round_with_a_warning() -> None:
    cable = bowden.BoucWen(slope=-0.938, hysteresis_gain=0.129)
    refused = pytest.warns(UserWarning, match="bowden run will refuse this rig")
    with refused, pytest.warns(UserWarning, match="counted the other way round"):
        trace = bowden.simulate(bowden.Rig(cable=cable, duration=6.0), "adaptive")
    assert trace.stable
    assert trace.metrics().rmse_deg == bowden.simulate(bowden.Rig(duration=6.0), "adaptive").metrics().rmse_deg


@pytest.mark.usefixtures("small_search")
def test_a_check_and_a_tuning_say_what_the_commands_say() -> None:
    found = bowden.check(bowden.Rig(), "adaptive")
    assert repr(found).startswith("Check of adaptive")
    assert len(repr(found).splitlines()) < 24
    assert "<svg" in found._repr_html_()
    (axes,) = found.plot()
    assert axes.get_xlabel() == "gain margin [dB]"
    tuning = bowden.tune(bowden.Rig(gains={"error_gain": 0.03}), generations=1)
    assert tuning.rig.fitted().gains == tuning.law.gains
    assert tuning.phase_margin_deg is not None
    assert repr(tuning).startswith("Tuning of adaptive")
    assert len(tuning.plot()) == 2
    assert "<svg" in tuning._repr_html_()


def test_a_rig_and_a_law_are_one_screen_each() -> None:
    rig = bowden.Rig(law="bowden", bend=np.pi)
    for text in (str(rig), *(repr(law) for law in bowden.LAWS.values())):
        assert 3 <= len(text.splitlines()) < 30
        assert max(map(len, text.splitlines())) <= 100
    assert str(rig).startswith(f"Rig {rig.hash}")
    assert repr(bowden.Rig()) == "Rig()"
    assert "<svg" in rig._repr_html_()
    assert "<table>" in bowden.LAWS["bowden"]._repr_html_()
    assert [axes.get_ylabel() for axes in rig.plot()] == ["reference [°]", "bend [°]"]


def test_a_fit_goes_into_a_rig_as_it_is() -> None:
    slid = [0.0]
    for motor in MOTOR:  # a play of ±0.05 rad
        slid.append(min(max(slid[-1], motor - 0.05), motor + 0.05))
    fit = bowden.identify(T, MOTOR, 0.9 * np.array(slid[1:]) + 1e-4 * np.random.default_rng(1).normal(size=len(T)))
    assert fit.best.name != "line"
    shown = str(bowden.Rig(cable=fit))
    assert f"identified as {fit.best.name}: slope" in shown, "the model that runs, not the Bouc–Wen one beside it"
    assert " rad/rad, " in shown
    assert " rad/rad, " in repr(fit)
    assert "low 0°, high 70°, period 10 s" in shown
    small = bowden.MinimumJerk.periodic(-0.3, 0.3, period=4.0)  # within what the log covered
    rigs = [bowden.Rig(cable=cable, reference=small, duration=4.0) for cable in (fit, fit.best)]
    runs = [bowden.simulate(rig, "adaptive") for rig in rigs]
    with pytest.warns(UserWarning, match=r"the reference goes from 0 to 65.9°, and the log .* covered -23.2 to 23.2°"):
        bowden.simulate(bowden.Rig(cable=fit, duration=4.0), "adaptive")
    assert runs[0].stable
    assert np.array_equal(runs[0]["joint"], runs[1]["joint"])


def test_a_model_is_written_and_read(tmp_path: Path) -> None:
    fit = bowden.identify(T, MOTOR, JOINT)
    fit.write(tmp_path / "fit.toml")
    model = bowden.CableModel.read(tmp_path / "fit.toml")
    assert model == fit.best
    model.write(tmp_path / "model.toml")
    assert bowden.CableModel.read(tmp_path / "model.toml") == model
    hashes = [bowden.Rig(cable=cable).hash for cable in (fit, fit.best, model)]
    assert len({*hashes}) == 1
    with pytest.raises(ParameterError, match=r"Fit.write: path is 3; expected the path of a file"):
        fit.write(3)  # type: ignore[arg-type]
    trace = example(motor=MOTOR, joint=JOINT)
    found = bowden.identify(trace, model=model)
    assert found.recalibration is not None
    assert found.recalibration.gain == pytest.approx(1.0)
    assert "nan" not in repr(found)


def test_a_rig_of_a_cable_that_runs_backwards_is_the_one_that_init_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    monkeypatch.chdir(tmp_path)
    fit = bowden.identify(T, 1.0 - MOTOR, JOINT)
    fit.write("model.toml")
    printed = command("init --model model.toml").out
    made = bowden.init(fit)
    assert made.rig.hash == bowden.init(fit.best).rig.hash == bowden.init("model.toml").rig.hash
    assert made.rig.hash == bowden.Rig.read("rig.toml").hash
    assert all(note in printed for note in made.notes)
    assert made.rig.cable.counting.direction == -1  # type: ignore[union-attr]
    assert made.rig.reference.high < 0.9 * np.ptp(JOINT)  # type: ignore[attr-defined]
    assert "against the log's direction" in repr(made)
    slow = bowden.init(fit, servo={"natural_frequency": 12.0})
    assert slow.rig.servo.natural_frequency == 12.0
    for wrong, said in (({"law": "adaptive"}, r"law is chosen here"), ({"servos": 1}, r"a rig has no 'servos'")):
        with pytest.raises(ParameterError, match=said):
            bowden.init(fit, **wrong)
    with pytest.raises(ParameterError, match=r"init: model is 3; expected a model.toml"):
        bowden.init(3)  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.live
def test_a_run_on_a_twin_is_a_context_and_leaves_a_trace(tmp_path: Path) -> None:
    rig = bowden.Rig(
        reference=bowden.MinimumJerk.periodic(0.0, 0.8, 4.0),
        duration=4.0,
        limits=bowden.Rig().limits._replace(**SHARED_LIMITS),
    )
    for _ in tries():  # a computer shared with others stalls, and the supervisor ends the run
        with warnings.catch_warnings(record=True) as said, bowden.run(rig, twin=True, out=tmp_path) as session:
            warnings.simplefilter("always")
            done = session.complete()
            channel = session.channel
        assert done or session.outcome != "ended as asked"
        if not said:
            break
        assert str(said[-1].message) == session.outcome
        assert session.outcome.startswith("the run was ended: ")
    assert done
    assert session.outcome == "ended as asked"
    assert "bowden-twin-" in channel
    trace = session.trace()
    assert session.log.parent == tmp_path
    assert np.nanmax(trace.array("joint", "deg")) > 40.0
    assert np.array_equal(bowden.read_trace(session.log)["joint"], trace["joint"], equal_nan=True)
    assert "Run of adaptive" in repr(session)
    assert rig_of_log(session.log).drive == rig.drive  # not the bus of a twin that is no more


def end(*, ran: bool = True, **of_motor: Any) -> Ended:
    """Of a loop with one motor; as asked where nothing else is given."""
    as_asked = EndedMotor(Mode.STOPPED, 0, TorqueLeft.OFF, Reason.NONE)
    return Ended(9, 0, 0.0, 0.0, ran, (as_asked._replace(**of_motor),))


FROZEN = (
    "joint angle does not change; look at the joint encoder, its coupling and the cable; "
    "as a consequence: joint and motor disagree"
)


@pytest.mark.parametrize(
    ("ended", "error", "mode", "came", "said"),
    [
        (None, "", None, [], "not begun"),
        (None, "", Mode.RUNNING, [], "the run goes on, under its law"),
        (None, "", Mode.RUNNING, [Fault.JOINT_FROZEN], "the run goes on, under its law"),
        (None, "", Mode.LATCHED, [Fault.JOINT_FROZEN, Fault.JOINT_MOTOR_MISMATCH], f"stopped by a fault: {FROZEN}"),
        (end(), "", Mode.STOPPED, [], "ended as asked"),
        (end(ran=False), "", Mode.STOPPED, [], "ended as asked, before it ran"),
        (
            *(end(faults=1 << Fault.RECORDER_LOST, ran=False), "", Mode.STOPPED, [Fault.RECORDER_LOST]),
            "the run was ended: nothing is recorded; its log was removed, replaced or moved",
        ),
        (
            *(end(mode=Mode.LATCHED), "", Mode.LATCHED, [Fault.JOINT_FROZEN, Fault.JOINT_MOTOR_MISMATCH]),
            f"ended: {FROZEN}",
        ),
        (end(torque=TorqueLeft.UNKNOWN), "", Mode.STOPPED, [], "assume it is on, press the emergency stop"),
        (
            *(end(reason=Reason.RESTLESS), "it died", Mode.STOPPED, []),
            f"the run was ended: {REASONS[Reason.RESTLESS]}; it died",
        ),
    ],
)
def test_how_a_run_ended_is_said(ended: Any, error: str, mode: Any, came: list[Fault], said: str) -> None:
    axis: Any = SimpleNamespace(name="", came={fault: float(i) for i, fault in enumerate(came)})
    assert said in outcome(RunState(ended, error, mode, (axis,), 0.5, on_twin=False, recorder=RecorderState.FILE_GONE))


@pytest.mark.parametrize(
    ("modes", "fault", "stops", "said"),
    [
        ((0, 1, 2, 4, 0), None, 0, "ended as asked"),
        ((0, 2, 4, 5, 0, 2, 4, 0), None, 1, "ended as asked, after 1 stop by a fault"),
        ((0, 1, 4, 0), None, 0, "ended as asked, before it ran"),
        ((0, 1, 4, 0), Fault.RECORDER_LOST, 0, "ended before it ran: nothing is recorded; the disk takes nothing"),
        ((0, 2, 4, 5), Fault.JOINT_FROZEN, 1, "ended by a fault at 3.000 s: joint angle does not change"),
        ((5, 5), Fault.JOINT_FROZEN, 0, "ended by a fault: joint angle does not change; look at the joint encoder"),
        ((0, 2), None, 0, "not known: the log ends in the mode running"),
        ((), None, 0, "not known"),
    ],
)
def test_a_log_says_how_its_run_ended(modes: tuple[int, ...], fault: Fault | None, stops: int, said: str) -> None:
    bits = 0.0 if fault is None else float(1 << fault)
    rows = np.array([(mode, bits, float(RecorderState.FULL)) for mode in modes]).reshape(len(modes), 3)
    columns = ("mode", "faults", "recorder")
    log = Recording({}, None, columns, ("1",) * 3, np.arange(len(modes)), rows, [], Damage(0, 0, 0))
    stop = RunStop(3.0, (fault.meaning if fault else "",), (), (), None)
    assert outcome_of(log, [stop] * stops, twin=False).startswith(said)


# errors

WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "simulate of a log": (lambda: bowden.simulate("log.csv"), r"log\.csv is a log, not a rig; .*: bowden identify log"),
    "identify of nothing": (lambda: bowden.identify(), r"identify: log is missing; expected files, or three"),
    "identify of two": (lambda: bowden.identify(T, MOTOR), r"identify: joint is missing"),
    "other lengths": (lambda: bowden.identify(T, MOTOR[1:], JOINT), r"time has 2000 samples, motor has 1999"),
    "NaN": (lambda: bowden.identify(T, np.where(T == 5.0, np.nan, MOTOR), JOINT), r"sample 501: motor is nan"),
    "degrees": (
        lambda: bowden.identify(T, 57.3 * MOTOR, 57.3 * JOINT),
        r"look like degrees, or a length; give the unit deg",
    ),
    "factor 57.3": (lambda: bowden.identify(T, 0.7 * MOTOR, 35.0 * MOTOR), r"looks like degrees beside radians"),
    "its other side": (lambda: bowden.identify(T, 20.0 * MOTOR, 0.35 * MOTOR), r"the motor moves 57.1 times as far"),
    "time twice": (lambda: bowden.identify(T, MOTOR, JOINT, time=T), r"time is given twice"),
    "a file and arrays": (lambda: bowden.identify("log.csv", MOTOR, JOINT), r"motor of the log log.csv is an array"),
    "70 rad": (lambda: bowden.MinimumJerk.periodic(0.0, 70.0, 4.0), r"high is 70 rad.*looks like degrees"),
    "degrees on the way": (lambda: bowden.MinimumJerk.point_to_point([0, 1], [0, 70]), r"positions\[1\] is 70 rad"),
    "the class of rigs": (lambda: bowden.simulate(bowden.Rig), r"rig is the class Rig.*make one of it: Rig\(\)"),  # type: ignore[call-overload]
    "degrees in a rig": (lambda: bowden.Rig(initial_motor=70.0), r"initial_motor is 70.*looks like degrees"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_argument_is_refused_with_its_name_and_what_to_do(what: str) -> None:
    call, said = WRONG[what]
    with pytest.raises(BowdenError, match=said):
        call()


def test_several_traces_are_a_dictionary_that_shows_itself() -> None:
    traces = bowden.simulate(bowden.Rig(duration=5.0), ["uncompensated", "adaptive"])
    assert isinstance(traces, dict)
    lines = repr(traces).splitlines()
    assert lines[0] == "2 traces"
    assert [line.split()[0] for line in lines[1:]] == ["uncompensated", "adaptive"]
    html = traces._repr_html_()
    assert html == traces._repr_html_(), "kept outputs of a notebook do not change by themselves"
    assert html.count("<tr>") == 3
    assert "<svg" in html
    above, below = traces.plot()
    assert [line.get_label() for line in above.lines] == ["uncompensated", "adaptive", "reference"]
    assert len(below.lines) == 2


def test_parts_of_a_rig_may_be_given_by_their_fields() -> None:
    rig = bowden.Rig(suit={"worn": True, "drive_integral": 40.0}, wearer={"mass": 60.0})  # type: ignore[arg-type]
    assert rig.suit == bowden.Rig().suit._replace(worn=True, drive_integral=40.0)
    assert rig.hash == bowden.Rig(suit=rig.suit, wearer=rig.wearer).hash
    with pytest.raises(ParameterError, match=r"suit has no 'wron'; expected worn \(did you mean this\?\)"):
        bowden.Rig(suit={"wron": True})  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match=r"Rig: wearer.mass is -1"):
        bowden.Rig(wearer={"mass": -1.0})  # type: ignore[arg-type]
    servo = bowden.Rig(servo={"damping": 0.8}).servo  # type: ignore[arg-type]
    assert servo == bowden.Rig().servo._replace(damping=0.8)
    with pytest.raises(ParameterError, match=r"Rig: servo is"):
        bowden.Rig(servo=[0.8])  # type: ignore[arg-type]


def recorded_emg() -> np.ndarray:
    """Eight seconds at 1 kHz [mV]: rest, and a contraction from 3 to 5 s."""
    size = np.interp(np.arange(8000) / 1000.0, [0.0, 3.0, 3.1, 4.9, 5.0], [0.004, 0.004, 0.1, 0.1, 0.004])
    return size * np.random.default_rng(1).normal(size=8000)


def test_emg_goes_from_a_recording_to_a_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    emg = recorded_emg()
    rows = np.column_stack([10.0 + np.arange(8000) / 1000.0, emg])
    np.savetxt("biceps.csv", rows, delimiter=",", header="time_s,biceps_mV", comments="")
    Path("labels.csv").write_text("onset_s,offset_s\n13.0,15.0\n")
    found = bowden.emg_score("biceps.csv", labels="labels.csv")
    assert found.score.misses == found.score.false_activations == 0
    assert 13.0 < found.spans[0][0] < 13.3, "in the recording's time"
    of_arrays = bowden.emg_score(emg, rate=1000.0, labels=[(3.0, 5.0)])
    assert of_arrays.score.latency_median_s == pytest.approx(found.score.latency_median_s, abs=0.01)
    assert "1 found, 0 missed, 0 false" in repr(found)
    assert "<svg" in found._repr_html_()
    assert len(found.plot()) == 3

    wearer = bowden.emg_calibrate("biceps.csv")
    rest = bowden.emg_calibrate("biceps.csv", emg[:2900], rate=1000.0)
    assert 0.5 < rest.rest / wearer.rest < 2.0
    assert rest.mvc == wearer.mvc > 10.0 * wearer.rest
    wearer.write("wearer.toml")
    rig = bowden.Rig(emg={"high": 0.8, "duration": 1.0}).with_emg("file:biceps.csv", wearer)  # type: ignore[arg-type]
    assert rig.emg.levels == wearer
    trace = bowden.simulate(rig, "adaptive")
    assert trace["reference"].max() == pytest.approx(0.8)
    assert trace.metrics().rmse_deg < 1.0


def test_several_logs_and_a_recalibration_show_themselves() -> None:
    units = {"time": "s", "motor": "rad", "joint": "rad"}
    logs = [bowden.Trace({"time": T, "motor": MOTOR, "joint": 0.9 * MOTOR - 0.5 * load}, units) for load in (0.0, 0.2)]
    together = bowden.identify(logs, load=[0.0, 0.2])
    found = bowden.identify(logs[0], model=together, load=0.0)
    for one in (together, found):
        assert "<svg" in one._repr_html_()
        assert len(one.plot()) == 1


WRONG_EMG: dict[str, tuple[Callable[[], Any], str]] = {
    "labels of another": (
        lambda: bowden.emg_score(recorded_emg(), rate=1e3, labels=[(3.0, 50.0)]),
        r"labels from 3 to 50 s, and the recording lasts from 0 to 8 s",
    ),
    "rest alone": (lambda: bowden.emg_calibrate(recorded_emg()[:2900], rate=1e3), r"the recording: no contraction"),
}


@pytest.mark.parametrize("what", WRONG_EMG)
def test_emg_that_cannot_be_used_is_refused(what: str) -> None:
    call, said = WRONG_EMG[what]
    with pytest.raises(BowdenError, match=said):
        call()


def test_a_line_of_progress_ends_where_the_call_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)

    def failing() -> None:
        with reported(True, "tune") as report:
            report("a step", 0.5)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        failing()
    assert capsys.readouterr().err.endswith("a step\n")


def test_laws_run_in_turn_until_an_interruption() -> None:
    laws = [LAWS["adaptive"], LAWS["observer"], LAWS["adaptive"]]
    said: list[tuple[str, float]] = []

    def run(i: int) -> int:
        if i == 2:
            raise KeyboardInterrupt
        return 10 * i

    assert in_turn(laws, run, lambda what, share: said.append((what, share))) == ({"adaptive": 0, "observer": 10}, True)
    assert [what for what, _ in said] == [f"simulating {name}" for name in ("adaptive", "observer", "adaptive-2")]
    with pytest.raises(KeyboardInterrupt):
        in_turn(laws[2:] * 3, lambda i: run(2), lambda what, share: None)
    assert in_turn(laws[:2], run, lambda what, share: None) == ({"adaptive": 0, "observer": 10}, False)


def test_a_run_without_with_says_so() -> None:
    with pytest.raises(AttributeError, match=r"nothing runs yet: with bowden\.run"):
        bowden.run(bowden.Rig(), twin=True).complete()
