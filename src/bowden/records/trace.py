"""A trace: the record of a run, with its units, settings and seed, to and from NPZ, CSV and Parquet."""

import csv
import itertools
import json
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bowden.core import arguments
from bowden.core.errors import BowdenError, LogError, ParameterError, UnknownNameError, near
from bowden.core.extras import extra_module
from bowden.core.files import whole_file
from bowden.core.guesses import Answering, answering
from bowden.core.units import DEGREES
from bowden.drawing import shown
from bowden.records import metrics
from bowden.records.run_figures import Metrics
from bowden.records.table import FIRST_LINE, KEY, read_table

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    from matplotlib.axes import Axes

_ROWS = 10_000
"""That are made text of at a time."""

_FACTORS = {
    ("rad", "deg"): DEGREES,
    ("rad/s", "deg/s"): DEGREES,
    ("rad/s²", "deg/s²"): DEGREES,
    ("s", "ms"): 1e3,
    ("A", "mA"): 1e3,
}
"""Unit of a column, unit asked for → what one of the first is of the second."""
_SPELLINGS = {"°": "deg", "degrees": "deg", "radians": "rad", "°/s": "deg/s", "°/s²": "deg/s²", "deg/s^2": "deg/s²"}


LED = 2.0
"""Column ``source`` of a live log from which on the law leads: `bowden.cycle.one_cycle.TargetSource.LAW_BEGINS`."""


def _meant(trace: "Trace", name: str) -> str:
    """What to write for a column, with or without the unit asked for, or for a figure of merit."""
    column, _, unit = name.rpartition("_")
    columns = trace.__dict__.get("columns", {})
    if name in columns:
        return f"trace[{name!r}], in its unit; trace.array({name!r}, 'deg') in degrees"
    if column in columns and unit in ("deg", "rad", "ms"):
        return f"trace.array({column!r}, {unit!r})"
    if name in trace.__dict__.get("settings", {}):
        return f"trace.settings[{name!r}]"
    figures = [one.name for one in fields(Metrics)]
    return next((f"trace.metrics().{one}" for one in figures if one.startswith(name)), "")


