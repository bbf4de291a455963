/* angles - the angular springs of an island, and which of them each unknown has */
#ifndef MS_LAYOUT_ANGLES_H
#define MS_LAYOUT_ANGLES_H

#include "base/buckets.h"
#include "layout/unknowns.h"

/* Angles in a chunk of work: some 5 us. */
enum { MS_ANGLE_CHUNK = 64 };

/* Corners of angle e: 3 e of i, 3 e + 1 of the vertex j, 3 e + 2 of k */
typedef struct ms_angles {
  int32_t n;       /* 0: all pointers are NULL */
  int32_t *row;    /* 3 n: the rows of the corners */
  int32_t *angle;  /* n: numbers in the scene, ascending */
  ms_buckets of;   /* the corners at each unknown, in the order of the angles */
  double *k;       /* n: N m/rad^2 */
  double *bend;    /* n: pi - rest, rad */
  double *damping; /* n: N m s/rad */
  double *weight;  /* 2 n: of equivalent springs i-j and k-j (scene/angles.h), 1/m^2 */
  double *corner;  /* 9 n: a vector for each corner; scratch, of physics/angle_springs.c */
  double *sum;     /* one for each MS_ANGLE_CHUNK angles; likewise */
} ms_angles;

msim_status ms_angles_create(const ms_scene *scene, const ms_island *island,
                             const ms_unknowns *rows, ms_angles *angles, msim_error *err);
void ms_angles_destroy(const ms_scene *scene, ms_angles *angles);

/* The sum over the equivalent springs of an unknown of e w by, e = 2, or 1 if the other end is
 * pinned; by: of each angle, k or damping */
double ms_angles_sum_row(const ms_angles *angles, int32_t nfree, const double *by, int32_t row);

#endif
