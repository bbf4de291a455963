/* plot - plots the results of a benchmark with gnuplot */
#ifndef BENCH_PLOT_H
#define BENCH_PLOT_H

#include "report.h"

/* CURVES: each through the places of one family, whose names begin with the same letters. BARS:
 * side by side at each place. PANELS: curves, a panel for each place, one below the other. HEAT: a
 * map, places x by series, with decades of x within a place; coloured by the outcome y. */
enum { CURVES, BARS, PANELS, HEAT };

enum { MOST_MEASURES = 3 };

/* How the rows of a benchmark are plotted: by which of their keys. */
typedef struct plot {
  const char *title, *x_label, *y_label;
  const char *x_format; /* of gnuplot; NULL: "10k" for 10 000 */
  int style;
  const char *measures[MOST_MEASURES]; /* of the rows that are plotted */
  const char *condition;               /* a key that is true in them; NULL: none */
  int main_step;      /* 1: only rows with k = 1000 N/m and h = 1/60 s, as in the summary */
  const char *series; /* key of the name with its own colour */
  const char *place;  /* of the scene, or the label below the bars; NULL: none */
  const char *x, *y;  /* of the coordinates; x: NULL for bars */
  double y_scale;     /* 0: 1 */
} plot;

/* Whether gnuplot can be run; prints an error if not. */
int gnuplot_is_available(void);

/* Writes SVG to an open file; prints an error if that fails. */
int plot_write(const plot *p, const report *r, output_file *file);

#endif
