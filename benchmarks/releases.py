"""Releases at random places, for random causes, on random rigs: what the joint does until the power is off.

Each is drawn from its number: a bench with a cable of any slope, dead zone and zero, or a suit on an arm; a motion of
its reference; and the moment in it at which R2, or an operator's stop, begins. The supervisor sees the twin's plant.
"""

import functools
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.kernel import compiled
from bowden.core.signals import DriveReading
from bowden.core.units import DEGREES, RADIANS
from bowden.design.rig_of_suit import suit_text
from bowden.hardware.twin.of_rig import twin_plant_of
from bowden.hardware.twin.plant import FOLLOW
from bowden.hardware.twin.suit import TwinSuit
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.drive.servo import Servo
from bowden.models.drive.thermal import cold
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release
from bowden.safety.state import Mode, Observed, PreflightResult, Request
from bowden.safety.supervisor import begin, supervise
from kept import Kept
from measure import Figure, Found
from wearers import random_wearer

COUNT = 1000
STRIDE = 5
"""Cycles over which a speed is taken: the step of a stiff cable within one is none."""
BEFORE = 0.3
"""Time for which the supervisor sees the motion before its release [s]."""
CAUSES = ("stop", "operator lost", "joint lost", "late", "law lost", "saturated")


class Release(NamedTuple):
    """What a release came to, in degrees and seconds."""

    number: int
    kind: str
    cause: str
    start: float
    """Joint where the release begins, less the joint's rest."""
    end: float
    """The same where the power goes off."""
    lowest: float
    """The least of it, until half a second after the power is off."""
    before: float
    """Largest speed of the joint in the motion that is released."""
    speed: float
    """Largest speed of the joint towards its rest in the release."""
    allowed: float
    """Largest speed of the joint that the rig allows in this release."""
    seconds: float
    """From the cause to the power's being off."""
    longest: float
    """The longest that this may take."""
    mode: int
    faults: int


class Drawn(NamedTuple):
    """A rig and when it is released."""

    kind: str
    rig: Rig
    cause: str
    moment: float
    """After the beginning of the motion [s]."""


