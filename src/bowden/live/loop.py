"""The loop: once a period read, filter, law, supervisor, drive, ring; and nothing else.

Of several motors all are read, then all are judged, then all are written, so that the buses carry their frames
together.
"""

import contextlib
import functools
import struct
from collections.abc import Sequence

from bowden.core.clock import SECOND, TimeSource, next_deadline
from bowden.core.errors import SafetyError
from bowden.core.signals import DriveReading
from bowden.cycle.one_cycle import HOLD, NOWHERE, Cycle, Plan
from bowden.cycle.torque_offset import TorqueOffset
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.ports import Drive, Power, TorqueLeft
from bowden.live.brake_hold import BrakeHold
from bowden.live.control_block import ControlBlock
from bowden.live.ended import Ended, EndedMotor
from bowden.live.gain_ramp import GainRamp, step_all
from bowden.live.joint_estimate import LiveEstimate
from bowden.live.ring import RecorderState, RingWriter
from bowden.live.row import AT
from bowden.live.script import Script
from bowden.live.together import AxisCoordinator
from bowden.safety.faults import Fault, Reaction, bits_of
from bowden.safety.last_word import LastWord
from bowden.safety.state import Mode, Observed, PreflightResult, Request, Verdict

_RESTING = (Mode.STOPPED, Mode.LATCHED)
_LAST = 10
"""Cycles with the power off before the loop ends, in which the drive learns of it and says so."""


