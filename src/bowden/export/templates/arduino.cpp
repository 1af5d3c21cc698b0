/* A loop for a board with the Arduino core: joint and motor by their encoders' counts, a motion to and fro of minimum
 * jerk, the law, and the drive's command. What it asks of your board stands in board.cpp, which is yours.
 *
 * Arduino: rename to FOLDER.ino, and put it into a folder of that name with board.cpp, [[name]].h and [[name]].c.
 * PlatformIO: this folder is a project; name your board in platformio.ini.
 */

#include <Arduino.h>

#include "[[name]].h"

static const [[name]]_real AMPLITUDE = 0.2f; /* of the joint, from where it is [rad] */
static const [[name]]_real DURATION = 2; /* of one way [s] */
static const uint32_t PERIOD = [[microseconds]]; /* of a cycle [us]: what the law was exported for */

static [[name]]_LawState state;
static [[name]]_real begin;
static uint32_t next_cycle, cycles;

{% if counts %}
long read_motor_counts();
long read_joint_counts();
void write_motor_counts(long counts);
{% else %}
double read_motor_angle();
double read_joint_angle();
void write_motor_target(double angle);
{% endif %}

static [[name]]_Sample measured()
{
    [[name]]_Sample sample;

    sample.joint = [[joint]];
    sample.motor = [[motor]];
    return sample;
}

void setup()
{
    const [[name]]_Sample sample = measured();

    [[name]]_start(&state, &sample);
    begin = sample.joint;
    next_cycle = micros();
}

void loop()
{
    const uint32_t now = micros();

    if ((int32_t)(now - next_cycle) < 0) {
        return;
    }
    next_cycle += PERIOD;
    if ((int32_t)(now - next_cycle) >= 0) {
        next_cycle = now + PERIOD; /* cycles that were missed are left out, not caught up on */
    }
    const [[name]]_Sample sample = measured();
    const [[name]]_real time = ([[name]]_real)cycles * ([[name]]_real)(PERIOD * 1e-6);
    const bool back = time > DURATION;
    const [[name]]_Reference reference = [[name]]_minimum_jerk(
        back ? begin + AMPLITUDE : begin, back ? begin : begin + AMPLITUDE, DURATION, back ? time - DURATION : time);
    const [[name]]_real command = [[name]]_step(&state, &sample, &reference);

    {% if counts %}write_motor_counts(lround([[name]]_motor_counts(command))){% else %}write_motor_target(command){% endif %};
    cycles = time < 2 * DURATION ? cycles + 1 : 0;
}
