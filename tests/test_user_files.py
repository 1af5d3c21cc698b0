"""Files of a user's own: what goes wrong in them late is named with file and line; what they import belongs to them."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS, user_law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core import user_file
from bowden.core.errors import ParameterError, StreamError
from bowden.plants import user_plant
from bowden.rig.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.rig.settings import EmgSettings
from bowden.sim.many import Case, simulate_many
from bowden.sim.run import simulate
from bowden.sim.scenario import constant_bend

EXAMPLES = Path(__file__).parents[1] / "examples"
LAW, PLANT = ((EXAMPLES / name).read_text() for name in ("my_law.py", "my_plant.py"))
LAW_ENDS, PLANT_ENDS = "    return State(integral), command\n", "    return Body(given.slope * end, motor, speed)\n"
MOTION = PeriodicMinimumJerk(0.0, 1.0, 1.0)
LATE_LAW, LATE_PLANT = "    if reference.position > 0.5:\n        ", "    if motor > 0.5:\n        "
OBSERVE = """

@kernel
def observe(plant: Any, body: Body, normals: Any) -> Any:
    return body, Measurement(body.joint if body.motor < 0.5 else np.nan, body.motor, np.nan, np.nan)
"""


def run_law(path: Path) -> None:
    law = user_law.load(str(path))
    with user_law.explained(law):
        simulate(default_bench(), law, MOTION, duration=0.5)


def run_plant(path: Path) -> None:
    simulate(user_plant.load(str(path)), LAWS["uncompensated"], MOTION, duration=0.5)


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
        late_plant(f"{LATE_PLANT}speed = np.nan\n"),
        "@kernel\ndef advance",
        "the plant 'own' gave nan for motor_velocity at t = 0.",
    ),
    "a plant's sensor": (
        run_plant,
        PLANT.replace("import numpy as np\n", "import numpy as np\nfrom bowden.control.source import Measurement\n")
        + OBSERVE,
        "@kernel\ndef observe",
        "the plant 'own' gave nan for joint_measured at t = 0.",
    ),
    "a law's shape": (
        run_law,
        late_law(f"{LATE_LAW}return (integral,), command\n"),
        "return (integral,)",
        "the law 'own' cannot be compiled: Can't unify return type",
    ),
    "a plant's shape": (
        run_plant,
        late_plant(f"{LATE_PLANT}return (given.slope * end, motor, speed)\n"),
        "return (given",
        "the plant 'own' cannot be compiled: Can't unify return type",
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
    assert said in str(caught.value)
    lines = range(1, 4) if "Can't unify" in said else [1]  # a compiler names a line near it
    first = source[: source.index(at)].count("\n")
    assert any(f"{path}, line {first + line}:" in str(caught.value) for line in lines), str(caught.value)
    assert caught.value.do.startswith(("correct", "use only"))
    assert "\n" not in str(caught.value)


def test_a_law_that_gives_no_number_is_named_by_a_batch_too(tmp_path: Path) -> None:
    _, source, _, said = LATE["a law's command"]
    (tmp_path / "own.py").write_text(source)
    law = user_law.load("own.py", tmp_path)
    case = Case(default_bench(), (law,), MOTION, constant_bend(np.pi), 0)
    with pytest.raises(ParameterError, match=said):
        list(simulate_many([case], 0.5))


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
    assert [one.file for one in user_file.modules_of(path, path.read_bytes())] == [
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
