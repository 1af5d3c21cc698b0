"""Gains that may be changed while the law runs: declared, bounded, gone over to, recorded, replayed, checked first."""

from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.laws import uncompensated
from bowden.core.errors import ParameterError, SafetyError
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample
from bowden.cycle.one_cycle import Filters, TargetSource
from bowden.live.events import Changes
from bowden.live.gain_check import GainCheck, required
from bowden.live.gain_ramp import RAMP
from bowden.live.mcap_read import Recording, read
from bowden.live.preflight import Preflight
from bowden.live.replay import replay
from bowden.live.ring import Description
from bowden.live.script import Script
from bowden.live.session import Session
from bowden.operations.run import run
from bowden.plants.suit_settings import SuitSettings
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from bowden.safety.state import Mode
from live_runs import SHARED_LIMITS, assert_replays, tries
from loop_rig import LoopRig, twin_bench
from support.simulated_drive import SimulatedDrive

LIVE = {
    "active_disturbance_rejection": ("observer_bandwidth", "control_bandwidth"),
    "adaptive": ("feedback_gain",),
    "adaptive_sliding_mode": ("bandwidth",),
    "backlash_inverse": ("proportional_gain", "integral_gain"),
    "bowden": ("bandwidth",),
    "cascaded_pid": ("proportional_gain", "integral_gain"),
    "disturbance_observer": ("bandwidth", "rate_limit"),
    "hysteresis_model": ("proportional_gain", "integral_gain"),
    "observer": (),
    "offset_inverse": ("error_share", "error_rate"),
    "repetitive": ("bandwidth", "rate_limit", "learning"),
    "uncompensated": (),
}
"""As docs/simulate.md has them, with why."""


class Pair(NamedTuple):
    share: Annotated[float, Quantity("of the error", ge=0.0, le=2.0, live=True)] = 1.0
    whole: Annotated[float, Quantity("a whole number by mistake", ge=0.0, le=9.0, live=True)] = 3


class OwnGains(NamedTuple):
    pair: Pair = Pair()
    slope: float = 1.0


@kernel
def own_step(
    gains: OwnGains, state: uncompensated.UncompensatedState, sample: Sample, reference: Reference, dt: float
) -> tuple[uncompensated.UncompensatedState, float]:
    command = gains.pair.share * reference.position + 0.0 * gains.pair.whole
    return uncompensated.UncompensatedState(command), command


@kernel
def own_start(gains: OwnGains, sample: Sample) -> uncompensated.UncompensatedState:
    return uncompensated.UncompensatedState(sample.motor)


OWN = Law("own", OwnGains(), own_start, own_step, source="a test", from_rig={"slope": "slope"})


def test_the_laws_declare_what_the_page_says() -> None:
    assert {name: law.live for name, law in LAWS.items()} == LIVE
    for law in LAWS.values():
        for name in law.live:
            low, high = law.limits[name]
            assert low <= law.numbers[name] <= high
            assert name in law.choices


def test_a_law_of_ones_own_declares_its_live_gains_with_their_range() -> None:
    assert OWN.live == ("pair.share", "pair.whole")
    assert OWN.limits["pair.share"] == (0.0, 2.0)
    with pytest.raises(ParameterError, match=r"pair.share of law 'own' is 3; expected a number from 0 to 2"):
        OWN.with_gains(**{"pair.share": 3.0})

    class Endless(NamedTuple):
        share: Annotated[float, Quantity("of the error", ge=0.0, live=True)] = 1.0

    with pytest.raises(ParameterError, match="may be changed while the law runs, and has no limits"):
        Law("own", Endless(), own_start, own_step, source="a test")

    class Fact(NamedTuple):
        slope: Annotated[float, Quantity("of the cable", ge=0.1, le=2.0, live=True)] = 1.0

    with pytest.raises(ParameterError, match="and is a fact of the rig"):
        Law("own", Fact(), own_start, own_step, source="a test", from_rig={"slope": "slope"})


@pytest.mark.parametrize("worn", [False, True])
@pytest.mark.parametrize("law", LIVE)
def test_a_rig_with_another_gain_differs_in_that_one_alone(law: str, worn: bool) -> None:
    """On a suit, too, where a law begins with its preset as long as a rig names no gains."""
    rig = Rig(law=law, suit=SuitSettings(worn=worn))
    for name in LIVE[law]:
        before = rig.fitted().numbers
        value = 0.9 * before[name]
        after = rig.with_gain(name, value).fitted().numbers
        assert after == {**before, name: value}


TABLE = np.column_stack([0.2 * (1.0 - np.cos(np.arange(3500) * 2e-3)), np.zeros(3500), np.zeros(3500)])


