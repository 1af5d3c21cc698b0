"""A rig as plain bytes: its sections as a file has them, the contents of the files that these name, and its hash."""

import base64
import contextlib
import dataclasses
import hashlib
import json
import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from bowden import __version__
from bowden.control import LAWS, Law, user_law
from bowden.control.law_file import LawFile, code_of_law, packable
from bowden.control.recorded_motion import RecordedFile, RecordedMotion
from bowden.core.arguments import format_value as shown
from bowden.core.errors import BowdenError, ParameterError
from bowden.core.kernel_content import code_of
from bowden.plants.identified import IdentifiedCable
from bowden.plants.plant_file import PlantFile, as_file
from bowden.plants.user_plant import UserPlant
from bowden.rig.declaration import replaced
from bowden.rig.joints import JointSettings
from bowden.rig.sections import PARTS, REFERENCES
from bowden.rig.settings import EmgSettings
from bowden.rig.tree import tree_of, unnamed, values_of
from bowden.sensing.wearer_file import MuscleCalibration

FORMAT = 2
"""Of the document."""
MOST_BYTES = 32 << 20
"""A larger rig is not packed: its recorded motion is too long [bytes]."""
_DIGITS = 12
"""Numbers that are alike in this many digits make the same hash: degrees to radians and back is not exact."""

OF_MOTORS = ("motors", "independent", "joints")
"""Fields of a rig that one without motors says nothing of."""


def document(values: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a rig as JSON values; of one with motors, what these have in common.

    ``tree`` is what a file says; ``files`` is what was in the files that it names; ``exact`` are numbers that no file
    can say to the last bit, in SI.

    Raises:
        ParameterError: a reference, cable or law that exists only in this process, or too much of it.
    """
    law: Any = values["law"]
    own: dict[str, float] = {}
    if isinstance(law, Law):
        law, own = packable(law)
    values = {**values, "law": law}
    tree = tree_of(values, of_process=True)
    found: dict[str, Any] = {"format": FORMAT, "software": f"bowden {__version__}", "tree": tree}
    found["files"] = {name: text for name in _HELD if (text := _content(name, values[name])) is not None}
    again = values_of(tree, Path("Rig"), values, whole=False)
    found["exact"] = {
        name: given for key in again if key in values for name, given in _rest(key, values[key], again[key])
    }
    return found | ({"own_gains": own} if own else {})


def of_rig(rig: Any) -> dict[str, Any]:
    """See `Rig.document`."""
    found = document(rig.compared) | {"origin": rig.origin, "hash": rig.hash}
    if not rig.motors:
        return found
    motors = [{"name": name, "rig": of_rig(one), "joint": joint} for name, one, joint in rig.motors]
    joints = [one._asdict() for one in rig.joints]
    return found | {"motors": motors, "independent": rig.independent, "joints": joints}


def packed(found: Mapping[str, Any]) -> bytes:
    """A document as bytes.

    Raises:
        ParameterError: too much of it.
    """
    whole = json.dumps(found, ensure_ascii=False).encode()
    if len(whole) > MOST_BYTES:
        raise ParameterError(
            f"the rig has {len(whole) / 2**20:.0f} MB with what it was made of",
            expected=f"{MOST_BYTES >> 20} MB at most",
            do="shorten or thin out its recorded motion",
        )
    return whole


def unpacked(pack: bytes | Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The fields of a rig from a document, or its bytes, and those of its motors as they stand there. No file is read.

    Args:
        pack: what `packed` or `document` gave.

    Raises:
        ParameterError: it is none, or of a version that cannot be read.
    """
    found = pack if isinstance(pack, Mapping) else _read(pack)
    if found.get("format") != FORMAT:
        raise ParameterError(
            f"the packed rig has the format {found.get('format')!r}, by {found.get('software', 'an unknown program')}",
            expected=f"format {FORMAT}",
            do="use the version of bowden that wrote it",
        )
    with _understood(found):
        tree, files, exact = (dict(found.get(name, {})) for name in ("tree", "files", "exact"))
        held = {name: _HELD[name](given) for name, given in files.items()}
        held["emg"] = held.get("emg", EmgSettings())._replace(
            **{key: tree.get("emg", {}).get(key) for key in ("source", "wearer")}
        )
        _refuse_absent(tree, held)
        values = values_of(tree, Path(str(found.get("origin", "Rig"))), held, whole=False)
        for name, given in exact.items():
            field, *path = name.split(".")
            values[field] = _with(values[field], path, given)
        if "own_gains" in found:
            law = values["law"]
            loaded = law.load() if isinstance(law, LawFile) else LAWS[law]
            values["law"] = loaded.with_gains(**found["own_gains"])
        beside = {name: found[name] for name in OF_MOTORS if name in found}
        if "motors" in beside:
            beside["motors"] = [(one["name"], one["rig"], one["joint"]) for one in beside["motors"]]
            beside["joints"] = tuple(JointSettings(**one) for one in beside["joints"])
    return values, beside


def own_files(found: Mapping[str, Any]) -> list[LawFile | PlantFile]:
    """The users' programs in a document, and in those of its motors; nothing of them is run.

    Raises:
        ParameterError: the document is none.
    """
    with _understood(found):
        motors = [one["rig"] for one in found.get("motors", ())]
        files = [dict(one.get("files", {})) for one in (found, *motors)]
        return [_HELD[name](one[name]) for one in files for name in ("law", "plant") if name in one]


@contextlib.contextmanager
def _understood(found: Mapping[str, Any]) -> Iterator[None]:
    """Whatever a foreign document holds in place of a part of a rig becomes one line.

    Raises:
        ParameterError: it is no such part.
    """
    try:
        yield
    except BowdenError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, zlib.error) as error:
        why = f"it has no {error.args[0]!r}" if isinstance(error, KeyError) and error.args else str(error)
        raise ParameterError(
            f"the packed rig is {shown(dict(found))}: {' '.join(why.split())}",
            expected="what Rig.pack or Rig.document gave",
            do="pack the rig again",
        ) from None


