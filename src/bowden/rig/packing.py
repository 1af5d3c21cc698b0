"""A rig as plain bytes: a JSON document with all its numbers, and the contents of the files that it was made of."""

import base64
import contextlib
import dataclasses
import hashlib
import json
import math
import zlib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from bowden import __version__
from bowden.control import LAWS, Law
from bowden.control.law_file import LawFile, code_of_law, packable
from bowden.control.recorded_motion import RecordedFile, RecordedMotion
from bowden.core import user_file
from bowden.core.arguments import said
from bowden.core.errors import BowdenError, ParameterError
from bowden.core.kernel_content import code_of
from bowden.core.quantity import optional
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.counting import Counting, Covered
from bowden.plants.identified import IdentifiedCable
from bowden.plants.plant_file import PlantFile, as_file
from bowden.plants.trust import Trust
from bowden.plants.user_plant import UserPlant
from bowden.rig.checked import Gains
from bowden.rig.declaration import items_of
from bowden.rig.pair import NO_PAIR, PairSettings
from bowden.rig.sections import BENDS, DEFAULT_FAMILY, PARTS, REFERENCES, drive_part

FORMAT = 1
"""Of the document."""
MOST_BYTES = 32 << 20
"""A larger rig is not packed: its recorded motion is too long [bytes]."""
_DIGITS = 12
"""Numbers that are alike in this many digits make the same hash: degrees to radians and back is not exact."""

OF_AXES = ("axes", "independent", "pair")
"""Fields of a rig that one without axes says nothing of."""
OF_SOME = ("load_cell", "brake")
"""Fields of which a rig that is as usual says nothing."""

_REFERENCE_TAGS = {part.kind: tag for tag, part in REFERENCES.items() if tag != "recorded"}
_BEND_TAGS = {part.kind: tag for tag, part in BENDS.items()}


class Packed(NamedTuple):
    """What is in a document."""

    values: dict[str, Any]
    """Field of a rig → its value."""
    remarks: tuple[str, ...]
    """What another version of the package wrote otherwise."""


