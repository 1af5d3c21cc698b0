/* One cycle of the loop: counts, angles, reference, law, supervisor, drive; as bowden.cycle.one_cycle has it.
 *
 * [[preamble]]
 */

#include <math.h>

#include "loop.h"

/* the reference of the rig: a motion of minimum jerk from where the joint is to LOW, then {% if detector %}as EMG says{% else %}to HIGH and back{% endif %} */
static const [[name]]_real LOW = ([[name]]_real)[[low]]; /* [rad] */
{% if not detector %}
static const [[name]]_real HIGH = ([[name]]_real)[[high]]; /* [rad] */
{% endif %}
static const [[name]]_real DURATION = ([[name]]_real)[[duration]]; /* of one way [s] */

static [[name]]_LawState law;
static safety_SupervisorState supervisor;
static safety_Sample sample; /* the last valid angles */
static double motor_age, joint_age; /* since a reading came [cycles] */
static safety_Mode mode; /* of the supervisor; while it bridges a gap, the one before */
static double armed_at; /* where the motor was when it was armed [rad] */
static double since; /* this mode began, the preflight with an enabled drive [s] */
static safety_PreflightResult preflight;
static [[name]]_real from, to, elapsed_way; /* of the motion [rad, rad, s] */
static loop_Cycle cycle;
{% if sensor %}
static joint_TrackedJoint tracked; /* the joint's angle, which no encoder measures */
{% endif %}
{% if detector %}

static [[detector]]_[[detector_state]] muscles[LOOP_MUSCLES];
{% if proportional %}
static envelope_EnvelopeState envelope;
static volatile float share; /* of the largest contraction */
static bool heard;
{% endif %}
static volatile bool fresh[LOOP_MUSCLES], contracts[LOOP_MUSCLES], troubled[LOOP_MUSCLES];
static double emg_age[LOOP_MUSCLES], trouble; /* since a sample came; since a signal is bad, away from rest [s] */
static course_CourseState course;

void loop_emg(const int muscle, const double value)
{
    [[detector]]_Trouble found;

    if (muscle < 0 || muscle >= LOOP_MUSCLES) {
        return;
    }
    contracts[muscle] = [[detector]]_step(&muscles[muscle], ([[detector]]_real)value, &found);
    troubled[muscle] = found != 0;
{% if proportional %}
    if (muscle == 0 && isfinite(value)) { /* a filter never forgets a NAN */
        envelope_real signal;
        if (!heard) {
            envelope_start(&envelope, (envelope_real)value);
        }
        heard = true;
        const double level = (double)envelope_step(&envelope, (envelope_real)value, &signal);
        share = (float)((level - [[levels.rest]]) / ([[levels.mvc]] - [[levels.rest]]));
    }
{% endif %}
    fresh[muscle] = fresh[muscle] || isfinite(value);
}

/* The age of the newest sample: the older muscle's; a bad signal away from rest ages after a second. */
static double age_of_emg(const double elapsed)
{
    const bool rests = !(cycle.reference.position > LOW + ([[name]]_real)1e-3);
    double age = 0.0;
    bool bad = false;

    for (int i = 0; i < LOOP_MUSCLES; ++i) {
        emg_age[i] = fresh[i] ? 0.0 : emg_age[i] + elapsed;
        fresh[i] = false;
        age = emg_age[i] > age ? emg_age[i] : age;
        bad = bad || troubled[i];
    }
    trouble = bad && !rests ? trouble + elapsed : 0.0;
    return trouble > 1.0 && trouble > age ? trouble : age;
}
{% endif %}

/* What there is to see: what the board has not overwritten stays as it is set here. */
static safety_Observed observe(const double lateness, const double elapsed)
{
    double motor_late = 0.0, joint_late = 0.0;
    const double motor = board_motor(&motor_late), joint = board_joint(&joint_late);
    safety_Observed observed = {
        .reading = {
            .motor = (double)[[name]]_motor_angle(([[name]]_real)motor),
            .joint = (double){% if counts and not sensor %}[[name]]_joint_angle(([[name]]_real)joint){% else %}joint{% endif %},
            .current = NAN,
            .tension = NAN,
            .temperature = NAN,
            .joint_torque = NAN,
            .joint_sensor_age = NAN,
            .joint_std = NAN,
            .joint_sensor = NAN,
            .drive_state = SAFETY_DRIVE_STATE_SWITCH_ON_DISABLED,
        },
        .lateness = lateness,
        .elapsed = elapsed,
        .recorder = true,
        .reference = NAN,
    };

    motor_age = isfinite(motor) ? motor_late : motor_age + 1.0;
    joint_age = isfinite(joint) ? joint_late : joint_age + 1.0;
    observed.reading.motor_age = motor_age;
    observed.reading.joint_age = joint_age;
{% if sensor %}
    joint_step(&tracked, observed.reading.motor, motor_age, joint_late > 0.0 ? NAN : joint, elapsed);
    observed.reading.joint = tracked.estimate.angle;
    observed.reading.joint_age = motor_age;
    observed.reading.joint_sensor_age = tracked.estimate.age;
    observed.reading.joint_std = tracked.estimate.std;
    observed.reading.joint_sensor = joint;
{% endif %}
{% if detector %}
    observed.emg_age = age_of_emg(elapsed);
{% endif %}
    board_observe(&observed);
    if (board_emergency_stop()) {
        observed.reading.emergency = SAFETY_EMERGENCY_STOP;
    }
    if (!board_may_move() && observed.request != SAFETY_REQUEST_ACKNOWLEDGE) {
        observed.request = SAFETY_REQUEST_STOP; /* arms nothing, and lets down what moves */
    }
    return observed;
}

