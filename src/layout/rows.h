/* rows - which particles are unknowns, and where each lies in a vector.
 *
 * Inside a sim a vector holds `dims` components one after the other, `stride` doubles apart:
 * component c of row r is vec[c * stride + r], along axis[c] of space. Rows [0, nfree) are the
 * unknowns; pinned particles follow from row `first_pinned` on. Both parts are padded to whole
 * groups of MS_GROUP rows with zeros. Nothing outside this module assumes that row = particle. */
#ifndef MS_ROWS_H
#define MS_ROWS_H

#include "layout/islands.h"

/* One AVX-512, two AVX2 or four SSE2 registers: one order of summation on every CPU. */
enum { MS_GROUP = 8 };

typedef struct ms_rows {
  int32_t dims;         /* components of a vector: 3, or 2 */
  int32_t axis[3];      /* dims: the axis of space of each */
  int32_t left_out;     /* the axis that has no component; -1: none */
  int32_t n;            /* particles of the island */
  int32_t nfree;        /* unknown rows */
  int32_t first_pinned; /* nfree, rounded up to whole groups */
  int32_t stride;       /* all rows, rounded up */
  int32_t *particle;    /* stride: the particle of each row, -1 for padding */
  double narrowed;      /* how many times nearer neighbours lie than in the scene; 0: left alone */
  int sorted;           /* by number of springs, within small windows */
} ms_rows;

msim_status ms_rows_create(const ms_scene *scene, const ms_island *island, ms_rows *rows,
                           msim_error *err);
/* No component along this axis. Called before anything has made a vector. */
void ms_rows_leave_out(ms_rows *rows, int32_t axis);
void ms_rows_destroy(const ms_scene *scene, ms_rows *rows);

/* row[p] = the row of particle p, for those that have one. */
void ms_rows_invert(const ms_rows *rows, int32_t *row);

/* A zero vector of dims stride doubles. */
double *ms_rows_vector(const ms_scene *scene, const ms_rows *rows);

/* Flat arrays of the scene to rows, and back. What has no row or no component is left alone. */
void ms_rows_gather(const ms_rows *rows, const double *flat, double *vec);
void ms_rows_scatter(const ms_rows *rows, const double *vec, double *flat);

/* Row r of a vector in space, 0 along the axis left out, and back. */
static inline void ms_row_get(const ms_rows *rows, const double *vec, int32_t r, double out[3]) {
  out[0] = out[1] = out[2] = 0;
  for (int32_t c = 0; c < rows->dims; c++)
    out[rows->axis[c]] = vec[(size_t)c * (size_t)rows->stride + (size_t)r];
}

static inline void ms_row_put(const ms_rows *rows, const double in[3], int32_t r, double *vec) {
  for (int32_t c = 0; c < rows->dims; c++)
    vec[(size_t)c * (size_t)rows->stride + (size_t)r] = in[rows->axis[c]];
}

/* The island's springs, in row numbers and in the order of the scene. */
typedef struct ms_springs {
  int32_t n;
  int32_t *i, *j;             /* n: rows */
  double *k, *rest, *damping; /* n */
  int32_t *spring;            /* n: the spring's number in the scene */
} ms_springs;

msim_status ms_springs_create(const ms_scene *scene, const ms_island *island, const ms_rows *rows,
                              ms_springs *springs, msim_error *err);

/* Take k, rest and damping from the scene again. */
void ms_springs_update(const ms_scene *scene, ms_springs *springs);
void ms_springs_destroy(const ms_scene *scene, ms_springs *springs);

#endif