class LoopMotor:
    """One motor of the loop.

    Args:
        drive: brought up.
        cycle: begun, so that it is compiled.
        script: what it does.
        course: of a run by EMG; the script's too.
        push: of a drive that takes a torque offset.
        brake: of a drive with a holding brake.
        estimate: of a joint without an encoder.
    """

    among = shared = False
    """True if it is one of several, and if another one is on its joint."""

    def __init__(
        self,
        drive: Drive,
        cycle: Cycle,
        script: Script,
        course: EmgCourse | None = None,
        push: TorqueOffset | None = None,
        brake: BrakeHold | None = None,
        estimate: LiveEstimate | None = None,
    ) -> None:
        self.drive, self.cycle, self.script, self.estimate = drive, cycle, script, estimate
        self._course, self._push, self._brake = course, push, brake
        begun = self.cycle.state.supervisor
        self.mode, self.target = begun.decided.mode, begun.target
        """Of the last verdict."""
        self.ran = False
        """True if it ever was in `Mode.RUNNING`."""
        self.verdict = Verdict(self.target, Power.OFF, self.mode, Reaction.NONE, 0)
        self.gains = GainRamp(self.cycle.law, self.cycle.gains, self.cycle.period)
        self.stalled = 0.0
        """See `Ended.stalled`."""
        self.reading: DriveReading
        self.request, self.others, self.outcome = Request.NONE, Reaction.NONE, PreflightResult.PENDING
        self.neighbour = 0.0
        """Input of its supervisor from the other motors."""
        self._last_word = LastWord(self.cycle.limits, self.cycle.period, self.target)
        self._plan, self._requested_target, self._torque = Plan(HOLD, 0.0, NOWHERE), self.target, 0.0
        self._emg_age = 0.0

    def read(self, now: float) -> None:
        """Read the drive."""
        reading = self.drive.read(now)
        reading = reading if self._brake is None else self._brake.shown(reading)
        self.reading = reading if self.estimate is None else self.estimate.shown(reading, now)

    def plan(self, woke: int, cycles: int) -> None:
        """Plan the target of the motor; `cycles` are periods since the last cycle."""
        self._emg_age = 0.0 if self._course is None else self._course.look(woke)
        self._plan = self.script.plan(self.mode, self.target, self.reading, cycles)
        self.outcome = self.script.outcome

    def judge(self, lateness: float, elapsed: float, age: float, recorder: int) -> SafetyError | None:
        """What is done: law and supervisor; an error where the verdict is broken, which the torque's end replaces."""
        cycle, before = self.cycle, self.mode
        observed = Observed(
            *(self.reading, lateness, elapsed, self.request, age, recorder == RecorderState.OK),
            *(self.outcome, self._emg_age),
            *(self.others, self.neighbour),
        )
        self._requested_target, verdict = cycle.step(observed, self._plan)
        if verdict.mode not in _LED and before in _LED and verdict.faults & _STALLS:
            self.stalled = max(lateness, cycle.state.supervisor.timers.late)
        broken = None
        try:
            self._last_word.judge(verdict)
        except SafetyError as error:  # recorded as what is done instead; the error has what was said
            broken = error
            verdict = self._off(verdict)
        self.verdict, self.mode, self.target = verdict, verdict.mode, verdict.target
        self.ran = self.ran or verdict.mode == Mode.RUNNING
        return broken

    def _off(self, verdict: Verdict) -> Verdict:
        return verdict._replace(target=self.target, power=Power.OFF, mode=Mode.LATCHED)

    def switch_off(self) -> None:
        """In place of its verdict: another motor's is broken."""
        self.verdict = self._off(self.verdict)
        self.mode = self.verdict.mode

    def write(self, now: float) -> None:
        """Send the drive what was decided."""
        verdict, push = self.verdict, self._push
        self._torque = 0.0 if push is None else push.step(self.target, verdict, self.cycle.period)
        if self._brake is None:
            self.drive.write(self.target, verdict.power, now, self._torque)
        else:
            self._brake.write(verdict, self.reading.motor, now, self._torque)

    @property
    def pulls(self) -> bool:
        """True if its drive has a sign of torque, by its state or its current, although its power is off."""
        return self.cycle.state.supervisor.timers.undisabled > 0.0

    @property
    def turning(self) -> bool:
        """True if it has one, and the supervisor has not found that it keeps it."""
        return not self.verdict.faults >> Fault.NOT_DISABLED & 1 and self.pulls

    def put(self, ring: memoryview, at: int, times: tuple[float, float, float, float, float, float] | None) -> int:
        """Write what is kept of a cycle into its row; where the next motor's part begins.

        Args:
            ring: its bytes.
            at: where in them this motor's part begins.
            times: of the first motor, which has what is common too: the columns ``time``, ``lateness``, ``elapsed``,
                ``overruns``, ``operator_age`` and ``recorder``.
        """
        cycle, script, reading = self.cycle, self.script, self.reading
        if times is not None:
            time, lateness, elapsed, skipped, age, recorder = times
            _WHOLE.pack_into(
                *(ring, at, time, *cycle.reference, *reading, *cycle.sample[:2], self._requested_target, *self.verdict),
                *(self._plan.source, lateness, elapsed, skipped, self.request, age, recorder),
                *(self.outcome, script.reason, script.play, 0.0),
            )
            states = at + _WHOLE.size
        else:
            _OWN.pack_into(
                *(ring, at, *cycle.reference, *reading, *cycle.sample[:2], self._requested_target, *self.verdict),
                *(self._plan.source, self.request, self.outcome, script.reason, script.play),
            )
            states = at + _OWN.size
        kept, course, push = cycle.kept_bytes, self._course, self._push
        rest = (
            *(*(() if course is None else course.row()), *(() if push is None else push.row())),
            *(() if self._brake is None else self._brake.row()),
            *(*cycle.recorded_source, *self.gains.recorded, *self.together),
        )
        end = states + len(kept)
        ring[states:end] = kept
        packed = _doubles(len(rest))
        packed.pack_into(ring, end, *rest)
        return end + packed.size

    @property
    def together(self) -> tuple[float, ...]:
        """What a motor among others has besides, `together.TOGETHER`, and one that shares its joint,
        `together.SHARED`."""
        among = (self.others, self.script.outcome) if self.among else ()
        return (*among, self.neighbour) if self.shared else among