def led(folder: Path, law: Law, asks: dict[int, tuple[int, float]], stalls: dict[int, int] | None = None) -> Recording:
    """A run of the loop in which gains are asked for after so many cycles under the law."""
    waiting = dict(asks)

    def between(rig: LoopRig) -> None:
        rig.time += 40_000 + (stalls or {}).get(rig.led, 0)
        if rig.led in waiting:
            rig.block.ask_gain(*waiting.pop(rig.led))

    folder.mkdir(exist_ok=True)
    script = Script(TABLE, 0.0, 0.5, Preflight(), 1e-3)
    rig = LoopRig(folder, law, Limits(), SimulatedDrive(twin_bench()), script, between)
    _, found = rig.run()
    assert not waiting
    return found


def test_the_loop_goes_over_in_a_straight_line_and_a_replay_is_the_same(tmp_path: Path) -> None:
    law = LAWS["cascaded_pid"]
    found = led(tmp_path / "changed", law, {300: (1, 20.0), 1500: (0, 0.6)})
    value, asked = found["gain.integral_gain"], found["asked.integral_gain"]
    first = int(np.flatnonzero(np.diff(asked))[0]) + 1
    steps = round(RAMP / 1e-3)
    assert value[first] == law.gains.integral_gain
    assert value[first : first + steps + 1] == pytest.approx(np.linspace(40.0, 20.0, steps + 1), abs=1e-12)
    assert np.all(value[first + steps :] == 20.0)
    assert found["gain.proportional_gain"][-1] == 0.6
    same = replay(found, law, Limits(), Filters(), 1e-3, same=True)
    assert not same.deviates
    assert same.law_cycles > 3000
    unchanged = Recording(**{**vars(found), "columns": tuple(name.replace("gain.", "x.") for name in found.columns)})
    assert replay(unchanged, law, Limits(), Filters(), 1e-3, same=True).deviates, "the gains change what is commanded"

    about = Description(found.columns, found.units, {}, 0, 0)
    texts = [event.text for event in Changes(about).find(found.numbers, found.rows)[0] if "gain" in event.text]
    assert texts == [
        "gain integral_gain: 40 → 20 asked for",
        "gain integral_gain: 20 in force",
        "gain proportional_gain: 0.4 → 0.6 asked for",
        "gain proportional_gain: 0.6 in force",
    ]


def test_the_loop_takes_nothing_that_is_out_of_bounds_and_one_change_after_the_other(tmp_path: Path) -> None:
    law = LAWS["cascaded_pid"]
    wrong = [(1, float("nan")), (1, float("inf")), (1, -1.0), (1, 1e9), (2, 1.0), (-1, 1.0)]
    found = led(tmp_path / "wrong", law, {100 + 50 * i: ask for i, ask in enumerate(wrong)})
    for name in law.live:
        assert set(found[f"gain.{name}"]) == set(found[f"asked.{name}"]) == {law.numbers[name]}

    found = led(tmp_path / "two", law, {300: (1, 20.0), 400: (0, 0.6)})
    first, second = (int(np.flatnonzero(np.diff(found[f"asked.{name}"]))[0]) for name in reversed(law.live))
    assert second == first + round(RAMP / 1e-3) + 1


def test_a_ramp_takes_its_time_where_deadlines_are_skipped(tmp_path: Path) -> None:
    found = led(tmp_path / "stalls", LAWS["cascaded_pid"], {300: (1, 20.0)}, {400: 3_400_000})
    asked, value = found["asked.integral_gain"], found["gain.integral_gain"]
    begin, end = int(np.flatnonzero(np.diff(asked))[0]) + 1, int(np.flatnonzero(value == 20.0)[0])
    assert found["overruns"].sum() == 3
    assert found["time"][end] - found["time"][begin] == pytest.approx(RAMP, abs=2e-3)


def test_the_loop_changes_a_nested_gain_and_one_that_is_written_whole(tmp_path: Path) -> None:
    found = led(tmp_path / "own", OWN, {300: (0, 0.5), 1000: (1, 4.5)})
    assert set(found["gain.pair.whole"][-100:]) == {4.5}
    law = found["source"] == TargetSource.LAW
    late = law & (found["gain.pair.share"] == 0.5)
    assert np.all(found["requested_target"][late] == 0.5 * found["conditioned.position"][late])
    assert not replay(found, OWN, Limits(), Filters(), 1e-3, same=True).deviates


def test_a_law_without_live_gains_has_no_columns_of_them(tmp_path: Path) -> None:
    found = led(tmp_path / "none", LAWS["uncompensated"], {300: (0, 1.0)})
    assert not [name for name in found.columns if name.startswith(("gain.", "asked."))]


def test_gains_are_refused_that_do_not_hold_or_cannot_be_checked() -> None:
    assert required("a", "holds", "") == ""
    assert required("a", "little_margin", "little") == "little"
    with pytest.raises(SafetyError, match=r"do not hold on this rig: poles at 1\.1"):
        required("a", "does_not_hold", "poles at 1.1")
    with pytest.raises(SafetyError, match="swing at rest on this rig: by 3°"):
        required("a", "limit_cycle", "by 3°")
    with pytest.raises(SafetyError, match=r"cannot be checked \(no number\)"):
        required("a", None, "no number")
    check = GainCheck(Rig())
    check._process.kill()
    check._listener.join(30.0)
    with pytest.raises(SafetyError, match="ended without a result"):
        check.require()
    check.close()


