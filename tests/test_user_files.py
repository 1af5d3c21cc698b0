"""Files of a user's own: what goes wrong in them late is named with file and line; what they import belongs to them."""

import importlib
import json
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS, user_law
from bowden.control.law_file import LawFile, load
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core import own_file, user_file
from bowden.core.errors import OutputError, ParameterError, StreamError
from bowden.design.rig_of_bench import toml_text
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.plant_file import PlantFile
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.rig.settings import EmgSettings
from bowden.sim.joint import CabledJoint, JointMotor, simulate_joint
from bowden.sim.many import simulate_many
from bowden.sim.run import Case, simulate

EXAMPLES = Path(__file__).parents[1] / "examples"
LAW, PLANT = ((EXAMPLES / name).read_text() for name in ("my_law.py", "my_plant.py"))
LAW_ENDS, PLANT_ENDS = "    return State(integral), command\n", "    return Body(given.slope * end, motor, speed)\n"
MOTION = PeriodicMinimumJerk(0.0, 1.0, 1.0)
LATE_LAW, LATE_PLANT = "    if reference.position > 0.5:\n        ", "    if motor > 0.5:\n        "
OBSERVE = """
import math

@kernel
def observe(plant: Any, body: Body, normals: Any) -> Any:
    return body, Measurement(body.joint if body.motor < 0.5 else math.nan, body.motor, math.nan, math.nan)
"""


def run_law(path: Path) -> None:
    law = load(str(path))
    with user_law.explained(law):
        simulate(default_bench(), law, MOTION, duration=0.5)


def run_plant(path: Path) -> None:
    simulate(PlantFile.found(str(path)).load(), LAWS["uncompensated"], MOTION, duration=0.5)


def late_law(text: str) -> str:
    return LAW.replace(LAW_ENDS, text + LAW_ENDS)


def late_plant(text: str) -> str:
    return PLANT.replace(PLANT_ENDS, text + PLANT_ENDS)


NO_NUMBER = "0.0 / (dt - dt)"
LATE: dict[str, tuple[Callable[[Path], None], str, str, str]] = {
    "a law raises": (run_law, late_law(f"{LATE_LAW}raise ValueError('too far')\n"), "raise ", "ValueError: too far"),
    "a plant raises": (run_plant, late_plant(f"{LATE_PLANT}raise ValueError('far')\n"), "raise ", "ValueError: far"),
    "a law's command": (
        run_law,
        late_law(f"    command = command if reference.position < 0.5 else {NO_NUMBER}\n"),
        "@kernel\ndef step",
        "the law 'own' gave nan for command at t = 0.2",
    ),
    "a law's state": (
        run_law,
        late_law(f"    integral = integral if reference.position < 0.5 else {NO_NUMBER}\n"),
        "@kernel\ndef step",
        "the law 'own' gave nan for law.integral at t = 0.2",
    ),
    "a plant's body": (
        run_plant,
        late_plant(f"{LATE_PLANT}speed = {NO_NUMBER}\n"),
        "@kernel\ndef advance",
        "the plant 'own' gave nan for motor_velocity at t = 0.",
    ),
    "a plant's sensor": (
        run_plant,
        PLANT.replace("import kernel\n", "import kernel\nfrom bowden.control.source import Measurement\n") + OBSERVE,
        "@kernel\ndef observe",
        "the plant 'own' gave nan for joint_measured at t = 0.",
    ),
    "a law's shape": (
        run_law,
        late_law(f"{LATE_LAW}return (integral,), command\n"),
        "return (integral,)",
        "the law 'own' cannot be compiled, at … Can't unify return type",
    ),
    "a plant's shape": (
        run_plant,
        late_plant(f"{LATE_PLANT}return (given.slope * end, motor, speed)\n"),
        "return (given",
        "the plant 'own' cannot be compiled, at … Can't unify return type",
    ),
}


