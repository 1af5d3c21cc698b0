/* Replays a recorded run through [[name]]_start and [[name]]_step.
 *
 *   replay RECORDING.csv           compares every command with the recorded one; exit code 1 where one is not exact, in
 *                                  float where they are further than NEAR from it, root mean square
 *   replay RECORDING.csv --print   prints time, command and state of every cycle instead
 *
 * A recording is a CSV file with the columns of a live run's log: `bowden log export RUN.mcap`.
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "[[name]].h"

#define EXACT [[0 if single else 1]] /* whether every command must be the recorded one, to the bit */
#define NEAR 1e-3 /* [rad], some two counts of an encoder of 14 bits */

enum { TIME, JOINT, MOTOR, POSITION, VELOCITY, ACCELERATION, REQUESTED_TARGET, SOURCE, COLUMNS };

/* other names are those of a simulated trace */
static const char *const NAMES[COLUMNS][2] = {
    {"time", ""}, {"joint_seen", "joint_measured"}, {"motor_seen", "motor_measured"}, {"reference", ""},
    {"reference_velocity", ""}, {"reference_acceleration", ""}, {"requested_target", "command"}, {"source", ""}
};

static char line[65536], *fields[512];

/* Cut the next line at its commas; returns the number of fields, 0 at the end of the file. */
static int split(FILE *in)
{
    int count = 0;

    do {
        if (fgets(line, sizeof line, in) == NULL) {
            return 0;
        }
    } while (line[0] == '#');
    line[strcspn(line, "\r\n")] = '\0';
    for (char *at = line; at != NULL && count < 512;) {
        char *comma = strchr(at, ',');
        if (comma != NULL) {
            *comma++ = '\0';
        }
        at += *at == '"';
        at[strcspn(at, "\"")] = '\0';
        fields[count++] = at;
        at = comma;
    }
    return count;
}

static int table(FILE *in, int print)
{
    int at[COLUMNS], count = split(in);
    long cycles = 0, differ = 0;
    double furthest = 0.0, squares = 0.0;
    [[name]]_LawState state;

    for (int i = 0; i < COLUMNS; ++i) {
        at[i] = -1;
        for (int k = 0; k < count; ++k) {
            if (strcmp(fields[k], NAMES[i][0]) == 0 || (strcmp(fields[k], NAMES[i][1]) == 0 && at[i] < 0)) {
                at[i] = k;
            }
        }
        if (at[i] < 0 && i != TIME && i != SOURCE) {
            fprintf(stderr, "replay: the recording has no column %s\n", NAMES[i][0]);
            return 2;
        }
    }
    if (print) {
        printf("time,command,[[header]]\n");
    }
    while ((count = split(in)) > 0) {
        double row[COLUMNS];
        for (int i = 0; i < COLUMNS; ++i) {
            const char *text = at[i] >= 0 && at[i] < count ? fields[at[i]] : "";
            row[i] = *text != '\0' ? strtod(text, NULL) : (double)NAN;
        }
        /* where the requested target came from: below 2 from no law, 2 from one that begins; a simulated run begins once */
        const double source = at[SOURCE] >= 0 ? row[SOURCE] : cycles == 0 ? 2.0 : 3.0;
        if (!(source >= 2.0)) {
            continue;
        }
        const [[name]]_Sample sample = {
            .joint = ([[name]]_real)row[JOINT],
            .motor = ([[name]]_real)row[MOTOR],
            .joint_age = ([[name]]_real)NAN,
            .joint_std = ([[name]]_real)NAN, /* of an encoder */
        };
        const [[name]]_Reference reference = {
            ([[name]]_real)row[POSITION], ([[name]]_real)row[VELOCITY], ([[name]]_real)row[ACCELERATION]
        };
        if (source == 2.0) {
            [[name]]_start(&state, &sample);
        }
        const double command = (double)[[name]]_step(&state, &sample, &reference);
        const double away = fabs(command - row[REQUESTED_TARGET]);
        differ += !((command != command && row[REQUESTED_TARGET] != row[REQUESTED_TARGET]) || memcmp(&command, &row[REQUESTED_TARGET], sizeof command) == 0);
        furthest = away > furthest ? away : furthest;
        squares += away * away;
        cycles++;
        if (print) {
            const double values[] = {
                row[TIME],
                command{% for way in ways %},
                (double)state[[way]]{% endfor +%}
            };
            for (size_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
                printf("%s%.17g", i > 0 ? "," : "", values[i]);
            }
            printf("\n");
        }
    }
    if (cycles == 0) {
        fprintf(stderr, "replay: no law ran in this recording\n");
        return 2;
    }
    const double apart = sqrt(squares / (double)cycles);
    const int failed = EXACT ? differ > 0 : !(apart <= NEAR);
    const char *result = failed ? "failed" : "passed";

    if (!EXACT) {
        fprintf(stderr, "%s: %ld cycles in float, %.3g rad from the recorded commands, %.3g rad at most\n", result, cycles, apart, furthest);
    } else {
        fprintf(stderr, "%s: %ld cycles, %ld commands differ, by %.3g rad at most\n", result, cycles, differ, furthest);
    }
    return !print && failed;
}

int main(int count, char **arguments)
{
    FILE *in = count > 1 ? fopen(arguments[1], "r") : NULL;
    int code;

    if (in == NULL || count > 3 || (count == 3 && strcmp(arguments[2], "--print") != 0)) {
        fprintf(stderr, "usage: replay RECORDING.csv [--print]\n");
        return 2;
    }
    code = table(in, count == 3);
    fclose(in);
    return code;
}
