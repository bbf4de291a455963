/* strain - strain and tension of the springs and reactions of the pins in a frame, for recorders
 *
 * A spring of length l and rest length L has strain (l - L) / L, 0 where L = 0, and tension
 * k (l - L). A face has the mean of the springs among its edges, 0 where none is a spring, so that
 * a surface can be coloured. Reactions are those of msim_sim_reactions. In single precision, as
 * they follow from positions and velocities; numbers beyond its range are its largest ones. */
#ifndef MS_STRAIN_H
#define MS_STRAIN_H

#include "scene/section.h"

typedef struct ms_strain {
  int32_t *edge;           /* the springs between the corners of each face; -1: none */
  float *strain, *tension; /* of the cells, springs and then faces; tension in N */
  float *reaction;         /* 3 nparticles, N; NULL: no particle was pinned at ms_strain_init */
  size_t nparticles;
  double *exact; /* the same of the rows of a section, in double precision */
  size_t rows;   /* of `exact` */
} ms_strain;

/* A section of a scene with its other springs, and with reactions the ends of all springs and
 * angular springs at pinned particles */
typedef struct ms_strain_section {
  ms_section in_whole;   /* in the numbers of the whole scene */
  const ms_scene *scene; /* has all of it: the whole scene, or a slice of it */
  ms_section numbers;    /* the section in the numbers of this scene */
  const double *x, *v;   /* of its rows */
} ms_strain_section;

/* For the cells of a section; x and v are not used. nparticles: of the whole scene. reactions: 1 to
 * compute those, too, if particles are pinned. Call ms_strain_free always. */
msim_status ms_strain_init(ms_strain *s, const ms_strain_section *section, int32_t nparticles,
                           int reactions, const msim_allocator *alloc, msim_error *err);

/* Of a section with the same cells. Fails for want of memory only where it has more rows than
 * before. */
msim_status ms_strain_compute(ms_strain *s, const ms_strain_section *section,
                              const msim_allocator *alloc, msim_error *err);
void ms_strain_free(ms_strain *s, const msim_allocator *alloc);

#endif
