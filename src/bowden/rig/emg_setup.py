"""What a run by EMG goes by: the stream, its channels, the wearer's levels and the motions, from [emg] and --emg."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bowden.core.errors import ParameterError, StreamError
from bowden.core.units import RADIANS
from bowden.hardware.emg.course import CourseSettings
from bowden.hardware.emg.listener import Levels
from bowden.hardware.emg.sources import open_source
from bowden.hardware.ports import EmgStream
from bowden.rig import wearer_file
from bowden.rig.emg_schema import EmgSection
from bowden.rig.wearer_file import Wearer
from bowden.sensing.intent import IntentSettings

_UNIT = re.compile(r"[_\s(\[]+([mµu]?V)[)\]]?$")
"""At the end of a channel's name."""


@dataclass(frozen=True)
class EmgRun:
    """A run by EMG, all but its stream."""

    source: str
    flexor: str | None
    """Name of the channel; None for the first."""
    extensor: str | None
    wearer: Wearer | None
    where: str
    """The wearer's file."""
    course: CourseSettings

    @property
    def wanted(self) -> tuple[str, ...]:
        """Channels that the stream must have."""
        return tuple(name for name in (self.flexor, self.extensor) if name is not None)

    def told(self) -> dict[str, Any]:
        """What the log keeps of it."""
        levels = None if self.wearer is None else self.wearer._asdict()
        course = self.course._asdict() | {"intent": self.course.intent._asdict()}
        return {"source": self.source, "flexor": self.flexor, "extensor": self.extensor, "course": course} | {
            "wearer": levels
        }


def emg_run(section: EmgSection, folder: Path, source: str | None = None) -> EmgRun | None:
    """What [emg] asks for; None where the run goes by [reference].

    Args:
        section: of the rig.
        folder: of the rig, where its files are found from.
        source: in place of the rig's; its file is found from here.

    Raises:
        ParameterError: keys that do not fit one another, or a wearer's file that cannot be used.
        StreamError: what names no source.
    """
    named = section.source if source is None else source
    if named is None:
        return None
    open_source(named)
    if not section.low_deg < section.high_deg:
        raise ParameterError(
            f"emg.low_deg is {section.low_deg:g} and high_deg {section.high_deg:g}",
            expected="low_deg below high_deg",
            do="correct them in rig.toml",
        )
    if section.extensor is not None and section.extensor == section.flexor:
        raise ParameterError(
            f"emg.flexor and emg.extensor are both {section.flexor!r}",
            expected="two channels, or no extensor",
            do="correct them in rig.toml",
        )
    where = "" if section.wearer is None else str(folder / section.wearer)
    wearer = wearer_file.read(Path(where)) if where else None
    if wearer is None and section.mode == "proportional":
        raise ParameterError(
            "emg.mode is 'proportional', and there is no emg.wearer",
            expected="a file of a maximum contraction",
            do="measure one with bowden emg calibrate",
        )
    muscles = 1.0 if section.extensor is None else 2.0
    low, high = section.low_deg * RADIANS, section.high_deg * RADIANS
    return EmgRun(
        source if source is not None else _from(named, folder),
        section.flexor,
        section.extensor,
        wearer,
        where,
        CourseSettings(
            IntentSettings(low, high, section.duration_s, muscles),
            float(section.mode == "proportional"),
            0.01 * section.full_percent,
        ),
    )


def _from(source: str, folder: Path) -> str:
    kind, _, rest = source.partition(":")
    return f"file:{folder / rest}" if kind == "file" else source


def columns(run: EmgRun, stream: EmgStream) -> tuple[int, int | None]:
    """Where flexor and extensor are among an open stream's channels.

    Raises:
        StreamError: a channel is missing, or the flexor is none that the wearer was measured with.
    """
    names = stream.channels
    for wanted in run.wanted:
        if wanted not in names:
            raise StreamError(f"{run.source} has no channel {wanted!r}", expected=f"one of {_listed(names)}")
    others = [i for i, name in enumerate(names) if name != run.extensor]
    if not others:
        raise StreamError(f"{run.source} has no channel beside the extensor {run.extensor!r}")
    flexor = others[0] if run.flexor is None else names.index(run.flexor)
    if run.wearer is not None:
        _check_wearer(run, names[flexor], stream.unit)
    return flexor, None if run.extensor is None else names.index(run.extensor)


def _check_wearer(run: EmgRun, channel: str, unit: str) -> None:
    assert run.wearer is not None
    measured, ours = _parts(run.wearer.channel), _parts(channel, unit)
    if measured != ours:
        raise StreamError(
            f"{run.where} was measured on {measured[0]!r} in {measured[1] or 'no unit'}, and {run.source} has "
            f"{ours[0]!r} in {ours[1] or 'no unit'}",
            do="run bowden emg calibrate on this channel, or name another one as emg.flexor",
        )


def _parts(channel: str, unit: str = "") -> tuple[str, str]:
    """A channel's plain name and its unit."""
    named = _UNIT.search(channel)
    told = (named[1] if named else unit).replace("u", "µ")
    return (channel[: named.start()] if named else channel), told


def levels(run: EmgRun) -> Levels | None:
    """The wearer's, for the envelope's share of MVC."""
    return None if run.wearer is None else Levels(run.wearer.rest, run.wearer.mvc, run.wearer.mains)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))
