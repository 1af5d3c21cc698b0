"""What is killed leaves no torque and loses nothing, a sample of `make soak`; no stop is lost in a burst of keys."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from live_runs import tries
from support.key_bursts import bursts

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
pytestmark = pytest.mark.live


@pytest.mark.parametrize(
    ("victim", "number"),
    [("operator", 1), *(pytest.param(name, 10, marks=pytest.mark.long) for name in ("reader", "loop", "recorder"))],
)
def test_what_is_killed_leaves_no_torque_and_nothing_else(
    victim: str, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])
    import process_kills

    for attempt in tries():
        (values,) = process_kills.cases([number + 100 * attempt], (victim,))
        found: dict[str, Any] = dict(zip(process_kills.COLUMNS, values, strict=True))
        if not found["before"]:  # a stall of the machine has not ended it first
            break
    assert found["left"] == []
    assert np.isnan(found["off"]) or found["off"] <= process_kills.OFF[victim]
    assert found["lost"] <= process_kills.MOST_LOST


def test_no_stop_is_lost_in_a_burst_of_keys(tmp_path: Path) -> None:
    found = list(bursts(tmp_path, 10, in_law=5))
    assert len(found) == 10
    assert [keys for keys, taken in found if not taken] == []
