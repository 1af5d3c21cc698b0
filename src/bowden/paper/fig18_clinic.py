"""Figs 18–19: the wearer's biceps starts each flexion and extension of the suit.

The EMG is a recording of another person's biceps (``../shared/data/emg/biceps_bursts``), whose first seven contractions
stand for the paper's seven motions; where the recording is missing, seven made-up ones. A contraction begins a flexion
from rest and an extension from hold (`bowden.sensing.intent`), minimum jerk of 2 s. Before it the law has made two slow
flexions (Fig. 17), in which it has learned what it can.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.core.kernel import compiled, kernel
from bowden.core.style import COLOURS, legend, new_figure, thin
from bowden.core.trace import Trace
from bowden.core.units import DEGREES
from bowden.identify.emg.log import read_emg, read_labels
from bowden.identify.emg.score import Findings, Spans, find
from bowden.paper.experiment import Finding, Runs
from bowden.rig.presets.suit import (
    DRIVE_INTEGRAL,
    FRICTION_FEEDFORWARD,
    SuitCalibration,
    flexions,
    run_suit,
    suit_adaptive,
    suit_adaptive_integral,
    suit_ours,
)
from bowden.sensing.intent import IntentSettings, IntentState, intent_start, intent_step
from bowden.sim.emg import background, contractions

Array = NDArray[np.float64]

MOTIONS = 7
"""As in Fig. 19."""
RATE = 1000.0
"""Of the recording, and of the control loop [Hz]."""
LEARNING = 50.0
"""Two slow flexions before the clinic's [s]."""
MOVED_DEG = 0.5
"""The elbow counts as moving once it has gone this far: ten steps of the flex sensor [deg]."""


@dataclass(frozen=True)
class StagedRecording:
    """EMG with its contractions."""

    values: Array
    labels: Spans
    name: str


@dataclass(frozen=True)
class Asked:
    """What the EMG asks the elbow to do, after `LEARNING`; a `Trajectory`."""

    references: Array
    """(n, 3), one row a cycle."""

    def sample(self, time: Array) -> Array:
        """Position, velocity, acceleration (n, 3)."""
        slow, rows = flexions().sample(time), np.round((time - LEARNING) * RATE).astype(int)
        return np.where((rows < 0)[:, None], slow, self.references[np.clip(rows, 0, len(self.references) - 1)])

    def describe(self) -> dict[str, Any]:
        """What this trajectory is."""
        return {"kind": "emg_intent", "learning": LEARNING, "duration": len(self.references) / RATE}


def recording() -> StagedRecording:
    """The biceps, or its stand-in, until shortly before the eighth contraction."""
    folder = Path(__file__).parents[4] / "shared" / "data" / "emg"
    if (folder / "biceps_bursts.csv.gz").is_file():
        log, labels = read_emg(folder / "biceps_bursts.csv.gz"), read_labels(folder / "biceps_bursts.labels.csv")
        return StagedRecording(
            log.values[: round((labels[MOTIONS][0] - 0.2) * RATE)], labels[:MOTIONS], "a recorded biceps"
        )
    made = [(1.0 + 3.2 * k, 2.3 + 3.2 * k) for k in range(MOTIONS)]
    count = round(3.2 * (MOTIONS + 0.2) * RATE)
    signal = background(RATE, count, np.random.default_rng(1))
    signal += contractions(RATE, [(*span, 0.2) for span in made], count, seed=1)
    return StagedRecording(signal, made, "made-up EMG, since the recording is not here")


@kernel
def asked_for(settings: IntentSettings, state: IntentState, active: Array, out: Array, dt: float) -> None:
    """The references of a whole course of contractions; fills `out` (n, 3)."""
    for k in range(len(active)):
        state, reference = intent_step(settings, state, active[k], 0.0, dt)
        for i in range(3):
            out[k, i] = reference[i]


def motions(trace: Trace, found: Spans, settings: IntentSettings) -> tuple[Array, Array]:
    """Of each motion: the time from its detection to the elbow moving [s], and the largest error after its first second
    until the next detection [deg]."""
    starts = [round((LEARNING + onset) * RATE) for onset, _ in found]
    ends = [*starts[1:], len(trace)]
    late, error = [], []
    for start, end in zip(starts, ends, strict=True):
        joint, wanted = trace["joint"][start:end], trace["reference"][start:end]
        gone = np.sign(wanted[min(len(wanted) - 1, round(0.5 * settings.duration * RATE))] - wanted[0])
        moving = np.flatnonzero(gone * (joint - joint[0]) * DEGREES >= MOVED_DEG)
        late.append(moving[0] / RATE if len(moving) else np.inf)
        error.append(np.max(np.abs(trace.error[start:end][round(RATE) :])) * DEGREES)
    return np.array(late), np.array(error)


