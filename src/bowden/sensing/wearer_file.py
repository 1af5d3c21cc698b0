"""``wearer.toml``: what `bowden emg calibrate` measures of a wearer, and later commands go by."""

import math
from pathlib import Path
from typing import Any, NamedTuple

from bowden.core import arguments
from bowden.core.bounded import read_toml
from bowden.core.errors import ParameterError
from bowden.core.files import write_text
from bowden.core.toml_text import quoted

EARLIER = "measured by an earlier version, and does not separate contractions from rest: run bowden emg calibrate again"
"""Reason why a file without `sigma` is refused."""

MAINS_HZ = (0.0, 50.0, 60.0)
"""Mains that are taken out of an envelope; 0 for none [Hz]."""


class MuscleCalibration(NamedTuple):
    """One muscle of one wearer, under one pair of electrodes."""

    rest: float
    """Envelope at rest, in the recording's unit."""
    mvc: float
    """Envelope of the maximum voluntary contraction, in the same unit."""
    channel: str
    """Name of the recording's column, with its unit."""
    source: str
    """Recordings it was measured from."""
    sigma: float = 0.0
    """Size of the signal at rest as the detector measures it, in the same unit; 0 where it is not known."""
    mains: float = 50.0
    """Mains frequency removed from the envelopes, and from those compared with them: 50, 60 or 0 [Hz]."""

    def write(self, path: str | Path) -> None:
        """Write the file that ``[emg] wearer`` of a rig.toml names.

        Raises:
            ParameterError: what is no path.
            OutputError: the file cannot be written.
        """
        write(arguments.path_of(path, "write: path"), self)


_LEAST_RATIO = 1.5
"""The largest envelope is at least this many times rest's, or there is no share of it to speak of."""


def check(wearer: MuscleCalibration, where: str) -> MuscleCalibration:
    """`wearer`, if it can be one.

    Raises:
        ParameterError: an MVC that is not well above rest, or mains that no country has.
    """
    if not (0.0 <= wearer.rest < math.inf and 0.0 < wearer.mvc < math.inf and 0.0 <= wearer.sigma < math.inf):
        raise ParameterError(
            f"{where}: rest is {wearer.rest:g}, MVC {wearer.mvc:g} and sigma {wearer.sigma:g}",
            expected="numbers above 0",
        )
    check_mains(wearer.mains, f"{where}: mains_hz")
    if wearer.mvc < _LEAST_RATIO * wearer.rest:
        raise ParameterError(
            f"{where}: the envelope is {wearer.rest:.4g} at rest and {wearer.mvc:.4g} at the largest contraction",
            expected=f"at least {_LEAST_RATIO:g} times as much",
            do="contract as hard as you can in the recording, rest longer or apart (--rest), or look at the electrodes",
        )
    return wearer


def check_mains(mains: float, name: str) -> None:
    """See that a frequency [Hz] is one of mains, or 0.

    Raises:
        ParameterError: it is not; `name` says which key or option has it.
    """
    if mains not in MAINS_HZ:
        raise ParameterError(f"{name} is {mains:g}", expected="50, 60, or 0 for none", do="give one of them")


def write(path: Path, wearer: MuscleCalibration) -> None:
    """Write the file.

    Raises:
        OutputError: it cannot be written.
    """
    write_text(path, text_of(wearer))


def text_of(wearer: MuscleCalibration) -> str:
    """Text of the file."""
    return (
        "# Measured by bowden emg calibrate; envelopes in the unit of the channel.\n\n[emg]\n"
        f"channel = {quoted(wearer.channel)}\nrest = {float(wearer.rest)!r}\nmvc = {float(wearer.mvc)!r}\n"
        f"sigma = {float(wearer.sigma)!r}\n"
        f"source = {quoted(wearer.source)}\nmains_hz = {wearer.mains:g}\n"
    )


def read(path: Path) -> MuscleCalibration:
    """Read the file.

    Raises:
        ParameterError: not there, no such keys, or values that cannot be.
    """
    try:
        section = read_toml(path)["emg"]
        known = {"mains_hz": 50.0, "sigma": 0.0} | section
        rest, mvc, sigma, mains = (_number(known, key) for key in ("rest", "mvc", "sigma", "mains_hz"))
        found = MuscleCalibration(rest, mvc, str(section["channel"]), str(section["source"]), sigma, mains)
        unknown = set(section) - {"rest", "mvc", "sigma", "channel", "source", "mains_hz"}
    except OSError as error:
        raise ParameterError(f"cannot read {path}: {error.strerror or error}", do="run bowden emg calibrate") from None
    except (KeyError, TypeError, ValueError) as error:  # TOMLDecodeError and UnicodeDecodeError are ValueErrors
        said = f"no key {error}" if isinstance(error, KeyError) else str(error)
        raise ParameterError(f"{path}: {said}", expected="[emg] with channel, rest, mvc and source") from None
    if unknown:
        raise ParameterError(f"{path}: unknown key {sorted(unknown)[0]!r} in [emg]")
    return check(found, str(path))


def _number(section: dict[str, Any], key: str) -> float:
    value = section[key]
    if isinstance(value, bool) or not isinstance(value, float | int):
        raise TypeError(
            f"{key} is {quoted(value) if isinstance(value, str) else str(value).lower()}, which is not a number"
        )
    return float(value)
