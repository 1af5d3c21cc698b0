"""What several logs of one cable say of it, and how it is shown and written."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from bowden import __version__
from bowden.core.arguments import path_of as path_of_file
from bowden.core.errors import ParameterError
from bowden.core.files import write_text
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.drawing.style import legend
from bowden.identify.cable.cycles import FOR_YES, Cycles
from bowden.identify.cable.file_lines import cycles_row, error_lines, one_line, parameter_rows, warning_lines
from bowden.identify.log.read import Log
from bowden.models.cable.scheduled import cable_of, hats, powers
from bowden.plants.cable_parameters import shown_value
from bowden.plants.identified import CableModel
from bowden.plants.model_file import log_lines
from bowden.plants.trust import QUARTER, Trust, least, trust_lines

if TYPE_CHECKING:
    import pathlib

    from matplotlib.axes import Axes

_SHOWN = (("#0072b2", "-"), ("#009e73", "--"), ("#d55e00", "-."))
"""Colour and line at the least, the middle and the largest load."""


@dataclass(frozen=True)
class JudgedLog:
    """How well one of several logs is predicted."""

    name: str
    """The log's."""
    values: tuple[float, ...]
    """Of the scheduling variables, its means."""
    samples: int
    """In it."""
    cycles: Cycles
    """Whole cycles in it, and how many more to record."""
    train_rms: float
    """Error of the model, which was fitted to this log too [rad]."""
    test_rms: float
    """On its second half, of a model fitted to the first halves of all logs [rad]."""
    same_rms: float
    """Of a model fitted to all logs but this one; NaN where no other has its load [rad]."""
    same_offset_rms: float
    """The same on the second half, once the offset was fitted again to the first [rad]."""
    unseen_rms: float
    """Of a model fitted to all logs but those of this load, and of this bend where both schedule; NaN where fewer than
    two values of either are left [rad]."""
    unseen_offset_rms: float
    """The same on the second half, once the offset was fitted again to the first [rad]."""


@dataclass(frozen=True, repr=False)
class JointFit:
    """What several logs say of one cable."""

    best: CableModel
    """The scheduled model, at the middle of what was seen; a rig takes it as its cable."""
    variables: tuple[str, ...]
    """What it is scheduled by: ``load``, ``bend``, both or nothing."""
    units: tuple[str, ...]
    """Of the variables; empty where nothing says it."""
    logs: tuple[JudgedLog, ...]
    """In the order in which they were given."""
    warnings: tuple[str, ...]
    """What the logs cannot show, and what was mended in them."""
    seconds: float = field(compare=False)
    """Time that the identification took [s]."""
    read: tuple[Log, ...] = field(compare=False)
    """What was fitted."""

    @property
    def samples(self) -> int:
        """In all logs."""
        return sum(one.samples for one in self.logs)

    @property
    def train_rms(self) -> float:
        """Of all logs [rad]."""
        return _over_logs([one.train_rms for one in self.logs])

    @property
    def test_rms(self) -> float:
        """Of all logs' second halves [rad]."""
        return _over_logs([one.test_rms for one in self.logs])

    @property
    def judged(self) -> float:
        """What to expect of another log of this cable once its offset was refitted: on unseen loads where those were
        judged, then on unseen logs, then on second halves [rad]."""
        for name in ("unseen_offset_rms", "same_offset_rms", "test_rms"):
            found = [getattr(one, name) for one in self.logs]
            if np.isfinite(found).any():
                return _over_logs(found)
        return float("nan")

    @property
    def trust(self) -> Trust:
        """Whether to trust the model: the gravest of what any of its logs gives reason to doubt."""
        doubts = [
            Trust(one.level, tuple(f"{log.name}: {why}" for why in one.reasons))
            for log in self.read
            for one in log.doubts
        ]
        short = [one.name for one in self.logs if one.cycles.whole < FOR_YES]
        if short:
            doubts.append(Trust("with care", (f"fewer than {FOR_YES} whole cycles in {', '.join(short)}",)))
        for log, one in zip(self.read, self.logs, strict=True):
            if one.test_rms > QUARTER * float(
                np.std(log.joint - np.polyval(np.polyfit(log.motor, log.joint, 1), log.motor))
            ):
                doubts.append(
                    Trust("with care", (f"{log.name}: the model leaves a quarter or more of what a line does",))
                )
        return least([Trust("yes", ("within the motion of these logs",)), *doubts])

    def at(self, **values: float) -> CableModel:
        """The model at a load, at a bend, or both.

        Raises:
            ParameterError: it is not scheduled by that.
        """
        for name in values:
            if name not in self.variables:
                raise ParameterError(
                    f"the model is scheduled by {', '.join(self.variables) or 'nothing'}, not by {name!r}",
                    expected="values of its variables",
                    do="identify logs that differ in it",
                )
        return replace(self.best, parameters={**self.best.parameters, **values})

    def write(self, path: "pathlib.Path | str") -> None:
        """Write the model and how each log was judged, as the model.toml of ``bowden identify`` with several logs.

        Raises:
            OutputError: the file cannot be written.
        """
        write_text(path_of_file(path, "JointFit.write: path"), joint_text(self))

    def plot(self, axes: "Axes | Sequence[Axes] | None" = None) -> "list[Axes]":
        """Draw the two branches of the loop without its straight line, at the least, the middle and the largest load.

        Args:
            axes: matplotlib's; a new figure is made where they are not given.

        Returns:
            The axes; ``axes[0].figure`` is theirs.

        Raises:
            ParameterError: something else than axes.
        """
        drawn = shown.axes_for(axes, 1, 1, 7.0, 3.6)
        draw_loads(drawn[0], self)
        return drawn

    def __repr__(self) -> str:
        """One screen: errors of each log, and what to know."""
        return shown.screen(self._title(), self._rows())

    def _repr_html_(self) -> str:
        from bowden.drawing.style import new_figure

        figure, axes = new_figure(height=3.6)
        draw_loads(axes[0], self)
        return shown.fragment(self._title(), self._rows(), figure)

    def _title(self) -> str:
        by = " and ".join(self.variables)
        return f"Fit of {len(self.logs)} logs{f', scheduled by {by}' if by else ''}"

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for one in self.logs:
            errors = (("second half", one.test_rms), ("left out", one.same_rms), ("load left out", one.unseen_rms))
            said = [f"{what} {shown.number(v * DEGREES, '°')}" for what, v in errors if np.isfinite(v)]
            at = [f"{name} {shown_value(name, value)}" for name, value in zip(self.variables, one.values, strict=True)]
            rows.append((one.name, ", ".join([*at, *said, one.cycles.counted])))
        rows += [("cycles", line) for line in cycle_lines(self.logs)]
        return [*rows, *(("note", warning) for warning in self.warnings[:4])]


