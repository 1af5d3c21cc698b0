"""Where the joint should be by contractions: motions that they begin, or the envelope, which it follows."""

from typing import NamedTuple

from bowden.core.kernel import kernel
from bowden.core.signals import Reference
from bowden.sensing.intent import IntentSettings, IntentState, intent_start, intent_step, proportional


class CourseSettings(NamedTuple):
    """How contractions move the reference."""

    intent: IntentSettings = IntentSettings()
    proportional: bool = False
    """True if the joint follows the envelope; else contractions begin motions."""
    full: float = 1.0 / 3.0
    """Envelope of a full flexion, as a share of MVC."""


class CourseState(NamedTuple):
    """State handed from one cycle to the next."""

    intent: IntentState
    followed: Reference
    """The proportional reference."""


@kernel
def course_step(
    settings: CourseSettings, state: CourseState, flexes: bool, extends: bool, share: float, dt: float
) -> tuple[CourseState, Reference]:
    """One cycle of `dt` [s]; `share` of MVC is NaN where a signal is in trouble or the wearer is not known."""
    intent, reference = intent_step(settings.intent, state.intent, flexes, extends, dt)
    followed = proportional(settings.intent, state.followed, share, settings.full, dt)
    return CourseState(intent, followed), followed if settings.proportional else reference


@kernel
def course_start(low: float) -> CourseState:
    """At rest where the joint is extended, at `low` [rad]."""
    return CourseState(intent_start(low), Reference(low, 0.0, 0.0))
