"""A detector of contractions on hard cases that nobody tuned for: ``python benchmarks/emg_cases.py``; see docs/emg.md.

The cases are those of `emg_draw`. Looks at the validation and judging sets are counted in ``emg_looks.toml`` before
anything is run. The signal runs through the detector as it is compiled for the live loop.
"""

import argparse
import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import BowdenError
from bowden.identify.emg.levels import EnvelopeLevels, check_contraction, envelope_levels
from bowden.identify.emg.log import check_signal
from bowden.identify.emg.score import PAPERS, spans
from bowden.sensing.detectors import DEFAULT, detector_named
from bowden.sensing.envelope import PLAIN_THRESHOLD
from bowden.sensing.onset_settings import SAFE
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector
from emg_draw import (
    QUICK,
    REST_SECONDS,
    SEEN,
    SETS,
    Case,
    Contraction,
    describe,
    draw,
    draw_calibration,
    draw_rest,
)
from kept import counted, finite, numbers_in, progress
from measure import table

Array = NDArray[np.float64]
Spans = list[tuple[float, float]]
Finder = Callable[[Case], Spans]

LOOKS = Path(__file__).with_name("emg_looks.toml")
COUNT = 400
"""Cases of a set where no numbers are given."""
EDGES = (1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 16.0, 64.0, 250.0, 1000.0)
"""Of the ratios in the table [–]."""
BEFORE, AFTER = 0.02, 0.15
"""A detection belongs to a contraction from so long before its onset to so long after its end [s]."""
SPLIT = 0.5
"""A detection so soon after the end of a contraction that was found is a part of it [s]."""


@dataclass(frozen=True)
class Told:
    """What became of one contraction."""

    case: int
    families: dict[str, str]
    ratio: float
    rise: float
    """[s]."""
    length: float
    """[s]."""
    found: bool
    latency: float
    """From when it is seen to the detection; NaN if missed [s]."""
    late_end: float
    """From its end, or from where it is no longer seen, to the end of its last detection; NaN if missed [s]."""
    split: int
    """Detections of it beyond the first."""


@dataclass(frozen=True)
class Result:
    """What became of one case."""

    told: tuple[Told, ...]
    false: int
    """Detections that belong to no contraction."""
    seconds: float
    """Without contractions, and without what is not judged [s]."""


def judge(case: Case, found: Spans) -> Result:
    """Set detections against what is truly there; each belongs to one contraction or to none."""
    left, told = list(found), []
    covered = 0.0
    for one in case.contractions:
        covered += one.length
        window = (one.onset - BEFORE, one.end + (AFTER if one.judged else SPLIT))
        mine = [span for span in left if window[0] <= span[0] < window[1]]
        if mine:
            mine += [span for span in left if window[1] <= span[0] < one.end + SPLIT]
        left = [span for span in left if span not in mine]
        if one.judged:
            told.append(_told(case, one, mine))
    return Result(tuple(told), len(left), len(case.values) / case.rate - covered)


def _told(case: Case, one: Contraction, mine: Spans) -> Told:
    found = bool(mine)
    latency, late = (mine[0][0] - one.seen, mine[-1][1] - one.gone) if found else (math.nan, math.nan)
    split = max(0, len(mine) - 1)
    return Told(case.number, case.families, one.ratio, one.rise, one.length, found, latency, late, split)


def ours(name: str, settings: Any = None) -> Finder:
    """A detector of the package, with its own settings or others."""
    kind = detector_named(name)

    def find(case: Case) -> Spans:
        return spans(OnsetDetector(case.rate, settings, kind).feed(case.values).active, case.rate)

    return find


class Known:
    """A detector of the package that knows the wearer, by a calibration that is drawn with each case."""

    def __init__(self, name: str, set_name: str) -> None:
        self._kind, self._set = detector_named(name), set_name
        self.refused: list[str] = []
        """What the calibration said of cases that it refused; they are run without."""

    def __call__(self, case: Case) -> Spans:
        """What is found."""
        settings = self._kind.settings
        if case.contractions:
            before = draw_calibration(self._set, case)
            try:
                found = calibrated(before)
                settings = self._kind.of_wearer(found.sigma, found.high)
            except BowdenError as error:
                self.refused.append(f"{case.number}: {error}")
        return spans(OnsetDetector(case.rate, settings, self._kind).feed(case.values).active, case.rate)