def _read(pack: bytes) -> Mapping[str, Any]:
    found = None
    with contextlib.suppress(ValueError, TypeError, RecursionError):
        found = json.loads(pack)
    if not isinstance(found, dict):
        raise ParameterError(
            f"Rig.unpack: {shown(pack)} is not a packed rig",
            expected="what Rig.pack or Rig.document gives",
            do="read a rig.toml with Rig.read",
        )
    return found


def _refuse_absent(tree: Mapping[str, Any], held: Mapping[str, Any]) -> None:
    """Refuse sections that name a file whose content is not there: this computer's own is not the one that was."""
    cable, control, reference = (tree.get(name, {}) for name in ("cable", "control", "reference"))
    named = {
        "cable": cable.get("model"),
        "plant": cable.get("plant"),
        "law": law if isinstance(law := control.get("law"), str) and user_law.is_file(law) else None,
        "reference": reference.get("file"),
    }
    for name, file in named.items():
        if file is not None and name not in held:
            raise ParameterError(
                f"the packed rig names {file!r}, and what was in it is not there",
                expected="what Rig.pack or Rig.document gave",
                do="pack the rig again",
            )


# contents of files


def _content(name: str, value: Any) -> Any:
    """What was in the file from which a field of a rig comes, as JSON; None of others."""
    if isinstance(value, IdentifiedCable):
        return _CABLE.dump_python(value, mode="json")
    if isinstance(value, RecordedMotion):
        return {"said": value.said._asdict(), "time": _array(value.time), "position": _array(value.position)}
    if isinstance(value, LawFile):
        return value.packed()
    if isinstance(value, UserPlant | PlantFile):
        plant = as_file(value)
        return plant.packed() | {"changed": dict(plant.changed)}
    if isinstance(value, EmgSettings) and (value.levels or value.place or value.recording):
        return _LEVELS.dump_python(value.levels, mode="json"), value.place, value.recording
    return None


def _plant(given: Mapping[str, Any]) -> PlantFile:
    changed = tuple((key, float(value)) for key, value in given["changed"].items())
    return PlantFile.unpacked(given, changed=changed)


def _motion(given: Mapping[str, Any]) -> RecordedMotion:
    return RecordedMotion(RecordedFile(**given["said"]), _numbers(given["time"]), _numbers(given["position"]))


def _emg(given: Any) -> EmgSettings:
    levels, place, recording = given
    return EmgSettings(levels=_LEVELS.validate_python(levels), place=str(place), recording=str(recording))


_CABLE: TypeAdapter[IdentifiedCable] = TypeAdapter(IdentifiedCable)
_LEVELS: TypeAdapter[MuscleCalibration | None] = TypeAdapter(MuscleCalibration | None)
_HELD: Mapping[str, Callable[[Any], Any]] = {
    "cable": _CABLE.validate_python,
    "law": LawFile.unpacked,
    "plant": _plant,
    "reference": _motion,
    "emg": _emg,
}
"""Field of a rig that may come from a file → that field from its content."""


def _array(values: NDArray[np.float64]) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values, dtype="<f8").tobytes())).decode()


def _numbers(text: str) -> NDArray[np.float64]:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype="<f8")


# what a file cannot say


