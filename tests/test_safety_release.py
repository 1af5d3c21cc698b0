"""A release of an arm that hangs on the suit: let down at a bounded speed until nothing pulls, and never dropped."""

import math
import tomllib
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import pytest

from bowden.core.kernel import compiled, kernel
from bowden.core.signals import DriveReading
from bowden.core.units import DEGREES, RADIANS
from bowden.design.rig_of_suit import suit_text
from bowden.live.live_run import live_run
from bowden.models.drive.thermal import cold
from bowden.models.suit.arm import Wearer
from bowden.plants.suit_parts import PreparedSuit, Suit, prepare_suit
from bowden.plants.suit_plant import Bends, SuitState, suit_motor, suit_start, suit_step
from bowden.plants.suit_settings import SuitSettings
from bowden.rig.rig import Rig
from bowden.safety.limits import ARM_LOWERING, FASTEST_RELEASE, Limits
from bowden.safety.release import longest_release
from bowden.safety.state import Mode, Observed, PreflightResult, Request
from bowden.safety.supervisor import begin, supervise
from releases import release, throws

SUIT = Suit()._replace(motor=Suit().motor._replace(integral=40.0))
STILL = Bends(math.pi, math.pi)
LOOSE = SUIT.motor._replace(friction=0.0, efficiency=1.0)
HEAVY = SUIT.arm._replace(mass=2.0 * SUIT.arm.mass, inertia=2.0 * SUIT.arm.inertia)
LIMITS, DT = Rig(suit=SuitSettings(worn=True)).supervisor_limits, 1e-3
FRESH = tomllib.loads(suit_text("rig.toml"))["limits"]
OF_INIT = LIMITS._replace(
    **{name[:-4]: value * RADIANS for name, value in FRESH.items() if name.endswith("_deg")}, reading_age=10.0
)
"""What `bowden init --suit` writes."""
REACH = (0.146 + 0.108 / 2.0) * 1.80
"""From the elbow of a tall man to the middle of his hand, by Winter's shares of the height [m]."""
CAUGHT = Wearer(stiffness=300.0, damping=5.0, centre=20.0 * RADIANS)


def test_a_hand_is_let_down_at_the_speed_that_is_allowed_near_people() -> None:
    """ISO 10218-1: 250 mm/s; without an arm, or out of a force, the joint goes a right angle in a second."""
    assert pytest.approx(0.25, rel=0.02) == ARM_LOWERING * REACH
    assert pytest.approx(math.pi / 2.0) == FASTEST_RELEASE
    assert LIMITS.lowering == ARM_LOWERING
    assert Rig().supervisor_limits.lowering == FASTEST_RELEASE


class Let(NamedTuple):
    """What a release came to."""

    drop: float
    """Of the joint within 0.2 s [deg]."""
    lasted: float
    """[s]"""
    fastest: float
    """Largest speed of the joint downwards [deg/s]."""
    joint: float
    """Where the power goes off [deg]."""
    flexor: float
    """Tension there [N]."""
    extensor: float
    """Largest tension until there [N]."""
    mode: float
    """At the end."""
    strained: float
    """For how long the flexor has more than 60 N [s]."""


@kernel
def rest(plant: Any, start: float, wearer: Wearer, cycles: int) -> SuitState:
    state = suit_start(plant, start, start, math.pi)
    for _ in range(cycles):
        state = suit_step(plant, state, start, True, Bends(math.pi, math.pi), wearer, 1e-3)
    return state


@cache
def at_rest(plant: PreparedSuit, start: float, wearer: Wearer) -> SuitState:
    """The suit after three seconds at a motor angle [rad]."""
    return SuitState(*compiled(rest)(plant, start, wearer, 3000))


def as_it_is(joint: float, first: float) -> float:
    return joint


