"""The commented rig.toml of the default bench, made from its schema."""

import json
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from bowden.control import LAWS, Law
from bowden.core.quantity import meanings
from bowden.core.toml_text import with_keys
from bowden.rig.declaration import Section
from bowden.rig.families import DEFAULT, family_named
from bowden.rig.families import names as families
from bowden.rig.sections import BEND_KINDS, REFERENCE_KINDS, Control, EncodersSection, RigFile, drive_part

_HEAD = """\
# The bench of bowden, and how to run it: bowden simulate {name}
# The numbers are those of the paper's bench (Dinh et al., Robotics and Autonomous Systems 92, 2017), with what the
# paper leaves out as fitted in `bowden reproduce`. What you leave out is taken as it stands here.
# In a comment: the unit, the meaning, and the paper's symbol. Lines that begin with # are other choices.
"""


class Key(NamedTuple):
    """One key of the file."""

    name: str
    example: str
    """A value as it is written; the default where there is one."""
    default: str
    """The same, or what to say where there is none."""
    unit: str
    symbol: str
    meaning: str
    limits: str


def toml_text(name: str = "rig.toml", law: str = Control().law, drive: str = DEFAULT) -> str:
    """The commented rig.toml of the default bench; it says exactly what an empty file says, but for another law, and
    another family of drives with what a bench with one has.
    """
    parts, example = [_HEAD.format(name=name)], family_named(drive).example
    if drive != DEFAULT:
        parts[0] += f"# Its drive is of the family {drive}, and motor, servo and limits fit it: put in yours.\n"
    for title, (chosen, *others) in sections():
        given = dict(example.get(title, {})) | ({"family": drive} if title == "drive" and drive != DEFAULT else {})
        table = _table(title, drive_part(drive).section if title == "drive" else chosen, given)
        parts.append(_with_law(table, law) if title == "control" else table)
        if title != "drive":  # drives of other families are on the page
            parts += [_commented(f"Or, in place of that:\n{_table(title, other)}") for other in others]
        if title == "control":
            gains = [(f"{name} = {value!r}", meaning) for name, value, meaning in gains_of(LAWS[law])]
            parts.append(_commented(_aligned("[control.gains]", gains)))
    return "\n\n".join(part.rstrip() for part in parts) + "\n"


def with_drive(text: str, drive: str, where: str) -> str:
    """A rig.toml with a drive of another family, and what of motor, servo and limits a bench with one has.

    Args:
        text: of the file.
        drive: name of the family.
        where: the file, for messages.

    Raises:
        ParameterError: there is no such family.
        OutputError: a section is written in a form that cannot be changed.
    """
    given = {title: dict(keys) for title, keys in family_named(drive).example.items()}
    given["drive"] = {"family": drive} | given.get("drive", {})
    for title, keys in given.items():
        text = with_keys(text, title, {key: json.dumps(value) for key, value in keys.items()}, where)
    return text


def _with_law(table: str, law: str) -> str:
    """The section of the law with another one than a file without it has."""
    own = Control().law
    if law == own:
        return table
    before, after = (f'law = "{one}"' for one in (own, law))
    return table.replace(f"{before:<{len(after)}}", f"{after:<{len(before)}}", 1).replace(
        "found from this file", f"found from this file; {own} if left out", 1
    )


def gains_of(law: Law) -> list[tuple[str, float, str]]:
    """Name, value and meaning of each gain; the meaning is the text below the field in the law's source."""
    kind: Any = type(law.gains)
    found = meanings(kind)
    return [(name, value, found.get(name, "")) for name, value in law.gains._asdict().items()]


def sections() -> Iterator[tuple[str, list[type[Section]]]]:
    """Title and class of each section, in the order of the file; of one with several kinds, the default first."""
    for name, field in RigFile.model_fields.items():
        if name == "reference":
            yield name, list(REFERENCE_KINDS.values())
        elif name == "drive":
            yield name, [drive_part(family).section for family in families()]
        elif name == "encoder":
            for side, inner in EncodersSection.model_fields.items():
                yield f"{name}.{side}", [type(inner.default)]
        else:
            yield name, [type(field.default)]
    yield "scenario.bend", list(BEND_KINDS.values())


def keys_of(section: type[Section]) -> Iterator[Key]:
    """The keys of a section, but those that are sections of their own."""
    for name, field in section.model_fields.items():
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        if isinstance(field.default, Section) or name == "gains":
            continue  # a section of its own
        rules = {type(rule).__name__: rule for rule in field.metadata}
        limits = [f"{sign} {getattr(rules[rule], key):g}" for rule, key, sign in _RULES if rule in rules]
        optional = field.default is None
        example = json.dumps((field.examples or [field.default])[0], ensure_ascii=False)
        yield Key(
            name,
            example,
            "none" if optional else "must be given" if field.is_required() else example,
            str(extra.get("unit", "–")),
            str(extra.get("symbol", "")),
            field.description or "which of the kinds it is",
            ", ".join(limits),
        )


_RULES = (("Gt", "gt", ">"), ("Ge", "ge", "≥"), ("Lt", "lt", "<"), ("Le", "le", "≤"))


def _table(title: str, section: type[Section], given: Mapping[str, Any] = MappingProxyType({})) -> str:
    """A section of the file with its comments, and with the values that are given in place of the default ones."""
    rows = []
    for key in keys_of(section):
        if key.name in given:
            key = key._replace(example=json.dumps(given[key.name]), default="")
        unit = f"[{key.unit}] " if key.unit != "–" else ""
        symbol = f", {key.symbol}" if key.symbol else ""
        left = f"{key.name} = {key.example}"
        away = key.default == "none" or key.example == "{}"  # a table may have a section of its own further down
        rows.append((f"# {left}" if away else left, f"{unit}{key.meaning}{symbol}"))
    return _aligned(f"[{title}]  # {sentence(section)}", rows)


def own_text(head: str, given: Mapping[str, Mapping[str, Any]], notes: Mapping[str, str]) -> str:
    """A rig.toml with some sections and keys of them, each key with its unit and meaning.

    Args:
        head: comments above.
        given: section → key → value, as a file has it; a key that begins with # is shown as a comment. A section
            without keys is left out.
        notes: section, or section and key with a dot between → what is said of it in place of that.
    """
    known = {title: {key.name: key for key in keys_of(kinds[0])} for title, kinds in sections()}
    tables = []
    for title, keys in given.items():
        rows = []
        for name, value in keys.items():
            key = known.get(title, {}).get(name.removeprefix("# "))
            note = notes.get(f"{title}.{name.removeprefix('# ')}", "" if key is None else key.meaning)
            unit = "" if key is None or key.unit == "–" else f"[{key.unit}] "
            rows.append((f"{name} = {json.dumps(value, ensure_ascii=False)}", f"{unit}{note}"))
        if rows:
            tables.append(_aligned(f"[{title}]" + (f"  # {notes[title]}" if title in notes else ""), rows))
    return "\n\n".join([head.rstrip(), *tables]) + "\n"


def _aligned(head: str, rows: list[tuple[str, str]]) -> str:
    width = max(len(left) for left, _ in rows)
    lines = (f"{left:<{width}}  # {comment.rstrip('.')}" if comment else left for left, comment in rows)
    return "\n".join([head, *lines])


def _commented(text: str) -> str:
    return "\n".join(f"# {line}" for line in text.splitlines())


def sentence(section: type[Section]) -> str:
    """What a section is, on one line."""
    return " ".join((section.__doc__ or "").split())
