"""Bad input: every name of the face refuses what it cannot take, and says which argument it is and what to do."""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bowden
from bowden.core.bounded import Bounded
from bowden.core.errors import BowdenError, ParameterError
from bowden.identify.log.read import Log
from bowden.live.live_run import live_run
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.identified import IdentifiedCable
from bowden.rig import packing
from bowden.rig.rig import Rig

EXAMPLES = Path(__file__).parents[1] / "examples"
T = np.arange(0.0, 3.0, 0.01)
WAVE = 0.5 * np.sin(T)
NO_TEXT: tuple[Any, ...] = (3, 2.5, object(), ["x"], WAVE)
NO_PATH: tuple[Any, ...] = (3, object(), ["x"], WAVE)
NO_FLAG: tuple[Any, ...] = ("yes", 1, [], object())
NO_NUMBER: tuple[Any, ...] = ("5", object(), [1.0], {}, float("nan"))
NO_WHOLE: tuple[Any, ...] = ("5", 2.5, object(), -1, True)
NO_PART: tuple[Any, ...] = ("5", None, [1.0], {}, int)
NO_RIG: tuple[Any, ...] = (3, None, Rig, {"servo": 1}, WAVE)
NO_LAW: tuple[Any, ...] = (3, Path.exists, int, {"adaptive": 1})
NO_CALL: tuple[Any, ...] = (3, "print")
NO_SAMPLES: tuple[Any, ...] = (3, object(), ["x"], np.zeros((3, 2)))
EMG = 0.004 * np.random.default_rng(1).normal(size=4000)


def trace() -> bowden.Trace:
    values = {"time": T, "reference": WAVE, "joint": 0.99 * WAVE}
    return bowden.Trace(values, {"time": "s", "reference": "rad", "joint": "rad"})


def made(function: Callable[..., Any], *given: Any, **named: Any) -> Callable[..., Any]:
    """A call with all of its arguments right, of which one will be wrong."""

    def call(**wrong: Any) -> Any:
        place = {name: i for i, name in enumerate(list(inspect.signature(function).parameters)[: len(given)])}
        values = list(given)
        for name in [name for name in wrong if name in place]:
            values[place[name]] = wrong.pop(name)
        found = function(*values, **(named | wrong))
        if hasattr(found, "__enter__"):
            with found:
                pass
        return found

    return call


