"""The law of a recorded run, with the gains it had, or another one in its place."""

from pathlib import Path

from bowden.app.config import near
from bowden.app.laws import KNOWN
from bowden.control import Law, user_law
from bowden.core.errors import LogError, ParameterError
from bowden.runtime.mcap_read import Recording


def law_of(found: Recording, wanted: str | None) -> tuple[Law, bool]:
    """The law to replay, and whether it is the one of the record.

    The record's own gets the record's gains, whether it is named or not; any other has its default gains.

    Raises:
        ParameterError: no such law, or a file that cannot be used.
        LogError: the record does not say which law ran, or its gains do not fit.
    """
    recorded = found.settings.get("law")
    source = found.settings.get("law_file") or recorded
    name = wanted or source
    if not isinstance(name, str):
        raise LogError("the log does not say which law ran", do="name one with --law")
    law = _load(name)
    if law.name != recorded:
        return law, False
    gains = found.settings.get("gains", {})
    try:
        return law.with_gains(**gains), True
    except (ParameterError, TypeError) as error:
        raise LogError(f"the log's gains do not fit the law {law.name!r}: {error}", do="name another law") from error


def _load(name: str) -> Law:
    if user_law.is_file(name):
        return user_law.load(name, Path())
    if name in KNOWN:
        return KNOWN[name]
    raise ParameterError(f"there is no law {name!r}", expected=near(name, KNOWN), do="or name a file: my_law.py:NAME")
