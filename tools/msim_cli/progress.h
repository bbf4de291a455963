/* progress - show a progress bar on the terminal during a long run */
#ifndef CLI_PROGRESS_H
#define CLI_PROGRESS_H

#include <stdint.h>

typedef struct progress {
  int wanted;            /* 1: stderr is a terminal and --quiet is not given */
  int shown;             /* columns of the line now on the terminal; 0: none */
  int64_t first, end;    /* the steps of this run; end < first: their number is unknown */
  double t_first;        /* s: time of its first state */
  double started, drawn; /* wall time, s */
} progress;

void progress_start(progress *bar, int quiet, int64_t first, int64_t end, double t_first);

/* Draw the bar, but not in the first half second, and at most ten times a second. */
void progress_update(progress *bar, double now, int64_t step, double t, double t_end);

/* Erase the line, before anything else is printed. */
void progress_hide(progress *bar);

#endif