def calibrated(case: Case) -> EnvelopeLevels:
    """Levels of a recording as ``bowden emg calibrate`` measures them.

    Raises:
        LogError: it is refused.
    """
    check_signal("emg", case.values, case.rate, "the recording")
    found = envelope_levels(case.values, case.rate, mains=case.facts.get("mains_hz", 50.0))
    check_contraction(found, found.low, "the recording")
    return found


def papers(case: Case) -> Spans:
    """The paper's threshold: the envelope above a fifth of its largest, which stands in for the MVC."""
    envelope = EnvelopeFilter(case.rate, PAPERS).feed(case.values).envelope
    return spans(np.where(envelope > PLAIN_THRESHOLD * float(envelope.max()), 1.0, 0.0), case.rate)


def tkeo(case: Case) -> Spans:
    """Teager and Kaiser's energy, causal: Solnik et al. (2010), with each of their filters run forward only.

    Band-pass of 30 to 300 Hz, |x² − x₋₁·x₊₁| through a low-pass of 50 Hz, against the mean and fifteen standard
    deviations of the first half second (after 0.2 s, in which the filters settle); 25 ms above it are an onset.
    """
    from scipy import signal

    rate = case.rate
    band = signal.butter(3, (30.0, min(300.0, 0.45 * rate)), "bandpass", fs=rate, output="sos")
    x = signal.sosfilt(band, case.values - case.values[0])
    energy = np.zeros(len(x))
    energy[2:] = np.abs(x[1:-1] ** 2 - x[:-2] * x[2:])
    smooth = signal.sosfilt(signal.butter(2, 50.0, fs=rate, output="sos"), energy)
    first = smooth[round(0.2 * rate) : round(0.7 * rate)]
    above = smooth > float(np.mean(first)) + 15.0 * float(np.std(first))
    least = round(0.025 * rate)
    held = [(on, off) for on, off in spans(np.where(above, 1.0, 0.0), rate) if round((off - on) * rate) >= least]
    return [(on + 0.025, off) for on, off in held]


PEERS: dict[str, Finder] = {"paper's threshold": papers, "TKEO, causal": tkeo}


def look(set_name: str, numbers: range, what: str, file: Path = LOOKS) -> int:
    """Write down that a set is looked at, and how often it has been; the development set is not counted."""
    return counted(file, set_name, {"cases": f"{numbers.start}:{numbers.stop}", "of": what})


@dataclass(frozen=True)
class Row:
    """Contractions of one kind; latencies are NaN where none was found."""

    kind: str
    count: int
    missed: int
    split: int
    latency: float
    """Median [s]."""
    latency_most: float
    """90 % [s]."""
    late_end: float
    """Median [s]."""


def row(kind: str, told: Sequence[Told]) -> Row:
    """Of contractions of one kind."""
    latency = np.array([one.latency for one in told if one.found])
    ends = np.array([one.late_end for one in told if one.found])
    figures = (np.median(latency), np.quantile(latency, 0.9), np.median(ends)) if len(latency) else (math.nan,) * 3
    missed, split = sum(not one.found for one in told), sum(one.split for one in told)
    return Row(kind, len(told), missed, split, *(float(value) for value in figures))


def curve(told: Sequence[Told]) -> list[Row]:
    """Missed and latency over the ratio to rest."""
    return [
        row(f"{low:g}–{high:g}", [one for one in told if low <= one.ratio < high])
        for low, high in itertools.pairwise(EDGES)
    ]


@dataclass(frozen=True)
class Resting:
    """What was told in rest of one kind."""

    kind: str
    hours: float
    false: int


def at_rest(results: Sequence[tuple[dict[str, Any], Result]]) -> list[Resting]:
    """False activations in rest alone, at rates that may move somebody and at lower ones; made up and recorded."""
    rows = []
    for kind, slow in itertools.product(("made up", "recorded"), (False, True)):
        mine = [
            result
            for what, result in results
            if (what["rest"] == "recorded") == (kind == "recorded") and (what["rate_hz"] < SAFE) == slow
        ]
        hours, false = sum(one.seconds for one in mine) / 3600.0, sum(one.false for one in mine)
        if mine:
            rows.append(Resting(f"{kind}, {'below' if slow else 'from'} {SAFE:g} Hz", hours, false))
    return rows