def test_a_latched_run_takes_no_gain_and_a_guessed_name_is_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    law = LAWS["cascaded_pid"]
    session = object.__new__(Session)
    session.motors = (SimpleNamespace(live=SimpleNamespace(law=law)),)  # type: ignore[assignment]
    session.live = SimpleNamespace(several=())  # type: ignore[assignment]
    monkeypatch.setattr(Session, "_require_live", lambda _: None)
    monkeypatch.setattr(Session, "mode", Mode.LATCHED)
    monkeypatch.setattr(Session, "outcome", "ended by a fault")
    with pytest.raises(SafetyError, match=r"no law runs that could take integral_gain = 20: ended by a fault"):
        session.set_gain("integral_gain", 20.0)
    for name, said in (("stop", r"session.ask\(Request.STOP\)"), ("complet", "did you mean complete")):
        with pytest.raises(AttributeError, match=rf"a session has no '{name}': {said}"):
            getattr(session, name)


@pytest.mark.live
@pytest.mark.filterwarnings("ignore:the run was")  # by a computer that stalls; then it is tried again
@pytest.mark.filterwarnings("ignore:.* is still being checked")  # which a busy computer says after three seconds
def test_a_gain_changes_in_mid_run_on_the_twin(tmp_path: Path) -> None:
    """Checked, gone over to, told; the log has the ramp and replays to the bit; what may not be is refused."""
    rig, finished = Rig(law="bowden", duration=6.0, limits=Limits(**SHARED_LIMITS)), False
    for number in tries():
        with run(rig, twin=True, out=tmp_path / f"out{number}") as session:
            try:
                session.start()
            except SafetyError:
                continue
            session.wait(1.0)
            session.last()
            assert session.gains == rig.fitted().numbers
            session.set_gain("bandwidth", 4.0)
            assert session.gains == {**rig.fitted().numbers, "bandwidth": 4.0}
            for name, value, why in (
                ("delay", 0.002, "cannot be changed while it runs; expected .* declares live: bandwidth"),
                ("bandwith", 4.0, "has no gain 'bandwith'.*did you mean bandwidth"),
                ("bandwidth", 21.0, "expected a number from 0.1 to 20"),
                ("bandwidth", float("nan"), "expected a number from 0.1 to 20"),
                ("bandwidth", 10**400, "expected a number from 0.1 to 20"),
                ("nonsense", 10**400, "has no gain 'nonsense'"),
                ("bandwidth", "4", "expected a number"),
                ("bandwidth", True, "expected a number"),
                (4.0, 4.0, "expected text"),
            ):
                with pytest.raises(ParameterError, match=why):
                    session.set_gain(name, value)  # type: ignore[arg-type]
            session.ask_gain("bandwidth", 5.0)
            with pytest.raises(SafetyError, match="another change of gains goes on"):
                session.ask_gain("bandwidth", 4.0)
            session.wait(RAMP + 0.3)
            session.last()
            assert session.gains["bandwidth"] == 5.0
            finished = session.complete()
        if finished and session.ended_well:
            break
    assert finished, session.outcome
    with pytest.raises(SafetyError, match="no session is live"):
        session.set_gain("bandwidth", 6.0)
    log = read(session.log)
    value, asked = log["gain.bandwidth"], log["asked.bandwidth"]
    at = np.flatnonzero(np.diff(asked)) + 1
    assert asked[at].tolist() == [4.0, 5.0]
    ramp = value[at[0] : np.flatnonzero(value == 4.0)[0] + 1]
    assert np.all(np.diff(ramp) < 0.0)
    assert np.abs(np.diff(ramp)).max() < 0.2
    assert_replays(str(session.log))


@pytest.mark.long
@pytest.mark.live
@pytest.mark.filterwarnings("ignore:the run was")  # by a computer that stalls; then it is tried again
@pytest.mark.filterwarnings("ignore:.* is still being checked")  # which a busy computer says after three seconds
def test_a_gain_that_does_not_hold_is_refused_with_the_figure(tmp_path: Path) -> None:
    rig = Rig(law="cascaded_pid", duration=40.0, limits=Limits(**SHARED_LIMITS))
    for number in tries():
        with run(rig, twin=True, out=tmp_path / f"out{number}") as session:
            try:
                session.start()
            except SafetyError:
                continue
            with pytest.raises(SafetyError, match=r"these gains of cascaded_pid do not hold on this rig: .*\d"):
                session.set_gain("integral_gain", 400.0)
            with pytest.raises(SafetyError, match=r"these gains of cascaded_pid swing at rest on this rig: .*\d"):
                session.set_gain("proportional_gain", 50.0)
            assert session.gains == rig.fitted().numbers
        break
    log = read(session.log)
    assert set(log["asked.proportional_gain"]) == {rig.fitted().numbers["proportional_gain"]}
