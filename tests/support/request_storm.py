"""A storm of requests, between the cycles of a loop on a clock of the tests' and inside them."""

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bowden.control import LAWS
from bowden.core.clock import SECOND
from bowden.core.signals import DriveReading, DriveState, Reference
from bowden.cycle.one_cycle import HOLD, LAW, LAW_BEGINS, NOWHERE, Cycle, Filters, Plan
from bowden.hardware.ports import Power, TorqueLeft
from bowden.live import row, together
from bowden.live.loop import Loop, LoopMotor
from bowden.live.ring import RecorderState, Report
from bowden.models.drive.thermal import cold
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Request
from loop_rig import PERIOD, surroundings

QUICK = Limits()._replace(release_time=2e-3)
"""A release of two cycles: what is asked for is tried in every mode, ten thousand times."""
POWERED = (Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING)
TOWARDS = {Mode.STOPPED: Request.ARM, Mode.PREFLIGHT: Request.RUN, Mode.LATCHED: Request.ACKNOWLEDGE}
"""What leads on to a law that runs."""


class Rested:
    """A drive whose motor stands still, and that is now and then in fault until it is reset."""

    def __init__(self) -> None:
        self.power, self.fault, self.resets = Power.OFF, False, 0

    def read(self, now: float) -> DriveReading:
        on = DriveState.OPERATION_ENABLED if self.power == Power.ON else DriveState.SWITCH_ON_DISABLED
        state = float(DriveState.FAULT if self.fault else on)
        return DriveReading(*(0.0,) * 3, *(math.nan,) * 2, *(0.0,) * 3, state, *(0.0,) * 4)

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        self.power = power

    def bring_up(self) -> str:
        return "a drive at rest"

    def reset_fault(self) -> None:
        self.fault, self.resets = False, self.resets + 1

    def close(self) -> TorqueLeft:
        return TorqueLeft.OFF


class AtOnce:
    """A script whose preflight has passed."""

    outcome, reason, play, done, least = 1.0, 0.0, math.nan, False, 0.0

    def __init__(self) -> None:
        self._ran = False

    def plan(self, mode: float, target: float, reading: DriveReading, cycles: int) -> Plan:
        ran, self._ran = self._ran, mode == Mode.RUNNING
        return (
            Plan(LAW if ran else LAW_BEGINS, target, Reference(0.0, 0.0, 0.0))
            if self._ran
            else Plan(HOLD, target, NOWHERE)
        )

    def approach(self, target: float) -> float:
        return 0.0


class Interleaved:
    """The block's words as the loop sees them: before each that it reads, the operator's side may write."""

    def __init__(self, words: Any, before: Callable[[], None]) -> None:
        self._words, self._before = words, before

    def __getitem__(self, place: int) -> Any:
        self._before()
        return self._words[place]

    def __setitem__(self, place: int, value: Any) -> None:
        self._words[place] = value


class Storm:
    """Bursts of requests, until so many of them had a stop and something else; it is the loop's clock too.

    Checked after each cycle: a stop that waited when it began was taken in it, has stopped every axis, and came alone;
    whatever else was taken was asked for after the last stop.
    """

    def __init__(self, folder: Path, seed: int, axes: int, bursts: int) -> None:
        self.random, self.time, self.bursts, self.modes = random.Random(seed), SECOND, bursts, set[Mode]()
        self._left: list[Request] = []  # of this burst
        self._valid: list[Request] = []  # asked for after the last stop
        self._waited, self._stops, self._taken, self._resets = False, 0, Request.NONE, 0
        law, names = LAWS["adaptive"], tuple("abc"[:axes]) if axes > 1 else ("",)
        self._columns = together.columns_of_all({name: row.columns(law, together=axes > 1) for name in names})
        self._names = names
        self.reader, self.block, writer, words = surroundings(folder, row.description(self._columns, {}, 0, 0), 64)
        self.drives = [Rested() for _ in names]
        parts = []
        for drive in self.drives:
            cycle = Cycle(law, QUICK, Filters(), PERIOD / SECOND)
            cycle.begin(drive.read(0.0), cold(QUICK.thermal))
            script: Any = AtOnce()
            parts.append(LoopMotor(drive, cycle, script))
        self._take = words.take
        words.__dict__.update(_words=Interleaved(words._words, self._ask_some), take=self._kept)
        self.loop = Loop(parts, writer, words, self, 0)

    def now(self) -> int:
        return self.time

    def sleep_until(self, deadline: int) -> None:
        self.time = max(self.time, deadline)
        modes = self._checked()
        self.reader.recorder.write(Report(int(RecorderState.OK), self.time, 0, 0, 0, 0))
        self.block.beat(self.time)
        if self.bursts <= 0:
            self.loop.quit()
            return
        if self.random.random() < 0.02:
            self.random.choice(self.drives).fault = True
        if self.random.random() < 0.4:
            self._left += self.random.choices(list(Request)[1:], (3, 3, 4, 2), k=self.random.randint(1, 5))
            self.bursts -= Request.STOP in self._left and len(set(self._left)) > 1
        elif modes and modes[0] in TOWARDS:
            self._left.append(TOWARDS[modes[0]])
        self._ask_some()
        self._waited = self.block.stop_waits

    def _kept(self) -> int:
        self._taken = Request(self._take())
        return self._taken

    def _ask_some(self) -> None:
        while self._left and self.random.random() < 0.3:
            request = self._left.pop(0)
            self.block.ask(request)
            self._valid.append(request)

    def _checked(self) -> list[Mode]:
        """The modes of the axes, once what the last cycle took is found to be right."""
        newest = self.reader.last()
        if newest is None:
            return []
        views = [together.view(self._columns, self._names, name) for name in self._names]
        rows = [dict(zip(view.columns, newest[list(view.places)].tolist(), strict=True)) for view in views]
        modes = [Mode(int(one["mode"])) for one in rows]
        self.modes.update(modes)
        came, self._stops = self.block.stops != self._stops, self.block.stops
        stopped = self._taken == Request.STOP
        assert stopped or not self._waited, "a stop that waited when the cycle began was not taken in it"
        assert stopped or not came or self.block.stop_waits, "a stop that came in the cycle is neither taken nor waits"
        if stopped:
            assert all(one["request"] == Request.STOP for one in rows)
            assert not set(modes) & set(POWERED)
        elif self._taken:
            assert self._taken in self._valid, "it was asked for before a stop"
        if Request.STOP in self._valid:
            after = len(self._valid) - self._valid[::-1].index(Request.STOP)
            self._valid = self._valid[after - 1 if self.block.stop_waits else after :]
        resets = sum(drive.resets for drive in self.drives)
        assert resets == self._resets or self._taken == Request.ACKNOWLEDGE
        self._resets = resets
        return modes
