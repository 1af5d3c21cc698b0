"""A rig in a folder: its rig.toml, and beside it the files that it needs."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from bowden.control.law_file import packable
from bowden.control.recorded_motion import RecordedMotion
from bowden.core.errors import OutputError, ParameterError
from bowden.core.files import whole_file
from bowden.plants.identified import IdentifiedCable, cable_text, load_cable
from bowden.plants.plant_file import as_file
from bowden.rig.motors import MotorTree
from bowden.rig.tree import of_motors, tree_of, written
from bowden.sensing import wearer_file


def write(rig: Any, target: Path, *, force: bool) -> None:
    """See `Rig.write`."""
    if target.is_dir():
        raise OutputError(f"{target} is a folder", do=f"give the file's name: {target / 'rig.toml'}")
    tree, files = tree_and_files(rig)
    contents = {target: written(tree).encode()} | {target.parent / name: text for name, text in files.items()}
    contents = {file: content for file, content in contents.items() if not _has_model(rig, file)}
    for file, content in contents.items():
        if file.exists() and file.read_bytes() != content and not force:
            raise OutputError(
                f"{file} is there already, with other content",
                do="choose another folder, or overwrite it: write(path, force=True)",
            )
    for file, content in contents.items():
        if file.parent != target.parent:  # of a package that a user's file imports
            file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as part:
            part.write_bytes(content)


def _has_model(rig: Any, file: Path) -> bool:
    """True if a file has the very models of one of the rig's cables, and the trust in them."""
    cables: list[Any] = [one.rig.cable for one in rig.parts if one.rig.identified]
    if not (cables and file.suffix == ".toml" and file.exists()):
        return False
    try:
        there = load_cable(file)
    except ParameterError:  # no model at all
        return False
    return any((there.digest, there.trust) == (one.digest, one.trust) for one in cables)


def tree_and_files(rig: Any) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The sections with the names of the files that lie beside, and what is in these.

    A recording of EMG is not among them: it stays where it is.

    Raises:
        ParameterError: see `tree_of`; or two of the files have one name.
    """
    files: dict[str, bytes] = {}
    if not rig.motors:
        return _tree_of(rig.fields, files), files
    trees = [MotorTree(name, _tree_of(one.fields, files), joint) for name, one, joint in rig.motors]
    return of_motors(rig, trees), files


def _tree_of(values: Mapping[str, Any], files: dict[str, bytes]) -> dict[str, Any]:
    """The sections of one motor's rig, whose files are added to those of the others."""
    tree, add = tree_of(values), partial(_add, files)
    cable, reference, law, emg = (values[name] for name in ("cable", "reference", "law", "emg"))
    if values["plant"] is not None:
        plant = as_file(values["plant"])
        name = Path(plant.path).name
        tree["cable"] |= {"plant": name + plant.name.rpartition(".py")[2]}
        for file, source in ((name, plant.source), *((one.file, one.source) for one in plant.modules)):
            add(file, source)
    elif isinstance(cable, IdentifiedCable):
        tree["cable"] = {"model": Path(tree["cable"]["model"]).name}
        add(tree["cable"]["model"], cable_text(cable).encode())
    if isinstance(reference, RecordedMotion):
        name = f"{Path(reference.said.file).name.partition('.')[0]}.csv"
        columns = {"time_column": "time_s", "position_column": "joint_rad", "unit": "rad"}
        tree["reference"] |= {"file": name} | columns
        pairs = zip(reference.time.tolist(), reference.position.tolist(), strict=True)
        add(name, "\n".join(["time_s,joint_rad", *(f"{t!r},{x!r}" for t, x in pairs), ""]).encode())
    law, _ = packable(law)
    if not isinstance(law, str):
        name = Path(law.path).name
        tree["control"]["law"] = name + law.name.rpartition(".py")[2]
        for file, source in ((name, law.source), *((one.file, one.source) for one in law.modules)):
            add(file, source)
    if emg.levels is not None:
        tree["emg"]["wearer"] = Path(emg.wearer or "wearer.toml").name
        add(tree["emg"]["wearer"], wearer_file.text_of(emg.levels).encode())
    if emg.place:
        kind, _, place = emg.place.partition(":")
        tree["emg"]["source"] = f"{kind}:{Path(place).absolute()}"
    return tree


def _add(files: dict[str, bytes], name: str, content: bytes) -> None:
    """Add a file that lies beside a rig.toml.

    Raises:
        ParameterError: another file has its name.
    """
    if files.setdefault(name, content) != content:
        raise ParameterError(
            f"two files of the rig have the name {name}",
            expected="files of different names",
            do="rename one, or pass the rig on with pack()",
        )