RIG = Rig(duration=1.0)
LOG = Log(T, WAVE, 0.9 * WAVE, "log", ())
LINE = {"slope": 0.9, "offset": 0.0}
MODEL = IdentifiedCable("line", {"line": LINE, "bouc_wen": {**BoucWen()._asdict(), "initial_h": 0.0}})
CALLS: dict[str, tuple[Callable[..., Any], dict[str, tuple[Any, ...]]]] = {
    "campaign": (
        made(bowden.campaign, "study.toml"),
        {
            "study": NO_PATH,
            "out": NO_PATH,
            "rig": NO_RIG[2:],
            "workers": (0, *NO_WHOLE),
            "cluster": NO_TEXT,
            "progress": NO_CALL,
        },
    ),
    "check": (made(bowden.check, RIG), {"rig": NO_RIG, "law": NO_LAW, "preset": NO_TEXT}),
    "identify_servo": (
        made(bowden.identify_servo, "step.csv"),
        {
            "log": NO_PATH,
            "time": NO_TEXT,
            "command": NO_TEXT,
            "motor": NO_TEXT,
            "unit": NO_TEXT,
            "rate": (*NO_NUMBER, 0.0),
            "sample_time_ms": (*NO_NUMBER, 0.0),
            "into": NO_PATH,
            "progress": NO_CALL,
        },
    ),
    "emg_calibrate": (
        made(bowden.emg_calibrate, EMG, rate=1000.0),
        {
            "recording": NO_SAMPLES,
            "rest": NO_SAMPLES,
            "channel": NO_TEXT,
            "rate": (*NO_NUMBER, 0.0),
            "mains": (*NO_NUMBER, 55.0),
            "detector": (*NO_TEXT, "best"),
        },
    ),
    "emg_score": (
        made(bowden.emg_score, EMG, rate=1000.0),
        {
            "recording": NO_SAMPLES,
            "labels": (3, [1.0], [(2.0, 1.0)], [(1.0, 90.0)]),
            "wearer": (3, [1.0]),
            "channel": NO_TEXT,
            "rate": (*NO_NUMBER, 0.0),
            "detector": (*NO_TEXT, "best"),
            "shortest_ms": (*NO_NUMBER, -1.0, 9000.0),
        },
    ),
    "export": (
        made(bowden.export, RIG, "c"),
        {
            "rig": NO_RIG,
            "folder": NO_PATH,
            "law": NO_LAW,
            "preset": NO_TEXT,
            "float32": NO_FLAG,
            "emg_rate": NO_NUMBER,
            "force": NO_FLAG,
        },
    ),
    "identify": (
        made(bowden.identify, T, WAVE, 0.9 * WAVE),
        {
            "motor": (3.0, ["a"], np.zeros((3, 2)), [[1.0], [1.0, 2.0]]),
            "joint": (3.0, ["a"], np.zeros((3, 2))),
            "unit": (3, "grad"),
            "counts_per_turn": ("few", 0, (1.0,) * 3),
            "rate": (*NO_NUMBER, 0.0, 1000.0),
            "name": NO_TEXT,
            "seed": NO_WHOLE,
            "progress": NO_CALL,
        },
    ),
    "identify several": (
        made(bowden.identify, [LOG, LOG]),
        {
            "log": (3, [LOG, 4]),
            "load": (3, [0.1], ["a", "b"], "tension"),
            "bend": (3, [0.1], ["a", "b"], "bent"),
        },
    ),
    "identify a known": (
        made(bowden.identify, LOG, model=MODEL),
        {"log": (3, None, [1.0], [LOG, LOG]), "model": (3,), "load": ("a", [1.0]), "bend": ("a", [1.0])},
    ),
    "init": (
        made(bowden.init, MODEL),
        {
            "model": (3, None, bowden.BoucWen()),
            "law": ("adaptive",),
            "servo": (3, {"damping": "x"}),
            "servos": (3,),
        },
    ),
    "CableModel.read": (made(bowden.CableModel.read, "model.toml"), {"path": NO_PATH}),
    "CableModel.write": (made(MODEL.model().write, "model.toml"), {"path": NO_PATH}),
    "kernel": (made(bowden.kernel, trace), {"function": (3, "step", None, int)}),
    "Law": (
        made(bowden.Law, "mine", bowden.LAWS["adaptive"].gains, trace, trace, "mine"),
        {"name": NO_TEXT, "gains": (3, {"a": 1.0}, (1.0,)), "start_kernel": (3, "f"), "step_kernel": (3, "f")},
    ),
    "Law.with_gains": (bowden.LAWS["adaptive"].with_gains, {"feedback_gain": ("1", None, {}), "nope": (1.0,)}),
    "Law.preset": (made(bowden.LAWS["adaptive"].preset, "paper"), {"name": NO_TEXT[:3]}),
    "MinimumJerk": (bowden.MinimumJerk, {"low": (0.0,)}),
    "MinimumJerk.periodic": (
        made(bowden.MinimumJerk.periodic, 0.0, 1.0, 4.0),
        {"low": (*NO_NUMBER, -70.0), "high": (*NO_NUMBER, 70.0), "period": (*NO_NUMBER, 0.0, -1.0)},
    ),
    "MinimumJerk.point_to_point": (
        made(bowden.MinimumJerk.point_to_point, [0.0, 1.0], [0.0, 1.0]),
        {"times": (3.0, "ab", [0.0, "1"]), "positions": (3.0, "ab", [0.0, 70.0])},
    ),
    "read_log": (
        made(bowden.read_log, "log.csv"),
        {"path": NO_PATH, "time": NO_TEXT[1:], "motor": NO_TEXT[1:], "joint": NO_TEXT[1:], "unit": NO_TEXT}
        | {"counts_per_turn": ("few", 0, (1.0,) * 3), "rate": (*NO_NUMBER, 0.0)},
    ),
    "read_trace": (made(bowden.read_trace, "run.csv"), {"path": NO_PATH}),
    "run": (
        made(bowden.run, RIG),
        {
            "rig": NO_RIG,
            "law": NO_LAW,
            "preset": NO_TEXT,
            "duration": (*NO_NUMBER, -1.0, 1e12),
            "twin": NO_FLAG,
            "channel": NO_TEXT,
            "emg": NO_TEXT,
            "out": NO_PATH,
            "force": NO_FLAG,
        },
    ),
    "simulate": (
        made(bowden.simulate, RIG),
        {
            "rig": NO_RIG,
            "preset": NO_TEXT,
            "duration": (*NO_NUMBER, -1.0, 1e12),
            "seed": (*NO_WHOLE, 2**63),
            "force": NO_FLAG,
        },
    ),
    "tune": (
        made(bowden.tune, RIG),
        {
            "rig": NO_RIG,
            "law": NO_LAW,
            "preset": NO_TEXT,
            "study": NO_PATH,
            "seed": NO_WHOLE,
            "generations": (0, *NO_WHOLE),
            "progress": NO_CALL,
        },
    ),
    "Trace": (
        made(bowden.Trace, {"time": T}, {"time": "s"}),
        {"columns": (3, {}, {"a": "x"}, {"a": T, "b": T[1:]}), "units": (3, {}, {"time": 1}), "seed": ("1", -1, 2.5)},
    ),
    "Trace.array": (made(trace().array, "joint"), {"name": (3, "jiont", None), "unit": (3, "mm")}),
    "Trace.to_pandas": (made(trace().to_pandas), {"unit": (3, "mm", ["rad"])}),
    "Trace.plot": (made(trace().plot), {"axes": (3, "here")}),
    "Trace.write": (made(trace().write, "run.csv"), {"path": (None, "run.txt", *NO_PATH)}),
    "Trace.read": (made(bowden.Trace.read, "run.csv"), {"path": (None, *NO_PATH)}),
    "Trace.bandwidth": (
        made(trace().bandwidth, 0.1, 5.0),
        {"lowest": (*NO_NUMBER, 9.0), "highest": NO_NUMBER, "half_width": (*NO_NUMBER, 0.0)},
    ),
    "Rig": (
        made(Rig),
        {
            "cable": (3, "model.toml", bowden.BoucWen(slope=0.0)),
            "plant": (3, "plant", trace),
            "width": NO_NUMBER,
            "servo": (3, "fast", bowden.Encoder(), bowden.Servo(natural_frequency=-1.0)),
            "joint_encoder": (0.1, bowden.Servo(), bowden.Encoder(resolution=-1.0)),
            "motor": (3, bowden.Motor(inertia=-1.0)),
            "sheath": (3, bowden.Sheath(bend=180.0)),
            "sample_time": (*NO_NUMBER, 1.0),
            "delay": NO_WHOLE,
            "substeps": NO_WHOLE,
            "suit": (True, "worn", {"worm": True}, {"worn": 1}),
            "wearer": ("me", 3),
            "admittance": (True,),
            "law": (3, trace, "adaptiv", None),
            "preset": (3, WAVE),
            "gains": (3, "high", {"nope": 1.0}, {3: 1.0}, {"feedback_gain": "1"}, {"feedback_gain": float("inf")}),
            "reference": (3, "sine", bowden.MinimumJerk.periodic, [0.0, 1.0]),
            "bend": ("straight", 180.0, None),
            "duration": NO_NUMBER,
            "seed": NO_WHOLE,
            "initial_motor": ("0", float("nan"), 1e9),
            "drive": ("can0", 3),
            "limits": (3, {"torque_hihg": 1.0}, {"motor_low": "x"}),
            "live": (3,),
            "emg": ("lsl:x",),
            "origin": NO_TEXT,
            "remarks": ("text", [3], (3,)),
            "original_hash": ("abc",),
            "servos": (3,),
        },
    ),
    "BoucWen": (bowden.BoucWen, {"slope": NO_PART, "slop": (1.0,)}),
    "Encoder": (bowden.Encoder, {"resolution": NO_PART, "resolutoin": (0.1,)}),
    "Motor": (bowden.Motor, {"gear": NO_PART, "gears": (2.0,)}),
    "Servo": (bowden.Servo, {"damping": NO_PART, "dampng": (0.7,)}),
    "Sheath": (bowden.Sheath, {"bend": NO_PART, "bent": (1.0,)}),
    "Rig.read": (made(Rig.read, "rig.toml"), {"path": NO_PATH}),
    "Rig.write": (made(RIG.write, "rig.toml"), {"path": NO_PATH}),
    "Rig.of_tree": (
        made(Rig.of_tree, {}, Path("rig.toml")),
        {"tree": (3, "x"), "origin": NO_PATH, "keep": (3, "x")},
    ),
    "Rig.replace": (RIG.replace, {"delay": NO_WHOLE, "dely": (3,), "original_hash": ("x",)}),
    "Rig.only": (made(RIG.only), {"name": (3,)}),
    "Rig.with_law": (made(RIG.with_law), {"law": (3, "adaptiv", trace), "preset": (3,), "folder": NO_PATH}),
    "Rig.with_gain": (made(RIG.with_gain, "feedback_gain", 30.0), {"name": (3,), "value": NO_NUMBER}),
    "Rig.with_emg": (made(RIG.with_emg, "lsl:x"), {"source": NO_TEXT, "wearer": (3, "wearer.toml")}),
    "Rig.offline": (made(RIG.offline), {"whole": NO_FLAG}),
    "Rig.on_bus": (made(RIG.on_bus, "can0"), {"channel": NO_TEXT, "interface": NO_TEXT}),
    "Rig.fitted": (made(RIG.fitted), {"law": (3, "adaptiv", trace), "known": (3, {})}),
    "Rig.plot": (made(RIG.plot), {"axes": (3, "here")}),
}
"""Name → a call of it that is right but for one argument, and wrong values of that."""


