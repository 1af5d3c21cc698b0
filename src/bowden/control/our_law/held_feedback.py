"""Feedback that may push the motor on but not back through the dead zone, and that does not hear the encoder's noise.

PI with lead on e = joint − reference, in motor angle:

    wish = −∫κ·e/a dt − κ·(2T·e + T²·de/dt)/a

With T = 1/ω it turns the servo's two lags into a plain integrator. Inside the dead zone the joint does not follow the
motor, or runs the wrong way: there the feedback may slow the motor down, to a stand where it is, but not turn it back.
Changes smaller than a few standard deviations of the noise, which is measured, are left alone. A loop that is seen to
ring, as with masses that swing, gets a smaller gain. Portable subset.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.kernel import kernel, sel
from bowden.core.quantity import Quantity

SLIP = 0.002
"""How far the command may stay ahead of the motor when it is taken back [rad]."""

LARGEST = 0.3
"""Largest error that is fed back [rad]."""

LOST = 1.0
"""Motor travel without any joint motion after which the joint is not pulled any further, twice any dead zone [rad]."""

_MOVED = 0.003
"""Joint motion that is one [rad]; more where the noise asks for it."""

_SLOW = 0.05
"""Time constant of the error that decides on crossing the dead zone on purpose [s]."""

_HEARING = 0.3
"""Time constant of the measured noise [s]."""

_TRACKING = 0.2
"""Time constant with which the integral follows what was held back at rest [s]."""

_SWAYING = 0.5
"""Time constant of the measured swing [s]."""

_SWING = (0.002, 4.0)
"""Swing of the error that is a half-wave, at least and in standard deviations of the noise [rad, –]."""

_HALF_WAVE = 0.15
"""Longest half-wave that is ringing [s]."""

_CALMING = (0.8, 0.3, 100.0)
"""Factor on the gain at each half-wave beyond three, the least of them all, and the time to forget [–, –, s]."""


class Feedback(NamedTuple):
    """What the feedback remembers."""

    integral: Annotated[float, Quantity("∫κ·e/a dt", "rad")]
    feedback: Annotated[float, Quantity("what is added to the plan", "rad")]
    error_before: Annotated[float, Quantity("error behind the first of two filters", "rad")]
    error: Annotated[float, Quantity("error behind both", "rad")]
    slow_error: Annotated[float, Quantity("error behind a filter of 50 ms", "rad")]
    trust: Annotated[
        float, Quantity("0 during a jump, rising to 1 after it; the feedback acts as far as it is trusted")
    ]
    joint: Annotated[float, Quantity("joint one cycle ago", "rad")]
    joint_before: Annotated[float, Quantity("joint two cycles ago", "rad")]
    variance: Annotated[float, Quantity("variance of the joint encoder's noise", "rad²")]
    moved_motor: Annotated[float, Quantity("motor angle where the joint was last seen to move", "rad")]
    moved_joint: Annotated[float, Quantity("joint angle there", "rad")]
    wave: Annotated[float, Quantity("sign of the last half-wave of the error")]
    wave_time: Annotated[float, Quantity("time since it began", "s")]
    waves: Annotated[float, Quantity("half-waves in a row")]
    calm: Annotated[float, Quantity("factor on the gain, below 1 where the loop has rung")]
    sway: Annotated[float, Quantity("mean square of the error's swing, of tremor above all", "rad²")]


class Setting(NamedTuple):
    """How the feedback is set in this cycle."""

    gain: float
    """κ [1/s]."""
    lead: float
    """T [s]."""
    smoothing: float
    """Time constant of each of the two filters [s]."""
    quiet: float
    """Changes that are left alone, in standard deviations of the noise [–]."""
    recovery: float
    """Time in which trust comes back after a jump [s]."""


@kernel
def no_feedback(motor: float, joint: float, variance: float) -> Feedback:
    """At the start."""
    return Feedback(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, joint, joint, variance, motor, joint, 0.0, 1.0, 0.0, 1.0, 0.0)


@kernel
def answered(before: Feedback, motor: float, error: float) -> float:
    """The error that is pushed for: at most `LARGEST`, and none that the joint does not answer.

    Where the joint has not moved while the motor went `LOST` towards the reference, a torn cable, a stop or a dead
    encoder would otherwise have the motor pulled on for ever.
    """
    gone = motor - before.moved_motor
    lost = (np.abs(gone) > LOST) * (gone * error < 0.0)
    return sel(lost, 0.0, np.fmax(-LARGEST, np.fmin(LARGEST, error)))


@kernel
def listen(before: Feedback, motor: float, joint: float, error: float, smoothing: float, dt: float) -> Feedback:
    """Filter the error, and measure the noise by the joint's second difference, whose variance is six times its.

    Ringing is told by half-waves of the error that follow one another within `_HALF_WAVE`, outside jumps.
    """
    follow = dt * (1.0 / (smoothing + dt))
    first = before.error_before + (error - before.error_before) * follow
    second = joint - 2.0 * before.joint + before.joint_before
    heard = np.fmin(second * second * (1.0 / 6.0), 16.0 * before.variance + 1e-9)
    swing, large = before.error - before.slow_error, np.fmax(_SWING[0], _SWING[1] * np.sqrt(before.variance))
    swings = (np.abs(swing) > large) * (swing * before.wave <= 0.0) * (before.trust > 0.5) > 0.0
    late = (before.wave_time > _HALF_WAVE) + (before.trust < 0.5) > 0.0
    waves = sel(late, 0.0, before.waves + sel(swings, 1.0, 0.0))
    rings = waves > 3.5
    calmer = np.fmax(_CALMING[1], before.calm * _CALMING[0])
    moved = np.abs(joint - before.moved_joint) > np.fmax(_MOVED, 10.0 * np.sqrt(before.variance))
    return Feedback(
        integral=before.integral,
        feedback=before.feedback,
        error_before=first,
        error=before.error + (first - before.error) * follow,
        slow_error=before.slow_error + (error - before.slow_error) * (dt / (_SLOW + dt)),
        trust=before.trust,
        joint=joint,
        joint_before=before.joint,
        variance=before.variance + (heard - before.variance) * (dt / (_HEARING + dt)),
        moved_motor=sel(moved, motor, before.moved_motor),
        moved_joint=sel(moved, joint, before.moved_joint),
        wave=sel(swings, np.sign(swing), before.wave),
        wave_time=sel(swings, 0.0, np.fmin(1.0, before.wave_time + dt)),
        waves=sel(rings, 2.0, waves),
        calm=sel(rings, calmer, before.calm + (1.0 - before.calm) * dt * (1.0 / _CALMING[2])),
        sway=before.sway + (swing * swing - before.sway) * (dt * (1.0 / (_SWAYING + dt))),
    )


@kernel
def steer(
    before: Feedback,
    setting: Setting,
    error: float,
    slope: float,
    side: float,
    jumping: float,
    held: float,
    free: float,
    tracks: float,
    dt: float,
) -> Feedback:
    """The feedback of this cycle, for an error that `listen` has heard.

    Args:
        before: with the filtered error.
        setting: gains.
        error: joint − reference [rad].
        slope: joint motion per motor motion [rad/rad].
        side: of the dead zone [–].
        jumping: 1 during a jump, in which nothing is fed back.
        held: 1 where the feedback may not turn the motor back.
        free: how far it may be taken back all the same [rad].
        tracks: 1 where the integral follows what was held back, 0 where it waits.
        dt: the cycle [s].
    """
    trust = sel(jumping, 0.0, np.fmin(1.0, before.trust + dt * (1.0 / setting.recovery)))
    rate = (before.error_before - before.error) * (1.0 / setting.smoothing)
    integral = before.integral + sel(trust >= 1.0, setting.gain * error * dt * (1.0 / slope), 0.0)
    lead = setting.lead
    wish = 0.0 - integral - setting.gain * trust * lead * (2.0 * before.error + lead * rate) * (1.0 / slope)
    change = wish - before.feedback
    noise = setting.quiet * np.sqrt(before.variance)
    change = sel(change > noise, change - noise, sel(change < -noise, change + noise, 0.0))
    onward = sel(side > 0.0, np.fmax(change, -free), np.fmin(change, free))
    kept = sel(held * (np.abs(side) > 0.5), onward, change)
    return Feedback(
        integral=sel(
            kept == change, integral, sel(tracks, integral + (change - kept) * dt / _TRACKING, before.integral)
        ),
        feedback=before.feedback + kept,
        error_before=before.error_before,
        error=before.error,
        slow_error=before.slow_error,
        trust=trust,
        joint=before.joint,
        joint_before=before.joint_before,
        variance=before.variance,
        moved_motor=before.moved_motor,
        moved_joint=before.moved_joint,
        wave=before.wave,
        wave_time=before.wave_time,
        waves=before.waves,
        calm=before.calm,
        sway=before.sway,
    )