/* Where the joint should be: at an angle that the board wants, or on the rig's motion. */
static [[name]]_Reference next_reference(const double wanted)
{
    [[name]]_Reference reference = {([[name]]_real)wanted, 0, 0};

    if (isfinite(wanted)) {
        from = reference.position; /* from there the rig's motion begins anew, once the board wants no more */
        to = LOW;
        elapsed_way = 0;
{% if detector %}
        course_start(&course);
{% endif %}
        return reference;
    }
    if (elapsed_way > DURATION) {
{% if detector %}
        course_Reference moved;
        course_step(&course, {% if muscles > 1 %}contracts[0], contracts[1]{% else %}contracts[0], false{% endif %}, {% if proportional %}troubled[0] ? NAN : (course_real)share{% else %}NAN{% endif %}, (course_real)LOOP_PERIOD, &moved);
        reference.position = moved.position;
        reference.velocity = moved.velocity;
        reference.acceleration = moved.acceleration;
        return reference;
{% else %}
        from = to;
        to = from == LOW ? HIGH : LOW;
        elapsed_way = ([[name]]_real)LOOP_PERIOD;
{% endif %}
    }
    reference = [[name]]_minimum_jerk(from, to, DURATION, elapsed_way);
    elapsed_way += ([[name]]_real)LOOP_PERIOD;
    return reference;
}

void loop_begin(void)
{
    safety_ThermalState warmth;
    safety_DriveReading reading;

{% if detector %}
    for (int i = 0; i < LOOP_MUSCLES; ++i) {
        [[detector]]_start(&muscles[i]);
        emg_age[i] = INFINITY;
    }
{% endif %}
    board_begin();
{% if sensor %}
    joint_start(&tracked);
{% endif %}
    mode = SAFETY_MODE_STOPPED;
    reading = observe(0.0, LOOP_PERIOD).reading;
    safety_cold(&warmth);
    safety_begin(&supervisor, &reading, &warmth);
    sample.joint = supervisor.joint.value;
    sample.motor = supervisor.motor.value;
}

void loop_cycle(const double lateness, const double elapsed)
{
    const safety_Mode now = supervisor.decided.mode;
    const bool begins = now != mode && now != SAFETY_MODE_BRIDGING;
    safety_Observed observed = observe(lateness, elapsed);
    const double wanted = observed.reference;

    mode = begins ? now : mode;
    since = begins ? 0.0 : since + elapsed;
    sample = safety_sense(&supervisor, &sample, &observed, LOOP_PERIOD);
    cycle.time += elapsed;
    cycle.seen.joint = ([[name]]_real)sample.joint;
    cycle.seen.motor = ([[name]]_real)sample.motor;
    cycle.seen.joint_age = ([[name]]_real)sample.joint_age;
    cycle.seen.joint_std = ([[name]]_real)sample.joint_std;
    cycle.reference.position = cycle.reference.velocity = cycle.reference.acceleration = NAN;
    cycle.requested_target = supervisor.target;
    cycle.source = 0;
    if (mode == SAFETY_MODE_PREFLIGHT) {
        const bool waits = begins || !supervisor.servo.enabled; /* for the drive */
        armed_at = waits ? supervisor.target : armed_at;
        since = waits ? 0.0 : since;
        cycle.requested_target = armed_at;
        cycle.source = 1;
        if (preflight == SAFETY_PREFLIGHT_RESULT_PENDING && !waits) {
            preflight = board_preflight(since, &observed.reading, &cycle.requested_target);
        }
    } else if (mode == SAFETY_MODE_RUNNING) {
        if (begins) {
            [[name]]_start(&law, &cycle.seen);
            from = cycle.seen.joint;
            to = LOW;
            elapsed_way = 0;
{% if detector %}
            course_start(&course);
            course.intent.flexor = contracts[0]; /* a contraction that is on is none that begins */
            course.intent.extensor = {% if muscles > 1 %}contracts[1]{% else %}0{% endif %};
{% endif %}
        }
        cycle.reference = next_reference(wanted);
        cycle.requested_target = (double)[[name]]_step(&law, &cycle.seen, &cycle.reference);
        cycle.source = begins ? 2 : 3;
    } else {
        preflight = SAFETY_PREFLIGHT_RESULT_PENDING;
    }
    observed.preflight = preflight;
    observed.reference = (double)cycle.reference.position;
    safety_supervise(&supervisor, &observed, cycle.requested_target, LOOP_PERIOD, &cycle.verdict);
    board_send((double)[[name]]_[[ "motor_counts" if counts else "spool_angle" ]](([[name]]_real)cycle.verdict.target), cycle.verdict.power == SAFETY_POWER_ON);
    board_record(&cycle);
}
