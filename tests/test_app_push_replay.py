"""A run by the wearer's push under another law: its reference with the lead which that law needs, or a clear line."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.source import TABLE, Measurement
from bowden.core.errors import LogError
from bowden.core.signals import DriveReading, Reference, Sample
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import LAW, LAW_BEGINS, NOTHING_OBSERVED, Cycle, Filters, Plan, TargetSource, clamp_offset
from bowden.design.felt import felt
from bowden.live.events import Changes
from bowden.live.figures import Damage
from bowden.live.live_run import Live, live_run
from bowden.live.log_rig import source_for
from bowden.live.mcap_log import LogFile, about
from bowden.live.mcap_read import Recording
from bowden.live.row import columns, description
from bowden.live.run_settings import run_settings
from bowden.live.summary import push_figures
from bowden.models.drive.thermal import cold
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from live_runs import pushed_rig
from support.command import Command

DT = 1e-3


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(pushed_rig(), encoding="utf-8")
    return tmp_path


def live(law: str) -> Live:
    return live_run(Rig.read("rig.toml").with_law(law))


def told(ran: Live) -> dict[str, Any]:
    """What the log of a run keeps, as it comes back from the file."""
    settings = run_settings(ran.law, ran.limits, Filters(), DT) | ran.settings()
    found: dict[str, Any] = json.loads(json.dumps(settings))
    return found


def recording(settings: dict[str, Any]) -> Recording:
    nothing = np.empty((0, 0))
    return Recording({}, None, (), (), np.arange(0), nothing, [], Damage(0, 0, 0), settings)


@pytest.mark.parametrize("ran", ["uncompensated", "bowden"])
def test_a_push_is_led_as_the_law_that_is_replayed_needs_it(ran: str) -> None:
    log = recording(told(live(ran)))
    for name in ("uncompensated", "bowden", "adaptive"):
        assert source_for(log, LAWS[name]).settings == live(name).source().settings, name
    leads = [source_for(log, LAWS[name]).settings.under for name in ("uncompensated", "bowden", "adaptive")]
    assert [under.lead > 0.0 for under in leads] == [True, False, True]
    assert [under.compliance > 0.0 for under in leads] == [False, True, True]


def test_a_range_and_a_share_that_the_log_has_stay() -> None:
    text = Path("rig.toml").read_text()
    changed = text.replace("enabled = true", "enabled = true\nfriction_share = 0.9\ncarried = 0.5\nlow_deg = 11.0")
    Path("rig.toml").write_text(changed.replace("joint_high_deg = 105.0", "joint_high_deg = 93.0"))
    settings = source_for(recording(told(live("uncompensated"))), LAWS["adaptive"]).settings
    assert settings == live("adaptive").source().settings
    assert (settings.admittance.low, settings.admittance.high) == pytest.approx((11.0 * RADIANS, 88.0 * RADIANS))


def test_a_table_is_the_same_table_for_any_law() -> None:
    settings = told(live("uncompensated"))
    del settings["admittance"]
    assert source_for(recording(settings), LAWS["adaptive"]) is TABLE


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: s.pop("rig"), "the log has no rig, of which the wearer's push is made for another law"),
        (
            lambda s: s["rig"]["fields"]["suit"].update(friction_mn=1),
            "the log's rig: the packed rig: suit.friction_mn: Extra inputs are not permitted; expected what Rig.pack "
            "or Rig.document gave",
        ),
        (
            lambda s: s["rig"]["fields"]["suit"].update(friction=-1.0),
            "the log's rig: Rig: suit.friction is -1; expected a number at least 0 and at most 100 in N·m",
        ),
        (
            lambda s: s["rig"]["fields"]["suit"].update(worn=False),
            "the log's rig: [admittance]: [admittance] is enabled without a suit; expected suit.worn = true",
        ),
        (
            lambda s: s["rig"]["fields"]["suit"].update(friction=3.0),
            "the log's rig computes the wearer's push in another way: its chain.friction is 3, and ran with 2.3032",
        ),
        (
            lambda s: s["admittance"]["chain"].update(cable=7000.0),
            "the log's rig computes the wearer's push in another way: its chain.cable is 8000, and ran with 7000",
        ),
    ],
)
def test_what_cannot_be_made_again_is_refused_and_its_own_law_is_not(change: Any, said: str) -> None:
    settings = told(live("uncompensated"))
    change(settings)
    log = recording(settings)
    assert source_for(log, LAWS["uncompensated"]).name == "admittance"
    with pytest.raises(LogError) as refused:
        source_for(log, LAWS["adaptive"])
    assert str(refused.value) == f"{said}; replay it without --law, which needs no rig"


CYCLES = 300


def recorded(ran: Live) -> np.ndarray:
    """Rows of the law at work from the first cycle, on a suit that is pushed to and fro."""
    source = ran.source()
    cycle = Cycle(ran.law, ran.limits, Filters(), DT, source)
    reading = DriveReading(0.8, 0.8, 0.0, math.nan, 35.0, 0.0, 0.0, 0.01, 4.0, 0.0, 0.0, 0.0, 0.0)
    cycle.begin(reading, cold(ran.limits.thermal))
    rows = []
    for k in range(CYCLES):
        swing = 0.8 + 0.1 * math.sin(0.02 * k)
        reading = reading._replace(joint=swing + 0.02 * math.sin(0.05 * k), motor=swing, current=0.5)
        plan = Plan(LAW_BEGINS if k == 1 else LAW, 0.8, Reference(0.8, 0.0, 0.0))
        observed = NOTHING_OBSERVED._replace(reading=reading, elapsed=DT, recorder=True)
        requested_target, verdict = cycle.step(observed, plan)
        rows.append(
            (
                *(k * DT, *cycle.reference, *reading, *cycle.recorded().sample[:2], requested_target),
                *(*verdict, plan.source, 0.0, DT, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, math.nan, 8e-5),
                *(*cycle.recorded().law, *cycle.recorded().conditioned),
                *(*cycle.recorded().supervisor, *cycle.recorded().source),
            )
        )
    return np.array(rows)


@pytest.mark.long
def test_the_replay_of_another_law_is_that_law_above_its_own_source(command: Command) -> None:
    ran, other = live("uncompensated"), live("cascaded_pid").law
    rows, source = recorded(ran), live("cascaded_pid").source()
    kept = description(columns(ran.law, source=ran.source()), told(ran), 1_700_000_000 * 10**9, 5)
    events, _ = Changes(kept).find(np.arange(CYCLES), rows)
    with Path("run.mcap").open("xb") as opened:
        file = LogFile(opened.fileno(), about(kept, {"software": "bowden 1", "host": "rig"}))
        file.write(np.arange(CYCLES), rows, events)
        file.finish({"lost": "0", "dropped": "0"})

    at = {name: i for i, name in enumerate(columns(ran.law, source=ran.source()))}
    differences, state, asked = [], None, None
    for row in rows[1:].tolist():
        sample = Sample(row[at["joint_seen"]], row[at["motor_seen"]])
        measured = Measurement(*sample[:2], row[at["current"]], math.nan)
        if state is None:
            state, asked = other.start(sample), source.start(measured)
        asked, reference, added = source.step(asked, measured, Reference(0.0, 0.0, 0.0), DT)
        state, target = other.step(state, sample, reference, DT)
        differences.append(clamp_offset(ran.limits, target, added) - row[at["requested_target"]])

    found = command.document("log replay run.mcap --law cascaded_pid")
    assert (found["same_law"], found["law_cycles"]) == (False, CYCLES - 1)
    assert found["requested_target_largest"] == pytest.approx(np.abs(differences).max(), rel=1e-12)
    assert found["requested_target_rms"] == pytest.approx(np.sqrt(np.mean(np.square(differences))), rel=1e-12)
    assert command.document("log replay run.mcap")["requested_target_largest"] == 0.0


def test_the_summary_of_a_run_has_the_figures_of_the_simulations(folder: Path) -> None:
    """The same torque over the same time, once as a live run estimated it and once as a simulation knows it."""
    pushing = live("uncompensated").pushing
    assert pushing is not None
    for seconds in (3.0, 9.0):
        time = np.arange(round(seconds / DT)) * DT
        joint, torque = 0.8 + 0.3 * np.sin(time), 2.0 * np.sin(3.0 * time) * np.exp(-time)
        names = ("source", "joint_seen", "admittance.estimate.torque", "admittance.estimate.doubt")
        before = np.tile([TargetSource.MOTION, 0.0, 50.0, 9.0], (700, 1))
        after = np.column_stack([np.full(len(time), TargetSource.LAW), joint, torque, np.full(len(time), 0.4)])
        rows = np.vstack([before, after])
        log = Recording({}, None, names, (), np.arange(len(rows)), rows, [], Damage(0, 0, 0))
        found = push_figures(log, pushing, DT)
        assert found is not None
        trace = Trace(
            {"time": time, "joint": joint, "interaction_torque": torque},
            dict.fromkeys(("time", "joint", "interaction_torque"), "1"),
        )
        expected = felt(trace, pushing.suit.arm, pushing.section.carried)
        assert (found.rms_nm, found.peak_nm) == (expected.rms, expected.peak)
        assert found.doubt_nm == 0.4
        assert (
            push_figures(Recording({}, None, names, (), np.arange(700), before, [], Damage(0, 0, 0)), pushing, DT)
            is None
        )