def wrong() -> Iterator[Any]:
    for name, (call, arguments) in CALLS.items():
        for argument, values in arguments.items():
            for i, value in enumerate(values):
                yield pytest.param(call, argument, value, id=f"{name}-{argument}-{i}")


@pytest.mark.parametrize(("call", "argument", "value"), list(wrong()))
def test_a_wrong_argument_is_named_with_what_to_do(
    call: Callable[..., Any], argument: str, value: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BowdenError) as caught:
        call(**{argument: value})
    error = caught.value
    assert argument.split("_")[0].rstrip("s") in str(error), str(error)
    assert error.expected, str(error)
    assert error.do, str(error)
    assert "\n" not in str(error)
    assert "--" not in str(error)
    assert not any(tmp_path.iterdir())


def test_every_function_of_the_face_is_in_that_table() -> None:
    functions = {name for name in bowden.__all__ if inspect.isroutine(getattr(bowden, name))} | {"identify", "export"}
    assert functions <= set(CALLS)
    methods = {
        f"{kind.__name__}.{name}"
        for kind in (Rig, bowden.Trace, bowden.MinimumJerk)
        for name, value in inspect.getmembers(kind, lambda one: inspect.isfunction(one) or inspect.ismethod(one))
        if not name.startswith("_") and set(inspect.signature(value).parameters) - {"self"}
    }
    # below; as to_pandas; of the loop, with its own buses
    assert methods - set(CALLS) == {"Rig.unpack", "Trace.to_polars"}


