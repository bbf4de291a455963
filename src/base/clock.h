/* clock - monotonic time in s, for statistics only */
#ifndef MS_CLOCK_H
#define MS_CLOCK_H

double ms_clock_now(void);

#endif