@pytest.mark.parametrize(("run", "source", "at", "said"), LATE.values(), ids=LATE.keys())
def test_what_goes_wrong_late_in_a_run_is_named_with_file_and_line(
    run: Callable[[Path], None], source: str, at: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "own.py"
    path.write_text(source)
    with pytest.raises(ParameterError) as caught:
        run(path)
    assert all(part in str(caught.value) for part in said.split(" … ")), str(caught.value)
    lines = range(1, 4) if "Can't unify" in said else [1]  # a compiler names a line near it
    first = source[: source.index(at)].count("\n")
    assert any(f"{path}, line {first + line}:" in str(caught.value) for line in lines), str(caught.value)
    assert caught.value.do.startswith(("correct", "use only"))
    assert "\n" not in str(caught.value)


def test_a_law_that_gives_no_number_is_named_by_a_batch_too(tmp_path: Path) -> None:
    _, source, _, said = LATE["a law's command"]
    (tmp_path / "own.py").write_text(source)
    law = load("own.py", tmp_path)
    case = Case(default_bench(), (law,), MOTION, constant_bend(np.pi), 0)
    with pytest.raises(ParameterError, match=said):
        list(simulate_many([case], 0.5))


@pytest.mark.parametrize("what", ["a law's command", "a law's state"])
def test_a_law_that_gives_no_number_is_named_of_two_motors_on_one_joint_too(what: str, tmp_path: Path) -> None:
    _, source, _, said = LATE[what]
    (tmp_path / "own.py").write_text(source)
    law, bench = load("own.py", tmp_path), default_bench()
    motors = [JointMotor(name, bench, constant_bend(np.pi), 0, sign) for name, sign in (("up", 1.0), ("down", -1.0))]
    with pytest.raises(ParameterError, match=said):
        simulate_joint(CabledJoint(tuple(motors), 10.0, 0.0), (law, law), MOTION, duration=0.5)


def test_a_helper_that_raises_is_named_by_its_own_line(tmp_path: Path) -> None:
    helper = "from bowden import kernel\n\n\n@kernel\ndef half(x):\n    if x > 0.2:\n        raise ValueError('half')\n"
    (tmp_path / "helper.py").write_text(helper + "    return 0.5 * x\n")
    source = LAW.replace("import tanh\n", "import tanh\nfrom helper import half\n")
    source = source.replace("0.5 * gains.play", "half(gains.play + reference.position)")
    (tmp_path / "own.py").write_text(source)
    with pytest.raises(ParameterError, match=r"helper\.py, line 7: the law 'own' failed: ValueError: half"):
        run_law(tmp_path / "own.py")


def with_modules(folder: Path, gain: float) -> Path:
    """A law that imports a module beside it, which imports a package."""
    folder.mkdir(exist_ok=True)
    (folder / "lab").mkdir(exist_ok=True)
    (folder / "lab" / "__init__.py").write_text("from .gain import GAIN\n")
    (folder / "lab" / "gain.py").write_text(f"GAIN = {gain}\n")
    (folder / "shared.py").write_text("import json\n\nimport numpy\n\nfrom lab import GAIN\n")
    path = folder / "own.py"
    path.write_text(
        LAW.replace("from typing", "import shared\nfrom typing").replace("float = 5.0", "float = shared.GAIN")
    )
    return path


def test_what_a_file_imports_is_part_of_the_rig_and_an_edit_of_it_makes_another(tmp_path: Path) -> None:
    path = with_modules(tmp_path / "a", 5.0)
    rig = Rig(law=str(path))
    assert [one.file for one in own_file.modules_of(path, path.read_bytes())] == [
        "lab/__init__.py",
        "lab/gain.py",
        "shared.py",
    ]
    assert rig.fitted().gains.integral_gain == 5.0
    assert Rig(law=str(with_modules(tmp_path / "b", 5.0))).hash == rig.hash
    other = Rig(law=str(with_modules(tmp_path / "a", 6.0)))
    assert other.hash != rig.hash
    assert other.fitted().gains.integral_gain == 6.0
    assert (rig.fitted().gains.integral_gain, Rig.unpack(rig.pack()).fitted().gains.integral_gain) == (5.0, 5.0)


@pytest.mark.parametrize(
    "source",
    [
        "import lab.gain as g\nGAIN = g.GAIN\n",
        "import lab.gain\nGAIN = lab.gain.GAIN\n",
        "from lab import gain\nGAIN = gain.GAIN\n",
        "from places.deep.gain import GAIN\n",  # folders without __init__.py
        "def late():\n    import other\n    return other.GAIN\nGAIN = late()\n",
    ],
)
def test_every_way_of_importing_finds_the_files_own_modules(tmp_path: Path, source: str) -> None:
    path = with_modules(tmp_path, 5.0)
    (tmp_path / "places" / "deep").mkdir(parents=True)
    (tmp_path / "places" / "deep" / "gain.py").write_text("GAIN = 5.0\n")
    (tmp_path / "other.py").write_text("import shared\nGAIN = 5.0\n")  # a circle
    (tmp_path / "shared.py").write_text(source)
    before = set(sys.modules)
    law = Rig.unpack(Rig(law=str(path)).pack()).loaded_law
    assert law.gains.integral_gain == 5.0
    assert not {name for name in set(sys.modules) - before if name.partition(".")[0] in ("lab", "places", "other")}


def test_what_the_user_has_imported_stays_what_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = with_modules(tmp_path / "a", 5.0)
    monkeypatch.syspath_prepend(tmp_path / "a")
    before = {name: importlib.import_module(name) for name in ("shared", "lab", "lab.gain")}
    try:
        with_modules(tmp_path / "a", 6.0)
        rig = Rig(law=str(path))
        assert all(sys.modules[name] is module for name, module in before.items())
        gains = rig.fitted().gains
        assert gains.integral_gain == 6.0  # what the file says now
        assert pickle.loads(pickle.dumps(gains)) == gains
    finally:
        for name in before:
            del sys.modules[name]


@pytest.mark.parametrize(
    ("helper", "line", "said"),
    [
        ("X = 1\n\nY = X / 0\n", 3, "ZeroDivisionError: division by zero"),
        ("X = 1\ndef half(:\n", 2, "invalid syntax"),
        ("import lab.nothing\n", 1, "ModuleNotFoundError: No module named 'lab.nothing'"),
    ],
)
def test_a_mistake_in_a_helper_while_it_is_imported_is_named_there(
    helper: str, line: int, said: str, tmp_path: Path
) -> None:
    path = with_modules(tmp_path, 5.0)
    (tmp_path / "shared.py").write_text(helper)
    with pytest.raises(ParameterError) as caught:
        load(str(path))
    assert str(caught.value).startswith(f"{tmp_path / 'shared.py'}, line {line}: {said}")


def test_a_rig_whose_file_is_gone_runs_a_copy_and_says_so(tmp_path: Path) -> None:
    path = with_modules(tmp_path / "a", 5.0)
    helper = path.parent / "shared.py"
    helper.write_text(f"{helper.read_text()}\ndef fail():\n    raise ValueError('far')\n")
    file = Rig.unpack(Rig(law=str(path)).pack()).law
    assert file.restored() == file
    shutil.rmtree(path.parent)
    copied = file.restored()
    with pytest.raises(ValueError, match="far") as caught:
        user_file.run(copied).shared.fail()
    said = str(user_file.mistake(caught.value, Path(copied.path)))
    place = Path(copied.path).parent / "shared.py"
    assert said.startswith(f"{place}, line 8: ValueError: far; this is the rig's copy: correct the file from which")


def test_another_process_needs_none_of_the_files(tmp_path: Path) -> None:
    rig = Rig(law=str(with_modules(tmp_path / "a", 5.0)))
    (tmp_path / "rig.json").write_bytes(rig.pack())
    shutil.rmtree(tmp_path / "a")
    code = (
        "import sys, pathlib; from bowden.rig.rig import Rig; "
        "rig = Rig.unpack(pathlib.Path(sys.argv[1]).read_bytes()); print(rig.hash, rig.fitted().gains.integral_gain)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "rig.json")], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == [rig.hash, "5.0"]
    rig.write(tmp_path / "rig.toml")
    assert (tmp_path / "lab" / "gain.py").read_text() == "GAIN = 5.0\n"
    assert Rig.read(tmp_path / "rig.toml").hash == rig.hash


def test_the_same_words_in_another_folder_are_another_file(tmp_path: Path) -> None:
    """What they read beside themselves is that folder's."""
    helper = "from pathlib import Path\n\nPLAY = float((Path(__file__).parent / 'play.txt').read_text())\n"
    found = []
    for play in ("0.05", "0.2"):
        (tmp_path / play).mkdir()
        (tmp_path / play / "play.txt").write_text(play)
        (tmp_path / play / "helper.py").write_text(helper)
        (tmp_path / play / "own.py").write_text("import helper\n\nPLAY = helper.PLAY\n")
        found.append(user_file.run(LawFile.seen(str(tmp_path / play / "own.py"))).PLAY)
    assert found == [0.05, 0.2]


def test_a_recording_that_has_changed_is_refused_in_a_simulation_too(tmp_path: Path) -> None:
    path = tmp_path / "emg.csv"
    time = np.arange(0.0, 4.0, 1e-3)
    signal = np.random.default_rng(1).standard_normal(len(time)) * np.where(time > 2.0, 1.0, 0.05)
    rows = "\n".join(f"{t:.3f},{v:.6f}" for t, v in zip(time, signal, strict=True))
    path.write_text(f"time_s,flexor_mV\n{rows}\n")
    rig = Rig(emg=EmgSettings()).with_emg(f"file:{path}")
    assert rig.offline().hash == rig.hash
    path.write_text(path.read_text() + "4.000,0.5\n")
    with pytest.raises(StreamError, match=r"emg\.csv has changed since the rig was read"):
        rig.offline()


def test_files_of_one_name_are_not_written_over_each_other(tmp_path: Path) -> None:
    law, plant = tmp_path / "a" / "own.py", tmp_path / "b" / "own.py"
    for path, text in ((law, LAW), (plant, PLANT)):
        path.parent.mkdir()
        path.write_text(text)
    with pytest.raises(
        ParameterError, match=r"two files of the rig have the name own\.py; expected files of different"
    ):
        Rig(law=str(law), plant=str(plant)).write(tmp_path / "c" / "rig.toml")
    assert not (tmp_path / "c").exists()
    with pytest.raises(OutputError, match=r"is a folder; give the file's name: .*rig\.toml"):
        Rig().write(tmp_path)


@pytest.mark.parametrize("place", ["../evil.py", "/evil.py", "evil.txt", "lab/../../evil.py"])
def test_a_packed_rig_writes_no_file_elsewhere(tmp_path: Path, place: str) -> None:
    packed = json.loads(Rig(law=str(with_modules(tmp_path / "a", 5.0))).pack())
    law = packed["fields"]["law"]
    law["modules"] = {place: law["source"]}
    with pytest.raises(ParameterError, match="a module is in"):
        Rig.unpack(packed)


def test_a_section_of_parameters_goes_below_what_init_writes(tmp_path: Path) -> None:
    (tmp_path / "plant.py").write_text(PLANT)
    path, below = tmp_path / "rig.toml", "[cable.parameters]\nslope = 0.6\n"
    path.write_text(f"{toml_text()}\n{below}")
    with pytest.raises(ParameterError, match="parameters"):  # of no plant; and no mistake in the TOML
        Rig.read(path)
    before, _, cable = toml_text().partition("[cable]")
    path.write_text(f"{before}[cable]\nplant = 'plant.py'\n\n[{cable.partition(chr(10) + '[')[2]}\n{below}")
    assert Rig.read(path).plant.parameters["slope"] == 0.6
