"""A trace: the record of a run, with its units, settings and seed, to and from Parquet and CSV."""

import contextlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bowden.core import metrics
from bowden.core.errors import LogError
from bowden.core.files import whole_file

if TYPE_CHECKING:
    import pyarrow as pa

_MAGIC = "# bowden trace: "
_KEY = b"bowden"


@dataclass(frozen=True)
class Trace:
    """Signals sampled on one clock.

    The columns that every simulated run has are ``time``, ``reference``, ``reference_velocity``, ``joint`` (true),
    ``motor`` (true), ``joint_measured``, ``motor_measured``, ``command``, ``motor_velocity``, ``current``, ``width``
    and ``slope``; the law's own state follows as ``law.<name>``.
    """

    columns: dict[str, NDArray[np.float64]]
    """Name → values, all of one length (n,)."""
    units: dict[str, str]
    """Name → unit, as printed: ``s``, ``rad``, ``rad/s``, ``A``, ``1``."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """All that made the run, as JSON values: law, gains, plant, reference, sample time, software version."""
    seed: int | None = None
    """Seed of the run's random numbers; None where there were none."""

    def __post_init__(self) -> None:
        lengths = {values.shape for values in self.columns.values()}
        if len(lengths) != 1 or len(next(iter(lengths))) != 1:
            raise ValueError(f"columns of a trace have the shapes {sorted(lengths)}; expected one length")
        missing = set(self.columns) - set(self.units)
        if missing:
            raise ValueError(f"no unit for the columns {sorted(missing)}")

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.columns[name]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

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
        """Whether the run reached its end with finite numbers."""
        return bool(np.isfinite(self.columns["joint"]).all())

    @property
    def stable(self) -> bool:
        """Whether it ended, and the joint was never further from the reference than that's whole stroke (5° at least).

        See `bowden.core.metrics.is_stable`.
        """
        return metrics.is_stable(self.columns["reference"], self.columns["joint"])

    def metrics(self) -> metrics.Metrics:
        """RMSE, peak error, delay, hysteresis width, power and energy of the run."""
        return metrics.summarise(
            self.columns, self.settings.get("motor_resistance"), self.settings.get("torque_constant")
        )

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

    def convergence_times(self, band: float = 0.05, period: float = 0.0) -> dict[str, float | None]:
        """When each of the law's variables (columns ``law.*``) settles: see `metrics.convergence_time` [s].

        Raises:
            LogError: time is not even.
        """
        laws = {name.removeprefix("law."): values for name, values in self.columns.items() if name.startswith("law.")}
        return {name: metrics.convergence_time(self.time, values, band, period) for name, values in laws.items()}

    def bandwidth(self, lowest: float, highest: float, half_width: float = 0.15) -> float | None:
        """−3 dB bandwidth of the joint over the reference, for a reference that excites every frequency between two.

        Args:
            lowest: first frequency to look at; the loop should still pass it whole [Hz].
            highest: last frequency to look at [Hz].
            half_width: half-width of the average over frequencies [Hz].

        Returns:
            The bandwidth [rad/s]; None where the gain stays above 1/√2, or the run is unstable.

        Raises:
            LogError: time is not even, or the run is too short for that resolution.
        """
        if not self.ended:
            return None
        frequencies = np.arange(lowest, highest, half_width / 6.0)
        reference, joint = self.columns["reference"], self.columns["joint"]
        gain = np.abs(metrics.frequency_response(self.time, reference, joint, frequencies, half_width))
        return metrics.bandwidth(frequencies, gain)

    def to_parquet(self, path: Path | str) -> None:
        """Write the trace; units go to the fields, settings and seed to the schema.

        Raises:
            OutputError: the file cannot be written.
        """
        write_parquet(iter([self]), path)

    def to_csv(self, path: Path | str) -> None:
        """Write the trace as text: a comment with units, settings and seed, a header, shortest exact decimals.

        Raises:
            OutputError: the file cannot be written.
        """
        write_csv(iter([self]), path)

    @classmethod
    def from_parquet(cls, path: Path | str) -> "Trace":
        """Read back what `to_parquet` wrote.

        Raises:
            LogError: no such file, or not a trace.
        """
        import pyarrow.parquet as pq

        with _reading(path, "Parquet"), Path(path).open("rb") as file:
            table = pq.read_table(file)
            return cls._from(table, json.loads((table.schema.metadata or {})[_KEY]))

    @classmethod
    def from_csv(cls, path: Path | str) -> "Trace":
        """Read back what `to_csv` wrote.

        Raises:
            LogError: no such file, or not a trace.
        """
        import pyarrow as pa
        from pyarrow import csv

        with _reading(path, "CSV"), Path(path).open("rb") as file:
            first = file.readline().decode()
            if not first.startswith(_MAGIC):
                raise ValueError(f"its first line does not begin with {_MAGIC!r}")
            metadata = json.loads(first.removeprefix(_MAGIC))
            numbers = csv.ConvertOptions(column_types={name: pa.float64() for name in metadata["units"]})
            return cls._from(csv.read_csv(file, convert_options=numbers), metadata)

    def _metadata(self) -> dict[str, Any]:
        return {"units": self.units, "settings": dict(self.settings), "seed": self.seed}

    def _table(self) -> "pa.Table":
        import pyarrow as pa

        fields = [pa.field(name, pa.float64(), metadata={"unit": self.units[name]}) for name in self.columns]
        schema = pa.schema(fields, metadata={_KEY: json.dumps(self._metadata()).encode()})
        return pa.table(list(self.columns.values()), schema=schema)

    @classmethod
    def _from(cls, table: "pa.Table", metadata: dict[str, Any]) -> "Trace":
        columns = {name: table[name].to_numpy().astype(np.float64) for name in table.column_names}
        if list(columns) != list(metadata["units"]) or not len(table):
            raise ValueError(f"{len(table)} rows of {list(columns)}, declared as {list(metadata['units'])}")
        return cls(columns, metadata["units"], metadata["settings"], metadata["seed"])


def write_parquet(traces: Iterator[Trace], path: Path | str) -> None:
    """Write traces, one or more that go on in one another, as one trace: what is too long for the memory.

    Raises:
        OutputError: the file cannot be written.
    """
    import pyarrow.parquet as pq

    with whole_file(path) as part, part.open("wb") as file:
        first = next(traces)._table()
        with pq.ParquetWriter(file, first.schema) as writer:
            writer.write_table(first)
            for trace in traces:
                writer.write_table(trace._table())


def write_csv(traces: Iterator[Trace], path: Path | str) -> None:
    """The same as text.

    Raises:
        OutputError: the file cannot be written.
    """
    from pyarrow import csv

    with whole_file(path) as part, part.open("wb") as file:
        first = next(traces)
        file.write((_MAGIC + json.dumps(first._metadata()) + "\n").encode())
        table = first._table()
        with csv.CSVWriter(file, table.schema) as writer:
            writer.write_table(table)
            for trace in traces:
                writer.write_table(trace._table())


@contextlib.contextmanager
def _reading(path: Path | str, kind: str) -> Iterator[None]:
    """Whatever goes wrong while reading becomes one line."""
    import pyarrow as pa

    try:
        yield
    except (OSError, pa.ArrowException, KeyError, TypeError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else "") or " ".join(str(error).split())
        if isinstance(error, KeyError):
            reason = f"it does not say its {error.args[0]!s}"
        raise LogError(f"cannot read {path}: {reason}", expected=f"a {kind} file written by bowden") from error
