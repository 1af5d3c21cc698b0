"""The process of one piece of work of the console; see `bowden.console.jobs`."""

import json
import os
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

from bowden.core.errors import BowdenError

Progress = Callable[[str, float], None]

_NICE = 10
"""The loop and the page come first."""


def main() -> int:
    """``python -m bowden.console.job_process``."""
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
        say("done", WORKS[work](lambda what, share: say("progress", [what, share]), **given))
    except BowdenError as error:
        say("error", {"what": error.what, "expected": error.expected, "do": error.do})
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
    """What `bowden check` says of a rig's law."""
    from bowden.design.findings import check_rows
    from bowden.design.linearise import NoNumberError
    from bowden.face.check import checked
    from bowden.rig.rig import Rig

    made = Rig.unpack(rig)
    progress("checking", 0.1)
    try:
        found = checked(made)
    except NoNumberError as error:
        text = f"{made.law_name} cannot be checked ({error.what}) and runs unchecked"
        return {"holds": True, "name": None, "text": text, "rows": [], "of": made.hash}
    rows = [[label, text] for label, text in check_rows(found) if text]
    margins = {"gain_margin_db": found.gain_margin_db, "phase_margin_deg": found.phase_margin_deg}
    holds = found.verdict != "does_not_hold"
    return {"holds": holds, "name": found.verdict, "text": found.reason, "rows": rows, "of": made.hash, **margins}


WORKS: dict[str, Callable[..., Any]] = {"check": check}
"""Name → the work."""

if __name__ == "__main__":
    sys.exit(main())
