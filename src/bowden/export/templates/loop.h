/* The loop: from encoder counts to the drive's command. Call it from a timer; what it calls in turn is board.cpp.
 *
 * [[preamble]]
 */

#ifndef LOOP_H
#define LOOP_H

#include "[[name]].h"
#include "safety.h"
{% if sensor %}
#include "joint.h"
{% endif %}
{% if detector %}
#include "course.h"
#include "envelope.h"
#include "[[detector]].h"
{% endif %}

#define LOOP_PERIOD [[period]] /* of a cycle [s] */
#define SAFETY_EMERGENCY_STOP [[emergency_stop]] /* among the codes of `emergency`, for an emergency stop */
#define LOOP_IN_[[unit|upper]] /* what board.cpp reads and sends; it looks for this */
{% if detector %}
#define LOOP_EMG_RATE [[emg_rate]] /* samples a second of each muscle */
#define LOOP_MUSCLES [[muscles]] /* the first one flexes{% if muscles > 1 %}, the second one extends{% endif %} */
{% endif %}

/* One cycle, by the names that `replay` and a log of `bowden run` have */
typedef struct {
    double time; /* since the first cycle [s] */
    [[name]]_Sample seen; /* joint_seen, motor_seen: what the law was given [rad] */
    [[name]]_Reference reference; /* reference, reference_velocity, reference_acceleration; NAN while no law leads */
    double requested_target; /* of the motor, before the supervisor [rad] */
    int source; /* 0: nobody, 1: the preflight, 2: the law, which begins, 3: the law */
    safety_Verdict verdict; /* mode, faults, power, and the target that the drive gets [rad] */
} loop_Cycle;

#ifdef __cplusplus
extern "C" {
#endif

/* loop.c: call the first one once, then the second one every LOOP_PERIOD: how late it is, the time since it was last [s] */
void loop_begin(void);
void loop_cycle(double lateness, double elapsed);
{% if detector %}

/* call this for every sample of a muscle, LOOP_EMG_RATE times a second: 0 is the first; NAN where one is missing */
void loop_emg(int muscle, double value);
{% endif %}

/* board.cpp: yours */
void board_begin(void);
double board_motor(double *age);
double board_joint(double *age);
void board_observe(safety_Observed *observed);
bool board_emergency_stop(void);
bool board_may_move(void);
safety_PreflightResult board_preflight(double seconds, const safety_DriveReading *reading, double *target);
void board_send(double [[unit]], bool power);
void board_record(const loop_Cycle *cycle);

#ifdef __cplusplus
}
#endif

#endif
