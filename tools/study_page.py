"""The tables of docs/campaign.md, made from what a study declares."""

import json
from pathlib import Path

import made_tables
from bowden.core.files import write_text
from bowden.design.rig_of_bench import keys_of
from bowden.rig.declaration import Section
from bowden.study.distributions import WANTED
from bowden.study.rows import FIGURES, SUIT_FIGURES
from bowden.study.schema import DistributionSection, FaultSection, KnownSection, StudyFile
from bowden.study.study import SENSOR_FAULTS

_SECTIONS: dict[str, type[Section]] = {"": StudyFile, "[known]": KnownSection, "[fault]": FaultSection}


def keys_table() -> str:
    """Every key of a study but its sections."""
    rows = ["| section | key | default | unit | range | meaning |", "|---" * 6 + "|"]
    for title, section in _SECTIONS.items():
        for key in keys_of(section):
            default = "1" if title == "[known]" else key.default
            rows.append(f"| {title} | `{key.name}` | {default} | {key.unit} | {key.limits} | {key.meaning} |")
    return "\n".join(rows)


def distributions_table() -> str:
    """Every kind of distribution."""
    rows = ["| kind | takes | example |", "|---|---|---|"]
    for name, field in DistributionSection.model_fields.items():
        if name in WANTED:
            example = json.dumps((field.examples or [""])[0])
            bounds = ", low = 0.8, high = 1.2" if name == "normal" else ""
            rows.append(f"| `{name}` | {WANTED[name]} | `{{ {name} = {example}{bounds} }}` |")
    return "\n".join(rows)


def figures_table() -> str:
    """Every figure of a row."""
    rows = ["| column | unit | meaning |", "|---|---|---|"]
    suits = {name: (unit, f"{meaning}; where a suit is worn") for name, (unit, meaning) in SUIT_FIGURES.items()}
    for name, (unit, meaning) in (FIGURES | suits).items():
        rows.append(f"| `{name}` | {unit} | {meaning.replace('|', chr(92) + '|')} |")
    return "\n".join(rows)


def faults_list() -> str:
    """The sensor faults."""
    return ", ".join(f"`{name}`" for name in ("nothing", *SENSOR_FAULTS))


def with_tables(page: str) -> str:
    """The page with what stands between its markers made anew."""
    tables = {
        "keys": keys_table(),
        "distributions": distributions_table(),
        "faults": faults_list(),
        "figures": figures_table(),
    }
    return made_tables.with_tables(page, tables)


def write_docs(docs: Path) -> None:
    """Write the tables where they belong.

    Raises:
        OutputError: a file cannot be written.
    """
    page = docs / "campaign.md"
    write_text(page, with_tables(page.read_text(encoding="utf-8")))
