"""The process of one piece of work of the console: an operation, or work on earlier runs; see `bowden.console.jobs`."""

import json
import os
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bowden.app import works
from bowden.console.access import parts_of
from bowden.core.caller import on_a_page, speaking
from bowden.core.errors import BowdenError

Progress = Callable[[str, float], None]

_NICE = 10
"""The loop and the page come first."""


def main() -> int:
    """``python -m bowden.app.job_process``."""
    os.nice(_NICE)
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what anything prints is no part of what is said

    def say(what: str, value: Any) -> None:
        out.write(json.dumps({what: value}, ensure_ascii=True) + "\n")
        out.flush()

    given = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_the_console, daemon=True).start()
    work = given.pop("work")
    try:
        with speaking(on_a_page):
            say("done", WORKS[work](lambda what, share: say("progress", [what, share]), **given))
    except BowdenError as error:
        say("error", parts_of(error))
    except Exception as error:  # the page says so; the terminal of the console shows the rest
        say(
            "error",
            {"what": f"the work failed: {type(error).__name__}", "expected": "", "do": "see the console's terminal"},
        )
        raise
    return 0


def _end_with_the_console() -> None:
    """Whoever waited for this is gone once nothing can come any more."""
    sys.stdin.buffer.read()
    os._exit(3)


def check(progress: Progress, rig: Mapping[str, Any]) -> dict[str, Any]:
    """Verdict on a rig's law for the page; of one with several motors of each, and the worst of them of all."""
    from bowden.design.linearise import NoNumberError
    from bowden.rig.rig import Rig

    whole = Rig.unpack(rig)
    try:
        return _checked(progress, whole, None)
    except NoNumberError as error:
        if not whole.motors:
            text = f"{whole.law_name} cannot be checked ({error.what}) and runs unchecked"
            return {**_UNCHECKED, "text": text, "of": whole.hash}
    each = {}
    for one in whole.parts:  # what cannot be judged of one motor says nothing of another
        try:
            each[one.name] = _checked(progress, whole, one.name)
        except NoNumberError as error:
            each[one.name] = {**_UNCHECKED, "text": f"{one.rig.law_name} cannot be checked ({error.what})"}
    name = max(each, key=lambda name: _VERDICTS.index(each[name]["name"]))
    margins = {
        key: min((one[key] for one in each.values() if one[key] is not None), default=None)
        for key in ("gain_margin_db", "phase_margin_deg")
    }
    rows = [[f"{motor}: {label}", text] for motor, one in each.items() for label, text in one["rows"]]
    holds = all(one["holds"] for one in each.values())
    said = {"holds": holds, "rows": rows, "text": f"{name}: {each[name]['text']}", "of": whole.hash}
    return each[name] | said | margins


_VERDICTS = ("holds", None, "little_margin", "limit_cycle", "does_not_hold")
"""From the best to the worst; None of a law that cannot be checked."""
_UNCHECKED: dict[str, Any] = {"holds": True, "name": None, "rows": [], "gain_margin_db": None, "phase_margin_deg": None}


def _checked(progress: Progress, rig: Any, motor: str | None) -> dict[str, Any]:
    """The operation `check`, with its lines as a terminal has them."""
    from bowden.design.check_result import check_rows
    from bowden.operations.check import check as operation

    found = operation(rig, motor=motor, progress=progress)
    rows = [
        [f"{name}: {label}" if name else label, text]
        for name, one in found.checks.items()
        for label, text in check_rows(one)
        if text
    ]
    worst = found.joint if found.joints else ""
    return {
        "holds": found.holds,
        "name": found.verdict,
        "text": f"{worst}: {found.reason}" if worst else found.reason,
        "rows": rows,
        "of": found.rig,
        "gain_margin_db": found.gain_margin_db,
        "phase_margin_deg": found.phase_margin_deg,
    }


def verdict(progress: Progress, rig: Mapping[str, Any]) -> dict[str, Any]:
    """Verdict of a check on one motor's law, without the search for what would hold: a run waits for it."""
    from bowden.design.check_rig import check_rig
    from bowden.rig.rig import Rig

    whole = Rig.unpack(rig)
    found = check_rig(whole, whole.fitted())
    return {"name": None, "text": found} if isinstance(found, str) else {"name": found.verdict, "text": found.reason}


def page(progress: Progress, path: str, to: str) -> str:
    """The page of a log, as `bowden log plot` draws it."""
    from bowden.live.mcap_read import read
    from bowden.views.log import draw_log

    found = next(iter(read(Path(path)).parts.values()))  # of several motors the first
    draw_log(found, Path(to), f"Run {Path(path).name}")
    return to


def export(progress: Progress, path: str, to: str) -> str:
    """A log as Parquet or CSV, by the ending of the new file's name."""
    from bowden.operations.log import log_export

    log_export(Path(path), out=Path(to))
    return to


WORKS: dict[str, Callable[..., Any]] = {
    "check": check,
    "verdict": verdict,
    "summaries": works.summaries,
    "details": works.details,
    "page": page,
    "export": export,
    "curves": works.curves,
    "identify": works.identified,
    "identify-servo": works.identified_servo,
    "tune": works.tuned_rig,
}
"""Name → the work."""

if __name__ == "__main__":
    sys.exit(main())
