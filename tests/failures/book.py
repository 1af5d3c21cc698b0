"""Failures that others have met in public: what happened, and what bowden does then on the twin, with its times.

The tests beside it run each row and hold it to its figures; ``PYTHONPATH=src:tests python -m failures.book`` prints the
rows as a table. *Stops after* counts from the failure's beginning, or from arming where it is there before. Times are
the twin's own, at 1 kHz with the default limits. A row says what its source says; later versions may differ.
"""

import math
import random
from collections.abc import Callable, Mapping
from typing import NamedTuple

from bowden.rig.rig import Rig
from support.family_matrix import CELLS
from support.memory_bus import MemoryBus

HEAD = (
    "what happened, and where",
    "on the twin",
    "what bowden does",
    "finds",
    "stops after [ms]",
    "no torque after [ms]",
)
NEVER = math.inf


class Play(NamedTuple):
    """How a failure is played: arguments of `support.family_matrix.react`."""

    family: str
    text: str
    """The injected faults."""
    onset: float | None = 0.35
    lasting: float = math.inf
    watched: float = 0.4
    each: Callable[[MemoryBus], None] = lambda bus: None
    late: Callable[[], Callable[[], float]] | None = None
    fitted: Callable[[Rig], Rig] = lambda rig: rig


class Failure(NamedTuple):
    """One row."""

    happened: str
    source: str
    does: str
    """What bowden does, in words."""
    faults: tuple[str, ...]
    """One of these stops the run, or keeps it from being armed; none where it goes on."""
    stops: float
    """From the fault's beginning, or from arming where it is there before, to R2, R3 or the preflight's refusal;
    0 where it cannot be armed, infinite where the run goes on [ms]."""
    off: float
    """From there to a motor without torque; 0 where it had none from then on, infinite where it keeps it [ms]."""
    play: Play | None = None
    """None of a failure whose test plays it by itself."""
    long: bool = False
    """Whether its test is left to `make long`."""


def _github(repository: str, number: int, kind: str = "issues") -> str:
    return f"[{repository} #{number}](https://github.com/{repository}/{kind}/{number})"


_TUM = "https://github.com/TUM-Aries-Lab/motor-module/blob/main/docs/CAN_TROUBLESHOOTING.md"


def _aries(problem: int) -> str:
    return f"[TUM-Aries-Lab/motor-module, CAN_TROUBLESHOOTING.md, problem {problem}]({_TUM})"


def _flood(bus: MemoryBus) -> None:
    """30 000 frames a second that nobody has asked for."""
    for _ in range(30):
        bus.put(0x088, bytes(8))


def _late(most: float) -> Callable[[], Callable[[], float]]:
    """Wakes up to so late [s]."""

    def begin() -> Callable[[], float]:
        numbers = random.Random(1)
        return lambda: numbers.uniform(0.0, most)

    return begin


_PLAIN = CELLS["plain frames"]
_CELL = {"family": _PLAIN[0], "fitted": _PLAIN[1]}

