"""What a drive of each family may do, through the live loop: the supervisor stops it in time, and the torque goes."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from bowden.hardware.drives import ak_drive, canopen_setup, moteus_setup, odrive_setup
from bowden.hardware.drives.findings import LagWatch
from support.family_matrix import DriveRow, cases, complaints, react

CASES = list(cases())
SAMPLE = [(name, row) for name, row in CASES if row.text == "inert"]
"""One for each family; the others are `long`, and in `benchmarks/fault_matrix.py`."""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (ak_drive, canopen_setup, moteus_setup, odrive_setup):
        monkeypatch.setattr(module, "LISTENING", 0.02)


@pytest.mark.parametrize(("name", "row"), SAMPLE, ids=str)
def test_an_inert_motor_of_each_family_is_let_go_of_within_50_ms(tmp_path: Path, name: str, row: DriveRow) -> None:
    assert list(complaints(row, react(tmp_path, name, row))) == []


@pytest.mark.long
@pytest.mark.parametrize(("name", "row"), CASES, ids=str)
def test_each_fault_of_a_drive_of_each_family_ends_the_run_in_time(tmp_path: Path, name: str, row: DriveRow) -> None:
    assert list(complaints(row, react(tmp_path, name, row))) == []


REFERENCES: dict[str, Callable[[float], float]] = {
    "chirp": lambda t: 0.6 * math.sin(2.0 * math.pi * (0.2 + 0.5 * t) * t),
    "triangle": lambda t: 0.7 * abs(1.5 * t % 2.0 - 1.0),
    "ramp": lambda t: 0.35 * t,
}


@pytest.mark.parametrize("frequency", [8.7, 20.0])
@pytest.mark.parametrize("name", REFERENCES)
def test_a_motor_that_is_well_is_not_inert_because_it_draws_no_current(name: str, frequency: float) -> None:
    """A servo of second order, with a current of zero throughout: nothing but its motion speaks for it."""
    watch, omega, position, velocity = LagWatch(20.0), 2.0 * math.pi * frequency, 0.0, 0.0
    watch._watch.inert = lambda *_, **__: False  # type: ignore[method-assign]  # that it stands still is another rule
    for k in range(3000):
        target = REFERENCES[name](1e-3 * k)
        for _ in range(10):
            velocity += 1e-4 * (omega**2 * (target - position) - 1.4 * omega * velocity)
            position += 1e-4 * velocity
        noise = 1e-4 * math.sin(1234.5 * k)
        assert not watch.inert(position + noise, target, 0.0, 1e-3 * k, led=True)
