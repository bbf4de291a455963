/* interrupt - Ctrl-C */
#ifndef BENCH_INTERRUPT_H
#define BENCH_INTERRUPT_H

/* From here on the first SIGINT or SIGTERM is only noted, and ends a read from a pipe; the second
 * one kills. */
void catch_interrupts(void);

int is_interrupted(void);

#endif
