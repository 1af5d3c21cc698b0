"""`emg calibrate`: a wearer's rest and MVC, from recordings or from a stream."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bowden.operations.support.operation import GivenProgress, Operation, Progress, Switch, Tell
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.design.contractions import Recording
    from bowden.sensing.detector import Detector
    from bowden.sensing.wearer_file import MuscleCalibration

_READY = 1.0
"""Time to make ready for what comes next [s]."""
_MUCH = 1.0
"""What is left out of a recording is a warning from here on; the end of a strong contraction has less of it [s]."""


@dataclass(frozen=True)
class EmgCalibration(Result["MuscleCalibration"]):
    """A wearer's levels."""

    rest: float
    """Envelope at rest, in the channel's unit."""
    mvc: float
    """Envelope of the maximum voluntary contraction."""
    sigma: float
    """Size at rest as the detector measures it; 0 where it could not be."""
    channel: str
    """Column of the signal."""
    left_out_s: float
    """How much was left out: dead electrodes, movement, mains and clicks, with the time in which filters ring after
    them."""
    _: KW_ONLY
    little: tuple[str, ...] = ()
    """What was left out that is too little for a warning."""


def emg_calibrate(
    recording: Annotated["Recording | None", Switch(Path, place=True)] = None,
    rest: Annotated["Recording | None", Switch(Path)] = None,
    *,
    source: str | None = None,
    lasting: Annotated[float, Switch(name="--seconds")] = 5.0,
    channel: str | None = None,
    rate: float | None = None,
    detector: str = "onset",
    mains: float = 50.0,
    progress: GivenProgress = None,
    tell: Tell = None,
) -> EmgCalibration:
    """Measure a wearer's rest and maximum voluntary contraction (MVC).

    MVC is the largest envelope in the recording. A recording without a maximum contraction gives its largest one, which
    stands in for MVC. Dead electrodes, movement, mains and clicks are left out. From a stream the wearer is asked to
    rest and to contract.

    Args:
        recording: CSV, csv.gz, NPZ or Parquet: rest, and at least one contraction as hard as possible; in Python also
            the samples of one channel (n,), with their rate.
        rest: recording of rest; by default the calmest tenth of the other.
        source: a stream in place of a recording: lsl:NAME, trigno:HOST or file:PATH.
        lasting: of a stream: of rest, and of contraction [s].
        channel: column of the signal; the first one by default.
        rate: samples a second, where the recording has no times, or to check those it has.
        detector: the one that recognises movement, mains and dead electrodes.
        mains: hum to take out of the envelope: 50 or 60 Hz; 0 for none.

    Returns:
        ``rest`` and ``mvc``, envelopes in the recording's unit; ``write("wearer.toml")`` keeps them, and
        ``rig.with_emg(source, wearer)`` uses them.

    Raises:
        LogError: a recording that cannot be used, or has no contraction in it.
        ParameterError: arguments of the wrong kind.

    Examples:
        bowden emg calibrate mvc.csv
        bowden emg calibrate mvc.csv --rest rest.csv --out anna.toml
        bowden emg calibrate --source lsl:EMG --channel biceps --seconds 5 --out anna.toml

    >>> import bowden
    >>> import numpy as np
    >>> random = np.random.default_rng(0)
    >>> time = np.arange(8000) / 1000.0
    >>> size = np.where((time > 3.0) & (time < 6.0), 0.2, 0.005)
    >>> wearer = bowden.emg_calibrate(size * random.normal(size=8000), rate=1000.0)
    >>> wearer.mvc > 20.0 * wearer.rest
    True
    """
    from bowden.core.caller import argument
    from bowden.core.errors import ParameterError
    from bowden.design.contractions import calibrated, recording_of
    from bowden.operations.support.progress import reported
    from bowden.sensing import wearer_file
    from bowden.sensing.detectors import detector_named

    kind = detector_named(detector)
    if (recording is None) == (source is None):
        given = argument("source").rstrip("=")
        said = f"{'both a' if source else 'neither a'} recording {'and' if source else 'nor'} a {given}"
        raise ParameterError(f"{said} {'are' if source else 'is'} given", expected="one of them")
    wearer_file.check_mains(mains, argument("mains").rstrip("="))
    if source is not None:
        if rest is not None or rate is not None:
            what = f"{argument('rest')} and {argument('rate')} are for recordings"
            raise ParameterError(what, do=f"leave them out with {argument('source')}")
        with reported(progress, "emg_calibrate") as report:
            little: list[str] = []
            wearer, left_out, needless = _from_stream(source, channel, lasting, mains, kind, report, tell or print)
            notes = needless
    else:
        log = recording_of(recording, channel, rate, "emg_calibrate")
        files = isinstance(recording, str | Path) and isinstance(rest, str | Path)
        same = log.channel if files or channel is not None else None
        calm = None if rest is None else recording_of(rest, same, rate, "rest")
        wearer, parts, odd = calibrated(log, calm, mains, kind)
        left_out = sum(parts.values())
        notes = [*log.warnings, *(() if calm is None else calm.warnings)]
        notes += [note for note, seconds in parts.items() if seconds >= _MUCH]
        little = [note for note, seconds in parts.items() if seconds < _MUCH]
        notes, needless = [*notes, *odd], notes
    found = wearer_file.check(wearer, wearer.source)
    return EmgCalibration(
        found.rest,
        found.mvc,
        found.sigma,
        found.channel,
        left_out,
        made=found,
        little=tuple(little),
        needless=tuple(needless),
        notes=tuple(notes),
    )


