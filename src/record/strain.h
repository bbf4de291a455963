/* strain - strain and tension of the springs and reactions of the pins in a frame, for recorders
 *
 * A spring of length l and rest length L has strain (l - L) / L, 0 where L = 0, and tension
 * k (l - L). A face has the mean of the springs among its edges, 0 where none is a spring, so that
 * a surface can be coloured. Reactions are those of msim_sim_reactions. In single precision, as
 * they follow from positions and velocities; numbers beyond its range are its largest ones. */
#ifndef MS_STRAIN_H
#define MS_STRAIN_H

#include "scene/scene.h"

/* Springs and then faces: some of these cells, or all */
typedef struct ms_cell_range {
  int64_t first, n;
} ms_cell_range;

typedef struct ms_strain {
  ms_cell_range cells;
  int32_t *edge;           /* the springs between the corners of each face in `cells`; -1: none */
  float *strain, *tension; /* of `cells`, tension in N */
  double *exact;           /* 3 nparticles, N: reactions in double precision */
  float *reaction;         /* 3 nparticles, N; NULL: no particle was pinned at ms_strain_init */
} ms_strain;

static inline ms_cell_range ms_cell_range_all(const ms_scene *scene) {
  return (ms_cell_range){0, (int64_t)scene->nsprings + scene->nfaces};
}

/* Find the springs of these faces. reactions: 1 to compute those, too, if particles are pinned.
 * Call ms_strain_free always. */
msim_status ms_strain_init(ms_strain *s, const ms_scene *scene, ms_cell_range cells, int reactions,
                           const msim_allocator *alloc, msim_error *err);
void ms_strain_compute(ms_strain *s, const ms_scene *scene, const double *x, const double *v);
void ms_strain_free(ms_strain *s, const msim_allocator *alloc);

#endif
