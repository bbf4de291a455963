/* angles - the angular springs of an island, and which of them each unknown has
 *
 * They are sorted such that 8 consecutive ones have consecutive rows wherever the order of the mesh
 * allows it, which kernels then read by one vector load: first one angle of each vertex, by rows,
 * then the second one of each, and so on. */
#ifndef MS_LAYOUT_ANGLES_H
#define MS_LAYOUT_ANGLES_H

#include "layout/corners.h"

/* Angles in a chunk of work: some 5 us. */
enum { MS_ANGLE_CHUNK = 128 };

/* Corners of angle e: 3 e of i, 3 e + 1 of the vertex j, 3 e + 2 of k */
typedef struct ms_angles {
  int32_t n;          /* 0: all pointers are NULL */
  int32_t nslots;     /* n, rounded up to whole slices */
  int32_t *row;       /* 3 n: the rows of the corners */
  int32_t *end[3];    /* nslots each: the same, of i, of j and of k; padding: any row */
  int32_t *start[3];  /* nslots / 8 each: the row of lane l is start + l; -1: see end */
  int32_t *angle;     /* n: numbers in the scene */
  ms_buckets of;      /* the corners at each unknown, those of i first, then of j, then of k */
  ms_corners corners; /* the same for kernels */
  double *k;          /* nslots: N m/rad^2; padding: 0 */
  double *bend;       /* nslots: pi - rest, rad */
  double *damping;    /* nslots: N m s/rad */
  int is_damped;      /* 1: some damping is not 0 */
  double *weight;     /* 2 n: of equivalent springs i-j and k-j (scene/angles.h), 1/m^2 */
  double *corner; /* 12 nslots: component c of corner q of angle e at (3 q + c) nslots + e; those of
                     q = 3 are 0; scratch, of physics/angle_springs.c */
  double *sum;    /* one for each MS_ANGLE_CHUNK angles; likewise */
} ms_angles;

/* angle: nangles, the numbers of the island's angular springs in the order of ms_angles.
 * island->row_scratch has the rows of particles. Returns 0 if memory is exhausted. */
int ms_angles_sort(const ms_scene *scene, const ms_island *island, const ms_unknowns *rows,
                   int32_t *angle);

msim_status ms_angles_create(const ms_scene *scene, const ms_island *island,
                             const ms_unknowns *rows, ms_angles *angles, msim_error *err);
void ms_angles_destroy(const ms_scene *scene, ms_angles *angles);

/* The sum over the equivalent springs of an unknown of e w by, e = 2, or 1 if the other end is
 * pinned; by: of each angle, k or damping */
double ms_angles_sum_row(const ms_angles *angles, int32_t first_fixed, const double *by,
                         int32_t row);

#endif
