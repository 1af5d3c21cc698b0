"""A detector of contractions on hard cases that nobody tuned for: ``python benchmarks/emg_cases.py``; see docs/emg.md.

The cases are those of `emg_draw`. Looks at the validation and judging sets are counted in ``emg_looks.toml`` before
anything is run. The signal runs through the detector as it is compiled for the live loop.
"""

import argparse
import itertools
import json
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import screen
from bowden.core.errors import BowdenError
from bowden.identify.emg.levels import EnvelopeLevels, check_contraction, envelope_levels
from bowden.identify.emg.log import check_signal
from bowden.identify.emg.score import PAPERS, score, spans
from bowden.sensing.detectors import DEFAULT, detector_named
from bowden.sensing.envelope import PLAIN_THRESHOLD
from bowden.sensing.onset_settings import SAFE
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector
from emg_draw import (
    CHANGING,
    QUICK,
    RECORDINGS,
    REST_SECONDS,
    SEEN,
    SETS,
    Case,
    Contraction,
    describe,
    draw,
    draw_calibration,
    draw_rest,
    recording,
    there,
)
from looks import counted

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
QUIET = {
    "mains": "none",
    "baseline": "still",
    "heart": "none",
    "movement": "none",
    "electrode": "on",
    "converter": "fine",
}
"""Families of a case in which there is nothing but rest and contractions."""


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
                settings = self._kind.of_wearer(found.sigma)
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


def is_quiet(one: Told) -> bool:
    """Whether there is nothing but rest and contractions in its case."""
    return all(one.families[part] == family for part, family in QUIET.items())


def curve(told: Sequence[Told]) -> list[Row]:
    """Missed and latency over the ratio to rest."""
    return [
        row(f"{low:g}–{high:g}", [one for one in told if low <= one.ratio < high])
        for low, high in itertools.pairwise(EDGES)
    ]


def by_family(told: Sequence[Told]) -> list[Row]:
    """From 2.5 times rest on, by rise, length and every family."""
    seen, rows = [one for one in told if one.ratio >= 2.5], []
    lengths = ((0.0, 0.3), (0.3, 1.0), (1.0, 3.0), (3.0, 10.1))
    rows += [row(f"length {a:g}–{b:g} s", [one for one in seen if a <= one.length < b]) for a, b in lengths]
    for part, families in CHANGING.items():
        drawn = [one for one in seen if part in one.families]
        rows += [
            row(f"{part}: {family}", [one for one in drawn if one.families[part] == family]) for family in families
        ]
    return rows


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


def text(rows: Iterable[Row], head: str) -> str:
    """A table of Markdown."""
    lines = [
        f"| {head} | contractions | missed | split | latency, median | 90 % | end, median |",
        "|---|---|---|---|---|---|---|",
    ]
    for one in rows:
        times = " | ".join(_ms(value) for value in (one.latency, one.latency_most, one.late_end))
        lines.append(f"| {one.kind} | {one.count} | {one.missed} | {one.split} | {times} |")
    return "\n".join(lines)


def _ms(value: float) -> str:
    return "–" if math.isnan(value) else f"{1e3 * value:.0f} ms"


def play(finders: dict[str, Finder], cases: Iterable[Case]) -> Iterator[tuple[dict[str, Any], dict[str, Result]]]:
    """Every finder on every case: what was drawn, and what became of it."""
    for case in cases:
        yield describe(case), {name: judge(case, find(case)) for name, find in finders.items()}


def recordings(find: Finder) -> list[dict[str, Any]]:
    """The recordings in ``../shared/data``, against their labels."""
    rows = []
    for name in there():
        values, labels = recording(name)
        case = Case(0, {}, values, 1000.0, (), 0.0)
        clear = [span for span in find(case) if not any(a <= span[0] < b for a, b in RECORDINGS[name])]
        found = score(clear, labels, len(values) / 1000.0)
        rows.append({"recording": name, "contractions": len(labels)} | asdict(found))
    return rows


SOURCES = {
    "biosignalsnotebooks": ("emg/biceps_bursts", "emg/biceps_fatigue", "emg/adductor_pollicis_twitches"),
    "BMC": ("emg_more/bmc_three",),
    "BioSPPy": ("emg_more/biosppy_weak", "emg_more/biosppy_four"),
}
"""Who published which recordings."""
GRID = tuple(itertools.product((1.5, 1.6, 1.7, 1.8, 1.9, 2.0, 2.2, 2.5), (1.0, 10.0, 100.0)))
"""`ratio` and `hours` that the detector is tried with, the strictest last."""


