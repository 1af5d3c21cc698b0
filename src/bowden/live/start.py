"""A live session of a rig's own law, checked before, or of its excitation."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.core.errors import OutputError, error_context
from bowden.core.files import output_folder
from bowden.rig.rig import Rig

if TYPE_CHECKING:
    from bowden.design.verdict import CheckVerdict
    from bowden.live.session import Session


@contextlib.contextmanager
def live_session(
    rig: Rig,
    name: str,
    *,
    twin: bool,
    out: Path,
    force: bool,
    tell: Callable[[str], None],
    measure: bool = False,
    checked: "CheckVerdict | None" = None,
    about: Mapping[str, str] | None = None,
    alone: str = "",
) -> Iterator["Session"]:
    """A session of a rig's own law, checked, or of its excitation; see `bowden.run`.

    Args:
        rig: with the law and all else that is to run.
        name: of the rig, for messages.
        twin: whether on a twin.
        out: folder for the log.
        force: run a law that does not hold.
        tell: called with each thing that the user should know.
        measure: move the motor through the excitation, in place of a law; nothing is checked then.
        checked: what the check says of this rig and its law, where it has been asked already.
        about: who and what for, for the log; see `Session`.
        alone: name of the motor that the rig is, of a file with several.
    """
    from bowden.design.forecast import foreseen, off_reference, own_run
    from bowden.design.objections import mismatches
    from bowden.design.power import require_power, unseen_watch
    from bowden.design.verdict import CheckVerdict, verdicts
    from bowden.live import left_behind
    from bowden.live.by_hand import require_confirmed
    from bowden.live.emg_process import EmgProcess
    from bowden.live.live_run import live_run
    from bowden.live.preflight import require
    from bowden.live.session import Session, prepared_loop
    from bowden.live.twin_process import own_twin
    from bowden.rig.families import family_of
    from bowden.sim.rig_runs import laws_of

    live = live_run(rig, measure=measure)
    for motor in () if twin else live.motors:  # another run's bus is refused at once; the drive claims it for good
        left_behind.await_host(partial(family_of(motor.rig.drive).claim, motor.rig.drive), tell)
        with error_context(motor.said):
            require_power(motor.rig, [other.rig for other in live.motors])
        require_confirmed(motor.rig, motor.name or alone)
    with contextlib.ExitStack() as stack:
        loop = stack.enter_context(prepared_loop())
        emg_process = None if live.emg is None else stack.enter_context(contextlib.closing(EmgProcess(rig)))
        pushing = live.pushing.notes([live.law], force=force) if live.pushing else []
        for note in (*live.notes, *pushing):
            tell(note)
        allowed = []
        found = dict[str, CheckVerdict]()
        for joint in rig.each_joint:
            verdict = CheckVerdict("holds", "") if measure else checked  # no gains take part in a measurement
            with error_context(joint.said):
                verdict = verdict or verdicts(joint, [laws_of(joint)], name, force=force)[0]
            found |= dict.fromkeys(joint.names, verdict)
            if verdict.note:
                tell(f"{joint.said}: {verdict.note}" if joint.said else verdict.note)
        for motor in live.motors:
            with error_context(motor.said):
                whose = f"{motor.said}: " if motor.said else ""
                if note := unseen_watch(motor.rig):
                    tell(f"{whose}{note}")
                if motor.rig.servo_assumed and not (twin or measure):
                    tell(f"{whose}gains are judged for {motor.rig.servo_text}")
                alone_on_joint = not (measure or motor.limits.shared)
                holds = found[motor.name].name != "does_not_hold"
                own = own_run(motor.rig, motor.law) if alone_on_joint and holds else None
                ends = "" if own is None else foreseen(motor.rig, motor.law, own)
                if ends and force:
                    tell(f"{whose}{ends}")
                require(
                    *(motor.limits, motor.rig.sample_time),
                    "little_margin" if force else found[motor.name].name or "little_margin",
                    opposed=motor.opposed,
                    given=motor.rig.limits,
                    mismatches=(*mismatches(motor.rig, motor.limits), *([ends] if ends and not force else ()))
                    if alone_on_joint
                    else (),
                )
                allowed.append(motor.limits.off_reference if measure else off_reference(motor.rig, motor.law, own))
        if emg_process is not None:
            emg_process.await_ready()  # a stream that cannot be used is refused before anything else is started
        if twin:
            live = live_run(
                stack.enter_context(own_twin(rig, measure=measure, alone=alone)), measure=measure, logged=rig
            )
        live = live.following(allowed)
        log = new_log(out, "measure" if measure else "-".join(dict.fromkeys(motor.law.name for motor in live.motors)))
        yield stack.enter_context(
            Session(live, log, emg_process, remembers=not twin, about=about, loop=loop, tell=tell)
        )


def new_log(folder: Path, name: str) -> Path:
    """A name for a log that is not taken yet, in a folder that is there.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    output_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {folder}: {error.strerror}", do="choose another one") from None
    number = 1
    while (path := folder / f"{name}-{number}.mcap").exists():
        number += 1
    return path