BOOK: Mapping[str, Failure] = {
    "an_ak_motor_goes_inert": Failure(
        "8.84 s into a run a motor gave no torque any more, with error code 0, while the loop went on commanding 44 "
        "rad/s "
        "for 16 s.",
        "reported publicly; source not found again",
        "the driver asks for a torque in vain for 20 ms: the motor is inert, R3",
        ("EMERGENCY",),
        41.0,
        0.0,
        Play("ak_mit", "inert", onset=8.84),
        long=True,
    ),
    "an_ak_motor_never_turns": Failure(
        "At 18.5 V in place of 24 V an AK60-6 answered every command with error code 0, and gave no torque at all.",
        _aries(5),
        "the same finding, in the first motion of the preflight",
        ("EMERGENCY",),
        563.0,
        0.0,
        Play("ak_mit", "inert", onset=None, watched=1.0),
    ),
    "a_position_is_off_by_a_turn_after_a_restart": Failure(
        "After some restarts the position of an AK10-9 was off by a multiple of 40° (one turn of its rotor) until it "
        "was "
        "switched off again.",
        _github("neurobionics/TMotorCANControl", 14),
        'joint and motor disagree: it cannot be armed; `home = "hint"` in `[drive]` finds the turn by itself',
        ("JOINT_MOTOR_MISMATCH",),
        0.0,
        0.0,
        Play("ak_mit", "turns_lost 1", onset=None, watched=0.3),
    ),
    "a_turn_is_lost_in_a_run": Failure(
        "The same, should the drive restart within a run and be led on.",
        _github("neurobionics/TMotorCANControl", 14),
        "the driver sees a whole number of turns in one cycle: R3, and it has to be brought up again",
        ("EMERGENCY",),
        1.0,
        1.0,
        Play("ak_mit", "turns_lost 1"),
    ),
    "a_kick_on_entering_motor_mode": Failure(
        "On entering motor mode a motor moved fast to a position that it seemed to remember; the maintainers know "
        "this kick.",
        _github("dfki-ric-underactuated-lab/mini-cheetah-tmotor-can", 4),
        "the gains are taken away before the mode is left, and the first command goes out with the order to enter. A "
        "drive "
        "that pulls all the same shows a torque in the trial of eight cycles with the smallest gains: R3, after 1.1° "
        "of the "
        "motor",
        ("EMERGENCY",),
        1.0,
        1.0,
        Play("ak_mit", "kick 20", onset=None),
    ),
    "commands_are_ignored_from_the_start": Failure(
        "With a cable in its UART socket an AK60-6 acknowledged and answered all frames on CAN, and obeyed none.",
        _aries(2),
        "the torque that the preflight asks for does not come: inert, R3",
        ("EMERGENCY",),
        563.0,
        0.0,
        Play("ak_mit", "commands_ignored", onset=None, watched=1.0),
    ),
    "commands_are_ignored_in_a_run": Failure(
        "The same, with the cable plugged in while the motor is led.",
        _aries(2),
        "inert, R3; but the order to let go is ignored as well: **press the emergency stop**. Once the run has ended "
        "and nobody "
        "speaks to the drive any more, its CAN timeout takes the torque off, within 20 ms",
        ("EMERGENCY",),
        55.0,
        NEVER,
        Play("ak_mit", "commands_ignored"),
    ),
    "the_send_queue_is_full_after_100_frames": Failure(
        "Within 100 frames in a row sending failed at once with ENOBUFS, though each had a time limit of 1 s.",
        f"{_github('hardbyte/python-can', 2004)}; {_aries(4)}",
        "nothing that is sent waits; no reading comes: R3. The order to let go is stuck too: the drive's own watch "
        "acts",
        ("MOTOR_STALE", "BUS_ERRORS"),
        8.0,
        37.0,
        Play("cia402", "queue_full 100"),
    ),
    "bus_off_without_a_restart": Failure(
        "After a short between its wires a bus stayed off: Linux restarts a controller only where restart-ms is set.",
        _github("wpilibsuite/SystemcoreTesting", 59),
        "R3 at the third frame that is not sent; the drive's own watch takes the torque off",
        ("BUS_ERRORS",),
        2.0,
        37.0,
        Play("cia402", "bus_off"),
    ),
    "bus_off_with_a_restart": Failure(
        "A bus that had stopped while frames were played to it came back by itself with restart-ms 10.",
        _github("linux-can/can-utils", 52),
        "the same; what comes back stays latched and without power until it is acknowledged",
        ("BUS_ERRORS",),
        2.0,
        37.0,
        Play("cia402", "bus_off", lasting=0.1),
    ),
    "the_adapter_is_unplugged": Failure(
        "The USB adapter of a servo was unplugged, and the motor went on turning.",
        _github("ROBOTIS-GIT/dynamixel-workbench", 358),
        "no drive is led whose own watch does not act within 50 ms; this one's board disarms",
        ("BUS_ERRORS",),
        1.0,
        33.0,
        Play("odrive", "queue_full 0"),
    ),
    "a_flood_of_foreign_frames": Failure(
        "Some 30 000 frames a second of another device hid the motor's answers from its program.",
        _aries(1),
        "up to 64 frames are read in a cycle, and others' are passed over: the run goes on",
        (),
        NEVER,
        NEVER,
        Play("ak_mit", "", each=_flood),
    ),
    "sync_jitter_on_a_loaded_core": Failure(
        "A SYNC from Python, every 25 ms, jittered by some 1.2 ms, and the drive often had its data too late to move "
        "smoothly.",
        _github("canopen-python/canopen", 285),
        "at 1 kHz, each cycle up to 1.2 ms late: R2 as soon as the delays add up",
        ("LATE", "CLOCK"),
        172.0,
        370.0,
        Play("cia402", "", late=_late(1.2e-3), watched=1.0),
        long=True,
    ),
    "an_encoder_reads_0_at_start": Failure(
        "Joints of an exoskeleton read an angle of 0 after start-up until their boards had begun; a reviewer asked "
        "whether "
        "one may actuate them.",
        _github("project-march/hardware-interface", 191, "pull"),
        "the motor's: the preflight's first motion is not seen, no law runs",
        ("PREFLIGHT_FAILED",),
        704.0,
        902.0,
        Play("cia402", "encoder_zero motor", onset=None, watched=1.5),
    ),
    "a_joint_encoder_reads_0_at_start": Failure(
        "The same at the joint.",
        _github("project-march/hardware-interface", 191, "pull"),
        "the preflight goes on to its largest motion, 30° of the motor, since the cable may have play; then no law "
        "runs",
        ("PREFLIGHT_FAILED",),
        4303.0,
        4502.0,
        Play("cia402", "encoder_zero joint", onset=None, watched=6.0),
        long=True,
    ),
    "a_load_cell_drifts": Failure(
        "An unloaded cell drifted by 4 %; another one by 30 % in 45 minutes.",
        f"{_github('bogde/HX711', 51)}, {_github('bogde/HX711', 92)}",
        "**not seen**: 4 % of 300 N, here within a second, is below every limit. Tare before each session",
        (),
        NEVER,
        NEVER,
        Play(**_CELL, text="load_drift 12", watched=1.0),
        long=True,
    ),
    "a_load_cell_sends_at_12_hz": Failure(
        "A cell whose amplifier was set for 80 samples a second sent 10.8; another one sent 11.7.",
        f"{_github('garethky/klipper', 14)}, {_github('olkal/HX711_ADC', 80)}",
        "silent for longer than `silence_ms` between two frames: it is refused before any power",
        ("TENSION_LOST",),
        0.0,
        0.0,
        Play(**_CELL, text="load_slow 12", onset=None),
    ),
    "a_load_cell_becomes_slow_in_a_run": Failure(
        "The same, from within a run on.",
        _github("garethky/klipper", 14),
        "R2, with the cable let out",
        ("TENSION_LOST",),
        16.0,
        215.0,
        Play(**_CELL, text="load_slow 12"),
        long=True,
    ),
    "a_load_cell_counts_the_wrong_way": Failure(
        "A cell's reading fell while it was pulled.",
        _github("olkal/HX711_ADC", 80),
        "a cable that pushes is slack: R2 before the preflight moves anything",
        ("SLACK",),
        56.0,
        255.0,
        Play(**_CELL, text="load_sign", onset=None),
    ),
    "stamps_of_a_stream_jump": Failure(
        "In 2 to 3 % of recordings the stamps of a stream jumped by some 200 000 s from one sample to the next.",
        _github("sccn/labstreaminglayer", 102),
        "none of those samples is taken; after 200 ms without one the run ends, R2",
        ("EMG_LOST",),
        191.0,
        459.0,
    ),
    "a_recording_ends_in_a_contraction": Failure(
        "A signal whose last contraction has no end within it made the analysis fail.",
        _github("neuropsychology/NeuroKit", 524),
        "`bowden emg` ends the contraction with the signal. A stream that ends so in a run: no new motion begins, R2 "
        "after "
        "200 ms",
        ("EMG_LOST",),
        201.0,
        479.0,
    ),
}
"""Name of the test → the row."""


def table() -> str:
    """All rows, in Markdown."""
    lines = [f"| {' | '.join(HEAD)} |", "|" + "---|" * len(HEAD)]
    for name, row in BOOK.items():
        played = "a stream in memory" if row.play is None else _played(row.play)
        found = ", ".join(f"`{fault}`" for fault in row.faults)
        if not row.faults:
            stops, off = "goes on", "–"
        elif not row.stops:
            stops, off = "not armed", "never had"
        else:
            stops, off = f"{row.stops:.0f}", f"{row.off:.0f}" if math.isfinite(row.off) else "**never**, by software"
        happened = f"**{name.replace('_', ' ').capitalize()}.** {row.happened} {row.source}"
        lines.append(f"| {' | '.join((happened, played, row.does, found or '–', stops, off))} |")
    return "\n".join(lines) + "\n"


def _played(play: Play) -> str:
    what = f"`{play.text}`" if play.text else "a loop that wakes late" if play.late else "frames 088h"
    lasting = f" for {play.lasting:g} s" if math.isfinite(play.lasting) else ""
    return f"{play.family}: {what}{lasting}" + (", before the start" if play.onset is None else "")


if __name__ == "__main__":
    print(table(), end="")
