"""The loop: once a period read, filter, law, supervisor, drive, ring; and nothing else."""

from dataclasses import dataclass

from bowden.core.clock import SECOND, TimeSource, next_deadline
from bowden.core.errors import SafetyError
from bowden.core.signals import DriveState
from bowden.cycle.one_cycle import Cycle
from bowden.cycle.torque_offset import TorqueOffset
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.ports import Drive, Power
from bowden.live.control_block import ControlBlock
from bowden.live.gain_ramp import GainRamp
from bowden.live.ring import RingWriter
from bowden.live.ring_status import RecorderState
from bowden.live.row import AT
from bowden.live.script import Script
from bowden.safety.faults import Fault
from bowden.safety.last_word import LastWord
from bowden.safety.supervisor import POWER_OFF, Mode, Observed, Request

_STOP, _ACKNOWLEDGE = float(Request.STOP), float(Request.ACKNOWLEDGE)
_RESTING = (float(Mode.STOPPED), float(Mode.LATCHED))
_TURNING = (
    *(float(DriveState.OPERATION_ENABLED), float(DriveState.QUICK_STOP_ACTIVE)),
    float(DriveState.FAULT_REACTION_ACTIVE),
)
"""States of a drive that may have torque."""
_LAST = 10
"""Cycles with the power off before the loop ends, in which the drive learns of it and says so."""


@dataclass(frozen=True)
class Ended:
    """How the loop ended."""

    cycles: int
    overruns: int
    """Deadlines that were skipped."""
    mode: int
    """Number of the supervisor's last `Mode`."""
    faults: int
    """The supervisor's last bit set."""
    torque: int
    """Number of the drive's `hardware.ports.TorqueLeft`."""
    stalled: float
    """How long this computer did not let the loop run, where that ended the run; 0 where it did not [s]."""
    unattended: float = 0.0
    """Age of the operator's last sign of life, where nobody asked for the end and this alone brought it before the
    reference had come to its own; 0 elsewhere [s]."""


class Loop:
    """All parts of a run, put together.

    Args:
        drive: brought up.
        cycle: begun, so that it is compiled.
        script: of the run.
        ring: for a row a cycle.
        block: the operator's words.
        clock: to go by.
        start: the clock where the column ``time`` is zero [ns].
        course: of a run by EMG; the script's too.
        push: of a drive that takes a torque offset.
    """

    def __init__(
        self,
        drive: Drive,
        cycle: Cycle,
        script: Script,
        ring: RingWriter,
        block: ControlBlock,
        clock: TimeSource,
        start: int,
        course: EmgCourse | None = None,
        push: TorqueOffset | None = None,
    ) -> None:
        self._drive, self._cycle, self._script = drive, cycle, script
        self._ring, self._block, self._clock, self._start = ring, block, clock, start
        self._course, self._push, self._quit = course, push, False

    def quit(self) -> None:
        """End the run with a controlled release, as the operator's word does; for signals."""
        self._quit = True

    def run(self) -> Ended:
        """Cycle until the end is asked for, or the operator is gone, and the power is off; then close the drive.

        The end waits until the drive says that its torque is off, or the supervisor has found that it keeps it.

        Raises:
            SafetyError: the supervisor's verdict was broken; the torque is switched off, and the cycle is recorded.
        """
        try:
            cycles, overruns, mode, faults, stalled, unattended = self._run()
        finally:
            left = self._drive.close()
            self._ring.close()
        return Ended(cycles, overruns, mode, faults, int(left), stalled, unattended)

    def _run(self) -> tuple[int, int, int, int, float, float]:
        clock, drive, cycle = self._clock, self._drive, self._cycle
        script, ring, block, course, push = self._script, self._ring, self._block, self._course, self._push
        period, patience = round(cycle.period * SECOND), cycle.limits.operator_age
        deadline = clock.now() + period
        before, skipped, overruns, cycles, resting = deadline - period, 0, 0, 0, 0
        begun = cycle.state.supervisor
        mode, target, verdict, stalled = float(begun.decided.mode), begun.target, None, 0.0
        last_word, gains = LastWord(cycle.limits, cycle.period, target), GainRamp(cycle.law, cycle.gains, cycle.period)
        while resting < _LAST:
            clock.sleep_until(deadline)
            woke = clock.now()
            now = woke * 1e-9
            reading = drive.read(now)

            # what is asked for
            age = block.age(woke)
            ending = self._quit or block.quitting or not age <= patience
            request = float(block.take())
            if ending or (script.done and mode == _RUNNING and request == 0.0):
                request = _STOP
            if request == _ACKNOWLEDGE:
                drive.reset_fault()
            emg_age = 0.0 if course is None else course.look(woke)
            plan = script.plan(mode, target, reading, 1 + skipped)
            gains.step(block, 1 + skipped)

            # what is done
            recorder = 1.0 if ring.recorder.state(woke) == RecorderState.OK else 0.0
            lateness, elapsed = (woke - deadline) * 1e-9, (woke - before) * 1e-9
            observed = Observed(reading, lateness, elapsed, request, age, recorder, script.outcome, emg_age)
            wish, verdict = cycle.step(observed, plan)
            if verdict.mode > _POWERED and mode in _LED and int(verdict.faults) & _STALLS:
                stalled = max(lateness, cycle.state.supervisor.sums.late)
            broken = None
            try:
                last_word.judge(verdict)
            except SafetyError as error:  # recorded as what is done instead; the error has what was said
                broken = error
                verdict = verdict._replace(target=target, power=POWER_OFF, mode=float(Mode.LATCHED))
            mode, target = verdict.mode, verdict.target
            torque = 0.0 if push is None else push.step(target, verdict, cycle.period)
            drive.write(target, Power(int(verdict.power)), now, torque)

            # what is kept
            row, state = ring.next_row(), cycle.recorded()
            row[:] = (
                *((woke - self._start) * 1e-9, *cycle.reference, *reading, *state.sample, wish),
                *(*verdict, plan.source, lateness, elapsed, skipped, request, age, recorder),
                *(script.outcome, script.reason, script.play, 0.0),
                *(*state.law, *state.conditioned, *state.supervisor, *(() if course is None else course.row())),
                *(*(() if push is None else push.row()), *state.source, *gains.recorded),
            )
            finished = clock.now()
            row[_RUN_TIME] = (finished - woke) * 1e-9
            ring.publish()
            if broken is not None:
                raise broken

            before, cycles = woke, cycles + 1
            turning = reading.drive_state in _TURNING and not int(verdict.faults) >> Fault.NOT_DISABLED & 1
            resting = resting + 1 if ending and mode in _RESTING and not turning else 0
            deadline, skipped = next_deadline(deadline, finished, period)
            overruns += skipped
        asked = self._quit or block.quitting or script.done
        return cycles, overruns, int(mode), int(verdict.faults) if verdict else 0, stalled, 0.0 if asked else age


_LED = (float(Mode.PREFLIGHT), float(Mode.RUNNING), float(Mode.BRIDGING))
_POWERED = float(Mode.BRIDGING)
"""The last mode in which a run is not at its end."""
_STALLS = 1 << Fault.LATE | 1 << Fault.CLOCK
"""Faults of this computer, and not of the rig."""
_RUNNING = float(Mode.RUNNING)
_RUN_TIME = AT["run_time"]
