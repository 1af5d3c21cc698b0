"""A study as plain bytes, for processes that may run on another machine, and what they do with it."""

import json
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.control import user_law
from bowden.control.law_file import LawFile, loaded
from bowden.core.errors import ParameterError
from bowden.rig.rig import Rig
from bowden.study.distributions import distribution
from bowden.study.rows import table_of
from bowden.study.schema import StudyFile
from bowden.study.study import Column, Study, software

if TYPE_CHECKING:
    import pyarrow as pa


def packed(study: Study) -> bytes:
    """The study with the models, recordings and laws that it needs."""
    document = {
        "software": software(),
        "path": str(study.path),
        "file": study.file.model_dump(mode="json", exclude_none=True, exclude={"vary", "known", "fault"}),
        "known": study.file.known is not None,
        "rig": study.rig.document(),
        "laws": [law if isinstance(law, str) else law.packed() for law in study.given],
        "columns": [[c.name, c.unit, c.spread.kind, list(c.spread.given)] for c in study.columns],
    }
    return json.dumps(document).encode()


@lru_cache(2)
def unpacked(pack: bytes) -> Study:
    """The study again.

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
    file = StudyFile.model_validate(document["file"] | ({"known": {}} if document["known"] else {}))
    given = tuple(law if isinstance(law, str) else LawFile.unpacked(law) for law in document["laws"])
    laws = tuple(loaded(law) for law in given)
    columns = tuple(Column(name, unit, distribution(kind, given)) for name, unit, kind, given in document["columns"])
    return Study(Path(document["path"]), file, Rig.unpack(document["rig"]), given, laws, columns)


def compute(pack: bytes, first: int, last: int) -> "pa.Table":
    """The rows of the runs `first` to `last` − 1 of a packed study.

    Raises:
        ParameterError: another version of the package, or a run whose values do not fit one another.
    """
    return rows(unpacked(pack), range(first, last))


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
    cycle = study.run(0)[0].sample_time  # [s]; it may be drawn
    rows(replace(study, rig=study.rig.replace(duration=8.0 * cycle)), range(1))
