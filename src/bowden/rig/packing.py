"""A rig as plain bytes: its fields in SI with the contents of the files that they name, and its hash."""

import base64
import contextlib
import dataclasses
import hashlib
import json
import math
import zlib
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from bowden import __version__
from bowden.control import LAWS, Law
from bowden.control.law_file import LawFile, code_of_law, packable
from bowden.control.recorded_motion import RecordedFile, RecordedMotion
from bowden.core.arguments import format_value as shown
from bowden.core.errors import BowdenError, ParameterError
from bowden.core.kernel_content import code_of
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.identified import IdentifiedCable
from bowden.plants.plant_file import PlantFile, as_file
from bowden.plants.user_plant import UserPlant
from bowden.rig.joints import JointSettings
from bowden.rig.sections import BENDS, PARTS, REFERENCES, drive_part
from bowden.rig.tree import kind_of, tree_of, unnamed

FORMAT = 3
"""Of the document."""
MOST_BYTES = 32 << 20
"""A larger rig is not packed: its recorded motion is too long [bytes]."""
_DIGITS = 12
"""Numbers that are alike in this many digits make the same hash: degrees to radians and back is not exact."""


def document(values: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a rig as JSON values in SI, with what was in the files that they name; of one with motors, what
    these have in common.

    Raises:
        ParameterError: a reference, cable or law that exists only in this process, or too much of it.
    """
    law: Any = values["law"]
    own: dict[str, float] = {}
    if isinstance(law, Law):
        law, own = packable(law)
    said = {name: _said(name, value) for name, value in {**values, "law": law}.items() if name != "motors"}
    found = {"format": FORMAT, "software": f"bowden {__version__}", "fields": said}
    return found | ({"own_gains": own} if own else {})


def of_rig(rig: Any) -> dict[str, Any]:
    """See `Rig.document`."""
    found = document(rig.compared) | {"origin": rig.origin, "hash": rig.hash}
    motors = [{"name": name, "rig": of_rig(one), "joint": joint} for name, one, joint in rig.motors]
    return found | ({"motors": motors} if motors else {})


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


def unpacked(pack: bytes | Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a rig from a document, or its bytes; of each motor name, document and joint. No file is read.

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
        values = {name: _value(name, given) for name, given in found["fields"].items()}
        values["origin"] = str(found.get("origin", "Rig"))
        if "own_gains" in found:
            law = values["law"]
            loaded = law.load() if isinstance(law, LawFile) else LAWS[law]
            values["law"] = loaded.with_gains(**found["own_gains"])
        values["motors"] = [(one["name"], one["rig"], one["joint"]) for one in found.get("motors", ())]
    return values


def own_files(found: Mapping[str, Any]) -> list[LawFile | PlantFile]:
    """The users' programs in a document, and in those of its motors; nothing of them is run.

    Raises:
        ParameterError: the document is none.
    """
    with _understood(found):
        motors = [one["rig"] for one in found.get("motors", ())]
        said = [(name, one.get("fields", {}).get(name)) for one in (found, *motors) for name in ("law", "plant")]
        return [_value(name, given) for name, given in said if isinstance(given, Mapping)]


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
            do=_AGAIN,
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


# fields


def _said(name: str, value: Any) -> Any:
    """A field as JSON values; with a number that is not finite as text."""
    if isinstance(value, IdentifiedCable):
        return {"identified": _CABLE.dump_python(value, mode="json")}
    if isinstance(value, RecordedMotion):
        return {"said": value.said._asdict(), "time": _array(value.time), "position": _array(value.position)}
    if isinstance(value, LawFile):
        return value.packed()
    if isinstance(value, UserPlant | PlantFile):
        plant = as_file(value)
        return plant.packed() | {"changed": dict(plant.changed)}
    if name in _KINDS:
        return {"kind": kind_of(value, _KINDS[name])} | _plain(value)
    return _plain(value)


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {one.name: _plain(getattr(value, one.name)) for one in dataclasses.fields(value)}
    if hasattr(value, "_asdict"):
        return {name: _plain(one) for name, one in value._asdict().items()}
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _value(name: str, given: Any) -> Any:
    """A field from what `_said` gave; no file is read.

    Raises:
        ParameterError: it is none.
    """
    if name == "law":
        return LAWS[given].name if isinstance(given, str) else LawFile.unpacked(given)
    if name == "plant":
        return None if given is None else _plant(given)
    if name == "reference" and "said" in given:
        return RecordedMotion(RecordedFile(**given["said"]), _numbers(given["time"]), _numbers(given["position"]))
    if name == "joints":
        return tuple(_made(JointSettings, one, name) for one in given)
    if name in _KINDS:
        given = dict(given)
        return _made(_KINDS[name][given.pop("kind")].kind, given, name)
    if name == "cable":
        return _CABLE.validate_python(given["identified"]) if "identified" in given else _made(BoucWen, given, name)
    part = drive_part(given["family"]) if name == "drive" else PARTS.get(name)
    return given if part is None else _made(part.kind, given, name)


_KINDS = {"reference": REFERENCES, "bend": BENDS}
_CABLE: TypeAdapter[IdentifiedCable] = TypeAdapter(IdentifiedCable)


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def _made(kind: type, given: Any, name: str) -> Any:
    if not isinstance(given, Mapping):
        raise TypeError(f"{name} is {shown(given)}")
    try:
        return _adapter(kind).validate_python(given)
    except ValidationError as error:
        first: Any = error.errors()[0]
        place = ".".join(map(str, (name, *first["loc"])))
        raise ParameterError(
            f"the packed rig: {place}: {first['msg']}", expected="what Rig.pack or Rig.document gave", do=_AGAIN
        ) from None


_AGAIN = "pack the rig again"


def _plant(given: Mapping[str, Any]) -> PlantFile:
    changed = tuple((key, float(value)) for key, value in given["changed"].items())
    return PlantFile.unpacked(given, changed=changed)


def _array(values: NDArray[np.float64]) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values, dtype="<f8").tobytes())).decode()


def _numbers(text: str) -> NDArray[np.float64]:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype="<f8")


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
