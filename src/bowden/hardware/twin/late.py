"""A twin's drive that takes its targets late, as a rig's ``delay_cycles`` says."""

from collections import deque
from typing import Any, cast

from bowden.hardware.twin.plant import FOLLOW, TwinPlant


def late(plant: TwinPlant, delay: float) -> TwinPlant:
    """The plant, whose motor begins to follow each target a time after it was set.

    Args:
        plant: behind the twin's drive.
        delay: what the loop itself does not make [s]; with none the plant is as it was.
    """
    return cast(TwinPlant, _Late(plant, delay)) if delay > 0.0 else plant


class _Late:
    """All of a plant but for when its targets count. Power and brake act at once, and forget what is on its way."""

    def __init__(self, plant: TwinPlant, delay: float) -> None:
        self.__dict__.update(_plant=plant, _delay=delay, _now=0.0, _followed=False, _coming=deque())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "command" or not self._followed:
            setattr(self._plant, name, value)
        elif value != (self._coming[-1][1] if self._coming else self._plant.command):
            self._coming.append((self._now + self._delay, value))

    def advance(self, now: float) -> None:
        """See `TwinPlant.advance`: each target from when it counts."""
        plant, coming = self._plant, self._coming
        while coming and (coming[0][0] <= now or plant.doing != FOLLOW):
            due, target = coming.popleft()
            plant.advance(min(due, now))
            plant.command = target
        plant.advance(now)
        self.__dict__.update(_now=now, _followed=plant.doing == FOLLOW)
