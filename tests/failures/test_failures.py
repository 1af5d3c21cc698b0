"""Public failures of the field, on the twin: what stops the run, and in how many milliseconds of the twin's time."""

from pathlib import Path
from typing import Any

import pytest

from bowden.core.errors import DriveError
from bowden.hardware.buses.link import Links
from bowden.hardware.ports import Power
from bowden.hardware.twin.injection import parse
from bowden.identify.emg.score import find
from bowden.rig.families import family_of
from bowden.safety.state import Mode
from failures.book import BOOK, NEVER, Failure, table
from failures.by_emg import CONTRACTS, contraction, react_by_emg
from support.family_matrix import DriveRow, played, react

NEAR = 4.0
"""A bring-up waits by the computer's clock, and so a fault falls in another part of a cycle from run to run [ms]."""
ON_TWIN = [
    pytest.param(row, marks=[pytest.mark.long] if row.long else [], id=name)
    for name, row in BOOK.items()
    if row.play is not None
]


def check(row: Failure, faults: Any, stops: float, off: float) -> None:
    """Whether a row of the page is what was found."""
    assert {*row.faults} & {*faults}, faults
    assert stops == pytest.approx(row.stops, abs=NEAR)
    assert off == pytest.approx(row.off, abs=NEAR)


@pytest.mark.parametrize("row", ON_TWIN)
def test_failure(tmp_path: Path, row: Failure) -> None:
    play = row.play
    assert play is not None
    given = play._asdict() | {"late": None if play.late is None else play.late()}
    try:
        found = react(tmp_path, given.pop("family"), DriveRow(given.pop("text"), 0), **given)
    except DriveError:  # refused at bring-up, which is without power
        assert row.stops == 0.0
        return
    if not row.faults:
        assert (found.mode, found.last) == (Mode.STOPPED, ())
        assert found.after > 1e3 * play.watched - NEAR, "it ended by itself"
    elif row.stops == 0.0:
        assert found.mode == Mode.STOPPED
        assert {*row.faults} & {*found.last}
        assert found.pulled == 0.0
    else:
        assert found.mode == Mode.LATCHED
        check(row, found.faults, found.after, found.off)
        assert found.silenced <= 50.0, "the drive's own watch acts once nobody speaks to it"


def test_a_hint_of_where_the_rig_is_finds_the_turn_after_a_restart() -> None:
    rig, bus, node = played("ak_mit")
    node.faults.inject(parse("turns_lost 2"))
    bus.advance(1e-3)
    parameters = rig.drive_parameters._replace(home="hint", motor_hint=node.bench.motor + 0.1)
    drive = family_of(parameters).open(parameters, Links(bus, bus))
    drive.bring_up()
    for _ in range(20):
        reading = drive.read(bus.time)
        drive.write(0.0, Power.OFF, bus.time)
        bus.advance(1e-3)
    assert reading.motor == pytest.approx(node.bench.motor, abs=5e-3)


def test_stamps_of_a_stream_jump(tmp_path: Path) -> None:
    found = react_by_emg(tmp_path, jumps=2.0e5)
    check(BOOK["stamps_of_a_stream_jump"], *found)


def test_a_recording_ends_in_a_contraction(tmp_path: Path) -> None:
    signal = contraction(ends=True)
    (span,) = find(signal, 1000.0).found
    assert span == pytest.approx((CONTRACTS, len(signal) / 1000.0), abs=0.06)
    found = react_by_emg(tmp_path, ends=True)
    check(BOOK["a_recording_ends_in_a_contraction"], *found)


def test_the_table_has_every_row() -> None:
    assert len(table().splitlines()) == len(BOOK) + 2
    assert NEVER not in [row.stops for row in BOOK.values() if row.faults]
