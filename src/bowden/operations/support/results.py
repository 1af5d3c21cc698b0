"""A result: frozen, with the figures that are printed as JSON, and beside them what a view draws."""

import dataclasses
import enum
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar, get_args

from bowden.core.documented import Documented

if TYPE_CHECKING:
    from bowden.operations.support.operation import Operation
    from bowden.rig.rig import Rig


Value = TypeVar("Value")


@dataclass(frozen=True)
class Result(Documented, Generic[Value]):
    """Result of an operation.

    The fields after ``_: KW_ONLY`` are no part of the JSON: they are what views draw and Python gets.
    """

    _: KW_ONLY
    notes: tuple[str, ...] = ()
    """Notes for the user."""
    needless: tuple[str, ...] = ()
    """Those of the notes that the figures say too: they do not stand beside a JSON document."""
    interrupted: str = ""
    """What was done before an interruption, up to where it was written; empty where there was no interruption."""
    made: Value | None = None
    """What the function of ``import bowden`` returns, and what views draw; None for the result itself."""
    cable_trust: Any = None
    """Trust in the model of the cable; None where nothing says it."""

    @property
    def value(self) -> Value:
        """What the function of ``import bowden`` returns."""
        return self if self.made is None else self.made  # type: ignore[return-value]

    @property
    def whole_document(self) -> dict[str, Any] | None:
        """What is printed as JSON in place of the fields; None for these."""
        return None

    def interruption(self) -> KeyboardInterrupt:
        """What Python gets of an operation that was interrupted."""
        return KeyboardInterrupt()

    @property
    def exit_code(self) -> int:
        """Of the command: 0, or 1 where the result is a bad one."""
        return 0


@dataclass(frozen=True)
class TrustLevel(Documented):
    """Level of trust in a cable's model."""

    level: Literal["yes", "with care", "no"]
    reasons: tuple[str, ...]
    """The gravest first."""


def fields(kind: type) -> list[dataclasses.Field[Any]]:
    """The fields of a result's type that are figures."""
    return [one for one in dataclasses.fields(kind) if not one.kw_only]


def json_of(value: Any) -> Any:
    """A result, or a part of one, as JSON has it; a number that is not finite does not exist, and is None.

    >>> json_of((1.0, math.nan, Path("a")))
    [1.0, None, 'a']
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {one.name: json_of(getattr(value, one.name)) for one in fields(type(value))}
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, enum.Enum):
        return value.value
    if hasattr(value, "_asdict"):
        return json_of(value._asdict())
    if isinstance(value, Mapping):
        return {key: json_of(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [json_of(one) for one in value]
    return str(value) if isinstance(value, Path) else value


def schema_of(operation: "Operation") -> dict[str, Any]:
    """The JSON schema of what an operation prints with ``--json``."""
    from pydantic import ConfigDict, Field, TypeAdapter, create_model

    seconds = (float, Field(ge=0.0, description="Time of the whole command, compilation included [s]."))
    trust = (TrustLevel | None, Field(default=None, description="In the model of the cable, where it is not yes."))
    files = (list[str], Field(description="What was written; a page comes last."))
    models: list[Any] = []
    for kind in operation.results:
        if kind.whole_document is not Result.whole_document:  # type: ignore[attr-defined]
            continue
        said = _descriptions(kind)
        own: dict[str, Any] = {
            one.name: (one.type, Field(description=said.get(one.name) or None)) for one in fields(kind)
        }
        if operation.viewer("write"):
            own.setdefault("files", files)
        own.setdefault("trust", trust)
        own["seconds"] = seconds
        models.append(create_model(kind.__name__, __config__=ConfigDict(extra="forbid"), __doc__=kind.__doc__, **own))
    whole: Any = models[0]
    for other in models[1:]:
        whole = whole | other
    found = _plain(TypeAdapter(whole).json_schema(mode="serialization"))
    for part in {part for kind in operation.results for one in fields(kind) for part in _parts(one.type)}:
        properties = found.get("$defs", {}).get(part.__name__, {}).get("properties", {})
        for name, text in _descriptions(part).items():  # pydantic leaves out those of fields that are inherited
            if name in properties:
                properties[name].setdefault("description", " ".join(text.split()))
    return found | {"title": f"bowden {operation.words} --json"}


def _parts(hint: Any) -> Iterator[type]:
    """The dataclasses in a type, and in the types of their fields."""
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        yield hint
        yield from (part for one in fields(hint) for part in _parts(one.type))
    for inside in get_args(hint):
        yield from _parts(inside)


def _descriptions(kind: type) -> dict[str, str]:
    """Field of a class → the text under it, those that it inherits too."""
    import ast
    import inspect
    import textwrap

    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        if not dataclasses.is_dataclass(one):
            continue
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(one))).body
        body = tree.body if isinstance(tree, ast.ClassDef) else []
        for name, text in itertools.pairwise(body):
            if isinstance(name, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                found[ast.unparse(name.target)] = str(text.value.value)
    return found


def _plain(schema: Any) -> Any:
    """Without the titles that pydantic makes of names, and with each description on one line."""
    if isinstance(schema, list):
        return [_plain(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: _plain(part) for key, part in schema.items() if not (key == "title" and isinstance(part, str))}
    if isinstance(text := kept.get("description"), str):
        kept["description"] = " ".join(text.split())
    return kept


def degrees(angle: float | None) -> Any:
    """An angle in degrees; None where there is none."""
    return None if angle is None else float(angle * 180.0 / math.pi)


Part = TypeVar("Part")


def filled(kind: type[Part], source: Any, **known: Any) -> Part:
    """A part of a document: what is known, and of all other fields what stands in a source, its angles in degrees."""
    for name in {one.name for one in fields(kind)} - {*known}:
        angle = name.removesuffix("_deg")
        known[name] = (
            degrees(getattr(source, angle)) if angle != name and hasattr(source, angle) else getattr(source, name)
        )
    return kind(**known)


Found = TypeVar("Found", bound=Result[Any])


def trusted(found: Found, rigs: "Sequence[Rig]") -> Found:
    """A result with the trust in the cables of the rigs that it was made of, where it does not have it already."""
    known = [one for rig in rigs if (one := rig.cable_trust) is not None]
    if found.cable_trust is not None or not known:
        return found
    from bowden.plants.trust import least

    return dataclasses.replace(found, cable_trust=least(known))


def doubt(found: Any, rigs: "Sequence[Rig]") -> str:
    """A line where the trust is not *yes*: with all reasons where a rig is made, with the gravest where one is used.

    Args:
        found: what an operation gave, with ``cable_trust``; or anything else.
        rigs: that it was made of; none where it made one.
    """
    trust = getattr(found, "cable_trust", None)
    if trust is None or trust.level == "yes":
        return ""
    first, *others = trust.reasons or ("",)
    cables = [motor.rig.cable for rig in rigs if Path(rig.origin).suffix for motor in rig.parts]
    files = " and ".join(dict.fromkeys(filter(None, (getattr(one, "file", "") for one in cables))))
    where = f"[trust] of {files}" if files else "rig.cable_trust"  # of a rig that a program made
    short = first.partition(";")[0]
    more = f" (more: {where})" if others or short != first else ""
    return f"Trust in the cable's model: {f'{trust.level}: {short}{more}' if rigs else trust}"
