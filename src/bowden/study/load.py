"""Reading and checking a study, so that what cannot be is refused before anything begins."""

from pathlib import Path
from typing import Any

from bowden.control import Law
from bowden.control.law_file import LawFile, loaded, named, packable
from bowden.core.errors import ParameterError
from bowden.rig.config import checked_file, read_toml
from bowden.rig.rig import Rig
from bowden.study.distributions import Value
from bowden.study.file import LONGEST, read_study
from bowden.study.keys import missing_for, nearest, numeric_keys, plant_keys, simulated, with_values
from bowden.study.study import SENSOR_FAULTS, Column, Study

_TRIED = 100
"""Runs that are put together before any of them begins, so that most mistakes show at once."""


def load(path: Path, over: Rig | None = None, *, own_law: bool = False) -> Study:
    """Read a study, and put its first runs together, so that what cannot be is refused before anything begins.

    Args:
        path: of the study.
        over: a rig for a study that names none, or names the file from which that rig was read.
        own_law: take that rig's law in place of the study's laws.

    Raises:
        ParameterError: a file, key, distribution or value that cannot be used.
    """
    file, spreads = read_study(path)
    own = path.parent / file.rig if file.rig else None
    if over is not None and own is not None and not _same_file(own, Path(over.origin)):
        raise ParameterError(
            f"{path}: its rig is {file.rig!r}, and the given one {over.origin}",
            expected="the same file, or a study without a rig",
            do="delete rig there, or give that file",
        )
    rig_path = own or path if over is None else Path(over.origin)
    duration = {"duration": file.duration_s} if file.duration_s else {}
    rig = (_changed(own, file.set, path) if over is None else _set_in(over, file.set, path)).replace(**duration)
    if over is not None:
        file = file.model_copy(update={"rig": over.origin} | ({"laws": [rig.law_name]} if own_law else {}))
    if rig.emg.source is not None:
        raise ParameterError(
            f"{path}: its rig goes by EMG, emg.source is {rig.emg.source!r}",
            expected="a rig that goes by [reference]",
            do="delete emg.source, or copy the rig without it",
        )
    given: tuple[str | LawFile, ...]
    if own_law:
        rig, own_one = _law_by_name(rig)
        given = (own_one,)
    else:
        given = tuple(named(name, path.parent) for name in file.laws)
    laws = tuple(loaded(law) for law in given)
    names = [law.name for law in laws]
    if len(set(names)) < len(names):
        raise ParameterError(f"{path}: laws has two of one name: {', '.join(names)}", do="name each law once")
    known = numeric_keys(rig.tree()) | plant_keys(rig)
    known |= {f"control.gains.{gain}": "–" for law in laws for gain in law.numbers}
    for key in file.vary:
        if key not in known:
            raise ParameterError(
                f"{path}: vary has the unknown key {key!r}", expected=nearest(key, known), do="rename or delete it"
            )
        if (missing := missing_for(key, rig)) is not None:
            raise ParameterError(
                f"{path}: vary has {key!r}, which changes nothing here", expected=missing, do="add that to [set]"
            )
    columns = tuple(Column(name, _unit(name, known), spread) for name, spread in spreads.items())
    study = Study(path, file, rig, given, columns)
    if rig.pushing is not None and "suit.drive_integral_per_s" not in file.vary:
        try:  # where it is varied, each run says which
            rig.pushing.refuse_integral()
        except ParameterError as error:
            where = path if "suit.drive_integral_per_s" in file.set else rig_path
            raise ParameterError(f"{where}: {error.what}", expected=error.expected, do=f"{error.do} there") from error
    for column in columns:
        _check_ends(study, column)
    for number in range(min(file.runs, _TRIED)):
        study.run(number)
    return study


def _unit(name: str, known: dict[str, str]) -> str:
    return "s" if name in ("fault.begin_s", "fault.length_s") else known.get(name, "–")