class Loop:
    """All parts of a run, put together.

    Args:
        motors: one, or several.
        ring: for a row a cycle.
        block: the operator's words.
        clock: to go by.
        start: the clock where the column ``time`` is zero [ns].
        independent: whether a motor that is stopped by a fault leaves the others running.
        encoders: for each motor the place of the one whose drive has its joint's encoder; its own where none are given.
        neighbours: for each motor the place of another one on its joint; its own where none are given.
    """

    def __init__(
        self,
        motors: Sequence[LoopMotor],
        ring: RingWriter,
        block: ControlBlock,
        clock: TimeSource,
        start: int,
        *,
        independent: bool = False,
        encoders: Sequence[int] = (),
        neighbours: Sequence[int] = (),
    ) -> None:
        self._motors, alone = tuple(motors), independent or len(motors) == 1
        self._beside = [(motors[i], motors[by]) for i, by in enumerate(neighbours) if by != i]
        self._borrowing = [(motors[i], motors[by]) for i, by in enumerate(encoders) if by != i]
        for motor in motors:
            motor.among, motor.shared = len(motors) > 1, any(motor is one for one, _ in self._beside)
        self._together = AxisCoordinator(len(motors), independent=alone)
        self._ring, self._block, self._clock, self._start = ring, block, clock, start
        self._quit, self._independent, self._running = False, alone, False

    def quit(self) -> None:
        """End the run with a controlled release, as the operator's word does; for signals."""
        self._quit = True

    def run(self) -> Ended:
        """Cycle until the end is asked for, or the operator is gone, and the power is off; then close the drives.

        The end waits until no drive shows torque, or the supervisor has found that one keeps it: its report of no
        torque is then not trusted.

        Raises:
            SafetyError: a supervisor's verdict was broken; the torque is switched off, and the cycle is recorded.
        """
        try:
            cycles, overruns, unattended = self._run()
        except BaseException:
            self._off()
            raise
        finally:
            left = self._close()
        ended = tuple(
            EndedMotor(
                *(motor.mode, motor.verdict.faults),
                *(TorqueLeft.ON if motor.pulls and not torque else torque, motor.script.reason),
            )
            for motor, torque in zip(self._motors, left, strict=True)
        )
        stalled, ran = max(motor.stalled for motor in self._motors), any(motor.ran for motor in self._motors)
        return Ended(cycles, overruns, stalled, unattended, ran, ended)

    def _off(self) -> None:
        """No drive waits for the end of another one's `close`; all are told, since SYNC follows the frames of all."""
        now = self._clock.now() * 1e-9
        for motor in self._motors:
            with contextlib.suppress(Exception):  # what ended the loop may be one of them
                motor.drive.write(motor.target, Power.OFF, now)

    def _close(self) -> list[TorqueLeft]:
        """Let go of each drive, and of the ring, whatever becomes of another one."""
        left: list[TorqueLeft] = []
        with contextlib.ExitStack() as stack:
            stack.callback(self._ring.close)
            for motor in reversed(self._motors):
                if motor.estimate is not None:
                    stack.callback(motor.estimate.close)
                stack.callback(lambda close: left.append(close()), motor.drive.close)
        return left

    def _run(self) -> tuple[int, int, float]:
        clock, motors, first = self._clock, self._motors, self._motors[0]
        ring, block, ramps = self._ring, self._block, [motor.gains for motor in self._motors]
        period, patience = round(first.cycle.period * SECOND), min(motor.cycle.limits.operator_age for motor in motors)
        deadline = clock.now() + period
        before, skipped, overruns, cycles, resting = deadline - period, 0, 0, 0, 0
        age = 0.0
        while resting < _LAST:
            clock.sleep_until(deadline)
            woke = clock.now()
            now = woke * 1e-9
            for motor in motors:
                motor.read(now)
            for motor, of in self._borrowing:
                motor.reading = motor.reading._replace(**{name: getattr(of.reading, name) for name in _OF_JOINT})
            for motor, other in self._beside:
                motor.neighbour = other.reading.motor

            # what is asked for
            age = block.age(woke)
            ending = self._quit or block.quitting or not age <= patience
            request = block.take()
            if ending or (request == Request.NONE and self._over()):
                request = Request.STOP
            if request == Request.ACKNOWLEDGE:
                for motor in motors:
                    motor.drive.reset_fault()
            self._plan(request, woke, 1 + skipped)
            step_all(ramps, block, 1 + skipped)

            # what is done
            recorder = ring.recorder.state(woke)
            lateness, elapsed = (woke - deadline) * 1e-9, (woke - before) * 1e-9
            broken = None
            for motor in motors:
                broken = motor.judge(lateness, elapsed, age, recorder) or broken
            if broken is not None:
                for motor in motors:
                    motor.switch_off()
            for motor in motors:
                motor.write(clock.now() * 1e-9)  # this process may have stood still since it woke

            # what is kept
            row = ring.next_place()
            at = first.put(ring.bytes, row, ((woke - self._start) * 1e-9, lateness, elapsed, skipped, age, recorder))
            for motor in motors[1:]:
                at = motor.put(ring.bytes, at, None)
            finished = clock.now()
            _RUN_TIME.pack_into(ring.bytes, row + _RUN_TIME_AT, (finished - woke) * 1e-9)
            ring.publish()
            if broken is not None:
                raise broken

            before, cycles = woke, cycles + 1
            rests = ending and all(motor.mode in _RESTING and not motor.turning for motor in motors)
            resting = resting + 1 if rests else 0
            deadline, skipped = next_deadline(deadline, finished, period)
            overruns += skipped
        asked = self._quit or block.quitting or all(motor.script.done for motor in motors)
        return cycles, overruns, 0.0 if asked else age

    def _over(self) -> bool:
        """True if the run has come to its end."""
        motors = self._motors
        return self._together.over([motor.script.done for motor in motors], [motor.mode for motor in motors])

    def _plan(self, request: Request, woke: int, cycles: int) -> None:
        """What is asked of the motors, and what the supervisor of each is shown of the others."""
        motors, together = self._motors, self._together
        modes = [motor.mode for motor in motors]
        asked = together.asked(request, modes, [motor.verdict.faults for motor in motors])
        shown = together.shown([motor.cycle.latched for motor in motors])
        if Mode.RUNNING in modes and not (self._running or self._independent):
            longest = max(motor.script.approach(motor.target) for motor in motors)
            for motor in motors:
                motor.script.least = longest
        self._running = Mode.RUNNING in modes
        for motor in motors:
            motor.plan(woke, cycles)
        outcomes = together.outcomes([motor.outcome for motor in motors])
        for motor, one, others, outcome in zip(motors, asked, shown, outcomes, strict=True):
            motor.request, motor.others, motor.outcome = one, others, outcome


_OF_JOINT = ("joint", "joint_age", "joint_sensor_age", "joint_std", "joint_sensor")
"""What of a reading is its joint's."""
_LED = (Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING)
_STALLS = bits_of((Fault.LATE, Fault.CLOCK))
"""Faults of this computer, and not of the rig."""
_RUN_TIME, _RUN_TIME_AT = struct.Struct("d"), 8 * AT["run_time"]
_COMMON = ("time", "lateness", "elapsed", "overruns", "operator_age", "recorder", "run_time")
_WHOLE, _OWN = struct.Struct(f"{len(AT)}d"), struct.Struct(f"{len(AT) - len(_COMMON)}d")
"""The first columns of the first motor, and of the others, without those of the loop."""


@functools.cache
def _doubles(count: int) -> struct.Struct:
    """What packs so many numbers."""
    return struct.Struct(f"{count}d")
