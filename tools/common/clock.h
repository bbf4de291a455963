/* clock - seconds on a clock that nobody sets */
#ifndef TOOLS_CLOCK_H
#define TOOLS_CLOCK_H

double wall_seconds(void);

#endif
