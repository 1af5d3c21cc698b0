"""`league`: every law on every plant in every scenario, with one set of gains for each law."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from bowden.control import LAWS, Law, user_law
from bowden.core import arguments, shown
from bowden.core.errors import ParameterError, near
from bowden.design import league as design
from bowden.design import league_cells, league_identified
from bowden.design.league import Cell, Played, Standing
from bowden.design.league_cells import LeaguePlant, LeagueScenario
from bowden.face import given
from bowden.face.given import GivenLaw, GivenRig
from bowden.face.progress import GivenProgress, Progress, reported
from bowden.plants.bench import Bench
from bowden.plants.cables import as_cable_plant
from bowden.rig.presets.bench import moved_sheath
from bowden.rig.rig import Rig
from bowden.rig.sections import DEFAULT_CABLE, DEFAULT_WIDTH
from bowden.sim.scenario import constant_bend

OWN = "rig"
"""What the rig's own plant is called in the league."""


@dataclass(frozen=True, repr=False)
class League:
    """A league that was played."""

    rig: str
    """Hash of the rig whose servo, motor, encoders and clock the plants have."""
    played: tuple[Played, ...]
    """Every cell with how its error went, in the order in which it was played."""
    scenarios: tuple[LeagueScenario, ...]
    """Those that were to be played."""
    notes: tuple[str, ...]
    """What was left out."""
    interrupted: bool
    """Whether it was broken off."""

    @property
    def cells(self) -> tuple[Cell, ...]:
        """What each law did in each scenario on each plant."""
        return tuple(one.cell for one in self.played)

    @property
    def standings(self) -> list[Standing]:
        """The laws from best to worst."""
        return design.standings(self.cells)

    def __repr__(self) -> str:
        """One screen: the ranking."""
        return shown.screen(self._title(), self._rows())

    def _repr_html_(self) -> str:
        return shown.fragment(self._title(), self._rows())

    def _title(self) -> str:
        plants = len({cell.plant for cell in self.cells})
        return f"League of {len(self.standings)} laws on {plants} plants in {len(self.scenarios)} scenarios"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for one in self.standings:
            error = "" if one.rmse_deg is None else f"median RMSE {one.rmse_deg:.3g}°"
            unstable = f"{one.unstable} unstable" if one.unstable else ""
            rows.append((one.law, shown.listed((f"{100.0 * one.won:.0f} % of the cells won", error, unstable))))
        return [*rows, ("rig", self.rig)]


def league(
    rig: GivenRig | None = None,
    laws: Sequence[GivenLaw] | None = None,
    *,
    plants: Sequence[str] | None = None,
    scenarios: Sequence[str] | None = None,
    data: str | Path | None = None,
    progress: GivenProgress = None,
) -> League:
    """Compare laws, each with one set of gains, on plants for which they were not tuned.

    Args:
        rig: a `Rig`, or the path of a rig.toml or of a log. All plants get its servo, motor, encoders and clock. Its
            own plant is ``rig``, and its law has the rig's gains. If left out: the paper's bench, as ``bench``.
        laws: keys of `LAWS`, ``FILE.py:NAME`` or `Law`; all of `LAWS` by default, and the rig's.
        plants: names of docs/league.md, ``rig``, or ``FILE.py:NAME`` of your own; all but your own by default.
        scenarios: names of docs/league.md; all by default.
        data: folder with recordings, ``cable/*.csv.gz`` and ``elbow/*.csv.gz``; without it there are fewer cells.
        progress: True for a line that says how far it is, or a function of what is being done and the share done.

    Raises:
        ParameterError: a rig, law, plant or scenario that cannot be used.

    >>> found = league(laws=["uncompensated"], plants=["bench"], scenarios=["fast"])
    >>> [round(cell.rmse_deg, 1) for cell in found.cells]
    [6.2]
    """
    whole = None if rig is None else given.rig_of(rig, "league")
    named = {"laws": laws, "plants": plants, "scenarios": scenarios}
    for name, value in named.items():
        if value is not None and (isinstance(value, str | Path | Law) or not isinstance(value, Sequence)):
            do = f'league({name}=["{value}"])' if isinstance(value, str | Path) else f"league({name}=[…])"
            raise ParameterError(f"league: {name} is {arguments.said(value)}", expected="a list", do=f"write {do}")
    for name in ("plants", "scenarios"):
        for i, one in enumerate(named[name] or ()):
            arguments.text(one, f"league: {name}[{i}]", "a name of docs/league.md")
    folder = None if data is None else arguments.path_of(data, "league: data", "folder")
    with given.in_words_of_python(), reported(progress, "league") as report:
        found = played(whole, laws, plants=plants or (), scenarios=scenarios or (), data=folder, progress=report)
    given.tell(found.notes)
    if found.interrupted:
        raise KeyboardInterrupt
    return found