@functools.cache
def written_suit() -> Rig:
    """What `bowden init --suit` writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "suit.toml"
        path.write_text(suit_text("suit.toml"), encoding="utf-8")
        return Rig.read(path)


def drawn(number: int) -> Drawn:
    """The rig of that number."""
    random = np.random.default_rng(number)
    cause, moment = CAUSES[int(random.integers(len(CAUSES)))], random.uniform(0.3, 3.0)
    high, period = random.uniform(30.0, 85.0), random.uniform(3.0, 8.0)
    if random.random() < 0.3:
        rig = written_suit().replace(reference=PeriodicMinimumJerk(0.0, high * RADIANS, 2.0 * period))
        return Drawn("suit", rig, cause, moment)
    slope = math.exp(random.uniform(math.log(0.4), math.log(2.5)))
    unit = BoucWen()
    dead_zone = random.uniform(1.0, 12.0) * RADIANS
    share = random.uniform(0.2, 0.9)  # of a monotone cable's αh·ρ over αφ
    gain = -0.5 * dead_zone / saturation(unit)
    cable = BoucWen(slope, gain, share * slope / abs(gain), unit.shape, unit.exponent)
    low = random.uniform(-40.0, 10.0)
    reference = PeriodicMinimumJerk(low * RADIANS, (low + high) * RADIANS, period)
    ends = sorted((0.0, low * RADIANS / slope, (low + high) * RADIANS / slope))
    room = (dead_zone + 0.25) / slope
    limits = Limits(
        motor_low=ends[0] - room,
        motor_high=ends[2] + room,
        joint_low=min(0.0, low * RADIANS) - 0.4,
        joint_high=(low + high) * RADIANS + 0.4,
        slope_low=0.75 * slope,
        slope_high=1.12 * slope,
        play=0.3 + dead_zone,
        frozen_travel=1.0 + dead_zone / slope,
        target_reach=3.0,
        motor_speed=max(15.0, 15.0 / slope),
    )
    servo = Servo(natural_frequency=random.uniform(25.0, 120.0), damping=random.uniform(0.7, 1.2))
    return Drawn("bench", Rig(cable=cable, servo=servo, reference=reference, limits=limits), cause, moment)


def release(number: int) -> Release:
    """The release of that number."""
    kind, rig, cause, moment = drawn(number)
    limits, dt = rig.supervisor_limits, rig.sample_time
    slope, plant = rig.slope, twin_plant_of(rig, 0.0)
    if rig.worn is not None:
        worn = random_wearer(number, rig.worn)
        slope, plant = 1.0, TwinSuit(worn.suit, worn.bend, rig.duration, number, rig.start_motor, 0.0)
    times = np.arange(0.0, 12.0, dt)
    requested = (rig.start_motor + (rig.trajectory.sample(times)[:, 0] - rig.begin) / slope).tolist()
    caused = round((BEFORE + moment) / dt)
    plant.doing = FOLLOW
    for k in range(caused - round(BEFORE / dt)):
        plant.command = requested[k]
        plant.advance(k * dt)

    def reading(lost: bool, current: float, drive_state: float) -> DriveReading:
        joint, motor = plant.read_encoders()
        return DriveReading(
            *(motor, math.nan if lost else joint, current, 20.0, math.nan, 0.0, 0.0, 0.0),
            *(drive_state, 0.0, 0.0, 0.0, 0.0),
        )

    target, first = plant.command, caused - round(BEFORE / dt)
    state = begin(limits, reading(False, 0.0, 4.0), cold(limits.thermal))
    state = state._replace(
        target=target,
        decided=state.decided._replace(mode=Mode.RUNNING, started=True, previous_target=target),
        servo=state.servo._replace(enabled=1.0, position=plant.motor, speed=plant.velocity),
    )
    step = compiled(supervise)
    home = rig.home
    sign, began, off, power = -limits.slack_sign, -1, -1, 3.0
    fastest, lowest, faults, start, end, mode = 0.0, math.inf, 0.0, math.nan, math.nan, 0
    before, joint, moved = 0.0, sign * (plant.joint - home), 0.0
    for k in range(first, len(times)):
        plant.advance(k * dt)
        given = k >= caused
        current = limits.current_peak if given and cause == "saturated" and k < caused + 60 else plant.current
        state, verdict = step(
            limits,
            state,
            Observed(
                reading(given and cause == "joint lost", current, 4.0 if power else 1.0),
                0.03 if k == caused and cause == "late" else 0.0,
                dt,
                Request.STOP if k == caused and cause == "stop" else Request.NONE,
                9.0 if given and cause == "operator lost" else 0.0,
                not (given and cause == "law lost"),
                PreflightResult.PASSED,
                0.0,
            ),
            math.nan if given and cause == "law lost" else requested[k],
            dt,
        )
        power = verdict.power
        plant.doing, plant.command = (FOLLOW, verdict.target) if power else (0, plant.command)
        faults = max(faults, float(verdict.faults))
        place = sign * (plant.joint - home)
        if (k - first) % STRIDE == 0:
            moved, joint = (place - joint) / (STRIDE * dt), place
        if began < 0 and verdict.mode >= Mode.RELEASING:
            began, start = k, place
        if began < 0:
            before = max(before, abs(moved))
        else:
            lowest = min(lowest, place)
            if off < 0:
                fastest, mode = max(fastest, -moved), int(verdict.mode)
                if not power:
                    off, end = k, place
            elif k > off + 500:
                break
    force = int(faults) >> Fault.SATURATED & 1
    allowed = limits.force_release if force else limits.lowering
    return Release(
        *(number, kind, cause, start * DEGREES, end * DEGREES, lowest * DEGREES),
        *(before * DEGREES, fastest * DEGREES),
        *(allowed * DEGREES, (off - began) * dt, float(longest_release(limits)), mode, int(faults)),
    )


def runs(count: int, done: int) -> Iterator[list[Any]]:
    for number in range(done, count):
        yield list(release(number))


ROOM = 1.5
"""Peak over allowed speed that friction and the springs of an arm may cause on a suit: 1.42 at most of a thousand."""


def throws(found: Release) -> str:
    """What is wrong with a release; empty if nothing is."""
    most = max(found.allowed, found.before) if found.kind == "bench" else ROOM * found.allowed
    rules = {
        f"{found.speed:.0f}°/s, not {most:.0f}": found.speed <= most + 1.0,
        f"{-found.lowest:.1f}° beyond its rest": found.lowest >= (-0.5 if found.kind == "bench" else -5.0),
        f"ends {found.end:.1f}° from its rest": found.end <= 15.0,
        f"{found.seconds:.2f} s, not {found.longest:.2f}": found.seconds <= found.longest,
        f"ended {Mode(found.mode).name}": found.mode in (Mode.STOPPED, Mode.LATCHED),
        "release pulls": not found.faults >> Fault.RELEASE_PULLS & 1,
    }
    return "; ".join(wrong for wrong, held in rules.items() if not held)


def kept(share: float = 1.0) -> list[Release]:
    """All releases, worked out where they are not there yet."""
    count = round(share * COUNT)
    rows = Kept(f"releases_{count}")
    return [Release(*row) for row in rows.filled(runs(count, len(rows.rows())), count)]


def figures(share: float) -> Found:
    """What the worst of them did."""
    found = kept(share)
    wrong = [one for one in found if throws(one)]
    for one in wrong[:20]:
        print("wrong:", one.number, one.kind, one.cause, throws(one))
    groups = {
        "benches": [one for one in found if one.kind == "bench"],
        "suits": [one for one in found if one.kind == "suit" and one.cause != "saturated"],
        "suits, `SATURATED`": [one for one in found if one.kind == "suit" and one.cause == "saturated"],
    }
    rows = []
    for name, ones in groups.items():
        if ones:
            speed = np.quantile([one.speed for one in ones], (0.5, 0.95, 1.0))
            ends, seconds = [one.end for one in ones], [one.seconds for one in ones]
            cells = (
                *(f"{max(one.allowed for one in ones):.0f}", ", ".join(f"{one:.0f}" for one in speed)),
                *(f"{min(ends):.1f} to {max(ends):.1f}", f"{min(one.lowest for one in ones):.1f}"),
            )
            rows.append((name, len(ones), *cells, f"{np.median(seconds):.2f}, {max(seconds):.2f}"))
    columns = (
        *("rigs", "releases", "allowed [°/s]", "peak speed: median, 95 %, largest [°/s]", "joint at power-off [°]"),
        *("lowest within 0.5 s after [°]", "time: median, longest [s]"),
    )
    what = f"releases that throw a joint, of {len(found)}"
    return Found([Figure(what, str(len(wrong)), "0", not wrong)], columns=columns, rows=rows)