def _from_stream(
    source: str,
    channel: str | None,
    lasting: float,
    mains: float,
    kind: "Detector",
    progress: Progress,
    tell: Callable[[str], None],
) -> "tuple[MuscleCalibration, float, list[str]]":
    """The wearer, how much was left out [s], and what is said of that."""
    from bowden.design.contractions import note_left_out
    from bowden.hardware.emg.sources import listen, open_source
    from bowden.identify.emg.levels import check_contraction, envelope_levels
    from bowden.operations.support.given import check_number
    from bowden.sensing.wearer_file import MuscleCalibration

    check_number("lasting", lasting, 2.0, 60.0)
    stream = open_source(source, [] if channel is None else [channel])
    try:
        said = stream.open()
        name = stream.channels[0] if channel is None else channel
        tell(f"{said}; {name!r} is taken")
        listen(stream, name, _READY, lambda share: progress("get ready", 0.2 * share), check=False)
        tell("REST: let the arm lie still")
        calm = listen(stream, name, lasting, lambda share: progress("rest", 0.2 + 0.3 * share))
        tell("get ready to contract as hard as you can")
        listen(stream, name, _READY, lambda share: progress("get ready", 0.5 + 0.2 * share), check=False)
        tell("CONTRACT, as hard as you can, and hold")
        hard = listen(stream, name, lasting, lambda share: progress("contract", 0.7 + 0.3 * share))
        tell("done, let go")
    finally:
        stream.close()
    rest = envelope_levels(calm, stream.rate, "rest", mains, kind)
    contraction = envelope_levels(hard, stream.rate, "the contraction", mains, kind)
    parts = {"rest": rest.left_out, "the contraction": contraction.left_out}
    notes = [note_left_out(seconds, where) for where, seconds in parts.items() if seconds >= 0.05]
    check_contraction(contraction, rest.middle, "the contraction")
    of = with_unit(name, stream.unit)
    wearer = MuscleCalibration(rest.middle, contraction.high, of, source, rest.sigma, mains)
    return wearer, sum(parts.values()), notes


def with_unit(channel: str, unit: str) -> str:
    """A channel's name with its unit at its end, as recordings' columns have it.

    >>> with_unit("sensor1", "mV"), with_unit("biceps_mV", "mV"), with_unit("a", "")
    ('sensor1_mV', 'biceps_mV', 'a')
    """
    return channel if not unit or channel.endswith(unit) else f"{channel}_{unit}"


OPERATIONS = (Operation("emg calibrate", emg_calibrate, 10),)