def document(values: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a rig as JSON values.

    Raises:
        ParameterError: a reference, cable or law that exists only in this process, or too much of it.
    """
    found = {name: _written(name, value) for name, value in values.items() if _says(name, value)}
    law, more = found["law"], {}
    if isinstance(values["law"], Law):
        base, own = packable(values["law"])
        law, more = _written("law", base), {"own_gains": own}
    return {"format": FORMAT, "software": f"bowden {__version__}"} | found | {"law": law} | more


def _says(name: str, value: Any) -> bool:
    """Whether a document has this field: one that not every rig has, and that is as usual, is left out."""
    if name == "pair":
        return bool(value.there)
    return bool(value) if name in OF_AXES else name not in OF_SOME or value != PARTS[name].default


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


def digest(values: Mapping[str, Any]) -> str:
    """A short name of the values: equal ones have the same, whether they come from Python or a file."""
    if values["axes"]:
        said: dict[str, Any] = {"axes": [[one.name, one.rig.hash] for one in values["axes"]]}
        said["independent"] = values["independent"]
        said |= {"pair": values["pair"]} if values["pair"].there else {}
    else:
        usual = [name for name in OF_SOME if not _says(name, values[name])]
        left_out = {*OF_AXES, *usual, *(["plant"] if values["plant"] is None else [])}
        said = {name: value for name, value in values.items() if name not in left_out}
    return hashlib.sha256(json.dumps(_said(said), sort_keys=True).encode()).hexdigest()[:16]


def _written(name: str, value: Any) -> Any:
    if name == "axes":
        return [{"name": one.name, "rig": one.rig.document()} for one in value]
    if isinstance(value, RecordedMotion):
        numbers = {"time": _array(value.time), "position": _array(value.position)}
        return {"kind": "recorded", "said": _plain(value.said)} | numbers
    if isinstance(value, IdentifiedCable):
        changed = {"changed": dict(value.changed)} if value.changed else {}
        counted = {} if value.counting.as_recorded else {"counting": _plain(value.counting)}
        covered = {} if value.covered is None else {"covered": _plain(value.covered)}
        found = {"best": value.best, "models": _dicts(value.models), "file": value.file, "digest": value.digest}
        trust = {} if value.trust is None else {"trust": _plain(value.trust)}
        return found | changed | counted | covered | trust
    if isinstance(value, LawFile):
        return user_file.written(value)
    if isinstance(value, UserPlant | PlantFile):
        plant = as_file(value)
        return user_file.written(plant) | {"changed": dict(plant.changed)}
    if isinstance(value, Law):
        return None  # `document` has its name or file
    if name == "reference":
        if type(value) not in _REFERENCE_TAGS:
            raise ParameterError(
                f"a reference of the type {type(value).__name__} exists only in this process",
                expected=f"one of {', '.join(part.kind.__name__ for part in REFERENCES.values())}",
                do="use one of these, or simulate in this process",
            )
        return {"kind": _REFERENCE_TAGS[type(value)]} | {
            one.name: _plain(getattr(value, one.name)) for one in dataclasses.fields(value)
        }
    if name == "bend":
        return {"kind": _BEND_TAGS[type(value)]} | _plain(value)
    return _plain(value)


def _plain(value: Any) -> Any:
    """Nested NamedTuples as dictionaries, without numbers that JSON does not have."""
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _array(values: NDArray[np.float64]) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(values, dtype="<f8").tobytes())).decode()


def _dicts(models: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    return {name: dict(parameters) for name, parameters in models.items()}


def _said(value: Any) -> Any:
    """What the hash is made of: numbers in a file's units and in their first digits, contents by their own hash."""
    if isinstance(value, RecordedMotion):
        contents = hashlib.sha256(np.round(value.position, 9).tobytes() + np.round(value.time, 9).tobytes())
        return {"recorded": contents.hexdigest(), "cutoff": _said(value.said.cutoff)}
    if hasattr(value, "content"):  # the motion of a recording of EMG
        return {"emg": hashlib.sha256(value.content).hexdigest()}
    if isinstance(value, IdentifiedCable):
        return {"best": value.best, "models": _said(_dicts(value.models))}
    if isinstance(value, LawFile):
        attribute = value.name.rpartition(".py")[2]
        return {"law": hashlib.sha256(value.source).hexdigest(), "name": attribute} | _modules_said(value)
    if isinstance(value, PlantFile):
        attribute = value.name.rpartition(".py")[2]
        found = {"plant": hashlib.sha256(value.source).hexdigest(), "name": attribute}
        return found | {"changed": _said(dict(value.changed))} | _modules_said(value)
    if isinstance(value, UserPlant):  # of a notebook, as for a law
        code = code_of(value.rest, value.advance, value.observe, value.effort) or id(value.advance)
        return {"plant": value.name, "code": code, "parameters": _said(value.describe())}
    if isinstance(value, Law):
        try:
            base, own = packable(value)
        except ParameterError:  # of a notebook: what is run is all that is known of it
            return {"law": value.name, "code": code_of_law(value) or id(value.step_kernel), "gains": _said(value.gains)}
        return {"law": _said(base), "gains": _said(own)} if own else _said(base)
    if isinstance(value, Mapping):
        return {key: _said(part) for key, part in value.items()}
    if hasattr(value, "_fields") or (dataclasses.is_dataclass(value) and not isinstance(value, type)):
        names = value._fields if hasattr(value, "_fields") else [one.name for one in dataclasses.fields(value)]
        factors = {item.path[0]: item.quantity.factor for item in items_of(type(value)) if not item.path[1:]}
        parts = {key: _said(_scaled(getattr(value, key), factors.get(key, 1.0))) for key in names}
        if "channel" in parts and "interface" in parts:  # where the drive hangs is not what the drive is
            parts |= {"channel": "", "interface": ""}
        if type(value).__name__ == "EmgSettings":
            parts |= {"place": "", "wearer": "", "source": value.source if not value.recording else value.recording}
        return {"type": type(value).__name__} | parts
    if isinstance(value, list | tuple):
        return [_said(part) for part in value]
    if hasattr(value, "describe"):
        return {"type": type(value).__name__, "described": _said(value.describe())}
    return f"{value:.{_DIGITS}g}" if isinstance(value, float) else value


def _modules_said(value: LawFile | PlantFile) -> dict[str, Any]:
    """What a user's file imports, for the hash; nothing where it imports nothing of the user's own."""
    found = {one.file: hashlib.sha256(one.source).hexdigest() for one in value.modules}
    return {"modules": found} if found else {}


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        return tuple(part / factor for part in value)
    return value / factor if isinstance(value, float) else value


def unpacked(pack: bytes | Mapping[str, Any], known: Iterable[str]) -> Packed:
    """The fields of a rig from a document, or its bytes; what it leaves out is left out.

    Args:
        pack: what `packed` or `document` gave.
        known: names of all fields.

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
    remarks: list[str] = []
    values: dict[str, Any] = {}
    fields = tuple(known)
    if missing := [name for name in fields if name not in found and name not in (*OF_AXES, *OF_SOME)]:
        remarks.append(f"the packed rig has no {', '.join(missing)}: taken as the default bench has it")
    for name, given in found.items():
        if name in ("format", "software", "own_gains", "hash"):
            continue
        if name not in fields:
            remarks.append(f"the packed rig has {name}, which this version does not know and leaves out")
            continue
        with _understood(name, given):
            values[name] = _value(name, given, remarks)
    if "own_gains" in found:
        with _understood("own_gains", found["own_gains"]):
            law = values["law"]
            loaded = law.load() if isinstance(law, LawFile) else LAWS[law]
            values["law"] = loaded.with_gains(**found["own_gains"])
    return Packed(values, tuple(remarks))


@contextlib.contextmanager
def _understood(name: str, given: Any) -> Iterator[None]:
    """Whatever a foreign document holds in place of a part of a rig becomes one line.

    Raises:
        ParameterError: it is no such part.
    """
    try:
        yield
    except BowdenError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, zlib.error) as error:
        why = f"it has no {error.args[0]!r}" if isinstance(error, KeyError) else str(error)
        raise ParameterError(
            f"the packed rig's {name} is {said(given)}: {why}",
            expected="what Rig.pack or Rig.document gave",
            do="pack the rig again",
        ) from None


def _read(pack: bytes) -> Mapping[str, Any]:
    found = None
    with contextlib.suppress(ValueError, TypeError, RecursionError):
        found = json.loads(pack)
    if not isinstance(found, dict):
        raise ParameterError(
            f"Rig.unpack: {said(pack)} is not a packed rig",
            expected="what Rig.pack or Rig.document gives",
            do="read a rig.toml with Rig.read",
        )
    return found


def _value(name: str, given: Any, remarks: list[str]) -> Any:
    if name == "axes":
        return tuple((one["name"], one["rig"]) for one in given)
    if name == "pair":
        return _made(PairSettings, given, NO_PAIR, name, remarks)
    if name in PARTS:
        return _made(PARTS[name].kind, given, PARTS[name].default, name, remarks)
    if name == "drive":
        part = drive_part(given.get("family", DEFAULT_FAMILY))
        return _made(part.kind, given, part.default, name, remarks)
    if name == "cable":
        if "best" in given:
            return IdentifiedCable(
                given["best"],
                given["models"],
                given.get("file", ""),
                given.get("changed", {}),
                digest=given.get("digest", ""),
                counting=Counting(**given.get("counting", {})),
                covered=Covered(**given["covered"]) if "covered" in given else None,
                trust=Trust(given["trust"]["level"], tuple(given["trust"]["reasons"])) if "trust" in given else None,
            )
        return _made(BoucWen, given, BoucWen(), name, remarks)
    if name == "reference":
        if given["kind"] == "recorded":
            said = RecordedFile(**given["said"])
            return RecordedMotion(said, _numbers(given["time"]), _numbers(given["position"]))
        part = REFERENCES[given["kind"]]
        rest = {key: tuple(v) if isinstance(v, list) else v for key, v in given.items() if key != "kind"}
        return part.kind(**rest)
    if name == "bend":
        part = BENDS[given["kind"]]
        return _made(part.kind, {k: v for k, v in given.items() if k != "kind"}, part.default, name, remarks)
    if name == "law" and isinstance(given, Mapping):
        return LawFile(given["name"], given["path"], **user_file.read(given))
    if name == "plant" and given is not None:
        changed = tuple((key, float(value)) for key, value in given["changed"].items())
        return PlantFile(given["name"], given["path"], changed=changed, **user_file.read(given))
    return Gains(given) if name == "gains" else given


def _made(kind: Any, given: Mapping[str, Any], default: Any, name: str, remarks: list[str]) -> Any:
    """A NamedTuple of a kind from what `_plain` made of it; what another version called otherwise is remarked."""
    if not isinstance(given, Mapping) or (given and not set(given) & set(kind._fields)):
        raise ValueError(f"it has none of {', '.join(kind._fields)}")
    unknown = sorted(set(given) - set(kind._fields))
    missing = [one for one in kind._fields if one not in given]
    if unknown:
        remarks.append(f"{name} has {', '.join(unknown)}, which this version does not know and leaves out")
    if missing:
        remarks.append(f"{name} has no {', '.join(missing)}: taken as the default bench has it")
    hints, values = get_type_hints(kind), {}
    for key in kind._fields:
        if key not in given:
            continue
        value, hint = given[key], hints[key]
        inner = optional(hint) or hint
        if isinstance(value, Mapping) and hasattr(inner, "_fields"):
            value = _made(inner, value, getattr(default, key), f"{name}.{key}", remarks)
        elif isinstance(value, list):
            value = tuple(value)
        elif inner is float and isinstance(value, str):
            value = float(value)
        values[key] = value
    return kind(**values) if not missing else default._replace(**values)


def _numbers(text: str) -> NDArray[np.float64]:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype="<f8")
