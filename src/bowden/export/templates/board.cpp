/* Yours: what loop.c asks of your board and your drive. A later export leaves this file as it is.
 * As exported nothing moves: board_may_move() says no, and no reading comes. Units are those of safety.h.
 */

#include <Arduino.h>
#include <math.h>

#include "loop.h"

/* Once, before the first cycle: start encoders and bus, and leave the drive without power.
 * Set the counters such that they read what the rig's log read in the same place (README.md, Zeros). */
void board_begin(void)
{
}

/* The motor now: {% if unit == "spool" %}the spool, where the cable is just taut at zero [rad]{% else %}counts of its encoder, as in the log of the rig{% endif %}.
 * NAN where the reading failed, never the last good one. */
double board_motor(void)
{
    return NAN;
}

/* The joint now: {% if unit == "spool" %}its angle, zero where the arm is straight [rad]{% else %}counts of its encoder, as in the log of the rig{% endif %}.
 * NAN where the reading failed, never the last good one. */
double board_joint(void)
{
    return NAN;
}

/* What else the board knows, in each cycle; see the table in README.md for what is preset.
 * At least: the motor's measured current, the drive's state, and what the operator asks for. */
void board_observe(safety_Observed *observed)
{
    (void)observed; /* observed->reading.current = ...; observed->reading.drive_state = ...; observed->request = ...; */
}

/* Whether this board may be armed and move: emergency stop closed, zeros set, directions proven by hand, supply there.
 * While it says no nothing is armed; a motor that moves is let down. */
bool board_may_move(void)
{
    return false;
}

/* Armed, before the law: move the motor a little, and look whether motor, joint and current answer, each the right way.
 * `*target` is where the motor was when it was armed [rad]: change it by some degrees, never at once. */
safety_PreflightResult board_preflight(double seconds, const safety_DriveReading *reading, double *target)
{
    (void)seconds, (void)reading, (void)target;
    return SAFETY_PREFLIGHT_RESULT_PENDING; /* ..._PASSED or ..._FAILED when you know */
}

/* The motor's target for the drive's position loop: {% if unit == "spool" %}angle of the spool [rad]{% else %}counts of its encoder{% endif %}; not rounded.
 * Without `power` take the torque off at once, whatever the target is. */
void board_send(double [[unit]], bool power)
{
    (void)[[unit]], (void)power;
}
