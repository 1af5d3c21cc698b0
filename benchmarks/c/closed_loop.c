/* The adaptive law against the bench, written by hand: the yardstick for the package's compiled loop.
 *
 * The arithmetic is the package's own (servo, series of the cable, conditioner of the reference, law, encoders,
 * reference, current).
 * The parameters are known at run time only, and the same columns are stored. The encoders' normal numbers are handed
 * in: they must be NumPy's for the two to agree.
 */
#include <math.h>

struct parameters { /* SI and radians */
    double sample_time;
    double slope, hysteresis_gain, rate, shape, exponent, offset;             /* cable */
    double bend, identified_bend, gap, loss;                                  /* sheath */
    double natural_frequency, damping, speed_limit, acceleration_limit;       /* servo */
    double torque_constant, gear, inertia, spring, pretension;                /* motor and load */
    double joint_resolution, joint_noise, motor_resolution, motor_noise;      /* encoders */
    double error_gain, feedback_gain, smoothing, slope_adaptation, bound_adaptation, slope_leakage, bound_leakage;
    double derivative_time;                                                   /* the last of the law's gains */
    double conditioning_frequency, conditioning_delay;                        /* the conditioner's */
    double low, high, period;                                                 /* reference */
    double initial_motor;
    long delay, substeps, cycles;
};

struct cable {
    double rate, exponent, growth, bound, piece, near_zero;
    int cubic;
};

struct servo {
    double xx, xv, vx, vv, dt, speed_limit, change, stiffness, drag, reach;
};

static double smaller(double a, double b) { return b < a ? b : a; }
static double larger(double a, double b) { return b > a ? b : a; }

static struct cable prepare_cable(const struct parameters *p)
{
    struct cable c;
    c.rate = p->rate;
    c.exponent = p->exponent;
    c.growth = 2.0 * p->shape - 1.0;
    c.bound = pow(c.growth, -1.0 / p->exponent);
    c.cubic = p->exponent == 3.0;
    c.piece = (c.cubic ? 0.045 : 0.03) / (1.0 + p->exponent / c.bound * larger(1.0, 1.0 / c.growth));
    c.near_zero = 0.5 * pow(0.01 / larger(1.0, c.growth), 1.0 / p->exponent);
    return c;
}

static struct servo prepare_servo(const struct parameters *p, double dt)
{
    double omega = p->natural_frequency, sigma = p->damping * omega;
    double disc = (p->damping * p->damping - 1.0) * omega * omega, root = sqrt(fabs(disc));
    double cosine = 1.0, sine = dt, decay = exp(-sigma * dt);
    if (root * dt >= 1e-6) {
        cosine = disc < 0.0 ? cos(root * dt) : cosh(root * dt);
        sine = (disc < 0.0 ? sin(root * dt) : sinh(root * dt)) / root;
    }
    struct servo s = {decay * (cosine + sigma * sine), decay * sine, -decay * omega * omega * sine,
                      decay * (cosine - sigma * sine), dt,           p->speed_limit,
                      p->acceleration_limit * dt,      omega * omega, 2.0 * sigma,
                      smaller(p->acceleration_limit, omega * p->speed_limit) * exp(-(omega + 2.0 * sigma) * dt)};
    return s;
}

static double turn(double offset, double velocity, const struct servo *s, double *time)
{
    double sigma = 0.5 * s->drag, q = velocity / (s->stiffness * offset + sigma * velocity);
    double square = s->stiffness - sigma * sigma, z = sqrt(fabs(square)) * q;
    if (fabs(z) < 1e-4)
        *time = q * (1.0 - square * q * q / 3.0);
    else
        *time = q * (square > 0.0 ? atan(z) : atanh(z)) / z;
    return exp(-sigma * *time) * ((1.0 + sigma * q) * offset + q * velocity) / sqrt(1.0 + square * q * q);
}

static double travel_of(double way, double faster, double time, double width, double next_width)
{
    if (next_width == width)
        return way * (1.0 / width);
    double middle = 0.5 * (width + next_width), growth = (next_width - width) / middle;
    return (way * (1.0 + growth * growth / 12.0) - growth * faster * time / 12.0) / middle;
}

