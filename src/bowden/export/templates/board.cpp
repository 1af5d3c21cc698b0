/* Yours: what the loop of arduino.cpp asks of your board. A later export leaves this file as it is. */

#include <Arduino.h>
{% if counts %}

long read_motor_counts()
{
    return 0; /* of the spool's encoder, as in the rig's log */
}

long read_joint_counts()
{
    return 0; /* of the joint's encoder, as in the rig's log */
}

void write_motor_counts(long counts)
{
    (void)counts; /* to the drive's position loop */
}
{% else %}

double read_motor_angle()
{
    return 0.0; /* in the joint's coordinate, through the spool [rad] */
}

double read_joint_angle()
{
    return 0.0; /* [rad] */
}

void write_motor_target(double angle)
{
    (void)angle; /* to the drive's position loop [rad] */
}
{% endif %}
