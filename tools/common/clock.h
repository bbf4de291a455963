/* clock - seconds on the monotonic clock, to measure durations, and sleeping */
#ifndef TOOLS_CLOCK_H
#define TOOLS_CLOCK_H

double clock_seconds(void);

/* Sleeps, so that threads that wait by spinning (OpenBLAS, OpenMP) go to sleep. */
void clock_sleep(double seconds);

#endif
