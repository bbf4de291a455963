/* precision_cells - the best method of msim, `auto` and the best of SUNDIALS in each cell (a scene
 * and an error that its reference solution resolves), and the keys that compare them */
#ifndef BENCH_PRECISION_CELLS_H
#define BENCH_PRECISION_CELLS_H

#include "work_precision.h"
#include "report.h"

enum { MAX_CELLS = 16 * ERROR_LEVELS };

/* s, NAN: no result */
typedef struct cell {
  const precision_scene *scene;
  int level;                     /* index in `levels` */
  int compared;                  /* whether SUNDIALS takes part */
  double best, chosen, sundials; /* chosen: of `auto` */
} cell;

typedef struct cells {
  int count;
  cell all[MAX_CELLS];
} cells;

/* a / b; a missing result counts as infinitely slow: INFINITY if only a is missing, 0 if only b is,
 * NAN if both are. */
double ratio_of_results(double a, double b);

/* Appends the cells of a scene, prints them and writes a row for each. */
void cells_add(const setting_sweep *c, report *out, cells *list);

/* Writes the keys over all cells. with_sundials: whether the library was found. */
void report_cell_keys(const cells *list, int with_sundials, report *out);

#endif
