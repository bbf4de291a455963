/* clock - seconds on the monotonic clock, to measure durations */
#ifndef TOOLS_CLOCK_H
#define TOOLS_CLOCK_H

double clock_seconds(void);

#endif
