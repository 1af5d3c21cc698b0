"""The check of a change of gains, in a process of its own: the one that stands by the run has no time for it.

It is the work ``verdict`` of `bowden.app.job_process`, as the console has it done.
"""

import json
import threading
from typing import Any

from bowden.core.errors import SafetyError
from bowden.live import child
from bowden.rig.rig import Rig

_REFUSED = {"does_not_hold": "do not hold", "limit_cycle": "swing at rest"}


class GainCheck:
    """A check that goes on.

    Args:
        rig: with the gains wanted.
    """

    def __init__(self, rig: Rig) -> None:
        self._law = rig.law_name
        self._process = child.started("bowden.app.job_process", stderr=None)
        self._found: dict[str, Any] | None = None
        self._listener = child.listen(self._process, self._take)
        # who reads it may be busy, and its input stays open while we wait
        document = json.dumps({"work": "verdict", "rig": rig.document()}) + "\n"
        threading.Thread(target=child.tell, args=(self._process, document), daemon=True).start()

    def _take(self, said: dict[str, Any] | None) -> None:
        if said is None or not {"done", "error"}.isdisjoint(said):
            failed = (said or {}).get("error", {"what": "the check ended without a result"})
            self._found = self._found or (said or {}).get("done") or {"name": None, "text": failed["what"]}

    @property
    def done(self) -> bool:
        """True if there is a verdict."""
        return self._found is not None

    def require(self) -> str:
        """Notes on gains that hold; empty where there are none.

        Raises:
            SafetyError: they do not hold, or cannot be checked.
        """
        assert self._found is not None
        return required(self._law, self._found["name"], self._found["text"])

    def close(self) -> None:
        """End it, whether it is done or not."""
        self._process.kill()
        self._listener.join()
        child.end(self._process)


def required(law: str, name: str | None, reason: str) -> str:
    """Doubts of the check about gains that are to change in a run; empty where they hold.

    A loop that swings at rest is begun with, where its user has read so, but not gone over to in mid-run: what holds
    otherwise, with margins or with little, holds at every value between the old ones and the new.

    Args:
        law: its name.
        name: of the verdict; None where the check cannot judge.
        reason: of the verdict, with its figure; or why there is none.

    Raises:
        SafetyError: they do not hold, or cannot be checked.
    """
    if name is None:
        raise SafetyError(
            f"the gains of {law} cannot be checked ({reason}), so that none changes while it runs",
            do="stop the run, change it, and start again",
        )
    if name in _REFUSED:
        raise SafetyError(
            f"these gains of {law} {_REFUSED[name]} on this rig: {reason}",
            expected="gains that hold by bowden check",
            do="choose a value nearer to the one in force",
        )
    return "" if name == "holds" else reason
