"""`init`: the rig.toml of the default bench, or a rig round an identified cable."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bowden.operations.support.operation import Operation, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.design.new_rig import NewRig
    from bowden.identify.cable.fit import Fit
    from bowden.plants.identified import CableModel, IdentifiedCable

    GivenModel = str | Path | Fit | CableModel | IdentifiedCable


@dataclass(frozen=True)
class Initialised(Result["NewRig"]):
    """A rig.toml that was written."""

    files: tuple[Path, ...]
    """The rig.toml."""
    _: KW_ONLY
    said: tuple[str, ...] = ()
    """Reference, law, and how angles are counted, of a rig with an identified cable."""


def init(model: "GivenModel", *, suit: bool = False, **parts: Any) -> "NewRig":
    """Make a rig round an identified cable, as ``bowden init --model`` does.

    A cable whose joint falls as its motor rises, or whose log does not count from where it is just taut, is counted so
    that both rise together from the lower end of the log's motion. The reference stays within the motion that the log
    covered, and the limits stand round it. The law is ``bowden`` where a check says that it holds there; else the law
    that does.

    Args:
        model: what `identify` returned, its ``best``, or the path of a
            model.toml.
        suit: True for a suit on an arm, both cables of which lose what this one does, as ``bowden init --suit --model``
            makes it.
        **parts: of the rig that are not as on the paper's bench, as `Rig` takes them, such as ``servo``. The law is
            chosen for the rig with them.

    Returns:
        ``rig``, and ``why`` it has its law. ``rig.write("rig.toml")`` writes it with its model.

    Raises:
        ParameterError: what is no model, a model without what zeros and limits follow from, or a part that is none.

    >>> import numpy as np
    >>> import bowden
    >>> time = np.arange(0.0, 20.0, 0.01)
    >>> motor = 0.5 * np.sin(2.0 * time)
    >>> made = bowden.init(bowden.identify(time, motor, 0.5 - 0.9 * motor))
    >>> made.rig.law, made.rig.cable.counting.direction
    ('bowden', -1)
    """
    from bowden.core import arguments
    from bowden.core.errors import ParameterError
    from bowden.design.new_rig import around
    from bowden.identify.cable.fit import Fit
    from bowden.plants.identified import CableModel, IdentifiedCable, load_cable
    from bowden.rig.rig import Rig

    for name in ("cable", "plant", "law", "reference"):
        if name in parts:
            raise ParameterError(
                f"init: {name} is chosen here", expected="other parts of a rig", do=f"init(…).rig.replace({name}=…)"
            )
    if isinstance(model, str | Path):
        cable = load_cable(arguments.path_of(model, "init: model"))
    else:
        kinds = (Fit, CableModel, IdentifiedCable)
        if not isinstance(model, kinds):
            raise ParameterError(
                f"init: model is {arguments.format_value(model)}",
                expected="a model.toml, or what bowden.identify gives",
                do="identify a log first",
            )
        cable = Rig(cable=model).cable  # type: ignore[assignment]  # an identified one, in whatever form it came
    return around(cable, Path("Rig"), "model.toml", parts, suit=suit)


def init_file(
    path: Annotated[Path, Switch(place=True)] = Path("rig.toml"),
    *,
    model: Path | None = None,
    suit: bool = False,
    drive: str | None = None,
    force: bool = False,
) -> Initialised:
    """Write a commented rig.toml of the default bench: every key with its unit and meaning.

    With `model` it has that cable, a reference within the motion of the cable's log, limits round it, and a law that
    holds: bowden, if need be with a smaller bandwidth, or another one and why. With `suit` too, both cables of the suit
    have that cable's play.

    Args:
        path: the file to write.
        model: the model.toml of ``bowden identify``: a bench with that cable, within its motion.
        suit: write a suit on an arm, moved by EMG, in place of the bench.
        drive: family of the drive, such as ak_mit or dynamixel, with its motor's numbers; cia402 if left out.
        force: overwrite a file that is there.

    Raises:
        ParameterError: a model that cannot be read, or a family that there is not.
        OutputError: a file that is there, or cannot be written.

    Examples:
        bowden init
        bowden init my_rig.toml --force
        bowden init servo.toml --drive dynamixel
        bowden init --model out/identify/model.toml
        bowden init suit.toml --suit --model out/identify/model.toml
    """
    import os
    import tomllib

    from bowden.core.caller import argument
    from bowden.core.errors import OutputError, ParameterError
    from bowden.core.files import shortened, whole_file
    from bowden.core.toml_text import with_keys
    from bowden.design import rig_of_bench
    from bowden.design.objections import objections
    from bowden.design.rig_of_suit import suit_text
    from bowden.design.verdict import OURS, mended_law
    from bowden.rig.families import DEFAULT, family_named
    from bowden.rig.rig import Rig

    try:
        is_there, is_folder = path.exists(), path.is_dir()
    except OSError as error:
        raise OutputError(f"cannot write {shortened(str(path))}: {error.strerror}", do="choose another name") from error
    if is_folder:
        raise OutputError(f"{path} is a folder", do=f"name the file: {path / 'rig.toml'}")
    if is_there and not force:
        do = f"choose another name, or overwrite it with {argument('force', True)}"
        raise OutputError(f"{path} is there already", do=do)
    said: tuple[str, ...] = ()
    trust = None
    if model is not None:
        from bowden.design.new_rig import around
        from bowden.plants.identified import load_cable

        cable = load_cable(model)
        made = around(
            cable, path, Path(os.path.relpath(model.absolute(), path.absolute().parent)).as_posix(), suit=suit
        )
        text, said, trust = made.text, made.notes, cable.trust
    else:
        text = suit_text(path.name) if suit else rig_of_bench.toml_text(path.name, OURS, drive or DEFAULT)
    if drive is not None:
        family = family_named(drive)
        unseen = family.unseen_watch(family.parameters)
        if suit and unseen:
            raise ParameterError(
                f"a suit means a limb, and {unseen}",
                expected="a drive whose watch over its host is seen at every start, such as cia402 or moteus",
                do=f"choose another {argument('drive')}",
            )
        if suit or model is not None:
            text = rig_of_bench.with_drive(text, drive, str(path))
        rig = Rig.of_tree(tomllib.loads(text), path)
        refused = objections(rig)
        if refused:
            without = f"write it without {argument('drive')}, and change both by hand"
            raise ParameterError(f"such a rig would be refused: {refused[0]}", do=without)
        mended = None if suit else mended_law(rig, rig.fitted())
        if mended is not None and mended.gains:
            gains = {name: f"{value:.3g}" for name, value in mended.gains.items()}
            text = with_keys(text, "control.gains", gains, str(path))
            said = (*said, f"Gains: with this drive {mended}")
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
    return Initialised((path,), said=said, cable_trust=trust)


OPERATIONS = (Operation("init", init_file, 10),)
