/* precision_cells - the best method of msim, `auto` and the best of SUNDIALS side by side in each
 * cell, that is a scene and an error that its truth resolves; the keys that compare them */
#ifndef BENCH_PRECISION_CELLS_H
#define BENCH_PRECISION_CELLS_H

#include "envelope.h"
#include "report.h"

enum { MOST_CELLS = 16 * LEVELS };

/* s, NAN: that one has no result */
typedef struct cell {
  const precision_scene *scene;
  int level;                     /* of `levels` */
  int compared;                  /* SUNDIALS takes part */
  double best, chosen, sundials; /* chosen: by `auto` */
} cell;

typedef struct cells {
  int count;
  cell all[MOST_CELLS];
} cells;

/* A missing result is the worst: INFINITY where only a is missing, 0 where only b is, NAN where
 * both are. */
double ratio_of_results(double a, double b);

/* Append the cells of a scene, print them and write a row for each. */
void cells_add(const climb *c, report *out, cells *list);

/* Keys over all cells. with_sundials: whether the library is there. */
void report_cell_keys(const cells *list, int with_sundials, report *out);

#endif