@dataclass(frozen=True)
class LeftOut:
    """One source, judged by thresholds that were chosen on the others."""

    source: str
    ratio: float
    hours: float
    equals: int
    """Pairs of thresholds that were as good on the others."""
    chosen_wrong: int
    """Missed and false on the others."""
    missed: int
    false: int
    wrong: tuple[int, int]
    """Missed and false of the source with any of the pairs: the fewest, and with the detector's own thresholds."""


def leave_one_out() -> list[LeftOut]:
    """The thresholds that are fewest missed and false on all sources but one, judged on that one.

    Of equals the middle one is taken, in the order of `GRID`: it is furthest from where something goes wrong.
    """
    own = detector_named(DEFAULT.name).settings
    wrong: dict[tuple[float, float], dict[str, tuple[int, int]]] = {}
    for ratio, hours in (*GRID, (own.ratio, own.hours)):
        rows = recordings(ours(DEFAULT.name, own._replace(ratio=ratio, hours=hours)))
        wrong[ratio, hours] = {
            source: (
                sum(one["misses"] for one in rows if one["recording"] in names),
                sum(one["false_activations"] for one in rows if one["recording"] in names),
            )
            for source, names in SOURCES.items()
        }
    made = []
    for source in SOURCES:
        others = {pair: sum(sum(wrong[pair][one]) for one in SOURCES if one != source) for pair in GRID}
        best = [pair for pair in GRID if others[pair] == min(others.values())]
        chosen = best[len(best) // 2]
        least = min(sum(wrong[pair][source]) for pair in GRID), sum(wrong[own.ratio, own.hours][source])
        made.append(LeftOut(source, *chosen, len(best), others[chosen], *wrong[chosen][source], least))
    return made


def _table_of_sources(rows: Sequence[LeftOut]) -> str:
    lines = [
        "| left out | ratio, hours chosen | equals | wrong on the others | missed | false |",
        "|---|---|---|---|---|---|",
    ]
    for one in rows:
        chosen = f"{one.ratio:g}, {one.hours:g} | {one.equals} of {len(GRID)} | {one.chosen_wrong}"
        lines.append(f"| {one.source} | {chosen} | {one.missed} | {one.false} |")
    return "\n".join(lines)


def _table_of_recordings(rows: Sequence[dict[str, Any]]) -> str:
    lines = ["| recording | contractions | missed | false | latency, median | worst |", "|---|---|---|---|---|---|"]
    for one in rows:
        times = (math.nan if one[key] is None else one[key] for key in ("latency_median_s", "latency_max_s"))
        median, most = map(_ms, times)
        counts = f"{one['contractions']} | {one['misses']} | {one['false_activations']}"
        lines.append(f"| {one['recording']} | {counts} | {median} | {most} |")
    return "\n".join(lines)


def _numbers(given: str) -> range:
    if not given:
        return range(COUNT)
    first, _, last = given.rpartition(":")
    return range(int(first or 0), int(last))


def _progress(items: Iterable[Any], total: int, what: str) -> Iterator[Any]:
    begun, said = time.perf_counter(), 0.0
    for done, item in enumerate(items, 1):
        yield item
        taken = time.perf_counter() - begun
        if taken > said + 0.5 or done == total:
            said = taken
            screen.line(f"{done} of {total} {what}, {taken:.0f} s")
    screen.end()


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("numbers", nargs="?", default="", help=f"COUNT or FIRST:END of the cases; {COUNT} without it")
    parser.add_argument("--set", choices=list(SETS), default="development", dest="set_name")
    parser.add_argument("--changing", action="store_true", help="draws whose rest changes, and has bursts, as people's")
    parser.add_argument("--detector", default=DEFAULT.name)
    parser.add_argument("--peers", action="store_true", help="the paper's threshold and TKEO, too")
    parser.add_argument("--wearer", action="store_true", help="the same detector with a wearer's file, too")
    parser.add_argument("--rest", type=float, default=0.0, metavar="HOURS", help="of rest alone, drawn alike")
    parser.add_argument("--recordings", action="store_true", help="those in ../shared/data, too")
    parser.add_argument("--sources", action="store_true", help="thresholds chosen on all sources of them but one, too")
    parser.add_argument("--families", action="store_true", help="the table by families, too")
    parser.add_argument("--worst", action="store_true", help="list what was missed, split or false, too")
    parser.add_argument("--json", action="store_true", help="one JSON document, nothing else")
    given = parser.parse_args()
    numbers, name = _numbers(given.numbers), given.set_name
    known = Known(given.detector, name)
    finders = {given.detector: ours(given.detector)} | (PEERS if given.peers else {})
    finders |= {f"{given.detector}, wearer known": known} if given.wearer else {}
    stretches = range(numbers.start, numbers.start + math.ceil(3600.0 * given.rest / REST_SECONDS))
    kind = "rest that changes; " if given.changing else ""
    looks = look(name, numbers, f"{kind}{', '.join(finders)}; {given.rest:g} h of rest")
    cases = (draw(name, k, given.changing) for k in numbers)
    rests = (draw_rest(name, k, given.changing) for k in stretches)
    done = list(_progress(play(finders, cases), len(numbers), "cases"))
    rest = list(_progress(play(finders, rests), len(stretches), "stretches of rest"))
    document: dict[str, Any] = {
        "set": name,
        "changing": given.changing,
        "cases": [numbers.start, numbers.stop],
        "looks": looks,
        "detectors": {},
    }
    for which, find in finders.items():
        results = [(what, found[which]) for what, found in done]
        told = [one for _, result in results for one in result.told]
        hours = sum(result.seconds for _, result in results) / 3600.0
        resting = [(what, found[which]) for what, found in rest]
        document["detectors"][which] = {
            "curve": [asdict(one) for one in curve(told)],
            "quiet": [asdict(one) for one in curve([one for one in told if is_quiet(one)])],
            "ramps": [asdict(one) for one in curve([one for one in told if one.rise > QUICK])],
            "quick": [asdict(one) for one in curve([one for one in told if one.rise <= QUICK])],
            "false": sum(result.false for _, result in results),
            "hours": hours,
            "rest": [asdict(one) for one in at_rest(resting)],
            "recordings": recordings(find) if given.recordings else [],
        }
        if not given.json:
            _print(which, told, document["detectors"][which], given.families)
            if given.worst:
                _list(results, resting)
    document["refused"] = known.refused
    document["sources"] = [asdict(one) for one in leave_one_out()] if given.sources else []
    if given.sources and not given.json:
        print("\n" + _table_of_sources([LeftOut(**one) for one in document["sources"]]))
    if given.wearer and not given.json:
        print(f"\nCalibrations refused: {len(known.refused)}")
        print("\n".join(f"- {said}" for said in known.refused))
    if given.json:
        print(json.dumps(_finite(document)))


def _print(which: str, told: Sequence[Told], made: dict[str, Any], families: bool) -> None:
    print(f"\n## {which}\n")
    for title, key in (
        ("All", "curve"),
        ("Quick onsets", "quick"),
        (f"Ramps, from {SEEN:g} × rest", "ramps"),
        ("Nothing but rest and contractions", "quiet"),
    ):
        print(text([Row(**one) for one in made[key]], f"{title}: ratio") + "\n")
    if families:
        print(text(by_family(told), "from 2.5 × rest") + "\n")
    print(f"False beside the contractions: {made['false']} in {made['hours']:.2f} h.")
    if made["rest"]:
        print("\n| rest | hours | false |\n|---|---|---|")
        for one in made["rest"]:
            print(f"| {one['kind']} | {one['hours']:.1f} | {one['false']} |")
    if made["recordings"]:
        print("\n" + _table_of_recordings(made["recordings"]))


def _list(results: Sequence[tuple[dict[str, Any], Result]], resting: Sequence[tuple[dict[str, Any], Result]]) -> None:
    """What was missed from 2.5 times rest on, split or false, case by case."""
    for what, result in results:
        said = [
            f"missed {one.ratio:.1f} × for {one.length:.1f} s"
            for one in result.told
            if not one.found and one.ratio > 2.5
        ]
        said += [f"{one.ratio:.1f} × split in {one.split + 1}" for one in result.told if one.split]
        said += [f"{result.false} false"] if result.false else []
        if said:
            print(f"- {'; '.join(said)}: {what}")
    for what, result in resting:
        if result.false:
            print(f"- rest, {result.false} false: {what}")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    main()
