/* A loop for a board with the Arduino core: joint and motor by their encoders' counts, a motion to and fro of minimum
 * jerk, the law, and the drive's command in counts. Fill in the three functions that are yours.
 *
 * Arduino: rename to FOLDER.ino, and put it into a folder of that name with @NAME@.h and @NAME@.c.
 * PlatformIO: this folder is a project; name your board in platformio.ini.
 */

#include <Arduino.h>

#include "@NAME@.h"

static const @NAME@_real AMPLITUDE = 0.2f; /* of the joint, from where it is [rad] */
static const @NAME@_real DURATION = 2; /* of one way [s] */
static const uint32_t PERIOD = @MICROSECONDS@; /* of a cycle [us]: what the law was exported for */

static @NAME@_LawState state;
static @NAME@_real begin;
static uint32_t next_cycle, cycles;

static long read_motor_counts()
{
    return 0; /* yours */
}

static long read_joint_counts()
{
    return 0; /* yours */
}

static void write_motor_counts(long counts)
{
    (void)counts; /* yours: to the drive, in counts of the motor's encoder */
}

static @NAME@_Sample measured()
{
    @NAME@_Sample sample;

    sample.joint = @JOINT@;
    sample.motor = @MOTOR@;
    return sample;
}

void setup()
{
    const @NAME@_Sample sample = measured();

    @NAME@_start(&state, &sample);
    begin = sample.joint;
    next_cycle = micros();
}

void loop()
{
    if ((int32_t)(micros() - next_cycle) < 0) {
        return;
    }
    next_cycle += PERIOD;
    const @NAME@_Sample sample = measured();
    const @NAME@_real time = (@NAME@_real)cycles * (@NAME@_real)(PERIOD * 1e-6);
    const bool back = time > DURATION;
    const @NAME@_Reference reference = @NAME@_minimum_jerk(
        back ? begin + AMPLITUDE : begin, back ? begin : begin + AMPLITUDE, DURATION, back ? time - DURATION : time);
    const @NAME@_real command = @NAME@_step(&state, &sample, &reference);

    write_motor_counts(lround(@COMMAND@));
    cycles = time < 2 * DURATION ? cycles + 1 : 0;
}
