"""What a run's curves are made of: rows out of the ring, kept for five minutes, reduced to the extremes of each pixel.

Rows are read by a reader of the console's own, which the loop never notices. Two stores are kept: every row for half a
minute, and the extremes of every 20 ms for five. A viewer's window is cut out of one of them; a pixel that is complete
is computed once for all viewers with the same window, and sent once.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.signals import DriveState
from bowden.core.units import DEGREES, RADIANS
from bowden.cycle.one_cycle import TargetSource
from bowden.live.events import Changes
from bowden.live.mcap_log import Event
from bowden.live.mcap_read import motors_of, settings_of
from bowden.live.ring import Description, RingReader
from bowden.live.row import AT
from bowden.live.together import modes_of_all, view
from bowden.safety.state import Mode

Array = NDArray[np.float64]
Values = NDArray[np.float32]

MOST_COLUMNS = 16
"""In a view."""
PIXELS = (50, 4000)
"""Fewest and most in a view."""
SECONDS = (2.0, 300.0)
"""Shortest and longest window [s]."""
CURVES, WHOLE, LOOP = 1, 2, 3
"""Kinds of frames: pixels that have come since; the whole window anew; joint over motor."""
_HEAD, _LOOP_HEAD = struct.Struct("<BBHIdd"), struct.Struct("<BBHII")
_RAW = 31.0
"""Rows are kept for this long [s]."""
_COARSE = 0.02
"""A bucket of the store of extremes [s]."""
_LOOP_POINTS, _LOOP_SECONDS, _STROKES = 1200, 30.0, 4
_MOST_EVENTS = 300
_MOVED = 0.2 * RADIANS
"""Motion of the target by which the preflight has begun to move the motor [rad]."""
_RECENT = 1.0
"""Over which the lateness is looked at [s]."""


class Curve(NamedTuple):
    """A curve on offer."""

    name: str
    title: str
    unit: str
    group: str
    source: tuple[str, ...]
    """Curve of the row; two for the first one less the second."""
    factor: float = 1.0
    """From the row's unit to this one."""
    low: float | None = None
    """Limit, in this unit."""
    high: float | None = None

    def document(self) -> dict[str, Any]:
        """As the page has it."""
        return {name: getattr(self, name) for name in ("name", "title", "unit", "group", "low", "high")}


def curves_of(names: Sequence[str], units: Sequence[str], settings: Mapping[str, Any]) -> list[Curve]:
    """The curves of a run; of one with several motors those of each, in groups of its own, but for the loop's.

    Args:
        names: of its columns.
        units: of each.
        settings: of the run.
    """
    motors = motors_of(settings)
    if not motors:
        return columns_of(names, units, settings)
    offered: list[Curve] = []
    for number, motor in enumerate(motors):
        seen = view(names, motors, motor)
        whole = dict(zip(seen.columns, (names[i] for i in seen.places), strict=True))
        of_motor = columns_of(seen.columns, [units[i] for i in seen.places], settings_of(settings, motor))
        for one in of_motor:
            if one.group == _LOOPS:
                offered += [one] * (number == 0)
                continue
            name, source = f"{motor}.{one.name}" if number else one.name, tuple(whole[column] for column in one.source)
            offered.append(
                one._replace(name=name, title=f"{motor}, {one.title}", group=f"{motor}: {one.group}", source=source)
            )
    return offered


_LOOPS = "loop"