COLUMNS = ("contractions", "missed", "split", "latency, median", "90 %", "end, median")


def text(rows: Iterable[Row], head: str) -> str:
    """A table of Markdown."""
    return table(
        (head, *COLUMNS),
        [(*astuple(one)[:4], *map(_ms, (one.latency, one.latency_most, one.late_end))) for one in rows],
    )


def _ms(value: float | None) -> str:
    return "–" if value is None or math.isnan(value) else f"{1e3 * value:.0f} ms"


def play(finders: dict[str, Finder], cases: Iterable[Case]) -> Iterator[tuple[dict[str, Any], dict[str, Result]]]:
    """Every finder on every case: what was drawn, and what became of it."""
    for case in cases:
        yield describe(case), {name: judge(case, find(case)) for name, find in finders.items()}


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("numbers", nargs="?", default="", help=f"COUNT or FIRST:END of the cases; {COUNT} without it")
    parser.add_argument("--set", choices=list(SETS), default="development", dest="set_name")
    parser.add_argument("--changing", action="store_true", help="draws whose rest changes, and has bursts, as people's")
    parser.add_argument("--rate", type=float, default=0.0, help="of the signal, in place of the drawn ones [Hz]")
    parser.add_argument("--detector", default=DEFAULT.name)
    parser.add_argument("--peers", action="store_true", help="the paper's threshold and TKEO, too")
    parser.add_argument("--wearer", action="store_true", help="the same detector with a wearer's file, too")
    parser.add_argument("--rest", type=float, default=0.0, metavar="HOURS", help="of rest alone, drawn alike")
    parser.add_argument("--json", action="store_true", help="one JSON document, nothing else")
    given = parser.parse_args()
    numbers, name = numbers_in(given.numbers, COUNT), given.set_name
    known = Known(given.detector, name)
    finders = {given.detector: ours(given.detector)} | (PEERS if given.peers else {})
    finders |= {f"{given.detector}, wearer known": known} if given.wearer else {}
    stretches = range(numbers.start, numbers.start + math.ceil(3600.0 * given.rest / REST_SECONDS))
    kind = "rest that changes; " if given.changing else ""
    kind += f"{given.rate:g} Hz; " if given.rate else ""
    looks = look(name, numbers, f"{kind}{', '.join(finders)}; {given.rest:g} h of rest")
    cases = (draw(name, k, given.changing, given.rate) for k in numbers)
    rests = (draw_rest(name, k, given.changing, given.rate) for k in stretches)
    done = list(progress(play(finders, cases), len(numbers), "cases"))
    rest = list(progress(play(finders, rests), len(stretches), "stretches of rest"))
    made: dict[str, Any] = {}
    for which in finders:
        results = [found[which] for _, found in done]
        told = [one for result in results for one in result.told]
        parts = {
            "curve": told,
            "ramps": [one for one in told if one.rise > QUICK],
            "quick": [one for one in told if one.rise <= QUICK],
        }
        made[which] = {key: [asdict(one) for one in curve(ones)] for key, ones in parts.items()} | {
            "false": sum(result.false for result in results),
            "hours": sum(result.seconds for result in results) / 3600.0,
            "rest": [asdict(one) for one in at_rest([(what, found[which]) for what, found in rest])],
        }
        if not given.json:
            _print(which, made[which])
    if given.json:
        head = {"set": name, "changing": given.changing, "cases": [numbers.start, numbers.stop], "looks": looks}
        print(json.dumps(finite(head | {"detectors": made, "refused": known.refused})))
    elif given.wearer:
        print(f"\nCalibrations refused: {len(known.refused)}", *known.refused, sep="\n- ")


def _print(which: str, made: dict[str, Any]) -> None:
    print(f"\n## {which}\n")
    for title, key in (
        ("All", "curve"),
        ("Quick onsets", "quick"),
        (f"Ramps, from {SEEN:g} × rest", "ramps"),
    ):
        print(text([Row(**one) for one in made[key]], f"{title}: ratio") + "\n")
    print(f"False beside the contractions: {made['false']} in {made['hours']:.2f} h.")
    if made["rest"]:
        rows = [(one["kind"], f"{one['hours']:.1f}", one["false"]) for one in made["rest"]]
        print("\n" + table(("rest", "hours", "false"), rows))


if __name__ == "__main__":
    main()
