"""What is written about rig.toml, made from its schema: the commented default, the reference page, the JSON schema."""

import ast
import inspect
import json
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from bowden.control import LAWS, Law
from bowden.control.knowledge import Knowledge
from bowden.core.files import whole_file
from bowden.rig.declaration import Section
from bowden.rig.sections import BEND_KINDS, REFERENCE_KINDS, Control, EncodersSection, RigFile

_HEAD = """\
# The bench of bowden, and how to run it: bowden simulate {name}
# The numbers are those of the paper's bench (Dinh et al., Robotics and Autonomous Systems 92, 2017), with what the
# paper leaves out as fitted in `bowden reproduce`. What you leave out is taken as it stands here.
# In a comment: the unit, the meaning, and the paper's symbol. Lines that begin with # are other choices.
"""


_GAINS = (
    "What `[control.gains]` may hold, with the law's own values.",
    "",
    "- What the rig gives a law comes first (the column *from the rig*), then the preset, then `[control.gains]`. What",
    "  a preset leaves as the law's own comes from the rig. Every command that runs a law goes by this.",
    "- `slope`, `width` and `doubt` come from the rig where its cable was identified (`cable.model`);",
    "  `cable.…` always.",
    "- The uncompensated law takes only the motor angle at which the joint is at zero: encoders that are not zeroed",
    "  together are no backlash. Its slope stays 1, as in the paper; set it where the joint is geared.",
    "- A cable whose slope is negative is counted the other way round, so these slopes are positive.",
    "- The observer's preset `paper` is that of Table 1: it knows the default bench's cable less well than it is.",
)


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


def toml_text(name: str = "rig.toml") -> str:
    """The commented rig.toml of the default bench; it says exactly what an empty file says."""
    parts = [_HEAD.format(name=name)]
    for title, (chosen, *others) in _sections():
        parts.append(_table(title, chosen))
        parts += [_commented(f"Or, in place of that:\n{_table(title, other)}") for other in others]
        if title == "control":
            gains = [(f"{name} = {value!r}", meaning) for name, value, meaning in gains_of(LAWS[Control().law])]
            parts.append(_commented(_aligned("[control.gains]", gains)))
    return "\n\n".join(part.rstrip() for part in parts) + "\n"


def markdown() -> str:
    """The reference page ``docs/rig.md``."""
    lines = [
        "# rig.toml",
        "",
        "Written by `bowden init`, read by every command that takes a rig. This page is made from what the values in",
        "Python declare, by `make docs`; the schema for machines is [rig.schema.json](json/rig.schema.json). A key",
        "that is left out has its default, and files are found from the folder of rig.toml. Angles are in degrees",
        "here, gains in SI units and radians; in Python (`bowden.rig.rig.Rig`) everything is in SI and radians.",
        "",
    ]
    for title, variants in _sections():
        lines += [f"## [{title}]", ""]
        for section in variants:
            lines += [f'### kind = "{section.model_fields["kind"].default}"', ""] if len(variants) > 1 else []
            lines += [_sentence(section), "", "| key | default | unit | range | symbol | meaning |", "|---" * 6 + "|"]
            lines += [
                f"| `{key.name}` | {key.default} | {key.unit} | {key.limits} | {key.symbol} | {key.meaning} |"
                for key in keys_of(section)
            ]
            lines.append("")
    lines += ["## Gains of the laws", "", *_GAINS, "", "| what a rig knows | meaning |", "|---|---|"]
    lines += [f"| `{name}` | {meaning} |" for name, meaning in _meanings(Knowledge).items()]
    lines.append("")
    for law in LAWS.values():
        lines += [f"### {law.name}", "", f"Presets: {', '.join(law.presets) or 'none'}. Source: {law.source}.", ""]
        lines += ["| gain | default | from the rig | meaning |", "|---|---|---|---|"]
        lines += [
            f"| `{name}` | {value:g} | {_from_rig(law, name)} | {meaning} |" for name, value, meaning in gains_of(law)
        ]
        lines.append("")
    return "\n".join(lines)


def json_schema() -> str:
    """``docs/json/rig.schema.json``."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema"} | RigFile.model_json_schema()
    return json.dumps(schema, ensure_ascii=False, indent=2) + "\n"


def write_docs(docs: Path) -> None:
    """Write the page and the schema where they belong.

    Raises:
        OutputError: a file cannot be written.
    """
    for path, text in ((docs / "rig.md", markdown()), (docs / "json" / "rig.schema.json", json_schema())):
        with whole_file(path) as part:
            part.write_text(text, encoding="utf-8")


def gains_of(law: Law) -> list[tuple[str, float, str]]:
    """Name, value and meaning of each gain; the meaning is the text below the field in the law's source."""
    found = _meanings(type(law.gains))
    return [(name, value, found.get(name, "")) for name, value in law.gains._asdict().items()]


def _meanings(kind: type) -> dict[str, str]:
    """Field of a NamedTuple → the text below it in its source."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    assert isinstance(tree, ast.ClassDef)
    meanings = {}
    for field, text in zip(tree.body, tree.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr):
            meanings[field.target.id] = " ".join(str(ast.literal_eval(text.value)).split())
    return meanings


def _from_rig(law: Law, gain: str) -> str:
    """What of the rig a gain takes, as `bowden.control.knowledge.Knowledge` has it; of a function its first line."""
    what = law.from_rig.get(gain)
    if callable(what):
        return " ".join((what.__doc__ or what.__name__).split(".")[0].split())
    return "" if what is None else f"`{what}`"


def _sections() -> Iterator[tuple[str, list[type[Section]]]]:
    """Title and class of each section, in the order of the file; of one with several kinds, the default first."""
    for name, field in RigFile.model_fields.items():
        if name == "reference":
            yield name, list(REFERENCE_KINDS.values())
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


def _table(title: str, section: type[Section]) -> str:
    """A section of the file with its comments."""
    rows = []
    for key in keys_of(section):
        unit = f"[{key.unit}] " if key.unit != "–" else ""
        symbol = f", {key.symbol}" if key.symbol else ""
        left = f"{key.name} = {key.example}"
        rows.append((f"# {left}" if key.default == "none" else left, f"{unit}{key.meaning}{symbol}"))
    return _aligned(f"[{title}]  # {_sentence(section)}", rows)


def _aligned(head: str, rows: list[tuple[str, str]]) -> str:
    width = max(len(left) for left, _ in rows)
    return "\n".join([head, *(f"{left:<{width}}  # {comment.rstrip('.')}" for left, comment in rows)])


def _commented(text: str) -> str:
    return "\n".join(f"# {line}" for line in text.splitlines())


def _sentence(section: type[Section]) -> str:
    return " ".join((section.__doc__ or "").split())
