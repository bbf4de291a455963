/* clock - seconds on the monotonic clock, to measure durations */
#ifndef TOOLS_CLOCK_H
#define TOOLS_CLOCK_H

double wall_seconds(void);

#endif