def columns_of(names: Sequence[str], units: Sequence[str], settings: Mapping[str, Any]) -> list[Curve]:
    """The curves that rows of these columns, of one motor, have.

    Args:
        names: of the row's columns.
        units: of each.
        settings: of the run, as its ring and its log have them: the supervisor's limits, and the wearer's EMG at rest
            and at most.
    """
    unit_of = dict(zip(names, units, strict=True))
    limits, wearer = _part(settings, "limits"), _part(_part(settings, "emg"), "wearer")

    def limit(name: str, factor: float = 1.0, of: Mapping[str, Any] = limits) -> float | None:
        value = of.get(name)
        return factor * float(value) if isinstance(value, int | float) and math.isfinite(value) else None

    def angle(name: str, title: str, source: tuple[str, ...], group: str, low: str = "", high: str = "") -> Curve:
        return Curve(name, title, "°", group, source, DEGREES, limit(low, DEGREES), limit(high, DEGREES))

    peak, torque, mvc = limit("current_peak"), limit("torque_high"), limit("mvc", of=wearer)
    opposite, level = None if torque is None else -torque, unit_of.get("emg.level", "1")
    offered = [
        angle("reference_deg", "reference", ("reference",), "motion"),
        angle("joint_deg", "joint", ("joint",), "motion", "joint_low", "joint_high"),
        angle("motor_deg", "motor", ("motor",), "motion", "motor_low", "motor_high"),
        angle("error_deg", "error, joint − reference", ("joint", "reference"), "error"),
        angle("requested_target_deg", "requested target of the law", ("requested_target",), "command"),
        angle("command_deg", "command to the drive", ("command",), "command", "motor_low", "motor_high"),
        Curve("current_a", "motor current", "A", "current", ("current",), 1.0, None if peak is None else -peak, peak),
        Curve("tension_n", "tension", "N", "tension", ("tension",), 1.0, limit("tension_low"), limit("tension_high")),
        Curve("joint_torque_nm", "torque on the joint", "N·m", "tension", ("joint_torque",), 1.0, opposite, torque),
        *(
            Curve(f"{part}_c", part, "°C", "temperature", (column,), high=limit(f"{part}_limit"))
            for part, column in (
                ("winding", "supervisor.heat.winding"),
                ("housing", "supervisor.heat.housing"),
                ("drive", "temperature"),
            )
        ),
        Curve("emg_level", "EMG envelope", level, "emg", ("emg.level",), 1.0, limit("rest", of=wearer), mvc),
        Curve("emg_flexor", "flexor contracts", "1", "emg", ("emg.flexor",)),
        Curve("emg_extensor", "extensor contracts", "1", "emg", ("emg.extensor",)),
        Curve("emg_intent", "detected intent", "1", "emg", ("emg.intent",)),
        Curve("lateness_us", "lateness of the cycle", "µs", "loop", ("lateness",), 1e6, high=limit("lateness", 1e6)),
        Curve("run_time_us", "run time of the cycle", "µs", "loop", ("run_time",), 1e6),
        Curve("operator_age_ms", "age of the operator's sign of life", "ms", "loop", ("operator_age",), 1e3),
    ]
    for name in names:
        if name.startswith("law."):
            turned, inner = unit_of[name] == "rad", name.removeprefix("law.")
            unit, factor = ("°", DEGREES) if turned else (unit_of[name], 1.0)
            offered.append(Curve(f"law.{inner}{'_deg' if turned else ''}", inner, unit, "law", (name,), factor))
    return [one for one in offered if {*one.source} <= {*names}]


