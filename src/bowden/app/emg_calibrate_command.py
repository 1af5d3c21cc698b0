"""``bowden emg calibrate``: a wearer's rest and MVC, from recordings or from a stream."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, progress_bar
from bowden.app.emg_command import ChannelOption, DetectorOption, JsonOption, RateOption, checked_rate, warn

if TYPE_CHECKING:
    from bowden.sensing.detector import Detector
    from bowden.sensing.wearer_file import MuscleCalibration

_READY = 1.0
"""Time to make ready for what comes next [s]."""


def calibrate(
    recording: Annotated[
        Path | None, typer.Argument(help="CSV, csv.gz or Parquet: rest, and at least one contraction.")
    ] = None,
    rest: Annotated[
        Path | None, typer.Option(help="Recording of rest; by default the calmest tenth of RECORDING.")
    ] = None,
    source: Annotated[
        str | None, typer.Option(help="A stream in place of RECORDING: lsl:NAME, trigno:HOST or file:PATH.")
    ] = None,
    lasting: Annotated[float, typer.Option("--seconds", help="Of a stream: of rest, and of contraction.")] = 5.0,
    channel: ChannelOption = None,
    rate: RateOption = None,
    detector: DetectorOption = "onset",
    mains: Annotated[float, typer.Option(help="Hum to take out of the envelope: 50 or 60 Hz; 0 for none.")] = 50.0,
    out: Annotated[Path, typer.Option(help="File to write.")] = Path("wearer.toml"),
    json: JsonOption = False,
) -> None:
    """Measure a wearer's rest and maximum voluntary contraction (MVC), and save both.

    MVC is the largest envelope in RECORDING. A recording without a maximum contraction gives its largest one, which
    stands in for MVC. Dead electrodes, movement, mains and clicks are left out. From a stream the wearer
    is asked on standard error to rest and to contract.
    """
    from bowden.core.errors import ParameterError
    from bowden.sensing import wearer_file
    from bowden.sensing.detectors import detector_named

    kind = detector_named(detector)
    if (recording is None) == (source is None):
        raise ParameterError(
            "both a recording and a --source are given" if source else "neither a recording nor a --source is given",
            expected="one of them",
        )
    wearer_file.check_mains(mains, "--mains")
    if source is not None:
        if rest is not None or rate is not None:
            raise ParameterError("--rest and --rate are for recordings", do="leave them out with --source")
        wearer, left_out = _from_stream(source, channel, lasting, mains, kind, json)
    else:
        assert recording is not None
        wearer, left_out = _from_recordings(recording, rest, channel, rate, mains, kind, json)
    wearer_file.write(out, wearer_file.check(wearer, wearer.source))
    if json:
        document = {"rest": wearer.rest, "mvc": wearer.mvc, "sigma": wearer.sigma, "channel": wearer.channel}
        document |= {"left_out_s": left_out}
        print_json(document | {"files": [str(out)]})
        return
    print(f"rest {wearer.rest:.4g}, MVC {wearer.mvc:.4g} (envelopes, in the unit of {wearer.channel}) → {out}")


def _from_recordings(
    recording: Path,
    rest: Path | None,
    channel: str | None,
    rate: float | None,
    mains: float,
    kind: "Detector",
    quiet: bool,
) -> "tuple[MuscleCalibration, float]":
    """The wearer, and how much was left out [s]."""
    from bowden.face.emg import calibrated
    from bowden.identify.emg.log import read_emg

    log = read_emg(recording, channel, checked_rate(rate))
    if not quiet:
        warn(log)
    wearer, left_out, odd = calibrated(log, None if rest is None else read_emg(rest, log.channel, rate), mains, kind)
    if not quiet:
        for note in left_out:
            _tell(f"note: {note}")
    for warning in odd:
        _tell(f"bowden: warning: {warning}")
    return wearer, sum(left_out.values())


def _from_stream(
    source: str, channel: str | None, lasting: float, mains: float, kind: "Detector", quiet: bool
) -> "tuple[MuscleCalibration, float]":
    """The wearer, and how much was left out [s]."""
    from bowden.app.emg_listen import listen
    from bowden.core.errors import ParameterError
    from bowden.hardware.emg.sources import open_source
    from bowden.identify.emg.levels import check_contraction, envelope_levels
    from bowden.sensing.wearer_file import MuscleCalibration

    if not 2.0 <= lasting <= 60.0:
        raise ParameterError(f"--seconds is {lasting:g}", expected="a number from 2 to 60")
    stream = open_source(source, [] if channel is None else [channel])
    try:
        said = stream.open()
        name = stream.channels[0] if channel is None else channel
        _tell(f"{said}; {name!r} is taken")
        with progress_bar(quiet) as progress:
            listen(stream, name, _READY, lambda share: progress("get ready", 0.2 * share), check=False)
            _tell("REST: let the arm lie still")
            calm = listen(stream, name, lasting, lambda share: progress("rest", 0.2 + 0.3 * share))
            _tell("get ready to contract as hard as you can")
            listen(stream, name, _READY, lambda share: progress("get ready", 0.5 + 0.2 * share), check=False)
            _tell("CONTRACT, as hard as you can, and hold")
            hard = listen(stream, name, lasting, lambda share: progress("contract", 0.7 + 0.3 * share))
            _tell("done, let go")
    finally:
        stream.close()
    rest = envelope_levels(calm, stream.rate, "rest", mains, kind)
    contraction = envelope_levels(hard, stream.rate, "the contraction", mains, kind)
    left_out = _report_left_out(rest.left_out, "rest", quiet)
    left_out += _report_left_out(contraction.left_out, "the contraction", quiet)
    check_contraction(contraction, rest.middle, "the contraction")
    of = with_unit(name, stream.unit)
    return MuscleCalibration(rest.middle, contraction.high, of, source, rest.sigma, mains), left_out


def _report_left_out(left_out: float, where: str, quiet: bool) -> float:
    """How much of a recording was left out [s], once that is said."""
    from bowden.face.emg import note_left_out

    if left_out >= 0.05 and not quiet:
        _tell(f"note: {note_left_out(left_out, where)}")
    return left_out


def with_unit(channel: str, unit: str) -> str:
    """A channel's name with its unit at its end, as recordings' columns have it.

    >>> with_unit("sensor1", "mV"), with_unit("biceps_mV", "mV"), with_unit("a", "")
    ('sensor1_mV', 'biceps_mV', 'a')
    """
    return channel if not unit or channel.endswith(unit) else f"{channel}_{unit}"


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


COMMANDS = (
    Command(
        "emg calibrate",
        calibrate,
        "Measure a wearer's rest and maximum contraction.",
        (
            "bowden emg calibrate mvc.csv",
            "bowden emg calibrate mvc.csv --rest rest.csv --out anna.toml",
            "bowden emg calibrate --source lsl:EMG --channel biceps --seconds 5 --out anna.toml",
        ),
        place=10,
    ),
)
