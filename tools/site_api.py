"""The pages of the Python API: which name is on which page. Their text is that of the docstrings."""

from typing import NamedTuple

import bowden


class Page(NamedTuple):
    """One page of the API."""

    title: str
    says: str
    """What is on it, in a line or two."""
    names: tuple[str, ...]
    """Names of `bowden.__all__`, in their order on the page."""
    beside: tuple[str, ...] = ()
    """Further things with their modules: what those names give, and what is not offered by `bowden` itself."""


PAGES = {
    "simulate": Page(
        "Simulate",
        "A law on a rig, and the trace that comes of it.",
        ("simulate", "Trace", "read_trace", "MinimumJerk"),
        ("bowden.records.metrics.Metrics",),
    ),
    "rig": Page(
        "Rig",
        "All that a run needs, as one frozen value, and the parts that it is made of.",
        ("Rig", "init", "Servo", "Motor", "Encoder", "BoucWen", "Sheath"),
        ("bowden.design.new_rig.NewRig",),
    ),
    "identify": Page(
        "Identify",
        "From a log of a cable to a model.",
        ("identify", "identify_servo", "read_log", "CableModel"),
        ("bowden.identify.cable.fit.Fit",),
    ),
    "design": Page(
        "Check and tune",
        "Whether gains hold on a rig, and gains that do.",
        ("check", "tune", "campaign"),
        (
            "bowden.design.check.Check",
            "bowden.design.tune.Tuning",
            "bowden.study.computed.Campaign",
        ),
    ),
    "live": Page(
        "Run live",
        "A law on a twin or on a drive, under the supervisor.",
        ("run",),
        ("bowden.live.session.Session",),
    ),
    "laws": Page(
        "Laws",
        "The laws that there are, and what a law of your own is made of.",
        ("LAWS", "Law", "Sample", "Reference", "kernel"),
        ("bowden.control.law_file.load",),
    ),
    "emg": Page(
        "EMG",
        "Rest and maximum contraction of a wearer, and how well contractions are found.",
        ("emg_calibrate", "emg_score"),
        ("bowden.design.contractions.Contractions",),
    ),
    "export": Page(
        "Export",
        "A law as C99.",
        ("export",),
        ("bowden.operations.export.Exported",),
    ),
    "plants": Page(
        "Plants and cables",
        "Cables of every kind as plants, and a plant of your own.",
        (),
        (
            "bowden.plants.bench.Bench",
            "bowden.plants.cable.Cable",
            "bowden.plants.cables.play",
            "bowden.plants.cables.stack",
            "bowden.plants.cable.bouc_wen",
            "bowden.plants.cables.identified",
            "bowden.plants.friction_cables.sliding",
            "bowden.plants.friction_cables.lumped",
            "bowden.plants.scheduled_cable.scheduled",
            "bowden.models.cable.capstan.Tendon",
            "bowden.models.cable.lumped_cable.LumpedTendon",
            "bowden.plants.user_plant.UserPlant",
            "bowden.sim.run.simulate",
        ),
    ),
    "errors": Page(
        "Errors",
        "What is raised: each says what was given, what was expected and what to do.",
        ("BowdenError",),
        (
            "bowden.core.errors.LogError",
            "bowden.core.errors.ParameterError",
            "bowden.core.errors.UnknownNameError",
            "bowden.core.errors.OutputError",
            "bowden.core.errors.DriveError",
            "bowden.core.errors.StreamError",
            "bowden.core.errors.SafetyError",
        ),
    ),
}
"""Name of the page → what is on it."""


def sources() -> dict[str, str]:
    """Each page's place in the site, and its text for mkdocstrings."""
    return {"api/index.md": _index()} | {f"api/{name}.md": _page(page) for name, page in PAGES.items()}


def _page(page: Page) -> str:
    homes = [(f"bowden.{name}", f"{bowden._HOMES[name]}.{name}") for name in page.names]
    beside = [(name.rpartition(".")[2], name) for name in page.beside]
    parts = [_entry(shown, home) for shown, home in [*homes, *beside]]
    return f"# {page.title}\n\n{page.says}\n\n" + "\n".join(parts)


def _entry(shown: str, home: str) -> str:
    note = "" if shown.startswith("bowden.") else f"\n*In `{home.rpartition('.')[0]}`.*\n"
    return f"::: {home}\n    options:\n      heading: {shown}\n      toc_label: {shown}\n{note}"


def _index() -> str:
    rows = [
        f"| [{page.title}]({name}.md) | {page.says} | {', '.join(f'`{one}`' for one in page.names) or '–'} |"
        for name, page in PAGES.items()
    ]
    return (
        "# Python API\n\n"
        "What `import bowden` offers, from the docstrings. [bowden in Python](../python.md) is the guide.\n\n"
        "Angles are in radians, all else in SI. A name that ends in `_deg` or `_ms` says otherwise.\n\n"
        "| page | for | names of `bowden` |\n|---|---|---|\n" + "\n".join(rows) + "\n"
    )