def _part(settings: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """A table of the settings; an empty one where there is none."""
    found = settings.get(name)
    return found if isinstance(found, Mapping) else {}


def taken(columns: Sequence[Curve], names: Sequence[str], rows: Array) -> Values:
    """The curves' values (n, columns) in their units, from rows (n, width)."""
    at = {name: i for i, name in enumerate(names)}
    out = np.empty((len(rows), len(columns)), np.float32)
    for i, column in enumerate(columns):
        values = rows[:, at[column.source[0]]]
        if len(column.source) > 1:
            values = values - rows[:, at[column.source[1]]]
        with np.errstate(over="ignore"):
            out[:, i] = values * column.factor
    return out


def reduced(times: Array, low: Values, high: Values, first: int, pixels: int, step: float) -> Values:
    """Extremes (columns, pixels, 2) of rows in each pixel; NaN where there is none.

    Args:
        times: of the rows, rising (n,) [s].
        low: smallest values (n, columns).
        high: largest values (n, columns).
        first: number of the first pixel; pixel k is from k to k + 1 times `step`.
        pixels: how many.
        step: width of a pixel [s].
    """
    out = np.full((low.shape[1], pixels, 2), np.nan, np.float32)
    if not len(times) or not pixels:
        return out
    place = np.floor(times / step + 1e-9).astype(np.int64) - first
    begin, end = np.searchsorted(place, (0, pixels))
    if begin == end:
        return out
    place = place[begin:end]
    starts = np.flatnonzero(np.diff(place, prepend=-1))
    at = place[starts]
    out[:, at, 0] = np.fmin.reduceat(low[begin:end], starts).T
    out[:, at, 1] = np.fmax.reduceat(high[begin:end], starts).T
    return out


class _Store:
    """The newest rows of a table that grows at its end; older ones are forgotten. Memory is taken once."""

    def __init__(self, most: int, width: int, tables: int) -> None:
        self._most, self._from, self._to = most, 0, 0
        self._times = np.empty(2 * most)
        self._tables = [np.empty((2 * most, width), np.float32) for _ in range(tables)]

    def add(self, times: Array, *tables: Values) -> None:
        """Rows that come after those that are there."""
        n = min(len(times), self._most)
        if self._to + n > 2 * self._most:
            kept = max(0, min(self._to - self._from, self._most - n))
            all_: tuple[NDArray[Any], ...] = (self._times, *self._tables)
            for one in all_:
                one[:kept] = one[self._to - kept : self._to].copy()
            self._from, self._to = 0, kept
        held: tuple[NDArray[Any], ...] = (self._times, *self._tables)
        more: tuple[NDArray[Any], ...] = (times, *tables)
        for there, new in zip(held, more, strict=True):
            there[self._to : self._to + n] = new[len(new) - n :]
        self._to += n
        self._from = max(self._from, self._to - self._most)

    def since(self, time: float) -> tuple[Array, list[Values]]:
        """Times and tables of the rows from a time on [s]; views, good until rows are added."""
        times = self._times[self._from : self._to]
        at = self._from + int(np.searchsorted(times, time - 1e-9))
        return self._times[at : self._to], [one[at : self._to] for one in self._tables]


class View(NamedTuple):
    """Request of a viewer."""

    columns: tuple[int, ...]
    """Numbers of the curves."""
    step: float
    """Width of a pixel [s]."""
    pixels: int
    """In the whole window."""
    coarse: bool
    """True if it is cut out of the store of extremes."""
    loop: bool = False
    """True if joint over motor is wanted as well."""


class Cursor:
    """Position up to which a viewer has been served."""

    def __init__(self, view: View, number: int) -> None:
        self.view, self.number = view, number
        self.next: int | None = None
        """The pixel that comes next; None before the first frame."""
        self.loop_at = -1.0
        """Time of the last row of the last loop that was sent [s]."""


class Watch:
    """Looks at one run: its curves, events and punctuality. For one thread.

    Args:
        reader: of the run's ring, of its own.
        period: of a cycle [s].
        measures: whether a motion of the motor is what leads, and no law.
    """

    def __init__(self, reader: RingReader, period: float, *, measures: bool = False) -> None:
        self._reader, self.period = reader, period
        self._leads = float(TargetSource.MOTION if measures else TargetSource.LAW_BEGINS)
        about: Description = reader.description
        self._names = about.columns
        self.columns = curves_of(about.columns, about.units, about.settings)
        """On offer."""
        self._number = {column.name: i for i, column in enumerate(self.columns)}
        width = len(self.columns)
        self._raw = _Store(math.ceil(_RAW / period), width, 1)
        self._coarse = _Store(math.ceil((SECONDS[1] + 2.0) / _COARSE), width, 2)
        self._rest = np.empty(0), np.empty((0, width), np.float32)
        self._changes = Changes(about)
        motors, self._independent = motors_of(about.settings), bool(about.settings.get("independent"))
        self._modes = [AT["mode"], *(about.columns.index(f"{name}.mode") for name in motors[1:])]
        self.events: list[Event] = []
        """The newest."""
        self.version = 0
        """Grows with the events."""
        self.begin: float | None = None
        """Curve `time` of the first row [s]."""
        self.now = 0.0
        """Time of the newest row since then [s]."""
        self.overruns = 0
        self.latest = 0.0
        """Largest lateness so far [s]."""
        self.late = np.empty(0)
        """Lateness of the last second's cycles [s]."""
        self.running_since = self.led_since = math.nan
        """When the run was begun, and when its law or motion began, since the first row [s]."""
        self.led_until = math.nan
        self.preflight_moves = False
        """True if the preflight moves the motor, or has."""
        self._held = math.nan
        self._last_mode = float(Mode.STOPPED)
        self._made: dict[tuple[Any, ...], Values] = {}

    def look(self) -> int:
        """Take in what has come; how many rows."""
        numbers, rows = self._reader.read()
        self._made.clear()
        if not len(rows):
            return 0
        if self.begin is None:
            self.begin = float(rows[0, AT["time"]])
        found, self._changes = self._changes.find(numbers, rows)
        if found:
            self.events = [*self.events, *found][-_MOST_EVENTS:]
            self.version += 1
        times = rows[:, AT["time"]] - self.begin
        self.now = float(times[-1])
        self._follow(times, rows)
        late = rows[:, AT["lateness"]]
        self.late = np.concatenate([self.late, late])[-max(1, round(_RECENT / self.period)) :]
        self.latest = max(self.latest, float(np.nanmax(late, initial=0.0)))
        self.overruns += int(np.nansum(rows[:, AT["overruns"]]))
        values = taken(self.columns, self._names, rows)
        self._raw.add(times, values)
        self._bucket(times, values)
        return len(rows)

    def _follow(self, times: Array, rows: Array) -> None:
        """Since when it runs, and since when its law leads."""
        source = rows[:, AT["source"]]
        mode = modes_of_all(rows[:, self._modes], independent=self._independent)
        going = (mode == Mode.RUNNING) | (mode == Mode.BRIDGING)
        for i in np.flatnonzero(np.diff(going.astype(np.int8), prepend=self._going())):
            if going[i]:
                self.running_since, self.led_since, self.led_until = float(times[i]), math.nan, math.nan
            else:
                self.led_until = float(times[i])
        checked = mode == Mode.PREFLIGHT
        if checked[-1]:
            on = np.flatnonzero(checked & (rows[:, AT["drive_state"]] == DriveState.OPERATION_ENABLED))
            if self._last_mode != Mode.PREFLIGHT:
                self._held, self.preflight_moves = math.nan, False
            if len(on):
                requested_target = rows[on, AT["requested_target"]]
                self._held = float(requested_target[0]) if math.isnan(self._held) else self._held
                self.preflight_moves |= bool(np.nanmax(np.abs(requested_target - self._held), initial=0.0) > _MOVED)
        self._last_mode = float(mode[-1])
        if math.isnan(self.led_since) and going[-1]:
            led = np.flatnonzero(going & (source >= self._leads) & (times >= self.running_since))
            if len(led):
                self.led_since = float(times[led[0]])

    def _going(self) -> int:
        return int(self._last_mode in (Mode.RUNNING, Mode.BRIDGING))

    def _bucket(self, times: Array, values: Values) -> None:
        """Add what completes buckets of the store of extremes; the rest waits."""
        times, values = np.concatenate([self._rest[0], times]), np.concatenate([self._rest[1], values])
        place = np.floor(times / _COARSE + 1e-9).astype(np.int64)
        whole = int(np.searchsorted(place, place[-1]))
        if whole:
            starts = np.flatnonzero(np.diff(place[:whole], prepend=place[0] - 1))
            low, high = (np_.reduceat(values[:whole], starts) for np_ in (np.fmin, np.fmax))
            self._coarse.add(np.asarray((place[starts] + 0.5) * _COARSE, np.float64), low, high)
        self._rest = times[whole:].copy(), values[whole:].copy()

    def view(self, names: Sequence[str], seconds: float, pixels: int, *, loop: bool) -> View:
        """The view of curves by their names; those that there are not are left out."""
        numbers = tuple(self._number[name] for name in dict.fromkeys(names) if name in self._number)
        step, coarse = seconds / pixels, seconds > _RAW - 1.0
        step = math.ceil(step / _COARSE - 1e-9) * _COARSE if coarse else max(step, 2.0 * self.period)
        return View(numbers, step, max(1, math.ceil(seconds / step)), coarse, loop)

    def frame(self, cursor: Cursor) -> bytes | None:
        """What a viewer has not got yet; None where there is nothing new."""
        view = cursor.view
        end = math.floor(((math.floor(self.now / _COARSE) * _COARSE) if view.coarse else self.now) / view.step + 1e-9)
        whole = cursor.next is None or end - cursor.next > view.pixels
        first = max(0, end - view.pixels) if whole or cursor.next is None else cursor.next
        if (first >= end and not whole) or self.begin is None:
            return None
        cursor.next = end
        key = (view.columns, view.step, view.coarse, first, end)
        made = self._made.get(key)
        if made is None:
            made = self._made[key] = self._cut(view, first, end)
        return packed(WHOLE if whole else CURVES, made, cursor.number, first * view.step, view.step)

    def _cut(self, view: View, first: int, end: int) -> Values:
        store = self._coarse if view.coarse else self._raw
        times, tables = store.since(first * view.step)
        low, high = tables[0], tables[-1]
        chosen = list(view.columns)
        return reduced(times, low[:, chosen], high[:, chosen], first, end - first, view.step)

    def loop_frame(self, cursor: Cursor, every: float) -> bytes | None:
        """Joint over motor of the last strokes, at most each `every` seconds; None where it is not wanted."""
        if not cursor.view.loop or self.begin is None or self.now - cursor.loop_at < every:
            return None
        cursor.loop_at = self.now
        key = ("loop",)
        made = self._made.get(key)
        if made is None:
            made = self._made[key] = self._strokes()
        return _LOOP_HEAD.pack(LOOP, 0, 0, cursor.number, len(made)) + made.tobytes()

    def _strokes(self) -> Values:
        """Motor and joint (n, 2) of the last strokes; a stroke ends where the motor turns by more than 2°."""
        _, (values,) = self._raw.since(self.now - _LOOP_SECONDS)
        at = [self._number["motor_deg"], self._number["joint_deg"]]
        pair = values[:, at]
        pair = pair[np.isfinite(pair).all(axis=1)]
        pair = pair[:: max(1, math.ceil(len(pair) / (4 * _LOOP_POINTS)))]
        begin = _turns(pair[:, 0], 2.0, _STROKES + 1)
        pair = pair[begin:]
        return np.ascontiguousarray(pair[:: max(1, math.ceil(len(pair) / _LOOP_POINTS))], np.float32)


def _turns(motor: Values, least: float, count: int) -> int:
    """Where the last `count` strokes begin: looked for from the end."""
    way, far, found = 0.0, len(motor) - 1, 0
    for i in range(len(motor) - 1, -1, -1):
        moved = float(motor[i] - motor[far])
        if way == 0.0:
            way = float(np.sign(moved)) if abs(moved) > least else 0.0
            far = i if way else far
        elif moved * way > 0.0:
            far = i
        elif abs(moved) > least:
            found, way = found + 1, -way
            if found >= count:
                return far
            far = i
    return 0


def packed(kind: int, values: Values, number: int, begin: float, step: float) -> bytes:
    """A frame of extremes (columns, pixels, 2)."""
    return _HEAD.pack(kind, values.shape[0], values.shape[1], number, begin, step) + values.tobytes()