def _rest(name: str, value: Any, again: Any) -> Iterator[tuple[str, Any]]:
    """Dotted name and value of each number that a file does not say to the last bit, or has no key for."""
    if value is again or value == again or name == "gains":
        return
    if hasattr(value, "_fields") and type(value) is type(again):
        fields = value._fields
    elif dataclasses.is_dataclass(value) and type(value) is type(again):
        fields = tuple(one.name for one in dataclasses.fields(value))
    elif not (value != value and again != again):  # NaN
        yield name, str(value) if isinstance(value, float) and not math.isfinite(value) else value
        return
    else:
        return
    for field in fields:
        yield from _rest(f"{name}.{field}", getattr(value, field), getattr(again, field))


def _with(value: Any, path: list[str], given: Any) -> Any:
    """A value with one that `_rest` gave."""
    given = tuple(given) if isinstance(given, list) else float(given) if isinstance(given, str) else given
    if not path:
        return given
    if hasattr(value, "_fields"):
        return replaced(value, tuple(path), given)
    return dataclasses.replace(value, **{path[0]: given})


# the hash


def digest(values: Mapping[str, Any]) -> str:
    """A short name of the values: equal ones have the same, whether they come from Python or a file.

    It is that of what a file says, of what was in the files that it names, and not of where these and the drive are.
    """
    if values["motors"]:
        said: Any = {
            "motors": [[one.name, one.rig.hash, one.joint] for one in values["motors"]],
            "independent": values["independent"],
            "joints": [list(one) for one in values["joints"]],
        }
    else:
        own = {name: found for name in _USUAL if (found := _of_process(values[name])) is not None}
        tree = tree_of({**values, **{name: _USUAL[name] for name in own}}, of_process=True)
        emg = values["emg"]
        held = isinstance(values["cable"], IdentifiedCable) or values["plant"] is not None  # its content says more
        encoder = not values["joint_sensor"].estimated  # then neither its section nor its limit says anything
        without: dict[str, tuple[str, ...]] = {
            "limits": ("joint_std_deg",) if encoder else (),
            "drive": ("interface", "channel"),
            "load_cell": ("interface", "channel"),
            "emg": ("wearer", "source"),
            "cable": tuple(tree["cable"]) if held else (),
            "control": ("law",) if isinstance(values["law"], LawFile) else (),
            "reference": () if "reference" in own else ("file", "time_column", "position_column", "unit"),
        }
        said = {
            title: {key: one for key, one in section.items() if key not in without.get(title, ())}
            for title, section in tree.items()
            if not (encoder and title == "joint_sensor")
        }
        said |= {"own": own, "emg source": emg.recording or emg.source, "levels": emg.levels}
        said |= {f"{name} file": _content_hash(values[name]) for name in ("cable", "law", "plant", "reference")}
        said |= {
            "unnamed": {
                name: dict(unnamed(values[name], part.default))
                for name, part in PARTS.items()
                if not (encoder and name == "joint_sensor")
            }
        }
    return hashlib.sha256(json.dumps(_rounded(said), sort_keys=True).encode()).hexdigest()[:16]


_USUAL = {"law": "adaptive", "plant": None, "reference": REFERENCES["periodic_minimum_jerk"].default}
"""Fields that may hold what exists only in this process → what stands for it in the sections."""


def _of_process(value: Any) -> Any:
    """What distinguishes a value that no file can say; None of all others."""
    if isinstance(value, UserPlant):  # of a notebook: what is run is all that is known of it
        code = code_of(value.rest, value.advance, value.observe, value.effort) or id(value.advance)
        return {"plant": value.name, "code": code, "parameters": value.describe()}
    if isinstance(value, Law):
        try:
            packable(value)
        except ParameterError:
            return {
                "law": value.name,
                "code": code_of_law(value) or id(value.step_kernel),
                "gains": value.gains._asdict(),
            }
    if hasattr(value, "content"):  # the motion of a recording of EMG
        return hashlib.sha256(value.content).hexdigest()
    known = isinstance(value, RecordedMotion) or any(type(value) is part.kind for part in REFERENCES.values())
    if hasattr(value, "describe") and not known:
        return {"type": type(value).__name__, "described": value.describe()}
    return None


def _content_hash(value: Any) -> Any:
    """What distinguishes the content of a file; nothing of what is from none."""
    if isinstance(value, IdentifiedCable):
        return {"best": value.best, "models": value.models}
    if isinstance(value, RecordedMotion):
        return hashlib.sha256(np.round(value.position, 9).tobytes() + np.round(value.time, 9).tobytes()).hexdigest()
    if isinstance(value, LawFile | PlantFile):
        modules = {one.file: hashlib.sha256(one.source).hexdigest() for one in value.modules}
        changed = dict(value.changed) if isinstance(value, PlantFile) else {}
        return [value.name.rpartition(".py")[2], hashlib.sha256(value.source).hexdigest(), modules, changed]
    return None


def _rounded(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(one) for one in value]
    return f"{value:.{_DIGITS}g}" if isinstance(value, float) else value
