#include <math.h>
#include <stdint.h>
#include <string.h>

#include "[[name]].h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define PATTERN 0x5aa5c33cu

extern uint32_t stack_bottom, stack_top;
void reset(void);

/* the emulator puts code and data in their places, so that there is nothing to copy */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*reset)(void);
} VECTORS = {&stack_top, reset};

static const double ROWS[][5] = {
[[rows]]
};

static uint32_t semihost(uint32_t what, const void *with)
{
    register uint32_t r0 __asm__("r0") = what;
    register const void *r1 __asm__("r1") = with;

    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void tell(const char *name, uint64_t value)
{
    char line[40];
    size_t at = strlen(name);

    memcpy(line, name, at);
    line[at++] = ' ';
    for (int shift = 60; shift >= 0; shift -= 4) {
        line[at++] = "0123456789abcdef"[(value >> shift) & 15u];
    }
    line[at++] = '\n';
    line[at] = '\0';
    semihost(0x04, line);
}

static uint32_t now(void)
{
    return REGISTER(0xe000e018); /* SysTick counts down */
}

int main(void)
{
    static [[name]]_LawState state;
    static double commands[sizeof ROWS / sizeof ROWS[0]];
    const size_t count = sizeof ROWS / sizeof ROWS[0];
    uint32_t ticks = 0, longest = 0, *at, *top;

    REGISTER(0xe000e014) = 0xffffff; /* SysTick: the longest period, the core's clock, no interrupt */
    REGISTER(0xe000e018) = 0;
    REGISTER(0xe000e010) = 5;
    __asm__ volatile("mov %0, sp" : "=r"(top));
    for (at = &stack_bottom; at < top; ++at) {
        *at = PATTERN;
    }
    for (size_t k = 0; k < count; ++k) {
        const [[name]]_Sample sample = {([[name]]_real)ROWS[k][0], ([[name]]_real)ROWS[k][1], NAN, NAN};
        const [[name]]_Reference reference = {
            ([[name]]_real)ROWS[k][2], ([[name]]_real)ROWS[k][3], ([[name]]_real)ROWS[k][4]
        };
        uint32_t begin, took;
        [[name]]_real command;

        if (k == 0) {
            [[name]]_start(&state, &sample);
        }
        begin = now();
        command = [[name]]_step(&state, &sample, &reference);
        took = (begin - now()) & 0xffffffu;
        commands[k] = (double)command;
        if (k > 0) {
            ticks += took;
            longest = took > longest ? took : longest;
        }
    }
    for (at = &stack_bottom; at < top && *at == PATTERN; ++at) {
    }
    for (size_t k = 0; k < count; ++k) {
        uint64_t bits;
        memcpy(&bits, &commands[k], sizeof bits);
        tell("command", bits);
    }
    tell("ticks", ticks);
    tell("longest", longest);
    tell("stack", (uint64_t)((char *)top - (char *)at));
    tell("state", sizeof state);
    return 0;
}

void reset(void)
{
    REGISTER(0xe000ed88) |= 0xfu << 20; /* CPACR: the FPU may be used */
    __asm__ volatile("dsb\n isb");
    main();
    semihost(0x18, (const void *)0x20026); /* the program has ended, and all is well */
    for (;;) {
    }
}
