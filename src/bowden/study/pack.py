"""A study as plain bytes, for processes that may run on another machine, and what they do with it."""

import json
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.control import Law, user_law
from bowden.core.errors import ParameterError
from bowden.core.files import whole_files
from bowden.core.kernel_cache import cache_folder
from bowden.rig import compose
from bowden.rig.schema import Rig
from bowden.study.distributions import distribution
from bowden.study.rows import table_of
from bowden.study.schema import Study as StudyFile
from bowden.study.study import Column, Study, software

if TYPE_CHECKING:
    import pyarrow as pa


def packed(study: Study) -> bytes:
    """The study with the models, recordings and laws that it needs."""
    names = [name if user_law.is_file(name) else "" for name in study.file.laws]
    laws = {str(i): Path(law.step_kernel.__code__.co_filename) for i, law in enumerate(study.laws) if names[i]}
    folder = study.rig_path.parent
    files = laws | {
        key: folder / name
        for key, name in (("model", study.rig.cable.model), ("motion", getattr(study.rig.reference, "file", None)))
        if name
    }
    document = {
        "software": software(),
        "hash": study.hash,
        "path": str(study.path),
        "file": study.file.model_dump(mode="json", exclude_none=True, exclude={"vary", "told", "fault"}),
        "told": study.file.told is not None,
        "rig": study.rig.model_dump(mode="json", exclude_none=True),
        "columns": [[c.name, c.unit, c.spread.kind, list(c.spread.given)] for c in study.columns],
        "duration": study.duration,
        "files": {key: [file.name, file.read_bytes().hex()] for key, file in files.items()},
    }
    return json.dumps(document).encode()


@lru_cache(2)
def unpacked(pack: bytes) -> Study:
    """The study again; its files are put beside the compiled code of this machine.

    Raises:
        ParameterError: it comes from another version of the package.
    """
    document: dict[str, Any] = json.loads(pack)
    if document["software"] != software():
        raise ParameterError(
            f"a worker has bowden {software()}, and the command {document['software']}",
            expected="the same software on both",
            do="install it there",
        )
    home = cache_folder() / "studies" / document["hash"]
    places: dict[str, Path] = {}
    for key, (name, content) in document["files"].items():
        with whole_files(home / key) as stage:
            (stage / name).write_bytes(bytes.fromhex(content))
        places[key] = home / key / name
    rig = document["rig"]
    if "model" in places:
        rig["cable"] = {"model": str(places["model"])}
    if "motion" in places:
        rig["reference"]["file"] = str(places["motion"])
    file = StudyFile.model_validate(document["file"] | ({"told": {}} if document["told"] else {}))
    laws = tuple(_law(name, places.get(str(i))) for i, name in enumerate(file.laws))
    columns = tuple(Column(name, unit, distribution(kind, given)) for name, unit, kind, given in document["columns"])
    path = Path(document["path"])
    return Study(path, file, path, Rig.model_validate(rig), laws, columns, document["duration"])


def _law(name: str, place: Path | None) -> Law:
    if place is None:
        return compose.law_named(name, Path())
    attribute = user_law.absolute(name).rpartition(".py")[2]
    return user_law.load(f"{place}{attribute}")


def compute(pack: bytes, first: int, last: int) -> bytes:
    """The rows of the runs `first` to `last` − 1 of a packed study, as an Arrow stream.

    Raises:
        ParameterError: another version of the package, or a run whose values do not fit one another.
    """
    import pyarrow as pa

    table = rows(unpacked(pack), range(first, last))
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue().to_pybytes())


def table(stream: bytes) -> "pa.Table":
    """What `compute` gave."""
    import pyarrow as pa

    with pa.ipc.open_stream(stream) as reader:
        return reader.read_all()


def rows(study: Study, numbers: range) -> "pa.Table":
    """`table_of`, with a user's mistakes in one line each.

    Raises:
        ParameterError: see there, or a law that cannot be compiled.
    """
    with ExitStack() as stack:
        for law in study.laws:
            stack.enter_context(user_law.explained(law))
        return table_of(study, numbers)


def warm(study: Study) -> None:
    """Compile what the study needs, so that processes on this machine find it: its first run, for a few cycles.

    Raises:
        ParameterError: a law that cannot be compiled.
    """
    cycle = study.setup(0)[0].bench.sample_time  # [s]; it may be drawn
    rows(replace(study, duration=8.0 * cycle), range(1))
