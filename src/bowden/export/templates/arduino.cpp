/* The clock of the loop, on a board with an Arduino core. What it does is loop.c; what your board does is board.cpp.
 *
 * PlatformIO: this folder is a project; name your board in platformio.ini.
 * Arduino: rename this file to FOLDER.ino, delete replay.c, and put the others beside it.
 */

#include <Arduino.h>

#include "loop.h"

static const uint32_t PERIOD = [["%.0f"|format(period * 1e6)]]; /* [us] */
static uint32_t due, last;

void setup()
{
    loop_begin();
    due = micros();
    last = due - PERIOD;
}

void loop()
{
    const uint32_t now = micros();

    if ((int32_t)(now - due) < 0) {
        return;
    }
    loop_cycle((now - due) * 1e-6, (now - last) * 1e-6);
    last = now;
    due += PERIOD;
    if ((int32_t)(micros() - due) >= 0) {
        due = micros() + PERIOD; /* cycles that were missed are left out, not caught up on */
    }
}
