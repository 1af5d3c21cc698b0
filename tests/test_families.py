"""A new family of drives, and a new detector of contractions: what each needs, done from this file."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pytest

from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.export.modules import emg_modules
from bowden.hardware.buses.link import Links
from bowden.hardware.emg.listener import Listener
from bowden.hardware.ports import Drive, EmgChunk, Power
from bowden.hardware.twin.bench import TwinBench
from bowden.identify.emg.score import find
from bowden.rig import families as drive_families
from bowden.rig.families import DriveFamily, DriveNeeds, family_named, family_of, names
from bowden.rig.rig import Rig
from bowden.sensing.detector import Detector, Trouble
from bowden.sensing.detectors import DETECTORS, detector_named
from bowden.sensing.stream import OnsetDetector
from support.simulated_drive import SimulatedDrive


class ToyParameters(NamedTuple):
    """A drive at the end of a piece of string."""

    family: Annotated[Literal["toy"], Quantity("family of the drive")] = "toy"
    string: Annotated[str, Quantity("which piece of string")] = "red"
    length: Annotated[float, Quantity("of the string", "m", shown="mm", gt=0.0)] = 0.5
    patience: Annotated[
        float, Quantity("without a word of ours it lets go after this; 0 for never", "s", shown="ms")
    ] = 0.02
    speed_limit: float = 0.0
    """Largest speed that the rig asks for [rad/s]."""


def toy_completed(given: ToyParameters, needs: DriveNeeds) -> ToyParameters:
    return given._replace(speed_limit=needs.speed_limit)


def toy_twin(given: ToyParameters, plant: Any, clock: Callable[[], float], options: Any) -> Any:
    return SimulatedDrive(plant)


PLAYED: dict[str, Any] = {}
"""The twin at the end of each string."""


def toy_open(given: ToyParameters, links: Any) -> Drive:
    drive: Drive = PLAYED[given.string]
    return drive


TOY = DriveFamily(
    name="toy",
    title="A drive at the end of a piece of string.",
    parameters=ToyParameters(),
    completed=toy_completed,
    open=toy_open,
    twin=toy_twin,
    node=lambda: SimulatedDrive,
    moved=lambda given, channel, interface: given._replace(string=channel or given.string),
    address=lambda given: {"string": given.string},
    control=lambda given: Path(f"toy-{given.string}"),
    claim=lambda given: lambda: None,
    watchdog=lambda given: given.patience or math.inf,
    most_push=lambda given, needs: 0.0,
    measures_tension=lambda given: False,
    scales=lambda given: (given.length,),
    homed=lambda given: True,
    simulated=lambda given: True,
    explain=lambda code: f"the string says {code}",
)


@pytest.fixture
def toy() -> Iterator[DriveFamily]:
    drive_families.register(TOY)
    yield TOY
    del drive_families._REGISTERED["toy"]


def test_a_rig_of_another_family_is_read_packed_written_and_run_against_its_twin(
    toy: DriveFamily, tmp_path: Path
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('[drive]\nfamily = "toy"\nstring = "blue"\nlength_mm = 250.0\n')
    rig = Rig.read(path)
    assert rig.drive == ToyParameters(string="blue", length=0.25)
    assert rig.drive_parameters.speed_limit == rig.supervisor_limits.motor_speed
    assert Rig.unpack(rig.pack()).drive == rig.drive
    assert Rig.unpack(rig.pack()).hash == rig.hash != Rig().hash
    assert 'family = "toy"' in rig.to_toml()
    assert rig.on_bus("green").drive.string == "green"

    family, parameters = family_of(rig.drive), rig.drive_parameters
    plant = TwinBench(rig.bench, rig.bend_path, rig.duration, rig.seed, rig.start_motor, 0.0)
    PLAYED["blue"] = family.twin(parameters, plant, lambda: 0.0, ())
    drive = family.open(parameters, Links())
    start = drive.read(0.0).motor
    for k in range(1, 400):
        drive.write(start + 0.1, Power.ON, k * 1e-3)
    assert drive.read(0.4).motor == pytest.approx(start + 0.1, abs=0.01)
    assert family.explain(7) == "the string says 7"


@pytest.mark.parametrize(
    ("patience", "said"), [(51.0, "takes its torque off 51 ms after our last word"), (0.0, "never")]
)
def test_a_drive_that_would_keep_its_torque_without_us_is_refused(toy: DriveFamily, patience: float, said: str) -> None:
    with pytest.raises(ParameterError, match=said) as refused:
        _ = Rig(drive=ToyParameters(patience=1e-3 * patience)).drive_parameters
    assert "within 50 ms by itself" in str(refused.value)
    assert Rig(drive=ToyParameters(patience=0.05)).drive_parameters.patience == 0.05


def test_a_family_that_there_is_not_is_named(tmp_path: Path) -> None:
    assert "cia402" in names()
    with pytest.raises(ParameterError, match="toy"):
        family_named("toy")
    path = tmp_path / "rig.toml"
    path.write_text('[drive]\nfamily = "cia40"\n')
    with pytest.raises(ParameterError, match=r"drive\.family is 'cia40'; expected cia402 \(did you mean this"):
        Rig.read(path)


def test_a_key_that_a_family_does_not_have_is_told_with_its_own(toy: DriveFamily, tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('[drive]\nfamily = "toy"\nstrng = "blue"\n')
    with pytest.raises(
        ParameterError, match=r"'strng' in \[drive\]; expected string \(did you mean this.*length_mm"
    ) as said:
        Rig.read(path)
    assert "node_id" not in str(said.value)


class ToySettings(NamedTuple):
    """A threshold."""

    threshold: float = 0.5
    shortest: float = 0.0


class ToyState(NamedTuple):
    """The largest value so far."""

    largest: float


@kernel
def toy_step(prepared: ToySettings, state: ToyState, value: float) -> tuple[ToyState, bool, Trouble]:
    size = abs(value)
    return ToyState(max(state.largest, size)), size > prepared.threshold, Trouble.NONE


@kernel
def toy_rest(state: ToyState) -> float:
    return state.largest


TOY_DETECTOR = Detector(
    name="toy",
    settings=ToySettings(),
    prepare=lambda rate, settings: settings,
    start=lambda prepared, first: ToyState(0.0),
    step=toy_step,
    rest=toy_rest,
    of_wearer=lambda rest, mvc: ToySettings(threshold=3.0 * rest),
    slowest=100.0,
    safe=200.0,
    quickest=5000.0,
    source="a test",
)


def test_a_new_detector_hears_scores_and_is_exported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(DETECTORS, "toy", TOY_DETECTOR)
    kind = detector_named("toy")
    signal = np.where(np.arange(2000) // 500 % 2 == 1, 1.0, 0.1) * np.where(np.arange(2000) % 2, 1.0, -1.0)
    told = OnsetDetector(1000.0, None, kind).feed(signal)
    assert np.array_equal(told.active, np.where(np.abs(signal) > 0.5, 1.0, 0.0))
    assert told.rest[-1] == 1.0
    found = find(signal, 1000.0, [(0.5, 1.0), (1.5, 2.0)], detector=kind)
    assert (found.score.misses, found.score.false_activations) == (0, 0)
    heard = Listener(1000.0, 0, detector=kind)
    heard.take(EmgChunk(signal[:700, None], np.arange(700) / 1000.0), 0.7)
    assert heard.reading.flexor == 1.0
    _, module = emg_modules(1000.0, kind)
    assert module.prefix == "toy"
    with pytest.raises(ParameterError, match="toy"):
        OnsetDetector(50.0, None, kind)


def test_a_rig_names_its_detector() -> None:
    from bowden.rig.settings import EmgSettings

    rig = Rig(emg=EmgSettings(source="lsl:EMG"))
    assert rig.emg_run is not None
    assert rig.emg_run.detector is DETECTORS["onset"]
    with pytest.raises(ParameterError, match="onset"):
        Rig(emg=EmgSettings(source="lsl:EMG", detector="onsat"))