@dataclass(frozen=True)
class Clinic:
    """The contractions, what is seen of them, and the motions that they ask for."""

    emg: StagedRecording
    seen: Findings
    settings: IntentSettings
    asked: Asked

    def go(
        self,
        law: Law,
        integral: float | None = None,
        fit: SuitCalibration | None = None,
        feedforward: float = 0.0,
    ) -> tuple[Trace, Array, Array]:
        """A law's run, and of each motion its delay [s] and its largest error [°], as in `motions`."""
        length = LEARNING + len(self.asked.references) / RATE
        trace = run_suit(
            law,
            reference=self.asked,
            duration=length,
            drive_integral=integral,
            friction_feedforward=feedforward,
            fit=fit,
        )
        return trace, *motions(trace, self.seen.found, self.settings)


def clinic() -> Clinic:
    """The recording, seen by the detector, and the references that it makes."""
    emg, settings = recording(), IntentSettings()
    seen = find(emg.values, RATE, emg.labels)
    references = np.empty((len(emg.values), 3))
    compiled(asked_for)(settings, intent_start(0.0), seen.detected.active, references, 1.0 / RATE)
    return Clinic(emg, seen, settings, Asked(references))


def run(runs: Runs) -> Finding:
    """Under the adaptive law on the paper's PD drive, and under ours on a drive with an integral."""
    made = clinic()
    emg, seen, references = made.emg, made.seen, made.asked.references
    adaptive, late, error = made.go(suit_adaptive())
    ours, our_late, our_error = made.go(suit_ours(), DRIVE_INTEGRAL)
    _, pushed_late, pushed_error = made.go(suit_ours(), DRIVE_INTEGRAL, feedforward=FRICTION_FEEDFORWARD)
    _, drive_late, drive_error = made.go(suit_adaptive_integral(), DRIVE_INTEGRAL)
    wanted = references[:, 0] * DEGREES
    first = round(seen.found[0][0] * RATE)
    reference_late = float(np.argmax(wanted[first:] > MOVED_DEG)) / RATE
    latency = seen.score.latency_median_s or 0.0
    return Finding(
        title="EMG of the wearer moves the suit (Dinh 2017, Figs 18 and 19)",
        values={
            "fig19.motions": float(len(seen.found)),
            "fig19.error": float(error.max()),
            "fig19.delay": float(np.median(late)),
        },
        details={
            "plain": float(len(seen.plain)),
            "latency": latency,
            "reference_late": reference_late,
            "ours_error": float(our_error.max()),
            "ours_delay": float(np.median(our_late)),
            "pushed_error": float(pushed_error.max()),
            "pushed_delay": float(np.median(pushed_late)),
            "drive_error": float(drive_error.max()),
            "drive_delay": float(np.median(drive_late)),
        },
        figures=[
            (
                _figure(emg, seen.detected.active, {"adaptive": adaptive, "ours": ours}),
                "Above: EMG; shaded where the detector sees a contraction. Middle: desired and true angle of the "
                "elbow. Below: "
                "error; dotted: ±5°.",
            )
        ],
        text=f"EMG: {emg.name}. The detector finds {len(seen.found)} contractions of {len(emg.labels)}, "
        f"{1e3 * latency:.0f} ms after their marks in the median; the paper's plain threshold fires {len(seen.plain)} "
        f"times. From a detection the minimum-jerk reference itself takes {1e3 * reference_late:.0f} ms to move by "
        f"{MOVED_DEG}°, which is what counts as moving here. From detection to the elbow moving, each: adaptive "
        f"{_list(late)} s, ours {_list(our_late)} s; largest error after the first second of each: adaptive "
        f"{_list(error, 1)}°, ours {_list(our_error, 1)}°. Where the drive also pushes against friction "
        f"({FRICTION_FEEDFORWARD} N·m), ours: {_list(pushed_late)} s and {_list(pushed_error, 1)}°.",
    )


def _figure(emg: StagedRecording, active: Array, traces: dict[str, Trace]) -> Any:
    figure, (top, middle, bottom) = new_figure(rows=3, width=8.6, height=6.0, share_x=True)
    time = np.arange(len(emg.values)) / RATE
    top.plot(*thin(time, emg.values, most=4000), color=COLOURS["data"], lw=0.6)
    top.fill_between(time, 0.0, active * float(np.max(np.abs(emg.values))), color=COLOURS["motor"], alpha=0.25, lw=0.0)
    colours = {"adaptive": COLOURS["adaptive"], "ours": COLOURS["bowden"]}
    skip = round(LEARNING * RATE)
    for name, trace in traces.items():
        joint, error = trace["joint"][skip:] * DEGREES, trace.error[skip:] * DEGREES
        middle.plot(*thin(time, joint, most=1500), color=colours[name], label=name)
        bottom.plot(*thin(time, error, most=1500), color=colours[name])
    reference = next(iter(traces.values()))["reference"][skip:] * DEGREES
    middle.plot(*thin(time, reference, most=1500), color=COLOURS["reference"], ls="--", label="desired")
    for limit in (-5.0, 5.0):
        bottom.axhline(limit, color=COLOURS["reference"], ls=":", lw=1.0)
    top.set(ylabel="EMG [mV]")
    middle.set(ylabel="elbow [°]")
    bottom.set(ylabel="error [°]", xlabel="time [s]")
    legend(middle, columns=3)
    return figure


def _list(values: Array, digits: int = 2) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)
