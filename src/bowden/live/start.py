"""A live session of a rig's own law, checked before, or of its excitation."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.core.errors import OutputError, asked_for_by
from bowden.core.files import output_folder
from bowden.core.toml_text import quoted
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
        alone: name of the axis that the rig is, of a file with several.
    """
    from bowden.design.forecast import off_reference
    from bowden.design.objections import mismatches
    from bowden.design.verdict import CheckVerdict, verdicts
    from bowden.live import left_behind
    from bowden.live.by_hand import require_confirmed, require_watch, unseen_watch
    from bowden.live.emg_process import EmgProcess
    from bowden.live.live_run import live_run
    from bowden.live.preflight import require
    from bowden.live.session import Session, own_twin, prepared_loop
    from bowden.rig.families import family_of

    live = live_run(rig, measure=measure)
    for axis in () if twin else live.axes:  # another run's bus is refused at once; the drive claims it for good
        left_behind.await_host(partial(family_of(axis.rig.drive).claim, axis.rig.drive), tell)
        with asked_for_by(f"axis {quoted(axis.name)}") if axis.name else contextlib.nullcontext():
            require_watch(axis.rig, [other.rig for other in live.axes])
        require_confirmed(axis.rig, axis.name or alone)
    with contextlib.ExitStack() as stack:
        loop = stack.enter_context(prepared_loop())
        emg_process = None if live.emg is None else stack.enter_context(contextlib.closing(EmgProcess(rig)))
        pushing = live.pushing.notes([live.law], force=force) if live.pushing else []
        for note in (*live.notes, *pushing):
            tell(note)
        allowed = []
        for axis in live.axes:
            of_axis = f"axis {quoted(axis.name)}"
            with asked_for_by(of_axis) if axis.name else contextlib.nullcontext():
                found = CheckVerdict("holds", "") if measure else checked  # no gains take part in a measurement
                found = found or verdicts(axis.rig, [axis.law], name, force=force)[0]
                for note in filter(None, (unseen_watch(axis.rig), found.note)):
                    tell(f"{of_axis}: {note}" if axis.name else note)
                verdict = "little_margin" if force else found.name or "little_margin"
                require(
                    *(axis.limits, axis.rig.sample_time, verdict),
                    opposed=axis.opposed,
                    given=axis.rig.limits,
                    mismatches=() if measure or axis.limits.paired else mismatches(axis.rig, axis.limits),
                )
                allowed.append(axis.limits.off_reference if measure else off_reference(axis.rig, axis.law))
        if emg_process is not None:
            emg_process.await_ready()  # a stream that cannot be used is refused before anything else is started
        if twin:
            live = live_run(
                stack.enter_context(own_twin(rig, measure=measure, alone=alone)), measure=measure, logged=rig
            )
        live = live.following(allowed)
        log = new_log(out, "measure" if measure else "-".join(dict.fromkeys(axis.law.name for axis in live.axes)))
        yield stack.enter_context(Session(live, log, emg_process, remembers=not twin, about=about, loop=loop))


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
