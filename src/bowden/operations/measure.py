"""`measure`: move the motor under supervision, and leave logs that identify and identify-servo take."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bowden.live.figures import EndedRun
from bowden.operations.support.operation import Folder, GivenRig, Operation, Quiet, Tell
from bowden.operations.support.results import Result


@dataclass(frozen=True)
class MeasuredMotion(EndedRun, Result["MeasuredMotion"]):
    """A run that moved the motor, and what it left."""

    cycles_left_out: int
    """Cycles of the motion that this computer did not let run; their samples are drawn in between their neighbours."""
    files: tuple[Path, ...]
    """The cable's log and the servo's; none where the run did not end well."""

    @property
    def exit_code(self) -> int:
        """1 where nothing was written."""
        return 0 if self.files else 1


def measure(
    rig: GivenRig,
    *,
    out: Folder = Path("out/measure"),
    auto: bool = False,
    twin: bool = False,
    motor: str | None = None,
    channel: str | None = None,
    attended: bool = False,
    tell: Tell = None,
    quiet: Quiet = False,
) -> MeasuredMotion:
    """Move the motor of a rig, and leave logs for identify and identify-servo: cable.csv and servo.csv.

    The motor goes through ramps, sines and a chirp within the limits. No law takes part; the joint follows as the cable
    lets it. Everything is supervised as in ``bowden run``.

    Args:
        rig: the rig, with its [drive] and [limits].
        out: folder for the logs.
        auto: arm, move once and end, without keys.
        twin: start bowden twin as well, on a bus of its own.
        motor: the motor, of a rig with several: one after the other.
        channel: the bus, in place of the rig's.
        attended: over ssh: somebody at the rig has the emergency stop in hand.

    Raises:
        SafetyError: limits that contradict one another, or a drive without an angle that was confirmed by hand.
        DriveError: a bus or drive that cannot be used.

    Examples:
        bowden measure rig.toml
        bowden measure rig.toml --twin --auto
    """
    from bowden.live.mcap_read import read
    from bowden.live.measured import NEEDED, stalls, write_motions
    from bowden.live.operator import ending_signals, operate, refuse_over_ssh, refuse_without_keys
    from bowden.live.start import live_session
    from bowden.live.summary import ended_run
    from bowden.operations.support import given

    note = tell or (lambda text: None)
    refuse_without_keys(auto, quiet)
    whole = given.rig_of(rig).only(motor).on_bus(channel)
    if not twin:
        refuse_over_ssh(whole, attended=attended)
    begun = partial(live_session, whole, given.name_of(whole), measure=True, force=False, alone=motor or "")
    with ending_signals() as ending, begun(twin=twin, out=out, tell=note) as session:
        if not quiet:
            note(session.live.losses())
        operate(session, ending, auto=auto, quiet=quiet)
    session.require_log()
    found = ended_run(session)
    files = write_motions(session.live, session.log, out) if found.ended_well else []
    left_out = stalls(read(session.log, NEEDED), session.live.rig.sample_time)
    return MeasuredMotion(
        **vars(found),
        cycles_left_out=left_out.drawn,
        files=tuple(files),
        notes=(left_out.note,) if files and left_out.note else (),
    )


OPERATIONS = (Operation("measure", measure, 50),)