static double power(double size, const struct cable *c)
{
    return c->cubic ? size * size * size : pow(size, c->exponent);
}

static double through_zero(double y, double z, double q, const struct cable *c)
{
    double n = c->exponent;
    double i1 = 1.0 / (n + 1.0), i2 = 1.0 / (2.0 * n + 1.0), i3 = 1.0 / (3.0 * n + 1.0), i4 = 1.0 / (4.0 * n + 1.0);
    double t = z + y * (1.0 + q * (i1 + q * (i2 + q * (i3 + q * i4))));
    q = (t > 0.0 ? c->growth : -1.0) * power(fabs(t), c);
    double b1 = -i1;
    double b2 = -n * b1 * i2;
    double b3 = -n * (b2 + 0.5 * (n - 1.0) * b1 * b1) * i3;
    double b4 = -n * (b3 + (n - 1.0) * b1 * (b2 + (n - 2.0) / 6.0 * b1 * b1)) * i4;
    return t * (1.0 + q * (b1 + q * (b2 + q * (b3 + q * b4))));
}

static double away_from_zero(double y, double z, double q, double n)
{
    double u = 1.0 / y;
    double a1 = 1.0 - q;
    double q1 = n * a1 * q * u;
    double a2 = -q1 / 2.0;
    double q2 = (2.0 * n * a2 * q + (n - 1.0) * a1 * q1) * u / 2.0;
    double a3 = q2 * (-1.0 / 3.0);
    double q3 = (3.0 * n * a3 * q + (2.0 * n - 1.0) * a2 * q1 + (n - 2.0) * a1 * q2) * u * (1.0 / 3.0);
    double a4 = -q3 / 4.0;
    double q4 = 4.0 * n * a4 * q + (3.0 * n - 1.0) * a3 * q1 + (2.0 * n - 2.0) * a2 * q2 + (n - 3.0) * a1 * q3;
    double a5 = q4 * u * (-1.0 / 20.0);
    return y + z * (a1 + z * (a2 + z * (a3 + z * (a4 + z * a5))));
}

static double by_cubes(double y, double z, double growth)
{
    double d = growth * y, e = d * y, q = e * y, square = q * q, z_square = z * z;
    double c3 = d * (2.5 * q - 1.0);
    double c4 = growth * (3.5 * q - 0.25 - 4.375 * square);
    double c5 = growth * e * (2.25 - 9.45 * q + 7.875 * square);
    double c6 = growth * d * (0.75 - 9.75 * q + square * (23.1 - 14.4375 * q));
    double tail = c3 + z * c4 + z_square * (c5 + z * c6);
    return y + z * (1.0 - q) * (1.0 - 1.5 * e * z + z_square * tail);
}

static double advance(double h, double travel, const struct cable *c)
{
    const double end = copysign(c->bound, travel);
    double left = c->rate * fabs(travel);
    while (left > 0.0 && !(fabs(end - h) < 1e-12 * c->bound)) {
        double size = fabs(h), z;
        int outward = h * end > 0.0;
        if (c->cubic && size <= c->bound && (outward || size > 1.01 * c->piece)) {
            z = smaller(left, c->piece);
            h = by_cubes(h, copysign(z, travel), copysign(outward ? c->growth : 1.0, travel));
        } else {
            double direction = copysign(1.0, travel), y = direction * h;
            double q = (y > 0.0 ? c->growth : -1.0) * power(size, c);
            if (size < c->near_zero) {
                z = smaller(left, c->near_zero);
                y = through_zero(y, z, q, c);
            } else {
                z = smaller(smaller(left, c->piece), 0.05 * size / larger(1.0, fabs(1.0 - q)));
                y = away_from_zero(y, z, q, c->exponent);
            }
            h = direction * y;
        }
        left -= z;
    }
    return h;
}

