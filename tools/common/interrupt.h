/* interrupt - handles Ctrl-C */
#ifndef TOOLS_INTERRUPT_H
#define TOOLS_INTERRUPT_H

/* After this call, the first SIGINT or SIGTERM sets a flag and interrupts a read from a pipe; the
 * second one terminates the program. */
void catch_interrupts(void);

int is_interrupted(void);

#endif
