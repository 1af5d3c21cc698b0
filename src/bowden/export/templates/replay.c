/* Replays a recorded run through @NAME@_start and @NAME@_step.
 *
 *   replay RECORDING.csv           compares every command with the recorded one; exit code 1 where one is not exact
 *   replay RECORDING.csv --print   prints time, command and state of every cycle instead
 *   replay --binary IN OUT         rows of six doubles in (start anew, joint, motor, reference, its velocity and
 *                                  acceleration), command and state as doubles out
 *
 * A recording is a CSV file with the columns of a live run's log: `bowden log export RUN.mcap --to csv`.
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "@NAME@.h"

#define EXACT @EXACT@ /* whether every command must be the recorded one, to the bit */
#define LONGEST_LINE 65536
#define MOST_COLUMNS 512

enum { TIME, JOINT, MOTOR, POSITION, VELOCITY, ACCELERATION, WISH, SOURCE, COLUMNS };

/* other names are those of a simulated trace */
static const char *const NAMES[COLUMNS][3] = {
    {"time", NULL, NULL},
    {"joint_seen", "joint_measured", "joint"},
    {"motor_seen", "motor_measured", "motor"},
    {"reference", NULL, NULL},
    {"reference_velocity", NULL, NULL},
    {"reference_acceleration", NULL, NULL},
    {"wish", "command", NULL},
    {"source", NULL, NULL}
};

static char line[LONGEST_LINE];

static double cycle(@NAME@_CycleState *state, int anew, const double *in)
{
    const @NAME@_Sample sample = {(@NAME@_real)in[0], (@NAME@_real)in[1]};
    const @NAME@_Reference reference = {(@NAME@_real)in[2], (@NAME@_real)in[3], (@NAME@_real)in[4]};

    if (anew) {
        @NAME@_start(state, &sample);
    }
    return (double)@NAME@_step(state, &sample, &reference);
}

static size_t gather(double *values, double command, const @NAME@_CycleState *state)
{
    const double all[] = {
        @VALUES@
    };

    memcpy(values, all, sizeof all);
    return sizeof all / sizeof all[0];
}

static int same(double a, double b)
{
    return (a != a && b != b) || memcmp(&a, &b, sizeof a) == 0;
}

static int binary(const char *from, const char *to)
{
    FILE *in = fopen(from, "rb");
    FILE *out = fopen(to, "wb");
    double row[6], values[MOST_COLUMNS];
    @NAME@_CycleState state;
    int failed = in == NULL || out == NULL;

    while (!failed && fread(row, sizeof row[0], 6, in) == 6) {
        const double command = cycle(&state, row[0] != 0.0, row + 1);
        const size_t count = gather(values, command, &state);
        failed = fwrite(values, sizeof values[0], count, out) != count;
    }
    if (in != NULL) {
        fclose(in);
    }
    if (out != NULL && fclose(out) != 0) {
        failed = 1;
    }
    if (failed) {
        perror("replay");
    }
    return failed ? 2 : 0;
}

/* Cut the line at its commas; returns the number of fields. */
static int split(char **fields)
{
    int count = 0;
    char *at = line;

    line[strcspn(line, "\r\n")] = '\0';
    while (at != NULL && count < MOST_COLUMNS) {
        char *comma = strchr(at, ',');
        if (comma != NULL) {
            *comma++ = '\0';
        }
        if (*at == '"') {
            at++;
            at[strcspn(at, "\"")] = '\0';
        }
        fields[count++] = at;
        at = comma;
    }
    return count;
}

static int find(char **fields, int count, const char *const *names)
{
    for (int n = 0; n < 3 && names[n] != NULL; ++n) {
        for (int i = 0; i < count; ++i) {
            if (strcmp(fields[i], names[n]) == 0) {
                return i;
            }
        }
    }
    return -1;
}

static int table(FILE *in, int print)
{
    char *fields[MOST_COLUMNS];
    int at[COLUMNS], count;
    long cycles = 0, differ = 0;
    double furthest = 0.0, values[MOST_COLUMNS];
    @NAME@_CycleState state;

    do {
        if (fgets(line, sizeof line, in) == NULL) {
            fprintf(stderr, "replay: no header\n");
            return 2;
        }
    } while (line[0] == '#');
    count = split(fields);
    for (int i = 0; i < COLUMNS; ++i) {
        at[i] = find(fields, count, NAMES[i]);
        if (at[i] < 0 && i != TIME && i != SOURCE) {
            fprintf(stderr, "replay: the recording has no column %s\n", NAMES[i][0]);
            return 2;
        }
    }
    if (print) {
        printf("time,@HEADER@\n");
    }
    while (fgets(line, sizeof line, in) != NULL) {
        double in_row[COLUMNS];
        const int found = split(fields);
        for (int i = 0; i < COLUMNS; ++i) {
            const char *text = at[i] >= 0 && at[i] < found ? fields[at[i]] : "";
            in_row[i] = *text != '\0' ? strtod(text, NULL) : (double)NAN;
        }
        /* where the wish came from: below 2 from no law, 2 from one that begins; a simulated run begins once */
        const double source = at[SOURCE] >= 0 ? in_row[SOURCE] : cycles == 0 ? 2.0 : 3.0;
        if (!(source >= 2.0)) {
            continue;
        }
        const double command = cycle(&state, source == 2.0, in_row + JOINT);
        const double away = fabs(command - in_row[WISH]);
        differ += !same(command, in_row[WISH]);
        furthest = away > furthest ? away : furthest;
        cycles++;
        if (print) {
            const size_t many = gather(values, command, &state);
            printf("%.17g", in_row[TIME]);
            for (size_t i = 0; i < many; ++i) {
                printf(",%.17g", values[i]);
            }
            printf("\n");
        }
    }
    if (cycles == 0) {
        fprintf(stderr, "replay: no law ran in this recording\n");
        return 2;
    }
    fprintf(stderr, "%ld cycles, %ld commands differ, by %.3g rad at most\n", cycles, differ, furthest);
    return EXACT && !print && differ > 0;
}

int main(int count, char **arguments)
{
    if (count == 4 && strcmp(arguments[1], "--binary") == 0) {
        return binary(arguments[2], arguments[3]);
    }
    if (count == 2 || (count == 3 && strcmp(arguments[2], "--print") == 0)) {
        FILE *in = fopen(arguments[1], "r");
        int code;
        if (in == NULL) {
            perror(arguments[1]);
            return 2;
        }
        code = table(in, count == 3);
        fclose(in);
        return code;
    }
    fprintf(stderr, "usage: replay RECORDING.csv [--print] | replay --binary IN OUT\n");
    return 2;
}