def _same_file(one: Path, other: Path) -> bool:
    return one.exists() and other.exists() and one.samefile(other)


def _law_by_name(rig: Rig) -> tuple[Rig, str | LawFile]:
    """A rig whose law is a name or a file, so that its runs can be made anywhere, and that law.

    Raises:
        ParameterError: a law of this process alone.
    """
    if not isinstance(rig.law, Law):
        return rig, rig.law
    law, chosen = packable(rig.law)
    return rig.replace(law=law, preset=rig.preset, gains={**chosen, **rig.gains}), law


def _set_in(rig: Rig, changes: dict[str, Any], path: Path) -> Rig:
    """A rig with what [set] changes."""
    if not changes:
        return rig
    tree = rig.tree()
    changed = _with_set(tree, tree, changes, path)
    return Rig.of_tree(changed, Path(rig.origin), keep=rig)


def _with_set(tree: dict[str, Any], known: dict[str, Any], changes: dict[str, Any], path: Path) -> dict[str, Any]:
    try:
        changed = with_values(tree, changes.items())
    except KeyError as error:
        raise ParameterError(
            f"{path}: set has the unknown key {error.args[0]!r}",
            expected=nearest(str(error.args[0]), numeric_keys(known)),
        ) from error
    checked_file(changed, path)
    return changed


def _changed(found: Path | None, changes: dict[str, Any], path: Path) -> Rig:
    """The rig of a file, or the default one, with what [set] changes; only both together need to make sense."""
    tree = read_toml(found) if found else {}
    whole = checked_file(tree, found or path).model_dump(exclude_none=True)
    if not changes:
        return Rig.of_tree(tree, found or path)
    return Rig.of_tree(_with_set(_as_given(tree, whole), whole, changes, path), found or path)


def _as_given(tree: dict[str, Any], whole: dict[str, Any]) -> dict[str, Any]:
    """All sections of a rig with their defaults, but a cable's parameters where the file names its model or plant."""
    named_there = {"model", "plant"} & tree.get("cable", {}).keys()
    return whole | ({"cable": tree["cable"]} if named_there else {})


def _check_ends(study: Study, column: Column) -> None:
    """Refuse a distribution that reaches values which its key may not have."""
    where = f"{study.path}: {column.name}"
    for end in column.spread.ends:
        if column.name == "fault.kind":
            if end not in ["nothing", *SENSOR_FAULTS]:
                raise ParameterError(f"{where} is {end!r}", expected=", ".join(["nothing", *SENSOR_FAULTS]))
        elif isinstance(end, str):
            raise ParameterError(f"{where} is {end!r}", expected="numbers", do="correct it there")
        elif column.name.startswith("fault."):
            if not 0.0 <= end <= LONGEST:
                expected = f"a time from 0 to {LONGEST:g} s, the longest run"
                raise ParameterError(f"{where} reaches {end:g}", expected=expected, do="correct it there")
        elif column.name.startswith("known."):
            if not 0.0 < end <= 100.0:
                raise ParameterError(f"{where} reaches {end:g}", expected="factors above 0, up to 100")
        elif column.name.startswith("control.gains."):
            _check_gain(study, column.name.removeprefix("control.gains."), end, where)
        else:
            _check_key(study, column.name, end)


def _check_gain(study: Study, gain: str, value: Value, where: str) -> None:
    for law in study.laws:
        if gain in law.numbers:
            try:
                law.with_gains(**{gain: value})
            except ParameterError as error:
                raise ParameterError(f"{where}: {error.what}", expected=error.expected, do="narrow it") from error


def _check_key(study: Study, key: str, end: Value) -> None:
    try:
        Rig.of_tree(with_values(simulated(study.rig), [(key, end)]), study.path, keep=study.rig)
    except ParameterError as error:
        raise ParameterError(
            error.what.replace(" is ", " reaches ", 1), expected=error.expected, do="narrow what is varied"
        ) from error
