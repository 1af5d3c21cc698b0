/* Yours: what loop.c asks of your board and your drive. A later export leaves this file as it is.
 * As exported nothing moves: board_may_move() says no, and no reading comes. Units are those of safety.h.
 */

#ifdef ARDUINO
#include <Arduino.h>
#endif
#include <math.h>

#include "loop.h"

#ifndef LOOP_IN_[[unit|upper]]
#error "loop.c has other units than this file, which an earlier export left: move it away, export again, and fill in the new one"
#endif

/* Once, before the first cycle: start encoders and bus, leave the drive without power, and see to the zeros.
 * How, says README.md. */
void board_begin(void)
{
}

/* The motor now: [[ "counts of its encoder, as in the rig's log" if counts else "angle of the spool, zero where the cable is just taut [rad]" ]].
 * NAN where the reading failed. If none was due, the last one again with its `age` [cycles], which is preset to 0. */
double board_motor(double *age)
{
    (void)age;
    return NAN;
}

{% if sensor %}
/* The joint's angle by its sensor, where a sample came since the last cycle [rad]; NAN in every other one[[ "" if sensor.sensed else ", of this rig in all" ]]. */
{% else %}
/* The joint now: [[ "counts of its encoder, as in the rig's log" if counts else "its angle, zero where the arm is straight [rad]" ]].
 * NAN and `age` as above. */
{% endif %}
double board_joint(double *age)
{
    (void)age;
    return NAN;
}

/* What else the board knows, in each cycle; the table in README.md says what is preset.
 * At least: the motor's measured current, the drive's state, and what the operator asks for. */
void board_observe(safety_Observed *observed)
{
    (void)observed; /* observed->reading.current = ...; observed->reading.drive_state = ...; observed->request = ...; */
}

/* Whether the emergency stop is pressed, or its wire is broken: the power goes off at once. */
bool board_emergency_stop(void)
{
    return true;
}

/* Whether this board may be armed and move: zeros set, directions proven by hand, supply there.
 * While it says no nothing is armed; a motor that moves is let down. */
bool board_may_move(void)
{
    return false;
}

/* Armed, before the law: move the motor a little, and look whether motor, joint and current answer, each the right way.
 * It is asked once the drive says that it is enabled; `seconds` count from there, from 0 at each arming:
 * keep the first angles and the first current then. `*target` is where the motor was when it was
 * armed [rad]: add a smooth motion of [[pulls]] that ends where it began. */
safety_PreflightResult board_preflight(double seconds, const safety_DriveReading *reading, double *target)
{
    (void)seconds, (void)reading, (void)target;
    return SAFETY_PREFLIGHT_RESULT_PENDING; /* ..._PASSED or ..._FAILED when you know */
}

/* The target of the drive's position loop, in each cycle: [[ "counts of the motor's encoder" if counts else "angle of the spool [rad]" ]]; not rounded.
 * With `power` enable the drive, and say in drive_state when it is enabled; without it take the torque off at once. */
void board_send(double [[unit]], bool power)
{
    (void)[[unit]], (void)power;
}

/* What the cycle made of it, for a print or a log: angles, reference, mode, faults (loop.h). It must not wait. */
void board_record(const loop_Cycle *cycle)
{
    (void)cycle;
}
