/* picture - what a bench found, drawn by gnuplot */
#ifndef BENCH_PICTURE_H
#define BENCH_PICTURE_H

#include "report.h"

/* A row as a point or a bar. */
typedef struct picture_point {
  const char *series; /* one colour, and a line in the key */
  const char *place;  /* the scene, or what stands below the bars */
  double x, y;        /* bars have no x */
} picture_point;

/* How the rows of a bench are drawn. */
typedef struct picture {
  const char *title, *x_label, *y_label;
  const char *x_format; /* of gnuplot; NULL: 10k for 10 000 */
  int bars; /* side by side at each place; 0: curves, each through places of one family, whose names
               begin with the same letters */
  int panels; /* curves: a picture for each place, one below the other */
  int heat;   /* neither: a field of cells, places x by series, x within; coloured by y */
  int (*point)(const json_t *row, picture_point *p); /* 0: the row is not in the picture */
} picture;

extern const picture linear_picture, skip_picture, forces_picture, scaling_picture, step_picture,
    precision_picture, stability_picture;

/* Whether gnuplot can be run; complains. */
int gnuplot_is_there(void);

/* To a file that is open, as SVG; complains. */
int picture_write(const picture *p, const report *r, output_file *file);

#endif
