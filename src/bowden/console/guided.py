"""The guided path: measure, identify, identify-servo, tune, run.

Each step's files lie in one folder, and the rig goes on with them.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bowden.console.access import Refused
from bowden.console.jobs import Jobs
from bowden.core.errors import BowdenError, LogError, ParameterError
from bowden.live.live_run import Live
from bowden.live.measured import write_motions
from bowden.rig.rig import Rig

STEPS = ("measure", "identify", "identify-servo", "tune", "run")
"""In their order."""
_NEEDS = {"identify": "cable.csv", "identify-servo": "servo.csv"}
"""Step → the file of the measurement that it begins with."""
PAGES = {"identify": "identify.html"}
"""Step → its page."""
_NEXT = {
    "measure": "measure: the motor moves through ramps, sines and a chirp within the limits",
    "identify": "identify the cable from what was measured",
    "identify-servo": "identify the servo from what was measured",
    "tune": "tune the gains on the identified cable",
    "run": "check the law, then run it",
}


@dataclass
class PathStep:
    """One step, as far as it has come."""

    state: str = "waiting"
    """``waiting``, ``going``, ``done`` or ``failed``."""
    said: str = ""
    files: list[str] = field(default_factory=list)


class GuidedPath:
    """How far it has come.

    Args:
        out: the console's folder; the path's is in it.
        jobs: compute what takes longer.
    """

    def __init__(self, out: Path, jobs: Jobs) -> None:
        self._out, self._jobs = out, jobs
        self._folder: Path | None = None
        self._steps = {name: PathStep() for name in STEPS}
        self.going = ""
        """The step that goes on."""
        self.fraction: float | None = None
        """How far that has come."""

    @property
    def folder(self) -> Path:
        """Of the path's files; a new one for each path."""
        if self._folder is None:
            number = 1
            while (found := self._out / f"path-{number}").exists():
                number += 1
            self._folder = found
        return self._folder

    def document(self) -> dict[str, Any]:
        """As the page shows it."""
        after = next((name for name in STEPS if self._steps[name].state != "done"), STEPS[-1])
        steps = [
            {
                **{"name": name, "state": one.state, "said": one.said, "files": one.files},
                "page": f"/api/path/{name}.html" if name in PAGES and one.state == "done" else None,
            }
            for name, one in self._steps.items()
        ]
        shown = self._steps[self.going or after]
        return {
            **{"step": self.going or after, "running": bool(self.going), "fraction": self.fraction},
            **{"files": shown.files, "said": shown.said, "next": _NEXT[after], "steps": steps},
        }

    def require(self, step: Any) -> str:
        """The step's name, if it can begin now.

        Raises:
            ParameterError: there is no such step, or what it needs is not there.
        """
        if step not in STEPS[:-1]:
            raise ParameterError("there is no such step", expected=", ".join(STEPS[:-1]), do="choose one")
        if self.going:
            raise ParameterError(f"the step {self.going} goes on", do="wait until it has ended")
        if step in _NEEDS and not (self.folder / _NEEDS[step]).is_file():
            raise ParameterError("nothing was measured", expected="a measurement", do="measure first")
        return str(step)

    def begin(self, step: str) -> None:
        """A step goes on; those after it are to be done again."""
        for name in STEPS[STEPS.index(step) :]:
            self._steps[name] = PathStep()
        self._steps[step].state, self.going, self.fraction = "going", step, 0.0

    def end(self, text: str, files: list[str], *, failed: bool = False) -> None:
        """The step that went on has ended."""
        if self.going:
            self._steps[self.going] = PathStep("failed" if failed else "done", text, files)
        self.going, self.fraction = "", None

    def measured(self, live: Live, log: Path, *, well: bool, lost: str = "") -> None:
        """A measurement has ended: write what was measured, for any thread."""
        try:
            if not well:
                raise ParameterError("the motion was not ended well", do="look at the run, then measure again")
            if lost:
                raise LogError(lost)
            files = write_motions(live, log, self.folder)
        except BowdenError as error:
            self.end(str(error), [log.name], failed=True)
            return
        self.end("the motor has moved through the excitation", [log.name, *map(self._named, files)])

    async def compute(self, step: str, rig: Rig) -> Rig | None:
        """Identify, or tune; the rig with what was found, None where nothing was."""

        def progress(what: str, share: float) -> None:
            self.fraction, self._steps[step].said = share, what

        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            found = await self._jobs.do(step, progress, rig=rig.document(), folder=str(self.folder.absolute()))
        except BowdenError as error:
            self.end(str(error), [], failed=True)
            return None
        made = Rig.unpack(found["rig"])
        self.end(found["said"], [f"{self.folder.name}/{name}" for name in found["files"]])
        return made

    def page(self, step: str) -> Path:
        """The page of a step that is done.

        Raises:
            Refused: there is none.
        """
        if step not in PAGES or self._steps[step].state != "done" or not (self.folder / PAGES[step]).is_file():
            raise Refused(404, "this step has no page", do="do the step first")
        return self.folder / PAGES[step]

    def _named(self, file: Path) -> str:
        return f"{self.folder.name}/{file.name}"
