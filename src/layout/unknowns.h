/* unknowns - numbers the particles of an island: which are unknowns, and where each lies in a
 * vector
 *
 * The row of a particle is its index in vectors and matrices. A vector of a sim holds `dims`
 * components one after the other, `stride` doubles apart: component c of row r, along axis[c] of
 * space, is vec[c * stride + r]. Rows [0, nfree) are the unknowns; pinned particles begin at row
 * `first_pinned`. Both parts are padded with zeros to whole slices of MS_SLICE rows. No code
 * outside this module assumes that row = particle. */
#ifndef MS_UNKNOWNS_H
#define MS_UNKNOWNS_H

#include "layout/islands.h"

/* Rows of a slice: one AVX-512, two AVX2 or four SSE2 registers, so that every CPU has the same
 * order of summation. */
enum { MS_SLICE = 8 };

typedef struct ms_unknowns {
  int32_t dims;              /* components of a vector: 3, or 2 */
  int32_t axis[3];           /* dims: the axis of space of each component */
  int32_t dropped_axis;      /* planar scene: the axis without a component; -1: none */
  int32_t n;                 /* particles of the island */
  int32_t nfree;             /* unknowns, particles that are not pinned */
  int32_t first_pinned;      /* nfree, rounded up to whole slices */
  int32_t first_fixed;       /* from here on particles are pinned; between first_pinned and here lie
                                ghosts, unknowns of other ranks (halo.h): none in one process */
  int32_t stride;            /* all rows, padding included */
  int32_t *particle;         /* stride: the particle of each row, -1 for padding */
  double distance_reduction; /* mean |row - neighbour| before over after renumbering; 0: not done */
  int sorted_by_degree;      /* by number of springs, within windows of 64 rows */
} ms_unknowns;

msim_status ms_unknowns_create(const ms_scene *scene, const ms_island *island, ms_unknowns *rows,
                               msim_error *err);
/* Drop the component along this axis; call it before any vector is made. */
void ms_unknowns_drop_axis(ms_unknowns *rows, int32_t axis);
void ms_unknowns_destroy(const ms_scene *scene, ms_unknowns *rows);

/* row[p] = the row of particle p, for each particle of the island. */
void ms_unknowns_find_rows(const ms_unknowns *rows, int32_t *row);

/* A hash of the particles of all rows */
uint64_t ms_unknowns_hash(const ms_unknowns *rows);

/* A zero vector of dims stride doubles; NULL: out of memory. */
double *ms_unknowns_new_vector(const ms_scene *scene, const ms_unknowns *rows);

/* A new vector for each of these addresses of pointers. 0: memory is exhausted. */
#define MS_NEW_VECTORS(scene, rows, ...)                                                       \
  ms_unknowns_new_vectors(scene, rows, sizeof((double **[]){__VA_ARGS__}) / sizeof(double **), \
                          (double **[]){__VA_ARGS__})
int ms_unknowns_new_vectors(const ms_scene *scene, const ms_unknowns *rows, size_t n,
                            double **const vectors[]);

/* From arrays of the scene, n x 3, to vectors, and back. Padding, particles of other islands and
 * the axis left out are not written. */
void ms_unknowns_gather(const ms_unknowns *rows, const double *array, double *vec);
void ms_unknowns_scatter(const ms_unknowns *rows, const double *vec, double *array);

/* Row r of a vector as a spatial vector, 0 along the axis left out, and back. */
static inline void ms_unknowns_get(const ms_unknowns *rows, const double *vec, int32_t r,
                                   double out[3]) {
  out[0] = out[1] = out[2] = 0;
  for (int32_t c = 0; c < rows->dims; c++)
    out[rows->axis[c]] = vec[(size_t)c * (size_t)rows->stride + (size_t)r];
}

static inline void ms_unknowns_set(const ms_unknowns *rows, const double in[3], int32_t r,
                                   double *vec) {
  for (int32_t c = 0; c < rows->dims; c++)
    vec[(size_t)c * (size_t)rows->stride + (size_t)r] = in[rows->axis[c]];
}

/* The share of this rank in what n particles have in common, as a spring its energy: of those rows
 * that are unknowns of any rank, the fraction that are its own. 1 in one process */
static inline double ms_unknowns_own_share(const ms_unknowns *rows, int32_t n, const int32_t *row) {
  int32_t own = 0, all = 0;
  for (int32_t c = 0; c < n; c++) own += row[c] < rows->nfree, all += row[c] < rows->first_fixed;
  return own == all ? 1 : (double)own / all;
}

/* The island's springs in the order of the scene, with their ends as rows. The scene has their
 * parameters (laws.h). */
typedef struct ms_springs {
  int32_t n;
  int32_t *i, *j;  /* n: rows of the ends */
  int32_t *number; /* n: of each spring in the scene; NULL: its index here */
} ms_springs;

/* The number of spring e of the island in the scene */
static inline int32_t ms_springs_number(const ms_springs *springs, int32_t e) {
  return springs->number ? springs->number[e] : e;
}

msim_status ms_springs_create(const ms_scene *scene, const ms_island *island,
                              const ms_unknowns *rows, ms_springs *springs, msim_error *err);
void ms_springs_destroy(const ms_scene *scene, ms_springs *springs);

#endif