static double reading(double angle, double normal, double resolution, double inverse, double noise)
{
    double noisy = angle + noise * normal;
    return resolution > 0.0 ? resolution * floor(noisy * inverse + 0.5) : noisy;
}

struct motion {
    double position, velocity, acceleration;
};

struct conditioned {
    struct motion shown;
    double given, unchanged, between, doubt;
};

static int departs(double before, struct motion given, double most, double dt)
{
    double bend = dt * dt * given.acceleration, gone = given.position - before - dt * given.velocity;
    return !(fabs(gone + 0.5 * bend) <= most || fabs(gone) <= most || fabs(gone + bend) <= most);
}

static struct motion follow(const struct parameters *p, const struct conditioned *c, struct motion given, double dt)
{
    double rate = 1.5 * p->conditioning_frequency / (1.0 + p->conditioning_frequency * p->conditioning_delay);
    double off = c->shown.position - (given.position - dt * (given.velocity - 0.5 * dt * given.acceleration));
    double off_rate = c->shown.velocity - (given.velocity - dt * given.acceleration), falls = 1.0 / (1.0 + rate * dt);
    double next_rate = (off_rate - rate * rate * dt * off) * falls * falls, next_off = off + dt * next_rate;
    struct motion shown = {given.position + next_off, given.velocity + next_rate,
                           given.acceleration - rate * (2.0 * next_rate + rate * next_off)};
    return shown;
}

static struct motion estimate(const struct parameters *p, const struct conditioned *c, double given, int changed,
                              double since, double dt)
{
    struct motion shown = {c->shown.position + dt * (c->shown.velocity + 0.5 * dt * c->shown.acceleration),
                           c->shown.velocity + dt * c->shown.acceleration, c->shown.acceleration};
    double tick = larger(dt, c->between), due = floor(since / tick + 0.5);
    if (changed || (due > floor((since - dt) / tick + 0.5) && due > 1.5)) {
        double span = larger(dt, changed ? since : tick), late = 0.5 * (span - dt);
        double x = 4.0 * p->conditioning_frequency * span, theta = 1.0 / (1.0 + x + 0.5 * x * x);
        if (span > 1.5 * dt)
            theta = larger(dt / span, theta);
        double kept = 1.0 - theta;
        double miss = given - (shown.position + late * (shown.velocity + 0.5 * late * shown.acceleration));
        double reach = larger(1.0 / 4.0, p->conditioning_frequency * span), most = 0.1 * reach * reach;
        double felt = larger(-most, smaller(most, miss)) / span;
        double by_acceleration = kept * kept * kept * felt / span;
        double by_velocity = 1.5 * kept * kept * (1.0 + theta) * felt - late * by_acceleration;
        shown.position += (1.0 - theta * theta * theta) * miss - late * (by_velocity + 0.5 * late * by_acceleration);
        shown.velocity += by_velocity;
        shown.acceleration += by_acceleration;
    }
    return shown;
}

/* as `bowden.control.conditioning` */
static void condition(const struct parameters *p, struct conditioned *c, struct motion given, double dt)
{
    const double slowest = 0.06, largest = 1e9;
    int begun = c->unchanged >= 0.0 && fabs(c->shown.position) < largest;
    given.position = fabs(given.position) < largest ? given.position : c->given;
    given.velocity = fabs(given.velocity) < largest ? given.velocity : 0.0;
    given.acceleration = fabs(given.acceleration) < largest ? given.acceleration : 0.0;
    double before = begun ? c->given : given.position, since = begun ? c->unchanged + dt : 0.0;
    int changed = given.position != before;
    double stray = 1e-3 + dt * (0.6 * fabs(given.acceleration - c->shown.acceleration) + 0.01 * fabs(given.acceleration));
    int contradicts = departs(before, given, stray * dt, dt);
    double doubt = larger(0.0, c->doubt - dt);
    if (contradicts)
        doubt = c->doubt > 0.0 ? 2.0 * slowest : slowest;
    if (changed && since > slowest)
        doubt = smaller(slowest, doubt);
    if (begun && doubt > slowest)
        c->shown = estimate(p, c, given.position, changed, since, dt);
    else if (!begun || (!departs(c->shown.position, given, stray * dt, dt) &&
                        fabs(c->shown.velocity - (given.velocity - dt * given.acceleration)) <= stray))
        c->shown = given;
    else
        c->shown = follow(p, c, given, dt);
    c->given = given.position;
    c->between = changed ? since : c->between;
    c->unchanged = changed ? 0.0 : since;
    c->doubt = doubt;
}

