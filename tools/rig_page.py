"""The reference page of rig.toml, made from what the values in Python declare."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bowden.control import LAWS, Law
from bowden.control.knowledge import Knowledge
from bowden.core.files import write_text
from bowden.core.quantity import Quantity, meanings
from bowden.design.rig_of_bench import Key, gains_of, keys_of, sections, sentence
from bowden.rig.declaration import Section
from bowden.rig.motors import INDEPENDENT, MEANINGS, MOTOR
from bowden.rig.sections import JOINT

_GAINS = (
    "What `[control.gains]` may hold, with the law's own value. `*`: computed from the rig's servo, cable or encoders.",
    "",
    "A value comes from `[control.gains]`, else from the preset, else from the rig, else from the law. The rig gives",
    "`slope`, `width` and `doubt` only for an identified cable (`cable.model`). For a cable by hand it scales a law's",
    "own slope by `relative_slope`. Slopes are positive: a cable with a negative slope is counted the other way round.",
    "What a gain means stands in the law's file in [control/laws](../src/bowden/control/laws).",
)
_SEVERAL = (
    f"{MEANINGS[MOTOR].capitalize()} ([how](several_motors.md)).",
    "",
    f"At the head of the file: `{INDEPENDENT}`, {MEANINGS[INDEPENDENT]}.",
)


def markdown() -> str:
    """The reference page ``docs/rig.md``."""
    lines = [
        "# rig.toml",
        "",
        "Every key of a rig, with its default and, in brackets, its range. `bowden init` writes such a file. A default",
        "of none follows from the rest of the rig. The ending of a key is its unit: `_deg`, `_nm` for N·m,",
        "`_nms_per_rad` for N·m·s/rad. Gains are in SI units and radians, as is all in Python (`bowden.Rig`). Files",
        "are found from the folder of rig.toml. `bowden schema rig` prints all of this as a JSON schema.",
        "",
    ]
    made: dict[type[Section], str] = {}
    for title, variants in sections():
        lines += [f"## [{title}]", ""]
        if twin := made.get(variants[0]):
            lines += [f"As [{twin}].", ""]
            continue
        made[variants[0]] = title
        shared = _shared(variants)
        for section in variants:
            lines += [f"### {_which(section)}", ""] if len(variants) > 1 else []
            lines += [sentence(section), "", *_rows(key for key in keys_of(section) if _said(key) not in shared), ""]
        if shared:
            keys = {_said(key): key for key in _keys(variants)}
            lines += [f"### Common to several kinds of [{title}]", ""]
            lines += [*_rows(_told_apart(keys[one], shared, variants) for one in shared), ""]
    lines += ["## [[motor]]", "", *_SEVERAL, ""]
    lines += ["## [[joint]]", "", sentence(JOINT.section), "", *_rows(keys_of(JOINT.section)), ""]
    lines += ["## Gains of the laws", "", *_GAINS, "", "law | gains", "---|---"]
    lines += [f"`{law.name}` | {', '.join(_gains(law))}{_presets(law)}" for law in LAWS.values()]
    lines += ["", "### What a rig knows", "", "For `FROM_RIG` of [your own law](own_law.md#your-own-law-in-a-file)."]
    lines += ["", "name | meaning", "---|---"]
    lines += [f"`{name}` | {meaning.split(';')[0].rstrip('.')}" for name, meaning in meanings(Knowledge).items()]
    return "\n".join([*lines, ""])


def _keys(variants: Iterable[type[Section]]) -> Iterator[Key]:
    """The keys of all variants of a section, but the one that tells them apart."""
    return (key for section in variants for key in keys_of(section) if key.name not in ("kind", "family"))


def _shared(variants: Sequence[type[Section]]) -> list[Key]:
    """Keys that several variants of a section have in the same words, without default and range where these differ."""
    counted = Counter(_said(key) for key in _keys(variants))
    return [key for key, count in counted.items() if count > 1]


def _told_apart(key: Key, shared: Sequence[Key], variants: Sequence[type[Section]]) -> Key:
    """A key with the variants that have it so, where others have it otherwise."""
    if sum(one.name == key.name for one in shared) == 1:
        return key
    who = [section for section in variants if _said(key) in map(_said, keys_of(section))]
    names = ", ".join(_which(one).rpartition(" ")[2].strip('"') for one in who)
    return key._replace(meaning=f"({names}) {key.meaning}")


def _said(key: Key) -> Key:
    """A key with what the page says of it."""
    return key._replace(example="", symbol="")


def _rows(keys: Iterable[Key]) -> Iterator[str]:
    """A table, one row a key."""
    rows = [f"`{key.name}` {_value(key)} | {_meaning(key)}" for key in keys if key.name not in ("kind", "family")]
    return iter(["key, default (range) | meaning", "---|---", *rows] if rows else [])


def _value(key: Key) -> str:
    """Default, and range in brackets."""
    default = rounded(key.default)
    return f"{default} ({_range(key.limits)})" if key.limits else default


def _range(limits: str) -> str:
    """A range as ``0…10``, or ``>0…10`` where the end is no part of it.

    >>> _range("> 0, ≤ 10"), _range("≥ -1"), _range("≥ 0, < 1")
    ('>0…10', '≥-1', '0…<1')
    """
    ends = [end.replace(" ", "") for end in limits.split(", ")]
    return "…".join(end.lstrip("≥≤") for end in ends) if len(ends) == 2 else ends[0]


def _meaning(key: Key) -> str:
    """The meaning, with the symbol and the unit that the key's ending does not say."""
    ending = Quantity("", shown=key.unit).named("")
    unit = "" if key.unit == "–" or (ending and key.name.endswith(ending)) else f" [{key.unit}]"
    return f"{key.meaning}{f' ({key.symbol})' if key.symbol else ''}{unit}"


def _gains(law: Law) -> Iterator[str]:
    """The gains of a law with their own values."""
    for name, value, _ in gains_of(law):
        yield f"`{name}={value:g}`{'*' if name in law.from_rig else ''}"


def _presets(law: Law) -> str:
    return f"; presets {', '.join(law.presets)}" if law.presets else ""


def rounded(default: str) -> str:
    """A default as the page shows it: of a number with many digits six."""
    try:
        short = f"{float(default):.6g}"
    except ValueError:
        return default
    return short if len(short) < len(default) - 2 else default


def write_docs(docs: Path) -> None:
    """Write the page where it belongs.

    Raises:
        OutputError: the file cannot be written.
    """
    write_text(docs / "rig.md", markdown())


def _which(section: type[Section]) -> str:
    """The key that tells a section from others of its title, with its value."""
    key = "kind" if "kind" in section.model_fields else "family"
    return f"{key} = {json.dumps(section.model_fields[key].default)}"