def played(
    rig: Rig | None,
    laws: Iterable[GivenLaw] | None,
    *,
    own_laws: Iterable[str] = (),
    plants: Sequence[str],
    scenarios: Sequence[str],
    data: Path | None,
    progress: Progress,
    begin: Callable[[], object] = lambda: None,
) -> League:
    """The league; an interruption ends it with what has been played.

    Args:
        rig: see `league`.
        laws: likewise; all of `LAWS` and the rig's where it is None.
        own_laws: further ones, ``FILE.py:NAME``.
        plants: those that are wanted; all where it is empty.
        scenarios: likewise.
        data: see `league`.
        progress: likewise.
        begin: called before the first cell is played, when all that was asked for is known to be there.

    Raises:
        ParameterError: see `league`.
    """
    base = Rig() if rig is None else rig
    entered = _entered(base, laws, own_laws)
    makers, notes = _plants(base, rig is not None, data)
    makers |= _own_plants(base, plants, makers)
    known, more = _scenarios(data)
    chosen, motions = _chosen("plant", makers, plants), _chosen("scenario", known, scenarios)
    begin()
    found: list[Played] = []
    interrupted = False
    try:
        for cell in design.play(entered, chosen, motions, progress, guard=user_law.explained):
            found.append(cell)
    except KeyboardInterrupt:
        interrupted = True
    return League(base.hash, tuple(found), tuple(motions), (*base.notes, *notes, *more), interrupted)


def _entered(rig: Rig, laws: Iterable[GivenLaw] | None, own: Iterable[str]) -> list[Law]:
    """The laws that play, the rig's with what the rig gives it."""
    named: list[GivenLaw] = list(LAWS) if laws is None else list(laws)
    found: dict[str, Law] = {}
    for one in [*named, *own]:
        ready = given.under(rig, one, None, "league").chosen_law
        if ready.name in found:
            raise ParameterError(
                f"{arguments.said(one)}: there is a law {ready.name!r} already", do="give yours another name"
            )
        found[ready.name] = ready
    if laws is None and rig.law_name not in found and rig.chosen_law.name not in found:
        found[rig.chosen_law.name] = rig.chosen_law
    return list(found.values())


def _chosen(what: str, known: Mapping[str, Any], wanted: Sequence[str]) -> list[Any]:
    """Those of `known` that are wanted, in the order of `known`; all where nothing is wanted.

    Raises:
        ParameterError: one that is not known.
    """
    for name in wanted:
        if name not in known:
            raise ParameterError(
                f"there is no {what} {name!r} in the league", expected=near(str(name), known), do="name one of them"
            )
    return [value for name, value in known.items() if not wanted or name in wanted]


def _plants(rig: Rig, own: bool, data: Path | None) -> tuple[dict[str, Callable[[], LeaguePlant]], list[str]]:
    """Plant → what makes it, and notes; the rig's own among them where a rig was given."""
    makers: dict[str, Callable[[], LeaguePlant]] = {}
    if own:
        makers[OWN] = partial(_plant_of, rig, OWN, "the rig's own plant")
    paper = rig.replace(plant=None, cable=DEFAULT_CABLE, width=DEFAULT_WIDTH).bench
    for one in league_cells.plants(paper, moved_sheath()):
        makers[one.name] = partial(_itself, one)
    files = [] if data is None else sorted((data / "cable").glob("*.csv.gz"))
    logs = {file.name.removesuffix(".csv.gz"): file for file in files}
    base = as_cable_plant(paper)
    for name in league_identified.names(logs):
        makers[name] = partial(league_identified.identified_plant, base, name, logs)
    missing = f"no cable logs in {data}/cable, so no plant that was identified from one"
    return makers, [] if logs or data is None else [missing]


def _plant_of(rig: Rig, name: str, what: str) -> LeaguePlant:
    """What a rig moves, as the league uses it."""
    plant = rig.moved
    return LeaguePlant(
        name,
        what,
        as_cable_plant(plant) if isinstance(plant, Bench) else plant,
        rig.bend_path if name == OWN else constant_bend(plant.sheath.bend),
        known=rig.knowledge,
    )


def _own_plants(rig: Rig, wanted: Sequence[str], others: Iterable[str]) -> dict[str, Callable[[], LeaguePlant]]:
    """The user's own plants among those that are wanted, with the rig's servo, motor, encoders and clock.

    Raises:
        ParameterError: one that cannot be used, or has the name of another one of the league.
    """
    found: dict[str, Callable[[], LeaguePlant]] = {}
    names = set(others) & set(wanted)
    for name in dict.fromkeys(wanted):
        if user_law.is_file(name):
            bare = {"suit": rig.suit._replace(worn=False), "admittance": rig.admittance._replace(enabled=False)}
            own = rig.replace(plant=name, cable=DEFAULT_CABLE, width=DEFAULT_WIDTH, **bare)
            plant = own.own_plant
            if plant.name in names:
                raise ParameterError(
                    f"{arguments.said(name)}: there is a plant {plant.name!r} already", do="give yours another name"
                )
            names.add(plant.name)
            what = f"a plant of your own, from {plant.path.name}"
            found[name] = partial(_plant_of, own, plant.name, what)
    return found


def _itself(plant: LeaguePlant) -> LeaguePlant:
    return plant


def _scenarios(data: Path | None) -> tuple[dict[str, LeagueScenario], list[str]]:
    """Scenario by name, and notes."""
    files = [] if data is None else sorted((data / "elbow").glob("*.csv.gz"))
    notes: list[str] = []
    if files:
        from bowden.rig.recorded import read_motion
        from bowden.rig.sections import RecordedFile

        said = RecordedFile(files[0].name, position_column="elbow_deg")
        found = league_cells.scenarios(read_motion(said, files[0].parent).motion)
    else:
        found = league_cells.scenarios()
        notes = [] if data is None else [f"no recording in {data}/elbow, so no scenario of an elbow"]
    return {one.name: one for one in found}, notes