/* The loop alone; `references` is (3, n), `normals` (n, 2), `record` (9, n) and `states` (13, n). Returns the cycles. */
long loop(const struct parameters *p, const double *references, const double *widths, const double *slopes,
          const double *normals, double *record, double *states)
{
    const struct cable cable = prepare_cable(p);
    const struct servo servo = prepare_servo(p, p->sample_time / (double)p->substeps);
    const struct servo cycle = prepare_servo(p, p->sample_time);
    const double reach = p->natural_frequency * p->sample_time <= 0.25 ? cycle.reach : -1.0;
    const long n = p->cycles;
    const double dt = p->sample_time;
    const double joint_inverse = 1.0 / p->joint_resolution, motor_inverse = 1.0 / p->motor_resolution;
    double position = p->initial_motor, velocity = 0.0, acceleration = 0.0, h = 0.0;
    double joint = slopes[0] * p->slope * position + widths[0] * p->hysteresis_gain * h + p->offset;
    double integral = 0.0, slope_inverse = 0.0, bound = 0.0, joint_rate = 0.0;
    double last = reading(joint, normals[0], p->joint_resolution, joint_inverse, p->joint_noise);
    struct conditioned c = {{last, 0.0, 0.0}, last, -1.0, 0.0, 0.0};

    for (long k = 0; k < n; k++) {
        double measured = reading(joint, normals[2 * k], p->joint_resolution, joint_inverse, p->joint_noise);
        double motor = reading(position, normals[2 * k + 1], p->motor_resolution, motor_inverse, p->motor_noise);
        const struct motion given = {references[k], references[n + k], references[2 * n + k]};
        condition(p, &c, given, dt);
        double reference = c.shown.position, reference_rate = c.shown.velocity;

        double error = measured - reference;
        integral += error * dt;
        joint_rate += ((measured - last) * (1.0 / dt) - joint_rate) * (dt / (p->derivative_time + dt));
        last = measured;
        double s = p->error_gain * error + integral;
        double direction = tanh(s * (1.0 / p->smoothing));
        double wanted = reference - p->error_gain * (joint_rate - reference_rate) - bound * direction;
        double command = slope_inverse * wanted - p->feedback_gain * s;
        double next = slope_inverse - dt * p->slope_adaptation * (wanted * s + p->slope_leakage * slope_inverse);
        bound += dt * p->bound_adaptation * (slope_inverse * direction * s - p->bound_leakage * bound);
        slope_inverse = next;

        double load = slopes[k] * p->slope * (p->pretension + p->spring * joint);
        double current = (p->inertia * acceleration + load) / (p->gear * p->torque_constant);
        record[k] = measured;
        record[n + k] = motor;
        record[2 * n + k] = command;
        record[3 * n + k] = current;
        record[4 * n + k] = joint;
        record[5 * n + k] = position;
        record[6 * n + k] = velocity;
        record[7 * n + k] = acceleration;
        record[8 * n + k] = h;
        states[k] = integral;
        states[n + k] = slope_inverse;
        states[2 * n + k] = bound;
        states[3 * n + k] = last;
        states[4 * n + k] = joint_rate;
        states[5 * n + k] = s;
        states[6 * n + k] = c.shown.position;
        states[7 * n + k] = c.shown.velocity;
        states[8 * n + k] = c.shown.acceleration;
        states[9 * n + k] = c.given;
        states[10 * n + k] = c.unchanged;
        states[11 * n + k] = c.between;
        states[12 * n + k] = c.doubt;
        if (!(fabs(command) < 1e3))
            return k;

        double applied = k >= p->delay ? record[2 * n + k - p->delay] : p->initial_motor;
        double offset = position - applied, travel = 0.0;
        if (fabs(-cycle.stiffness * offset - cycle.drag * velocity) + sqrt(cycle.stiffness) * fabs(velocity) <= reach) {
            double moved = cycle.xx * offset + cycle.xv * velocity, speed = cycle.vx * offset + cycle.vv * velocity;
            if (speed * velocity < 0.0) {
                double time, still = turn(offset, velocity, &cycle, &time);
                double width = widths[k] + (widths[k + 1] - widths[k]) * time / cycle.dt;
                h = advance(h, travel_of(still - offset, -velocity, time, widths[k], width), &cable);
                travel = travel_of(moved - still, speed, cycle.dt - time, width, widths[k + 1]);
            } else {
                travel = travel_of(moved - offset, speed - velocity, cycle.dt, widths[k], widths[k + 1]);
            }
            velocity = speed;
            position = moved + applied;
            acceleration = -cycle.stiffness * moved - cycle.drag * speed;
        } else {
            double before = velocity, widening = (widths[k + 1] - widths[k]) / (double)p->substeps;
            double inverse_width = 1.0 / widths[k];
            for (long i = 0; i < p->substeps; i++) {
                double moved, free = servo.vx * offset + servo.vv * velocity;
                before = velocity;
                if (fabs(free - velocity) <= servo.change && fabs(free) <= servo.speed_limit) {
                    moved = servo.xx * offset + servo.xv * velocity;
                    velocity = free;
                } else {
                    velocity = larger(before - servo.change, smaller(before + servo.change, free));
                    velocity = larger(-servo.speed_limit, smaller(servo.speed_limit, velocity));
                    moved = offset + 0.5 * servo.dt * (before + velocity);
                }
                if (widening != 0.0)
                    inverse_width = 1.0 / (widths[k] + ((double)i + 1.0) * widening);
                double piece = (moved - offset) * inverse_width;
                if (piece * travel < 0.0) {
                    h = advance(h, travel, &cable);
                    travel = 0.0;
                }
                travel += piece;
                offset = moved;
            }
            position = offset + applied;
            acceleration = (velocity - before) / servo.dt;
        }
        h = advance(h, travel, &cable);
        joint = slopes[k + 1] * p->slope * position + widths[k + 1] * p->hysteresis_gain * h + p->offset;
    }
    return n;
}