def cycle_lines(logs: Sequence[JudgedLog]) -> list[str]:
    """What more is to be recorded of logs with too few whole cycles: a line for all that lack as many.

    >>> log = JudgedLog("a.csv", (), 2000, Cycles(2, 3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    >>> cycle_lines([log, replace(log, name="b.csv")])
    ['record 3 more whole cycles (up and down): a.csv, b.csv have 2 whole cycles']
    """
    lines = []
    for cycles in dict.fromkeys(one.cycles for one in logs if one.cycles.more):
        names = [one.name for one in logs if one.cycles == cycles]
        has = "has" if len(names) == 1 else "have"
        lines.append(f"{cycles.to_record}: {', '.join(names)} {has} {cycles.counted}")
    return lines


def _over_logs(errors: Sequence[float]) -> float:
    """Root mean square over the logs for which there is one."""
    known = np.array([error for error in errors if np.isfinite(error)])
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def draw_loads(axes: "Axes", fit: JointFit) -> None:
    """Both branches over the motor, at the ends and in the middle of what schedules them."""
    cable, values = cable_of(fit.best.parameters)
    count = cable.middle.shape[1]
    motor = np.linspace(cable.first, cable.first + cable.step * (count - 1), 200)
    middle, height = (hats(motor, cable.first, cable.step, count, outward) for outward in (1.0, 0.0))
    ends = [cable.low.tolist(), list(values), cable.high.tolist()] if fit.variables else [[]]
    line = np.polyfit(motor, middle @ (powers(values, cable) @ cable.middle), 1)
    degrees = [unit == "rad" for unit in fit.units]
    for at, (colour, dashes) in zip(ends, _SHOWN, strict=False):
        weights = powers(at, cable)
        curve, half = middle @ (weights @ cable.middle), height @ (weights @ cable.height)
        label = ", ".join(
            f"{name} {value * DEGREES:.3g}°" if angle else f"{name} {value:.3g} {unit}".strip()
            for name, value, unit, angle in zip(fit.variables, at, fit.units, degrees, strict=False)
        )
        for side in (1.0, -1.0):
            drawn = (curve + side * half - np.polyval(line, motor)) * DEGREES
            said = label if label and side > 0.0 else None
            axes.plot(motor * DEGREES, drawn, color=colour, ls=dashes, lw=1.3, label=said)
    axes.set(xlabel="motor [°]", ylabel="joint − straight line [°]")
    if fit.variables:
        legend(axes)


def joint_text(fit: JointFit) -> str:
    """The content of model.toml of several logs: the scheduled model, the plain one, how each log was judged."""
    lines = [
        f"# The cable of {len(fit.logs)} logs, identified by bowden {__version__}. All angles are in radians.",
        "# A rig sets the load with load = … under [cable.parameters]. judged_rms_deg is the error to expect of",
        "# another log of this cable once its offset is known; the model itself was fitted to all logs.",
        "",
        f"best = {quoted(fit.best.name)}",
        f"source = {quoted(', '.join(one_line(one.name) for one in fit.logs))}",
        f"samples = {fit.samples}",
        *warning_lines(fit.warnings),
        *trust_lines(fit.trust),
        *log_lines(fit.best.covered, fit.best.encoders),
        "",
        f"[models.{fit.best.name}]",
        *error_lines({name: getattr(fit, name) for name in ("train_rms", "test_rms")} | {"judged_rms": fit.judged}),
        *(f"{name}_unit = {quoted(unit)}" for name, unit in zip(fit.variables, fit.units, strict=True)),
        "",
        f"[models.{fit.best.name}.parameters]",
        *parameter_rows(fit.best.parameters),
    ]
    for name, parameters in fit.best.others.items():
        lines += ["", f"[models.{name}.parameters]  # of the log in the middle", *parameter_rows(parameters)]
    for one in fit.logs:
        lines += ["", "[[logs]]", f"name = {quoted(one_line(one.name))}"]
        lines += [f"{name} = {value!r}" for name, value in zip(fit.variables, one.values, strict=True)]
        lines.append(cycles_row(one.cycles, one.cycles.to_record))
        lines += error_lines({name: value for name, value in dataclasses.asdict(one).items() if name.endswith("_rms")})
    return "\n".join(lines) + "\n"