# what a rig is packed as

DOCUMENT = Rig(gains={"feedback_gain": 1.5}).document()


def changed(**fields: Any) -> dict[str, Any]:
    return DOCUMENT | {"fields": DOCUMENT["fields"] | fields}


FOREIGN: dict[str, Any] = {
    "a number": 3,
    "nothing": None,
    "text": "rig.toml",
    "bytes": b"\x00\xff",
    "a list": b"[1]",
    "an empty one": {},
    "no format": {"servo": {}},
    "a rig of the future": DOCUMENT | {"format": 99},
    **{f"{name} is {value!r}": DOCUMENT | {name: value}
       for name in ("fields", "motors") for value in (3.5, "x", [1], {"a": 1})},
    **{f"{name} is {value!r}": DOCUMENT | {"fields": DOCUMENT["fields"] | {name: value}}
       for name in DOCUMENT["fields"] for value in ("x", [1], {"a": 1})
       if name not in ("origin", "remarks", "preset") and (name, str(value)) != ("drive", "x")},
    "a recording that is none": changed(reference={"said": {}, "time": "", "position": ""}),
    "a law without a source": changed(law={"name": "a.py", "path": "a.py"}),
    "a law that is not there": changed(law="a.py"),
    "a model that is not there": changed(cable={"model": "model.toml"}),
    "a plant of text": changed(plant={"name": "a.py", "path": "a.py", "source": "!", "changed": {}}),
    "own gains of no law": DOCUMENT | {"own_gains": {"nope": 1.0}},
}  # fmt: skip


@pytest.mark.parametrize("given", FOREIGN.values(), ids=FOREIGN.keys())
def test_a_foreign_document_is_refused_in_a_line(given: Any) -> None:
    with pytest.raises(BowdenError) as caught:
        Rig.unpack(given)
    assert "\n" not in str(caught.value)
    assert caught.value.expected


def test_a_rig_that_is_too_large_to_be_handed_on_is_refused_before_a_live_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packing, "MOST_BYTES", 1000)
    with pytest.raises(ParameterError, match=r"the rig has 0 MB.*shorten or thin out its recorded motion"):
        live_run(Rig())


def test_a_rig_stands_for_none_but_its_own() -> None:
    rig = Rig()
    assert "servo" in inspect.signature(Rig).parameters
    assert "original_hash" not in inspect.signature(Rig).parameters
    assert rig.offline().hash == rig.hash


def test_the_package_shows_what_it_offers_and_no_more() -> None:
    assert {name for name in dir(bowden) if not name.startswith("__")} == set(bowden.__all__) - {"__version__"}


def test_a_file_that_could_not_be_opened_can_be_closed(tmp_path: Path) -> None:
    file = Bounded.__new__(Bounded)
    with pytest.raises(OSError, match="No such file"):
        file.__init__(tmp_path / "none")  # type: ignore[misc]
    file.close()
    assert file.closed


def test_what_is_no_flag_is_refused_though_it_equals_one_that_was_given_before() -> None:
    assert Rig(suit={"worn": True}).suit.worn
    with pytest.raises(BowdenError, match="True or False"):
        Rig(suit={"worn": 1})
