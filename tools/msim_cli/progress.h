/* progress - a bar on the terminal while a long run is under way */
#ifndef CLI_PROGRESS_H
#define CLI_PROGRESS_H

#include <stdint.h>

typedef struct progress {
  int wanted;            /* stderr is a terminal and may be written to */
  int shown;             /* columns of the line that stands there now, 0: none */
  int64_t first, end;    /* the steps of this run; end < first: nobody knows how many */
  double t_first;        /* s: time of its first state */
  double started, drawn; /* wall time, s */
} progress;

void progress_start(progress *bar, int quiet, int64_t first, int64_t end, double t_first);

/* Draw the bar if it is time to: not in the first half second, and ten times a second. */
void progress_update(progress *bar, double now, int64_t step, double t, double t_end);

/* Erase the line, as before anything else is printed. */
void progress_hide(progress *bar);

#endif
