"""The guided path: measure, identify, identify-servo, tune, run.

Each step's files lie in one folder, and the rig goes on with them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bowden.console.jobs import Jobs
from bowden.core.errors import BowdenError, LogError, ParameterError
from bowden.core.files import whole_files
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

    def end(self, said: str, files: list[str], *, failed: bool = False) -> None:
        """The step that went on has ended."""
        if self.going:
            self._steps[self.going] = PathStep("failed" if failed else "done", said, files)
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

    def page(self, step: str) -> Path | None:
        """The page of a step that is done."""
        if step not in PAGES or self._steps[step].state != "done":
            return None
        return self.folder / PAGES[step]

    def _named(self, file: Path) -> str:
        return f"{self.folder.name}/{file.name}"


def identified(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Identify the cable that was measured, and put it into the rig, as identify and init do."""
    from bowden.core.units import DEGREES
    from bowden.identify.cable.identification import identify
    from bowden.identify.log.read import read_log
    from bowden.plants.identified import load_cable
    from bowden.report.identify_page import identify_page

    place, given = Path(folder), Rig.unpack(rig)
    checked = read_log(place / "cable.csv")
    fit = identify([checked], progress=lambda what, share: progress(what, 0.8 * share))
    progress("drawing the page", 0.85)
    text = identify_page(fit).html()
    with whole_files(place) as stage:
        (stage / "identify.html").write_text(text, encoding="utf-8")
        fit.write(stage / "model.toml")
    made = given.replace(cable=load_cable(place / "model.toml"))
    files = ["model.toml", "identify.html", *_written(made, place, "identified")]
    ahead = fit.forecast
    both = [] if ahead is None else [f"{value * DEGREES:.2g}° RMS" for value in ahead[:2]]
    forecast = f"{' left with this model as feed-forward, '.join(both)} without; " if both else ""
    said = f"{fit.best.name}: {forecast}trust: {fit.trust}"
    return {"rig": made.document(), "said": said, "files": files}


def identified_servo(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Identify the servo that was measured, and put it into the rig: the keys that identify-servo writes."""
    from bowden.identify.servo.fit import identify_servo
    from bowden.identify.servo.keys import document_of, keys_of
    from bowden.identify.servo.log import read_servo_log

    place, given = Path(folder), Rig.unpack(rig)
    log = place / "servo.csv"
    columns, _ = read_servo_log(log, {"time": "time_s", "command": "command_rad", "motor": "motor_rad"})
    progress("fitting the servo", 0.1)
    found = identify_servo(*columns)
    keys = document_of(found, 1e3 * given.sample_time)
    with whole_files(place) as stage:
        (stage / "servo.toml").write_text(keys_of(keys, log.name), encoding="utf-8")
    servo = given.servo._replace(natural_frequency=found.natural_frequency.value, damping=found.damping.value)
    if found.speed_limit is not None:
        servo = servo._replace(speed_limit=found.speed_limit.value)
    made = given.replace(servo=servo, delay=keys["delay_cycles"])
    frequency, damping, delay = (keys[name] for name in ("natural_frequency_hz", "damping", "delay_s"))
    said = (
        f"natural frequency {frequency['value']:.4g} ± {frequency['uncertainty']:.1g} Hz, damping "
        f"{damping['value']:.3g} ± {damping['uncertainty']:.1g}, delay {1e3 * delay['value']:.3g} ± "
        f"{1e3 * delay['uncertainty']:.1g} ms; {keys['residual_deg']:.2g}° RMS of the motor's motion are left"
    )
    return {"rig": made.document(), "said": said, "files": ["servo.toml", *_written(made, place, "servo")]}


def tuned_rig(progress: Callable[[str, float], None], rig: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """Tune the rig's law, and put the gains into the rig."""
    from bowden.core.units import DEGREES
    from bowden.study.tune_law import tuned

    given = Rig.unpack(rig)
    found = tuned(given, seed=0, progress=progress)
    made = found.rig
    said = f"{found.law.name}: largest RMSE over {found.runs} {found.worst_rmse * DEGREES:.3g}°, {found.found.verdict}"
    return {"rig": made.document(), "said": said, "files": _written(made, Path(folder), "tuned")}


def _written(rig: Rig, folder: Path, name: str) -> list[str]:
    """Write the rig, and the files that it names, into a folder of a name that is free."""
    number, target = 1, folder / name
    while target.exists():
        number += 1
        target = folder / f"{name}-{number}"
    target.mkdir(parents=True)
    rig.write(target / "rig.toml")
    return [f"{target.name}/rig.toml"]
