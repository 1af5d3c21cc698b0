"""The simulated suit on an arm behind the twin, moved on in real time.

The same kernel as in a simulation, a sub-step a call. Without torque the motor gives no current: what holds or
lets sink are the gears' friction, the cables and the arm's weight. A quick stop holds the spool where it was when it
began. A torn flexor has no tension, a slack one is longer by this much of the spool. The load cell sits at the flexor's
spool, and the power stage is that of `twin_bench`. A holding brake does what the drive's output says, with its delays.

A wearer who swings keeps still until the scenario begins, as the preflight wants it, swings from then on, and comes to
rest when the power goes off.
"""

import math

from bowden.core.kernel import compiled, kernel
from bowden.hardware.twin.plant import BRAKE, OFF, Look, TwinPlant
from bowden.models.drive.encoder import reading
from bowden.models.drive.geared_motor import no_load_speed
from bowden.models.suit.arm import Wearer
from bowden.models.suit.flex_sensor import flex_start, flex_step
from bowden.plants.suit_parts import Suit, gripped, prepare_suit
from bowden.plants.suit_plant import SETTLING, Bends, PreparedSuit, SuitState, suit_motor, suit_start, suit_step

SWELL = 1.0
"""Time in which a wearer's swing grows to its size, and goes [s]."""

TORN = 1.0
"""A torn cable is longer by this, which is more than any arm pulls [m]."""


@kernel
def advance_suit(
    suit: PreparedSuit,
    state: SuitState,
    command: float,
    powered: bool,
    before: float,
    after: float,
    wearer: Wearer,
    count: int,
    dt: float,
) -> SuitState:
    """`count` sub-steps of `dt` [s] on, in which the sheaths' bend goes from `before` to `after` [rad]."""
    for i in range(count):
        begin = before + (after - before) * i / count
        end = before + (after - before) * (i + 1.0) / count
        state = suit_step(suit, state, command, powered, Bends(begin, end), wearer, dt)
    return state


class TwinSuit(TwinPlant):
    """The suit with the arm that wears it, whose motor is in the joint's coordinate; see `TwinPlant`."""

    def _begin(self, plant: Suit, motor: float, now: float) -> None:
        self.suit = suit = plant
        self._substep = suit.sample_time / suit.substeps
        drive = suit.motor._replace(friction_feedforward=0.0)  # of a drive on a bus the loop makes it
        self.current_limit = drive.current_limit
        self.speed_limit = no_load_speed(drive)
        self._intact = prepare_suit(suit._replace(motor=drive))._replace(substeps=1)
        self._prepared = self._intact
        self._advance = compiled(advance_suit)
        self._read = now
        self._swinging, self._swing = False, 0.0  # whether the wearer does, and how much of it there is, 0 to 1
        self.torque_offset = 0.0
        stiffness = drive.inertia * drive.servo.natural_frequency**2
        self.servo_gains = stiffness, 2.0 * drive.servo.damping * stiffness / drive.servo.natural_frequency
        self._told, self._grips = (False, now), False
        self._held = math.nan  # where a quick stop holds the motor
        first = float(self._bends[0])
        state = suit_start(self._prepared, motor, motor, first)
        settling = round(SETTLING / self._substep)
        for powered in (True, False):
            state = self._advance(
                self._prepared, state, motor, powered, first, first, suit.wearer, settling, self._substep
            )
        self._state: SuitState = state
        self._flex = flex_start(self.joint)

    def start_scenario(self, now: float) -> None:
        """See `TwinPlant.start_scenario`."""
        super().start_scenario(now)
        self._swinging = now < math.inf
        self._state = self._state._replace(time=SETTLING)  # their swing's phase is that of a simulation then

    def advance(self, now: float) -> None:
        """See `TwinPlant.advance`: in whole sub-steps; what is left over waits for the next call."""
        count = int(self._since(now) / self._substep)
        if count < 1:
            return
        elapsed = count * self._substep
        before, after = self._bend_at(self._time), self._bend_at(self._time + elapsed)
        wearer = self._wearer(elapsed)
        self._time += elapsed
        self._held = math.nan if self.doing != BRAKE else self.motor if math.isnan(self._held) else self._held
        command = self._held if self.doing == BRAKE else self.command
        state = self._state._replace(spool=self._state.spool._replace(torque_offset=self.torque_offset or 0.0))
        suit = gripped(self._cabled(), self.suit.brake) if self._braked() else self._cabled()
        powered = self.doing != OFF
        self._state = self._advance(suit, state, command, powered, before, after, wearer, count, self._substep)
        self._warm(elapsed)

    def _braked(self) -> bool:
        """True if the brake grips: it does what it is told with its delay."""
        brake = self.suit.brake
        if self.brake_set != self._told[0]:
            self._told = self.brake_set, self._time
        if self._time - self._told[1] >= (brake.engage_delay if self.brake_set else brake.release_delay):
            self._grips = self.brake_set and brake.enabled
        return self._grips

    def _cabled(self) -> PreparedSuit:
        """The suit with its flexor as it is now."""
        longer = TORN if self.torn else self.slack * self.suit.spool_radius
        start = self._intact.flexor.start - longer
        if start != self._prepared.flexor.start:
            self._prepared = self._intact._replace(flexor=self._intact.flexor._replace(start=start))
        return self._prepared

    def _wearer(self, elapsed: float) -> Wearer:
        """The wearer, whose swing swells or fades over the time that has passed [s]."""
        self._swinging = self._swinging and self.doing != OFF
        swings = self._swinging and self._time >= self._began
        grown = self._swing + (1.0 if swings else -1.0) * elapsed / SWELL
        self._swing = max(0.0, min(1.0, grown))
        size = self._swing**2 * (3.0 - 2.0 * self._swing)
        return self.suit.wearer._replace(swing=size * self.suit.wearer.swing)

    def look(self) -> Look:
        """See `TwinPlant.look`; the tension is the flexor's."""
        state = self._state
        spool, motor = state.spool, float(suit_motor(self._prepared, state))
        return Look(motor, spool.velocity, state.joint, state.flexor_pull.motor, spool.current, state.interaction)

    def read_encoders(self) -> tuple[float, float]:
        """See `TwinPlant.read_encoders`: the flex sensor at the elbow, the encoder at the spool."""
        normal, wander, of_motor = (float(normal) for normal in self._noise(3))
        since, self._read = max(self._time - self._read, 1e-6), self._time
        self._flex, joint = flex_step(self.suit.joint_sensor, self._flex, self.joint, normal, wander, since)
        return float(joint), float(reading(self.motor, of_motor, self.suit.motor_encoder))
