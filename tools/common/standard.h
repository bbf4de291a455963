/* standard - standard files and signals, as every program of ours treats them */
#ifndef TOOLS_STANDARD_H
#define TOOLS_STANDARD_H

/* First thing in main: what is printed cannot end up in a file of ours, and a write that fails is
 * an error, not a signal. */
void standard_begin(void);

/* Last thing in main: what buffering hid. Returns `status`, or EXIT_ERROR with a complaint. */
int standard_end(int status);

#endif
