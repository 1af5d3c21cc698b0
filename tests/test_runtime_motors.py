"""Several motors in one loop on a clock of the tests': they begin and end together, whatever stops one of them."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.signals import DriveReading
from bowden.cycle.one_cycle import Filters, TargetSource
from bowden.hardware.ports import Power
from bowden.live.events import Changes
from bowden.live.live_run import live_run
from bowden.live.mcap_read import Recording
from bowden.live.operator import why_not
from bowden.live.preflight import Preflight
from bowden.live.replay import replay
from bowden.live.ring import Description
from bowden.live.session import Session
from bowden.live.session_motor import SessionMotor
from bowden.live.stops import run_stops, stops
from bowden.live.together import PATIENCE, AxisCoordinator, mode_of_all, modes_of_all
from bowden.rig.rig import Rig, RigMotor
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release
from bowden.safety.state import Mode, Request
from motors_rig import Misread, MotorsRig

LAW = LAWS["bowden"]
STOP, NONE, ARM, RUN = (float(one) for one in (Request.STOP, Request.NONE, Request.ARM, Request.RUN))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[MotorsRig, Recording]:
    rig = MotorsRig(tmp_path_factory.mktemp("run"), LAW, ("hip", "knee", "ankle"), starts=(0.0, 0.15, 0.05))
    ended, rows = rig.run()
    assert Mode(ended.mode) == Mode.STOPPED
    assert ended.faults == 0
    assert [one[:3] for one in ended.motors] == [(0, 0, 0)] * 3
    return rig, rows


def test_all_motors_are_armed_run_and_end_in_the_same_cycle_and_their_laws_begin_together(
    whole: tuple[MotorsRig, Recording],
) -> None:
    _, rows = whole
    parts = list(rows.parts.values())
    begins = [int(np.flatnonzero(part["source"] >= TargetSource.LAW_BEGINS)[0]) for part in parts]
    assert len({*begins}) == 1, "the way to the beginning takes as long for each"
    for part in parts[1:]:
        for mode in (Mode.PREFLIGHT, Mode.RUNNING):
            assert np.flatnonzero(part["mode"] == mode)[0] == np.flatnonzero(parts[0]["mode"] == mode)[0]
    assert len({int(np.flatnonzero(part["mode"] == Mode.RELEASING)[0]) for part in parts}) == 1


def test_each_motor_follows_as_it_does_alone_and_replays_to_the_bit(whole: tuple[MotorsRig, Recording]) -> None:
    _, rows = whole
    for name, part in rows.parts.items():
        led = part["source"] >= TargetSource.LAW_BEGINS
        assert np.sqrt(np.mean((part["joint"] - part["reference"])[led] ** 2)) < np.radians(1.0), name
        again = replay(part, LAW, Limits(), Filters(), 1e-3, same=True)
        assert again.law_cycles > 2000
        assert not again.deviates, name


def test_every_cycle_reads_all_then_writes_all_and_is_one_row(whole: tuple[MotorsRig, Recording]) -> None:
    rig, rows = whole
    assert {drive.reads for drive in rig.drives} == {len(drive.told) for drive in rig.drives} == {len(rows.rows)}
    assert [drive.closed for drive in rig.drives] == [1, 1, 1]
    assert len({*rows.columns}) == len(rows.columns) == len(rows.units)
    assert rows.columns[: len(rows.only("hip").columns)] == rows.only("hip").columns


def test_events_say_whose_they_are(whole: tuple[MotorsRig, Recording]) -> None:
    rig, rows = whole
    found, _ = Changes(Description(rows.columns, rows.units, rig.settings)).find(rows.numbers, rows.rows)
    texts = [event.text for event in found]
    for name in rig.names:
        assert f"{name}: mode: preflight → running" in texts


def lost_joint(onset: int) -> Misread:
    return lambda cycle, reading: reading._replace(joint=np.nan) if cycle >= onset else reading


def drive_fault(onset: int) -> Misread:
    return lambda cycle, reading: reading._replace(drive_state=7.0) if cycle >= onset else reading


def silent(onset: int) -> Misread:
    def misread(cycle: int, reading: DriveReading) -> DriveReading:
        return reading._replace(heartbeat_age=1e-3 * (cycle - onset)) if cycle >= onset else reading

    return misread


def second_master(onset: int) -> Misread:
    return lambda cycle, reading: reading._replace(foreign=1.0) if cycle == onset else reading


def emergency(onset: int) -> Misread:
    return lambda cycle, reading: reading._replace(emergency=8192.0) if cycle == onset else reading


def over_current(onset: int) -> Misread:
    return lambda cycle, reading: reading._replace(current=30.0) if cycle >= onset else reading


def frozen_joint(onset: int) -> Misread:
    return lambda cycle, reading: reading._replace(joint=0.3) if cycle >= onset else reading


def late(onset: int) -> Misread:
    """Its frames run late, ever more: by one cycle in ten."""
    past: list[DriveReading] = []

    def misread(cycle: int, reading: DriveReading) -> DriveReading:
        past.append(reading)
        behind = max(0, cycle - onset) // 10
        return past[-1 - behind]._replace(motor_age=float(behind), joint_age=float(behind))

    return misread


KINDS = (lost_joint, drive_fault, silent, second_master, emergency, over_current, frozen_joint, late)


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(k, marks=pytest.mark.long) for k in range(3, 100))])
def test_a_fault_of_any_motor_stops_all_within_the_limits(seed: int, tmp_path: Path) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 5))
    names = ("hip", "knee", "ankle", "toe")[:count]
    sick, kind = int(random.integers(count)), KINDS[int(random.integers(len(KINDS)))]
    onset = int(random.integers(300, 4000))
    rig = MotorsRig(tmp_path, LAW, names, seconds=1.5)
    rig.drives[sick].misread = kind(onset)
    ended, rows = rig.run()
    parts = list(rows.parts.values())
    first = parts[sick]
    stopped = np.flatnonzero((first["mode"] >= Mode.RELEASING) & (first["faults"] > 0.0))
    if not len(stopped):  # the run was over, or the joint was where it is said to be
        assert Mode(ended.mode) == Mode.STOPPED
        return
    at = int(stopped[0])
    powered = [part["power"][at - 1] == Power.ON for part in parts]
    r3 = first["reaction"][at] == 3.0
    for i, part in enumerate(parts):
        if not powered[i]:
            continue
        assert part["mode"][at + 1] >= Mode.RELEASING, "the others see it in the next cycle"
        longest = 2 if r3 else 2 + round(1000 * (longest_release(Limits()) + 0.005))
        off = min(at + longest, len(part.rows) - 1)  # or the run has ended, which it does without power
        assert part["power"][off] == Power.OFF
        assert all(power == Power.OFF for power, _ in rig.drives[i].told[at + longest :])
        if i != sick and any(powered):
            found = {*of(float(part["faults"][at + 1]))}
            assert found & {Fault.OTHER_RELEASED, Fault.OTHER_OFF}
            assert (Fault.OTHER_OFF in found) == bool(r3)
    if any(powered):
        said = run_stops(rows, {}, twin=False)
        assert said[0].motor == names[sick]
        assert not {Fault.OTHER_RELEASED.meaning, Fault.OTHER_OFF.meaning} & {*said[0].causes}


def test_motors_that_are_independent_leave_the_others_running(tmp_path: Path) -> None:
    rig = MotorsRig(tmp_path, LAW, independent=True, seconds=2.0)
    rig.drives[0].misread = drive_fault(2500)
    ended, rows = rig.run()
    hip, knee = rows.parts.values()
    assert [Mode(one.mode) for one in ended.motors] == [Mode.LATCHED, Mode.STOPPED]
    assert hip["mode"][2600] == Mode.LATCHED
    assert knee["mode"][2600] == Mode.RUNNING
    assert not stops(knee)
    assert (knee["source"] >= TargetSource.LAW_BEGINS).sum() >= 1999


def test_a_preflight_that_fails_fails_for_all(tmp_path: Path) -> None:
    wrong = Preflight(slope_sign=-1.0)
    ended, rows = MotorsRig(tmp_path, LAW, preflights=(Preflight(), wrong)).run()
    hip, knee = rows.parts.values()
    assert Mode(ended.mode) == Mode.LATCHED
    assert hip["preflight_reason"].max() == 0.0
    assert knee["preflight_reason"].max() > 0.0
    for part in (hip, knee):
        assert part["preflight"].min() == -1.0
        assert part["mode"].max() == Mode.LATCHED
        assert not (part["mode"] == Mode.RUNNING).any()


def test_no_motor_is_armed_while_another_is_latched_and_an_acknowledgement_is_for_all(tmp_path: Path) -> None:
    def between(rig: MotorsRig) -> None:
        if rig.sleeps == 100:
            rig.block.ask(Request.ACKNOWLEDGE)

    rig = MotorsRig(tmp_path, LAW, latched=(None, 2.0**Fault.SLACK), between=between, seconds=0.5, quits=400)
    rig.arms = (10, 150)
    ended, rows = rig.run()
    hip, knee = rows.parts.values()
    assert Mode(ended.mode) == Mode.STOPPED
    assert hip["mode"][:100].max() == Mode.STOPPED
    assert Fault.OTHER_RELEASED in of(float(hip["faults"][50]))
    assert knee["mode"][50] == Mode.LATCHED
    assert (hip["mode"] == Mode.RUNNING).sum() == (knee["mode"] == Mode.RUNNING).sum() > 400


def test_a_bridged_reading_as_the_run_begins_keeps_no_motor_behind(tmp_path: Path) -> None:
    gap: list[int] = []

    def between(rig: MotorsRig) -> None:
        newest = rig.reader.last()
        if newest is not None and not gap and rig.rows_of(newest)[0]["preflight"] == 1.0:
            gap.append(rig.drives[1].reads)

    def misread(cycle: int, reading: DriveReading) -> DriveReading:
        return reading._replace(joint=np.nan) if gap and gap[0] <= cycle < gap[0] + 3 else reading

    rig = MotorsRig(tmp_path, LAW, between=between, seconds=0.5)
    rig.drives[1].misread = misread
    ended, rows = rig.run()
    begins = [int(np.flatnonzero(part["mode"] == Mode.RUNNING)[0]) for part in rows.parts.values()]
    assert Mode(ended.mode) == Mode.STOPPED
    assert abs(begins[0] - begins[1]) <= 5


def test_a_broken_verdict_of_one_motor_switches_all_off_in_the_same_cycle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bowden.core.errors import SafetyError

    rig = MotorsRig(tmp_path, LAW)
    knee = rig.loop._motors[1]
    judge = knee._last_word.judge

    def broken(verdict: object) -> None:
        if rig.sleeps > 2000:
            raise SafetyError("broken")
        judge(verdict)  # type: ignore[arg-type]

    monkeypatch.setattr(knee._last_word, "judge", broken)
    with pytest.raises(SafetyError, match="broken"):
        rig.loop.run()
    assert [drive.told[2000][0] for drive in rig.drives] == [Power.OFF, Power.OFF]
    assert [drive.told[1999][0] for drive in rig.drives] == [Power.ON, Power.ON]
    rows = rig.reader.read().rows
    assert [one["mode"] for one in rig.rows_of(rows[-1])] == [float(Mode.LATCHED)] * 2


def test_whatever_one_drive_does_all_are_told_off_and_let_go_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = MotorsRig(tmp_path, LAW)
    hip, knee = rig.drives

    def broken(*_: object) -> None:
        raise RuntimeError("broken")

    def breaks(cycle: int, reading: DriveReading) -> DriveReading:
        if cycle == 2000:
            for name in ("write", "close"):
                monkeypatch.setattr(hip, name, broken)
            broken()
        return reading

    hip.misread = breaks
    with pytest.raises(RuntimeError, match="broken"):
        rig.loop.run()
    assert knee.told[-2][0] is Power.ON
    assert knee.told[-1][0] is Power.OFF
    assert knee.closed == 1


def test_what_is_asked_for_is_asked_of_all_or_of_none() -> None:
    pair = AxisCoordinator(2, independent=False)
    stopped, preflight, running, bridging, releasing, latched = map(float, Mode)
    assert pair.asked(ARM, [stopped, stopped], [0.0, 0.0]) == [ARM, ARM]
    assert pair.asked(ARM, [stopped, stopped], [0.0, 8.0]) == [NONE, NONE]
    assert pair.asked(ARM, [stopped, latched], [0.0, 8.0]) == [NONE, NONE]
    assert pair.asked(RUN, [preflight, preflight], [0.0, 0.0]) == [RUN, RUN]
    assert pair.asked(RUN, [preflight, bridging], [0.0, 0.0]) == [NONE, NONE]
    assert pair.asked(NONE, [preflight, stopped], [0.0, 0.0]) == [STOP, NONE]
    assert pair.asked(NONE, [running, latched], [0.0, 0.0]) == [STOP, NONE]
    assert pair.asked(NONE, [releasing, stopped], [0.0, 0.0]) == [NONE, NONE]
    assert pair.asked(STOP, [running, running], [0.0, 0.0]) == [STOP, STOP]
    for _ in range(PATIENCE):
        assert pair.asked(NONE, [running, preflight], [0.0, 0.0]) == [NONE, RUN]
    assert pair.asked(NONE, [running, preflight], [0.0, 0.0]) == [STOP, STOP]
    alone = AxisCoordinator(2, independent=True)
    assert alone.asked(ARM, [stopped, latched], [0.0, 8.0]) == [ARM, ARM]
    assert alone.shown([1 << Fault.SLACK, 0]) == [0, 0]
    assert alone.outcomes([1.0, -1.0]) == [1.0, -1.0]
    assert alone.over([True, False], [running, latched])
    assert not alone.over([True, False], [running, bridging]), "a reading that is missing ends no motor's run"


def test_the_others_are_shown_the_worst_of_an_motor_own_faults() -> None:
    three = AxisCoordinator(3, independent=False)
    slack, fault, follows = 1 << Fault.SLACK, 1 << Fault.DRIVE_FAULT, 1 << Fault.OTHER_OFF
    assert three.shown([0, 0, 0]) == [0.0, 0.0, 0.0]
    assert three.shown([slack, 0, 0]) == [0.0, 2.0, 2.0]
    assert three.shown([slack, fault, 0]) == [3.0, 2.0, 3.0]
    assert three.shown([follows, fault, follows]) == [3.0, 0.0, 3.0]
    assert three.outcomes([1.0, 0.0, 1.0]) == [0.0] * 3
    assert three.outcomes([1.0, 0.0, -1.0]) == [-1.0] * 3


@pytest.mark.parametrize("independent", [False, True])
def test_the_mode_of_all_is_that_of_the_motor_furthest_from_rest(independent: bool) -> None:
    rows = np.array([[float(a), float(b)] for a in Mode for b in Mode])
    each = [float(mode_of_all(row.tolist(), independent=independent)) for row in rows]
    assert modes_of_all(rows, independent=independent).tolist() == each
    assert mode_of_all((5.0, 0.0), independent=independent) == Mode.LATCHED
    assert mode_of_all((5.0, 2.0), independent=independent) == Mode.RUNNING


def looked_at(tmp_path: Path, modes: Sequence[Mode], faults: Sequence[float], *, independent: bool) -> Any:
    """A session of two motors that nobody has begun, and the row in which they are so."""
    hip = Rig(law="bowden")
    knee = hip.replace(drive=hip.drive._replace(node_id=2))
    live = live_run(Rig(motors=(RigMotor("hip", hip), RigMotor("knee", knee)), independent=independent))
    session, columns = Session(live, tmp_path / "x.mcap", remembers=False), (*live.columns(),)
    session.motors = tuple(SessionMotor(one, columns, live.names, 0, remembers=False) for one in live.motors)
    session.rows = SimpleNamespace(description=SimpleNamespace(columns=columns))  # type: ignore[assignment]
    session.ready = {"drive": "both", "drives": ["hip's", "knee's"]}
    values = dict.fromkeys(columns, 0.0)
    for before, mode, bits in zip(("", "knee."), modes, faults, strict=True):
        values |= {f"{before}mode": float(mode), f"{before}faults": bits}
    values["knee.preflight_reason"] = 1.0
    return session, session.row_of(np.array([*values.values()]))


def test_what_one_motor_has_is_told_of_it_alone(tmp_path: Path) -> None:
    session, row = looked_at(tmp_path, (Mode.RUNNING, Mode.LATCHED), (0.0, 2.0**Fault.DRIVE_FAULT), independent=True)
    assert Mode(int(row["mode"])) == Mode.RUNNING
    assert of(row["faults"]) == [Fault.DRIVE_FAULT], "of all"
    hip, knee = (motor.of(row) for motor in session.motors)
    assert (hip["faults"], hip["preflight_reason"], knee["preflight_reason"]) == (0.0, 0.0, 1.0)
    assert [one.motor for one in session.faults(row)] == ["knee"]
    assert session.drive_said(row) == "knee: knee's"


def test_a_key_that_moves_one_motor_that_goes_alone_is_not_said_to_do_nothing(tmp_path: Path) -> None:
    modes, none = (Mode.RUNNING, Mode.STOPPED), (0.0, 0.0)
    session, row = looked_at(tmp_path, modes, none, independent=True)
    assert why_not(Request.ARM, session.judged(row)) == ""
    session, row = looked_at(tmp_path, modes, none, independent=False)
    assert why_not(Request.ARM, session.judged(row)) == "it is armed"
    assert why_not(Request.ARM, session.judged(None)) == ""