/* A whole run: times, sheath, reference and loop. `inputs` holds time, reference, its rate and acceleration,
 * slope (5, n), `edges` the widths and slope factors between cycles (2, n + 1). */
long run(const struct parameters *p, const double *normals, double *inputs, double *edges, double *record,
         double *states)
{
    const long n = p->cycles;
    const double half = 0.5 * p->period, span = p->high - p->low, speed = 1.0 / half;
    double *references = inputs + n, *slope = inputs + 4 * n, *widths = edges, *slopes = edges + n + 1;
    for (long k = 0; k <= n; k++) {
        double bend = p->bend;
        widths[k] = larger(0.01, bend / p->identified_bend * p->gap);
        slopes[k] = larger(0.05, 1.0 - p->loss * (bend / p->identified_bend - 1.0));
    }
    for (long k = 0; k < n; k++) {
        double time = (double)k * p->sample_time;
        double until_top = half - (time - p->period * floor(time / p->period));
        double x = larger(0.0, smaller(1.0, (half - fabs(until_top)) / half));
        double rate = span * speed * 30.0 * x * x * (1.0 + x * (x - 2.0));
        inputs[k] = time;
        references[k] = p->low + span * x * x * x * (10.0 + x * (6.0 * x - 15.0));
        references[n + k] = until_top < 0.0 ? -rate : rate;
        references[2 * n + k] = span * speed * speed * 60.0 * x * (1.0 + x * (2.0 * x - 3.0));
        slope[k] = slopes[k] * p->slope;
    }
    return loop(p, references, widths, slopes, normals, record, states);
}
