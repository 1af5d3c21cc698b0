"""A run without an operator's keys: armed, run, and watched to its end."""

import sys
from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from bowden.core.errors import SafetyError
from bowden.live.control_block import ControlBlock
from bowden.live.ring import RecorderState
from bowden.live.stops import MotorFaults, remedy_of
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.state import Mode, Request

_PATIENCE = 3.0
"""Time that readings are given to come in before arming is given up [s]."""
_LATE_PATIENCE = 30.0
"""The same where nothing but the loop's lateness speaks against it, which on a shared computer comes and goes [s]."""


class Watched(Protocol):
    """A session, as far as `automatic` uses it."""

    ready: dict[str, Any]
    block: ControlBlock
    began_latched: bool
    """True if the previous run left an unacknowledged fault."""

    @property
    def on_twin(self) -> bool:
        """True if the drive is a twin of the command's own."""

    def last(self) -> dict[str, float] | None:
        """The newest row by its columns."""

    def faults(self, row: Mapping[str, float]) -> list[MotorFaults]:
        """The faults of a row, of each motor that has some."""


def _listed(row: Mapping[str, float], session: Watched) -> str:
    """The faults of a row with what to do, of several motors with whose they are."""
    recorder = row.get("recorder", RecorderState.OK)
    return "; ".join(
        f"{f'{one.motor}: ' if one.motor else ''}{fault.meaning}: "
        f"{remedy_of(fault, twin=session.on_twin, recorder=recorder, emg=row.get('emg.loss'))}"
        for one in session.faults(row)
        for fault in sorted(one.came, key=lambda fault: -fault.then)
    )


def automatic(session: Watched, stops: int = 0) -> Iterator[bool]:
    """Arm, run and wait for the end, one look at a time; ends when the run has ended, or does not begin.

    Args:
        session: the run.
        stops: `ControlBlock.stops` at its beginning: after another stop nothing is armed or run.

    Raises:
        SafetyError: what speaks against arming does not go.
    """
    begun, passed, announced, asked = None, None, False, False
    for request, wanted in ((Request.ARM, Mode.PREFLIGHT), (Request.RUN, Mode.RUNNING)):
        while True:
            row = session.last()
            assert row is not None
            begun = row["time"] if begun is None else begun
            if request == Request.RUN and row["mode"] == Mode.PREFLIGHT and row["preflight"] == 0.0:
                yield True
                continue
            if row["mode"] == wanted:
                break
            if request == Request.RUN and row["mode"] == Mode.PREFLIGHT:
                passed = row["time"] if passed is None else passed
                if row["faults"] and row["time"] - passed > _PATIENCE:
                    said = f"the preflight has passed, and the run does not begin: {_listed(row, session)}"
                    print(f"bowden: note: {said}", file=sys.stderr)
                    return
            if not asked and row["mode"] == Mode.LATCHED:
                listed = _listed(row, session)
                last = "the last run ended in a fault that has not been acknowledged"
                what = last if session.began_latched else "the supervisor has latched a fault before this run was armed"
                raise SafetyError(
                    f"{what}: {listed or 'which is not known'}",
                    do="correct the cause, and acknowledge it with k in a run without --auto",
                )
            if row["mode"] >= Mode.RELEASING or (request == Request.RUN and row["mode"] == Mode.STOPPED):
                return
            if session.block.stops != stops:
                return
            waited = row["time"] - begun
            if row["faults"] and row["mode"] == Mode.STOPPED and waited > _PATIENCE:
                found = list(faults.of(row["faults"]))
                listed = _listed(row, session)
                if found == [Fault.LATE]:
                    late = 1e3 * max(row["lateness"], row["supervisor.timers.late"])
                    listed = f"this computer is too busy, cycles come {late:.0f} ms late: {Fault.LATE.remedy}"
                if found != [Fault.LATE] or waited > _LATE_PATIENCE:
                    do = "with k, in a run without --auto" if Fault.DRIVE_FAULT in found else ""
                    raise SafetyError(f"the supervisor does not arm {session.ready['drive']}: {listed}", do=do)
                if not announced:
                    said = f"not armed yet, {listed}; waiting, for {_LATE_PATIENCE:g} s at most"
                    print(f"bowden: note: {said}", file=sys.stderr)
                announced = True
            session.block.ask(request, stops)
            asked = True
            yield True
    while (row := session.last()) is not None and row["mode"] in (Mode.RUNNING, Mode.BRIDGING, Mode.RELEASING):
        yield True
