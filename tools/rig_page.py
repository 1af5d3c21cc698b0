"""The reference page of rig.toml, made from what the values in Python declare."""

import json
from pathlib import Path

from bowden.control import LAWS, Law
from bowden.control.knowledge import Knowledge
from bowden.core.files import write_text
from bowden.core.quantity import meanings
from bowden.design.rig_of_bench import gains_of, keys_of, sections, sentence
from bowden.rig.declaration import Section
from bowden.rig.motors import INDEPENDENT, MEANINGS, MOTOR
from bowden.rig.sections import JOINT

_GAINS = (
    "What `[control.gains]` may hold, with the law's own values.",
    "",
    "- What the rig gives a law comes first (the column *from the rig*), then the preset, then `[control.gains]`. What",
    "  a preset leaves as the law's own comes from the rig. Every command that runs a law goes by this.",
    "- `slope`, `width` and `doubt` come from the rig where its cable was identified (`cable.model`);",
    "  `cable.…` always. On a cable by hand a law's own slope is multiplied by `relative_slope`.",
    "- The uncompensated law takes the motor angle at which the joint is at zero, and the ratio of the pulleys, 1 on",
    "  the paper's bench: neither zeros nor pulleys are backlash.",
    "- A cable whose slope is negative is counted the other way round, so these slopes are positive.",
    "- The observer's preset `paper` is that of Table 1: it knows the default bench's cable less well than it is.",
)


_SEVERAL = (
    f"Several motors in one loop ([how](several_motors.md)): {MEANINGS[MOTOR]}.",
    "Each `[[motor]]` has the key `name`, `joint` where others move its joint too, those of `[motor]`, and may repeat",
    "any other section above as `[motor.SECTION]`.",
    "",
    f"At the head of the file, `{INDEPENDENT} = true`: {MEANINGS[INDEPENDENT]}.",
)


def markdown() -> str:
    """The reference page ``docs/rig.md``."""
    lines = [
        "# rig.toml",
        "",
        "Written by `bowden init`, read by every command that takes a rig. A key that is left out has its default,",
        "shown here with at most six digits. Files are found from the folder of rig.toml. Angles are in degrees here,",
        "gains in SI units and radians; in Python (`bowden.Rig`) everything is in SI and radians. `make docs` makes",
        "this page from the code; `bowden schema rig` prints a JSON schema of the same.",
        "",
    ]
    for title, variants in sections():
        lines += [f"## [{title}]", ""]
        for section in variants:
            lines += [f"### {_which(section)}", ""] if len(variants) > 1 else []
            lines += [sentence(section), "", "| key | default | unit | range | symbol | meaning |", "|---" * 6 + "|"]
            lines += [
                f"| `{key.name}` | {rounded(key.default)} | {key.unit} | {key.limits} | {key.symbol} | {key.meaning} |"
                for key in keys_of(section)
            ]
            lines.append("")
    lines += ["## [[motor]]", "", *_SEVERAL, ""]
    lines += ["## [[joint]]", "", sentence(JOINT.section), "", *_joint_rows(), ""]
    lines += ["## Gains of the laws", "", *_GAINS, "", "| what a rig knows | meaning |", "|---|---|"]
    lines += [f"| `{name}` | {meaning} |" for name, meaning in meanings(Knowledge).items()]
    lines.append("")
    for law in LAWS.values():
        lines += [f"### {law.name}", "", f"Presets: {', '.join(law.presets) or 'none'}. Source: {law.source}.", ""]
        lines += ["| gain | default | from the rig | meaning |", "|---|---|---|---|"]
        lines += [
            f"| `{name}` | {value:g} | {_from_rig(law, name)} | {meaning} |" for name, value, meaning in gains_of(law)
        ]
        lines.append("")
    return "\n".join(lines)


def rounded(default: str) -> str:
    """A default as the page shows it: of a number with many digits six."""
    try:
        short = f"{float(default):.6g}"
    except ValueError:
        return default
    return short if len(short) < len(default) - 2 else default


def _joint_rows() -> list[str]:
    """The keys of [[joint]], which stands beside [[motor]]."""
    head = ["| key | default | unit | range | symbol | meaning |", "|---" * 6 + "|"]
    return head + [
        f"| `{key.name}` | {rounded(key.default)} | {key.unit} | {key.limits} | {key.symbol} | {key.meaning} |"
        for key in keys_of(JOINT.section)
    ]


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


def _from_rig(law: Law, gain: str) -> str:
    """What of the rig a gain takes, as `bowden.control.knowledge.Knowledge` has it; of a function its first line."""
    what = law.from_rig.get(gain)
    if callable(what):
        return " ".join((what.__doc__ or what.__name__).split(".")[0].split())
    return "" if what is None else f"`{what}`"