@answering(
    {
        **dict.fromkeys(("to_frame", "to_dataframe", "dataframe", "df"), "trace.to_pandas() or trace.to_polars()"),
        **dict.fromkeys(
            ("save", "to_file", "to_csv", "to_parquet", "to_npz"),
            "trace.write(path): .npz, .csv or .parquet",
        ),
        **dict.fromkeys(("load", "from_file", "from_csv", "from_parquet"), "bowden.read_trace(path)"),
        **dict.fromkeys(("show", "draw"), "trace.plot()"),
        **dict.fromkeys(("t", "times"), "trace.time"),
        **dict.fromkeys(("data", "values", "signals", "keys"), "trace.columns"),
        "rms": "trace.metrics().rmse_deg",
        "to_numpy": "trace.columns",
    },
    "make another: Trace({{**trace.columns, …}}, trace.units)",
    _meant,
)
@dataclass(frozen=True, repr=False)
class Trace(shown.Plotted, metaclass=Answering):
    """The record of a run: signals sampled on one clock, with their units and the settings of the run.

    >>> t = np.linspace(0.0, 10.0, 1001)
    >>> units = {"time": "s", "reference": "rad", "joint": "rad"}
    >>> trace = Trace({"time": t, "reference": np.sin(t), "joint": 0.99 * np.sin(t)}, units)
    >>> trace["joint"].max().round(3), trace.array("joint", "deg").max().round(1)
    (np.float64(0.99), np.float64(56.7))
    >>> trace
    Trace: 10.01 s, 1001 samples at 100 Hz
      error  RMSE 0.396°, after 10 s 0.312°, peak 0.573°, delay 0.373 ms, hysteresis width 0°
      [s]    time
      [rad]  reference, joint

    The columns that every simulated run has are ``time``, ``reference``, ``reference_velocity``, ``joint`` (true),
    ``motor`` (true), ``joint_measured``, ``motor_measured``, ``command``, ``motor_velocity``, ``current``, ``width``
    and ``slope``; the law's own state follows as ``law.<name>``. Drawn: reference and joint, and the error.
    """

    _panels = shown.Panels(2, 1, 7.0, 4.2)

    columns: dict[str, NDArray[np.float64]]
    """Name → values, all of one length (n,)."""
    units: dict[str, str]
    """Name → unit, as printed: ``s``, ``rad``, ``rad/s``, ``A``, ``1``."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """All that made the run, as JSON values: law, gains, plant, reference, sample time, software version."""
    seed: int | None = None
    """Seed of the run's random numbers; None where there were none."""

    def __post_init__(self) -> None:
        """Refuse what is no record of signals on one clock.

        Raises:
            ParameterError: columns that are none or not of one length, or one without a unit.
        """
        for name, given in (("columns", self.columns), ("units", self.units), ("settings", self.settings)):
            if not isinstance(given, Mapping):
                raise ParameterError(
                    f"Trace: {name} is {arguments.format_value(given)}", expected="values by name", do="{'time': …}"
                )
        if not self.columns:
            raise ParameterError("Trace: columns is {}", expected="a signal or more", do="{'time': …, 'joint': …}")
        whole = {name: arguments.signal(values, f"Trace: columns[{name!r}]") for name, values in self.columns.items()}
        arguments.one_length(whole, "Trace: columns")
        object.__setattr__(self, "columns", whole)
        missing = [name for name in self.columns if not isinstance(self.units.get(name), str)]
        if missing:
            raise ParameterError(
                f"Trace: units has none for {', '.join(map(repr, missing))}",
                expected="a unit for each column",
                do="give rad, s, or 1 where there is none",
            )
        if self.seed is not None:
            arguments.whole(self.seed, "Trace: seed", 0)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A column in its own unit.

        Raises:
            UnknownNameError: there is no such column; the message names the likely one.
        """
        try:
            return self.columns[name]
        except (KeyError, TypeError):
            meant = _meant(self, str(name))
            raise UnknownNameError(
                f"the trace has no column {name!r}",
                expected="" if meant else near(str(name), self.columns),
                do=meant or "name one of them",
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def array(self, name: str, unit: str | None = None) -> NDArray[np.float64]:
        """A column (n,) in the given unit, or in its own unit.

        Args:
            name: of the column.
            unit: ``deg`` for ``rad``, ``deg/s``, ``ms`` for ``s``, ``mA``; or the column's own.

        Raises:
            UnknownNameError: there is no such column.
            ParameterError: the column cannot be had in that unit.
        """
        values, own = self[name], self.units[name]
        wanted = None if unit is None else _SPELLINGS.get(str(unit), str(unit))
        if wanted in (None, own):
            return values
        if (own, wanted) not in _FACTORS:
            others = [into for given, into in _FACTORS if given == own]
            raise ParameterError(f"{name} in {unit!r}", expected=" or ".join([own, *others]), do="ask for that unit")
        return values * _FACTORS[own, wanted]

    def to_pandas(self, unit: str = "rad") -> "pd.DataFrame":
        """A pandas frame, a column for each signal; units are in its ``attrs["units"]``.

        Args:
            unit: of all angles, ``rad`` or ``deg``.

        Raises:
            ParameterError: another unit, or pandas is not installed.
        """
        columns, units = self._in(unit)
        frame = _frames("pandas").DataFrame(columns)
        frame.attrs["units"] = units
        return frame

    def to_polars(self, unit: str = "rad") -> "pl.DataFrame":
        """A polars frame, a column for each signal.

        Args:
            unit: of all angles, ``rad`` or ``deg``.

        Raises:
            ParameterError: another unit, or polars is not installed.
        """
        return _frames("polars").DataFrame(self._in(unit)[0])

    def _in(self, unit: str) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
        """Columns and their units, with angles in ``rad`` or ``deg``."""
        if not isinstance(unit, str) or _SPELLINGS.get(unit, unit) not in ("rad", "deg"):
            raise ParameterError(
                f"unit is {arguments.format_value(unit)}",
                expected="rad or deg, for all angles",
                do="ask for one of them",
            )
        units = dict(self.units)
        if _SPELLINGS.get(unit, unit) == "deg":
            units = {
                name: own.replace("rad", "deg") if (own, own.replace("rad", "deg")) in _FACTORS else own
                for name, own in units.items()
            }
        return {name: self.array(name, units[name]) for name in self.columns}, units

    def _draw(self, axes: "Sequence[Axes]") -> None:
        from bowden.drawing.style import draw_error, draw_motion

        signals = self["time"], self["reference"], self["joint"]
        draw_motion(axes[0], *signals)
        for below in axes[1:]:
            draw_error(below, *signals)
        axes[-1].set_xlabel("time [s]")

    def _drawable(self) -> bool:
        return {"time", "reference", "joint"} <= set(self.columns)

    def _title(self) -> str:
        law = self.settings.get("law")
        name = f" of {law}" if isinstance(law, str) else ""
        count, seed = f"{len(self)} samples", "" if self.seed is None else f"seed {self.seed}"
        if "time" not in self.columns or len(self) < 2:
            return f"Trace{name}: {shown.listed((count, seed))}"
        step = float(self.time[-1] - self.time[0]) / (len(self) - 1)
        return f"Trace{name}: {shown.listed((f'{len(self) * step:.5g} s', f'{count} at {1.0 / step:.5g} Hz', seed))}"

    def _rows(self) -> list[tuple[str, str]]:
        groups: dict[str, list[str]] = {}
        for name in self.columns:
            group, dot, rest = name.partition(".")
            groups.setdefault(f"{group}." if dot else f"[{self.units[name]}]", []).append(rest if dot else name)
        return [*self._merit(), *((unit, ", ".join(names)) for unit, names in groups.items())]

    def _merit(self) -> list[tuple[str, str]]:
        """The figures of merit in a line or two; what is missing where there are none."""
        if not {"time", "reference", "joint"} <= set(self.columns) or len(self) < 2:
            return []
        finite = np.isfinite(self["joint"])
        if not finite.all():
            first = int(np.argmin(finite))
            if finite[first:].any():
                return [("gaps", f"joint is not a number in {int((~finite).sum())} of {len(self)} samples")]
            return [("unstable", f"ran away {self.time[first] - self.time[0]:.4g} s after its start")]
        try:
            found = self.metrics()
        except BowdenError as error:
            return [("error", str(error))]
        texts = [(name, shown.number(*one)) for name, one in found.shown().items()]
        errors, energies = texts[:5], [(name.removesuffix(" energy"), text) for name, text in texts[5:]]
        return [
            ("error", shown.listed(f"{name} {text}" for name, text in errors if text)),
            ("energy", shown.listed(f"{name} {text}" for name, text in energies if text)),
        ]

    @property
    def time(self) -> NDArray[np.float64]:
        """Time (n,) [s]."""
        return self.columns["time"]

    @property
    def error(self) -> NDArray[np.float64]:
        """joint − reference (n,) [rad]."""
        return self.columns["joint"] - self.columns["reference"]

    @property
    def ended(self) -> bool:
        """True if the run reached its end with finite numbers."""
        return bool(np.isfinite(self.columns["joint"]).all())

    @property
    def stable(self) -> bool:
        """True if it ended, and the error was never larger than the whole stroke of the reference (at least 5°).

        See `bowden.records.metrics.is_stable`.
        """
        return metrics.is_stable(self.columns["reference"], self.columns["joint"])

    def metrics(self) -> Metrics:
        """RMSE, peak error, delay, hysteresis width, power and energy of the run.

        Of a live log: of the cycles in which the law led, as `bowden run` prints them. Where the clock is uneven there
        is no delay.
        """
        columns = self.columns
        if "log" in self.settings and {"source", "reference", "joint"} <= set(columns):
            led = (columns["source"] >= LED) & np.isfinite(columns["joint"] - columns["reference"])
            columns = {name: values[led] for name, values in columns.items()} if led.sum() > 1 else columns
        return metrics.summarise(columns, self.settings.get("motor_resistance"), self.settings.get("torque_constant"))

    def power(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mechanical and electrical power of the motor over time (Eq. 18), (n,) and (n,) [W].

        Raises:
            LogError: the trace has no motor speed or current, or does not know its motor.
        """
        resistance, constant = self.settings.get("motor_resistance"), self.settings.get("torque_constant")
        if resistance is None or constant is None or not {"motor_velocity", "current"} <= set(self.columns):
            raise LogError(
                f"no power from a trace with the columns {', '.join(self.columns)}",
                expected="motor_velocity and current, and motor_resistance and torque_constant in its settings",
            )
        return metrics.power(self.columns["motor_velocity"], self.columns["current"], resistance, constant)

    def bandwidth(self, lowest: float, highest: float, half_width: float = 0.15) -> float | None:
        """−3 dB bandwidth of the joint over the reference, for a reference that excites every frequency between two.

        Args:
            lowest: first frequency to look at; the loop should still pass it whole [Hz].
            highest: last frequency to look at [Hz].
            half_width: half-width of the average over frequencies [Hz].

        Returns:
            The bandwidth [rad/s]; None where the gain stays above 1/√2, or the run is unstable.

        Raises:
            ParameterError: frequencies that are none.
            LogError: time is not even, or the run is too short for that resolution.
        """
        given = {"lowest": lowest, "highest": highest, "half_width": half_width}
        for name, value in given.items():
            if not arguments.number(value, f"bandwidth: {name}", "a frequency in Hz") > 0.0:
                raise ParameterError(f"bandwidth: {name} is {value:g}", expected="Hz, above 0", do="correct it")
        if not lowest < highest:
            raise ParameterError(
                f"bandwidth: lowest is {lowest:g} and highest {highest:g}",
                expected="lowest below highest",
                do="swap them",
            )
        if not self.ended:
            return None
        frequencies = np.arange(lowest, highest, half_width / 6.0)
        reference, joint = self.columns["reference"], self.columns["joint"]
        gain = np.abs(metrics.frequency_response(self.time, reference, joint, frequencies, half_width))
        return metrics.bandwidth(frequencies, gain)

    def write(self, path: Path | str) -> None:
        """Write the trace with its units, settings and seed, exact to the last bit.

        Args:
            path: ``.npz`` (NumPy's, which is small and fast), ``.csv`` (for people and other programs), or
                ``.parquet``.

        Raises:
            ParameterError: what is no path, or has another ending.
            OutputError: the file cannot be written.
            MissingExtraError: Parquet, and PyArrow is not installed.
        """
        write_traces(iter([self]), arguments.path_of(path, "write: path"))

    @classmethod
    def read(cls, path: Path | str) -> "Trace":
        """Read back what `write` wrote; the contents of the file decide how, not its name.

        Raises:
            LogError: no such file, or not a trace.
            MissingExtraError: Parquet, and PyArrow is not installed.
        """
        path = arguments.path_of(path, "read: path")
        table = read_table(path)
        try:
            if table.about is None:
                raise KeyError("units")
            metadata = json.loads(table.about)
            if list(table.names) != list(metadata["units"]):
                raise ValueError(f"columns {list(table.names)}, declared as {list(metadata['units'])}")
            values = table.numbers(range(len(table.names)))
            if not len(values[0]):
                raise ValueError("it has no rows")
            columns = dict(zip(table.names, values, strict=True))
            return cls(columns, metadata["units"], metadata["settings"], metadata["seed"])
        except (KeyError, TypeError, ValueError, AttributeError, ParameterError, RecursionError) as error:
            said = f"it does not say its {error.args[0]!s}" if isinstance(error, KeyError) else str(error)
            raise LogError(f"{path} is no trace: {said}", expected="a file that bowden wrote") from None

    def _about(self) -> str:
        return json.dumps({"units": self.units, "settings": dict(self.settings), "seed": self.seed})


