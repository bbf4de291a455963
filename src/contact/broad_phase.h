/* broad_phase - finds the particles that may touch obstacles, by bounds on chunks of rows
 *
 * The box of the positions of a chunk, and a bound on the displacements of its particles, show that
 * none of them reaches an obstacle; where they do not, the same is tried with each slice of the
 * chunk, or, if there are planes alone, with each particle. So obstacles that are far away cost a
 * pass over the vectors. */
#ifndef MS_BROAD_PHASE_H
#define MS_BROAD_PHASE_H

#include "contact/impacts.h"
#include "physics/model.h"

/* The margin of a distance for rounding errors, over the size of the numbers that it is computed
 * from. It may be generous, as it costs no more than a few exact tests. */
#define MS_BROAD_PHASE_ROUNDING 1e-9

typedef struct ms_broad_phase {
  const ms_model *model;
  const ms_collision_planes *planes; /* solids that move are where they are at the start */
  const double *x;
  const double *v, *a; /* on parabolas from x with v and a for h; NULL: without */
  const double *x_end; /* NULL; or on straight paths from x to there */
  double h;
  int32_t chunk_end, slice_end; /* 0 at first: ends of the last chunk, and slice or row of it, that
                                   may touch */
} ms_broad_phase;

/* The first row from `row` on for which ms_impact_time_may_touch() may be true, or, without v and
 * a, which may be closer to an obstacle than the tolerance, at x or on its path; nfree: there is
 * none. Call it with ascending rows. */
int32_t ms_broad_phase_next(ms_broad_phase *b, int32_t row);

#endif
