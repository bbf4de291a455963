/* plot - plots the results of a benchmark with gnuplot */
#ifndef BENCH_PLOT_H
#define BENCH_PLOT_H

#include "report.h"

/* A row of the report as a point or a bar. */
typedef struct plot_point {
  const char *series; /* with its own colour */
  const char *place;  /* name of the scene, or label below the bars */
  double x, y;        /* x is unused for bars */
} plot_point;

/* How the rows of a benchmark are plotted. */
typedef struct plot {
  const char *title, *x_label, *y_label;
  const char *x_format; /* of gnuplot; NULL: "10k" for 10 000 */
  int bars;   /* 1: bars, side by side at each place; 0: curves, each through the places of one
               family, whose names begin with the same letters */
  int panels; /* curves: a panel for each place, one below the other */
  int heat;   /* 1: a heat map: places x by series, with x within a place; coloured by y */
  int (*point)(const json_t *row, plot_point *p); /* returns 0 if the row is not plotted */
} plot;

extern const plot linear_picture, skip_picture, forces_picture, scaling_picture, step_picture,
    precision_picture, stability_picture;

/* Whether gnuplot can be run; prints an error if not. */
int gnuplot_is_available(void);

/* Writes SVG to an open file; prints an error if that fails. */
int plot_write(const plot *p, const report *r, output_file *file);

#endif