def write_traces(traces: Iterator[Trace], path: Path) -> None:
    """Write traces that go on in one another as one; only as ``.npz`` need the whole of them fit into the memory.

    Raises:
        ParameterError: another ending than .npz, .csv or .parquet.
        OutputError: the file cannot be written.
        MissingExtraError: Parquet, and PyArrow is not installed.
    """
    write = {".npz": _write_npz, ".csv": _write_csv, ".parquet": _write_parquet}.get(path.suffix)
    if write is None:
        raise ParameterError(f"path is {path}", expected="a name that ends in .npz, .csv or .parquet", do="choose one")
    with whole_file(path) as part:
        first = next(traces)
        write(part, first, itertools.chain([first], traces))


def _write_npz(path: Path, first: Trace, traces: Iterator[Trace]) -> None:
    pieces = list(traces)
    with zipfile.ZipFile(path, "w") as file:
        for name in first.columns:
            with file.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:  # without the time of day
                np.lib.format.write_array(member, np.concatenate([one[name] for one in pieces]))
        file.writestr(zipfile.ZipInfo(KEY), first._about())


def _write_csv(path: Path, first: Trace, traces: Iterator[Trace]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"{FIRST_LINE.decode()}{first._about()}\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(first.columns)
        for trace in traces:
            for begin in range(0, len(trace), _ROWS):
                part_of = (values[begin : begin + _ROWS].tolist() for values in trace.columns.values())
                rows.writerows(zip(*part_of, strict=True))


def _write_parquet(path: Path, first: Trace, traces: Iterator[Trace]) -> None:
    pa = extra_module("pyarrow", "parquet", "writing Parquet (.csv and .npz need no package)")
    parquet = extra_module("pyarrow.parquet", "parquet", "writing Parquet (.csv and .npz need no package)")
    kinds = [pa.field(name, pa.float64(), nullable=False) for name in first.columns]
    schema = pa.schema(kinds, metadata={KEY: first._about()})
    with parquet.ParquetWriter(path, schema, use_dictionary=False) as file:
        for trace in traces:
            file.write_table(pa.table(list(trace.columns.values()), schema=schema))


def _frames(name: str) -> Any:
    """The library of that name.

    Raises:
        ParameterError: it is not installed.
    """
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ParameterError(
            f"to_{name} needs {name}, which cannot be imported ({error})",
            do=f"pip install {name}, or take NumPy arrays with trace.array(name)",
        ) from None


_COLUMNS = ("RMSE", "after 10 s", "peak", "delay", "hysteresis width")

_DRAWN = {"time", "reference", "joint"}
"""Columns without which a trace has no figures of merit, and no curves."""


class Traces(shown.Plotted, dict[str, Trace]):
    """A dictionary, name → trace, that shows itself as a table of figures of merit.

    Drawn, it has all joints over time beside the first one's reference, and their errors.

    >>> import numpy as np
    >>> t = np.linspace(0.0, 10.0, 1001)
    >>> units = {"time": "s", "reference": "rad", "joint": "rad"}
    >>> one = Trace({"time": t, "reference": np.sin(t), "joint": 0.99 * np.sin(t)}, units)
    >>> Traces({"mine": one, "yours": one})
    2 traces
      mine   RMSE 0.396°, after 10 s 0.312°, peak 0.573°, delay 0.373 ms, hysteresis width 0°
      yours  RMSE 0.396°, after 10 s 0.312°, peak 0.573°, delay 0.373 ms, hysteresis width 0°
    """

    _panels = shown.Panels(2, 1, 7.0, 4.2)

    def __missing__(self, name: Any) -> Trace:
        raise UnknownNameError(f"there is no trace {name!r}", expected=near(str(name), self), do="name one of them")

    def _draw(self, axes: "Sequence[Axes]") -> None:
        from bowden.drawing.style import COLOURS, colours_for, legend, stay_near, thin

        references = [trace["reference"] * DEGREES for trace in self.values()]
        joints = [trace["joint"] * DEGREES for trace in self.values()]
        colours = colours_for(list(self))
        for (name, trace), joint in zip(self.items(), joints, strict=True):
            axes[0].plot(*thin(trace.time, joint), color=colours[name], lw=1.1, label=name)
        for trace, reference in zip([*self.values()][:1], references, strict=False):
            drawn = thin(trace.time, reference)
            axes[0].plot(*drawn, color=COLOURS["reference"], lw=1.0, ls="--", label="reference")
        stay_near(axes[0], references, joints)
        axes[0].set_ylabel("angle [°]")
        legend(axes[0], 5)
        for below in axes[1:]:
            steady = [trace.error * DEGREES for trace in self.values() if trace.stable]
            errors = [trace.error * DEGREES for trace in self.values()]
            for (name, trace), error in zip(self.items(), errors, strict=True):
                below.plot(*thin(trace.time, error), color=colours[name], lw=1.0)
            stay_near(below, steady, errors)
            below.set_ylabel("error [°]")
        axes[-1].set_xlabel("time [s]")

    def _rows(self) -> list[tuple[str, str]]:
        rows = []
        for name, cells in self._table():
            named = zip(_COLUMNS, cells, strict=False)
            rows.append((name, shown.listed(f"{what} {text}" for what, text in named if text) or "–"))
        return rows

    def _drawable(self) -> bool:
        return bool(self) and all(set(trace.columns) >= _DRAWN for trace in self.values())

    def _repr_html_(self) -> str:
        rows = [(name, *(text or "–" for text in cells)) for name, cells in self._table()]
        return shown.table(self._title(), ["law", *_COLUMNS], rows, self._picture())

    def _title(self) -> str:
        return f"{len(self)} trace{'s' if len(self) != 1 else ''}"

    def _table(self) -> list[tuple[str, list[str]]]:
        rows = []
        for name, trace in self.items():
            if not set(trace.columns) >= _DRAWN:
                rows.append((name, [""] * len(_COLUMNS)))
                continue
            if not trace.stable:
                rows.append((name, ["unstable", *[""] * (len(_COLUMNS) - 1)]))
                continue
            figures = trace.metrics().shown()
            rows.append((name, [shown.number(*figures[column]) for column in _COLUMNS]))
        return rows