def let_go(
    suit: Suit,
    start: float,
    *,
    lost: bool = False,
    wearer: Wearer | None = None,
    held: Wearer | None = None,
    limits: Limits = LIMITS,
    shown: Callable[[float, float], float] = as_it_is,
    cycles: int = 1,
    lead: float = 0.0,
) -> Let:
    """An operator's stop, or a lost joint angle, at a motor that holds the arm at `start` [deg].

    Args:
        suit: on the arm.
        start: of the motor's target [deg].
        lost: whether the joint's angle is.
        wearer: of the arm from the stop on, None for the suit's own.
        held: of the arm before it, likewise.
        limits: of the supervisor.
        shown: the joint's angle as its encoder shows it, from what it is and was at the stop [rad].
        cycles: that each cycle of the loop lasts.
        lead: of the target over the motor, which cannot pull any more, at the stop [deg].
    """
    plant, step, own = prepare_suit(suit), compiled(suit_step), wearer or held or suit.wearer
    watch = compiled(supervise)
    state = at_rest(plant, start * RADIANS, held or suit.wearer)

    def reading(lost: bool) -> DriveReading:
        joint = math.nan if lost else shown(state.joint, first)
        return DriveReading(
            *(float(suit_motor(plant, state)), joint, state.spool.current, 20.0, math.nan, 0.0, 0.0, 0.0),
            *(4.0, 0.0, 0.0, 0.0, 0.0),
        )

    first = early = state.joint
    begun = begin(limits, reading(False), cold(limits.thermal))
    target = (start + lead) * RADIANS
    sees = begun._replace(
        target=target,
        decided=begun.decided._replace(mode=Mode.RUNNING, started=True, previous_target=target),
        servo=begun.servo._replace(enabled=True),
    )
    fastest, most, strained = 0.0, 0.0, 0.0
    for k in range(round(2.0 * longest_release(limits) / DT / cycles)):
        request = Request.STOP if k == 0 and not lost else Request.NONE
        observed = Observed(reading(lost), 0.0, cycles * DT, request, 0.0, True, PreflightResult.PASSED, 0.0)
        sees, verdict = watch(limits, sees, observed, target, DT)
        if not verdict.power:
            break
        for _ in range(cycles):
            state = SuitState(*step(plant, state, verdict.target, True, STILL, own, DT))
        early = state.joint if k * cycles < 200 else early
        fastest = max(fastest, -state.joint_velocity)
        most = max(most, state.extensor_pull.joint)
        strained += cycles * DT * (state.flexor_pull.joint > 60.0)
    told = (first - early) * DEGREES, k * cycles * DT, fastest * DEGREES, state.joint * DEGREES
    return Let(*told, state.flexor_pull.joint, most, verdict.mode, strained)


@pytest.mark.parametrize(
    ("suit", "lost"),
    [(SUIT, True), (SUIT._replace(motor=LOOSE, arm=HEAVY), False)],
    ids=["joint lost", "stop, twice the arm, gears without friction"],
)
def test_an_arm_is_let_down_and_not_dropped(suit: Suit, lost: bool) -> None:
    let = let_go(suit, 60.0, lost=lost)
    assert let.mode == (Mode.LATCHED if lost else Mode.STOPPED)
    assert let.drop < 6.0, "0.2 s at `lowering` are 8°"
    assert let.fastest < 100.0, "a fall of 0.2 s from rest comes to 200°/s"
    assert 1.0 < let.lasted < longest_release(LIMITS)
    assert let.joint < 12.0
    assert let.flexor < suit.pretension
    assert let.extensor < 2.0 * suit.pretension


def test_whoever_starts_a_run_is_told_how_long_it_takes() -> None:
    suit, bench = (live_run(Rig(suit=SuitSettings(worn=worn))).losses() for worn in (True, False))
    assert "the arm is let down at 40°/s; the power is off within 4.39 s" in suit
    assert "the joint is let down at 90°/s; the power is off within 2.22 s" in bench


@pytest.mark.parametrize("number", [n if n < 6 else pytest.param(n, marks=pytest.mark.long) for n in range(30)])
def test_a_release_throws_no_joint(number: int) -> None:
    """A random rig, place and cause; a thousand are in `make soak`, and as a figure in hazards.md."""
    assert throws(release(number)) == ""


def test_an_arm_that_hangs_is_let_go_of_at_once() -> None:
    assert let_go(SUIT, 2.0).lasted <= 0.2


def test_an_arm_that_its_wearer_holds_up_is_not_pulled_down() -> None:
    """The cable is slack once the motor is far enough behind; the extensor is not wound up against the wearer."""
    let = let_go(SUIT, 60.0, wearer=Wearer(stiffness=40.0, damping=2.0, centre=60.0 * RADIANS))
    assert let.lasted < 0.8
    assert let.joint > 50.0
    assert let.extensor < 120.0


@pytest.mark.parametrize("limits", [LIMITS, OF_INIT], ids=["default", "bowden init --suit"])
@pytest.mark.parametrize("lead", [0.0, 12.0])
def test_a_motor_that_cannot_pull_any_more_begins_to_let_go_at_once(limits: Limits, lead: float) -> None:
    """From its own angle, though the target is beyond it and may only go back in several cycles: from 40° to where a
    limb that is caught at 20° bears less than 60 N takes 1 s at 40°/s."""
    let = let_go(SUIT, 57.0, held=CAUGHT, limits=limits._replace(target_speed=20.0), lead=lead)
    assert let.strained < 1.1
    assert let.lasted < 2.0


@pytest.mark.parametrize(
    "shown",
    [lambda joint, first: first, lambda joint, first: joint + 13.0 * RADIANS],
    ids=["frozen", "13° too large"],
)
def test_a_joint_angle_that_is_wrong_drops_no_arm(shown: Callable[[float, float], float]) -> None:
    let = let_go(SUIT, 60.0, limits=OF_INIT, shown=shown)
    assert let.joint < 12.0
    assert let.lasted > 1.0


def test_long_cycles_end_with_the_arm_down() -> None:
    let = let_go(SUIT, 80.0, limits=OF_INIT._replace(tracking=0.7), cycles=15)
    assert let.joint < 12.0
    assert let.lasted < longest_release(OF_INIT)
