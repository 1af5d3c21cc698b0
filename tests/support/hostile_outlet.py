"""An LSL outlet that does harm, written on pylsl alone: what it may do stands in `Attack`, one field a kind of harm."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Sent = tuple[Array, Array]
"""Values (n, channels) and stamps (n,) [s]."""
RATE = 1000.0
CALM = 1.2
"""For so long after its first sample it sends what is right, so that it is opened [s]."""


def as_it_is(values: Array, stamps: Array) -> Sent:
    return values, stamps


@dataclass(frozen=True)
class Attack:
    """What the outlet does; without any it is a sound one that sends noise."""

    spoils: Callable[[Array, Array], Sent] = as_it_is
    """What becomes of each lot of samples once it has been calm for `CALM`."""
    calm: float = CALM
    silent_after: float = float("inf")
    """Nothing is sent from then on [s]."""
    closes_after: float = float("inf")
    """The outlet is gone from then on [s]."""
    twin_after: float = float("inf")
    """Then a second outlet of its name and source id comes [s]."""
    storm: bool = False
    """Goes and comes back twice a second."""
    again_with: int = 0
    """Comes back a second after it has gone, with so many channels."""
    channels: int = 1
    labels: Sequence[str] = ()
    labels_again: Sequence[str] = ()
    """Of an outlet that comes back."""
    unit: str = "microvolts"
    kind: str = "EMG"
    rate: float = RATE
    """That it declares [Hz]; it sends at `RATE`."""
    source: str | None = None
    """Its source id; its name by default."""


class HostileOutlet:
    """An outlet of this name, from its making to `close`; a thread sends once somebody reads."""

    def __init__(self, lsl: Any, name: str, attack: Attack) -> None:
        self._lsl, self.name, self._attack = lsl, name, attack
        self._outlets = [self._make(attack.channels, attack.labels)]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _make(self, channels: int, labels: Sequence[str]) -> Any:
        attack, lsl = self._attack, self._lsl
        source = self.name if attack.source is None else attack.source
        info = lsl.StreamInfo(self.name, attack.kind, channels, attack.rate, "double64", source)
        if labels:
            described = info.desc().append_child("channels")
            for label in labels:
                one = described.append_child("channel")
                one.append_child_value("label", label)
                one.append_child_value("unit", attack.unit)
        return lsl.StreamOutlet(info, 0, 10)

    def _run(self) -> None:
        attack, random = self._attack, np.random.default_rng(1)
        while not self._stop.is_set() and not self._outlets[0].have_consumers():
            time.sleep(0.005)
        begin, zero, sent = time.monotonic(), self._lsl.local_clock(), 0
        channels = attack.channels
        while not self._stop.is_set():
            since = time.monotonic() - begin
            gone = attack.closes_after <= since or (attack.storm and since > attack.calm and since % 0.5 > 0.25)
            if attack.again_with and since > attack.closes_after + 1.0:
                gone, channels = False, attack.again_with
            if gone:
                self._outlets.clear()
            elif not self._outlets:
                self._outlets.append(self._make(channels, attack.labels_again or attack.labels))
            if since > attack.twin_after and len(self._outlets) == 1:
                self._outlets.append(self._make(channels, attack.labels))
            due = int(since * RATE)
            stamps = zero + np.arange(sent, due) / RATE
            values = 0.01 * random.standard_normal((due - sent, channels))
            if since > attack.calm:
                values, stamps = attack.spoils(values, stamps)
            if len(values) and since < attack.silent_after:
                for outlet in self._outlets:
                    outlet.push_chunk(np.ascontiguousarray(values), stamps.tolist())
            sent = due
            time.sleep(0.004)

    def close(self) -> None:
        """End it; safe to call twice."""
        self._stop.set()
        self._thread.join()
        self._outlets.clear()
