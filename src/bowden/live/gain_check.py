"""The check of a change of gains, in a process of its own: the one that stands by the run has no time for it.

``python -m bowden.live.gain_check`` reads a rig with the gains wanted as JSON on standard input, and says as one line
of JSON what `bowden check` makes of it: ``{"name", "reason"}``, or ``{"error"}``. It ends with the process that began
it.
"""

import contextlib
import json
import os
import subprocess
import sys
import threading
from typing import Any

from bowden.core.errors import BowdenError, SafetyError
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
        pipe = subprocess.PIPE
        words = [sys.executable, "-P", "-m", "bowden.live.gain_check"]
        self._process = subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True, start_new_session=True)
        self._said: list[str] = []
        self._listener = threading.Thread(target=self._talk, args=(json.dumps(rig.document()),), daemon=True)
        self._listener.start()

    def _talk(self, document: str) -> None:
        given, said = self._process.stdin, self._process.stdout
        assert given is not None
        assert said is not None
        with contextlib.suppress(OSError):  # one that has died says nothing
            given.write(document + "\n")
            given.flush()  # and kept open: its end is the sign that nobody waits any more
            self._said.append(said.readline())

    @property
    def done(self) -> bool:
        """Whether there is a verdict."""
        return not self._listener.is_alive()

    def require(self) -> str:
        """What to know of gains that hold; empty where there is nothing.

        Raises:
            SafetyError: they do not hold, or cannot be checked.
        """
        try:
            found = json.loads(self._said[0])
        except (IndexError, ValueError):
            found = {"error": "the check ended without a result"}
        return required(self._law, found.get("name"), found.get("reason", ""), found.get("error", ""))

    def close(self) -> None:
        """End it, whether it is done or not."""
        self._process.kill()
        self._process.wait()
        self._listener.join()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):  # what was not written is for nobody
                    pipe.close()


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
