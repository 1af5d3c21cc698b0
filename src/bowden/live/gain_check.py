"""The check of a change of gains, in a process of its own: the one that stands by the run has no time for it.

``python -m bowden.live.gain_check`` reads a rig with the gains wanted as JSON on standard input, and says as one line
of JSON what `bowden check` makes of it: ``{"name", "reason"}``, or ``{"error"}``. It ends with the process that began
it.
"""

import json
import os
import sys
import threading
from typing import Any

from bowden.core.errors import BowdenError, SafetyError
from bowden.live import child
from bowden.rig.rig import Rig

_REFUSED = {"does_not_hold": "do not hold", "limit_cycle": "swing at rest"}
_NICE = 10
"""The loop comes first."""


class GainCheck:
    """A check that goes on.

    Args:
        rig: with the gains wanted.
    """

    def __init__(self, rig: Rig) -> None:
        self._law = rig.law_name
        self._process = child.started("bowden.live.gain_check", stderr=None)
        self._said: list[dict[str, Any] | None] = []
        self._listener = child.listen(self._process, self._said.append)
        document = json.dumps(rig.document()) + "\n"  # whose reader may be busy; its input stays open while we wait
        threading.Thread(target=child.tell, args=(self._process, document), daemon=True).start()

    @property
    def done(self) -> bool:
        """Whether there is a verdict."""
        return bool(self._said)

    def require(self) -> str:
        """What to know of gains that hold; empty where there is nothing.

        Raises:
            SafetyError: they do not hold, or cannot be checked.
        """
        found = (self._said[0] if self._said else None) or {"error": "the check ended without a result"}
        return required(self._law, found.get("name"), found.get("reason", ""), found.get("error", ""))

    def close(self) -> None:
        """End it, whether it is done or not."""
        self._process.kill()
        self._listener.join()
        child.end(self._process)


def required(law: str, name: str | None, reason: str, error: str = "") -> str:
    """What to know of gains that are wanted while the law runs, by what the check says of them; empty where they hold.

    A loop that swings at rest is begun with, where its user has read so, but not gone over to in mid-run: what holds
    otherwise, with margins or with little, holds at every value between the old ones and the new.

    Args:
        law: its name.
        name: of the verdict; None where the check cannot judge.
        reason: of the verdict, with its figure.
        error: why there is no verdict.

    Raises:
        SafetyError: they do not hold, or cannot be checked.
    """
    if name is None:
        why = error or reason or "the check gives no verdict"
        raise SafetyError(
            f"the gains of {law} cannot be checked ({why}), so that none changes while it runs",
            do="stop the run, change it, and start again",
        )
    if name in _REFUSED:
        raise SafetyError(
            f"these gains of {law} {_REFUSED[name]} on this rig: {reason}",
            expected="gains that hold by bowden check",
            do="choose a value nearer to the one in force",
        )
    return "" if name == "holds" else reason


def main() -> int:
    """The process."""
    os.nice(_NICE)
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a law's file prints is no part of what is said
    document = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_the_run, daemon=True).start()
    print(json.dumps(_found(document)), file=out, flush=True)
    return 0


def _found(document: Any) -> dict[str, Any]:
    from bowden.design.check_rig import check_rig

    try:
        rig = Rig.unpack(document)
        found = check_rig(rig, rig.fitted())
    except BowdenError as error:
        return {"error": error.what}
    return {"error": found} if isinstance(found, str) else {"name": found.verdict, "reason": found.reason}


def _end_with_the_run() -> None:
    """Whoever waited for this is gone once nothing can come any more."""
    sys.stdin.buffer.read()
    os._exit(3)


if __name__ == "__main__":
    sys.exit(main())
