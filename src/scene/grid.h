/* grid - particles of ropes, cloths and lattices, which all are grids */
#ifndef MS_GRID_H
#define MS_GRID_H

#include "base/error.h"

/* Offset in the grid from one end of a spring to the other. */
typedef struct ms_grid_spring {
  int8_t offset[3];
  int8_t stiffness; /* index of the stiffness in the grid's k */
} ms_grid_spring;

/* Particle (a n[1] + b) n[2] + c is at origin + a/(n[0]-1) edge[0] + b/(n[1]-1) edge[1] +
 * c/(n[2]-1) edge[2]. */
typedef struct ms_grid {
  int32_t n[3];
  double origin[3], edge[3][3];
  int has_last; /* 1: the last particle is exactly at `last` */
  double last[3];
  double k[3];
  const ms_grid_spring *springs;
  int32_t nsprings;
} ms_grid;

/* Count the parts of a shape that is a grid; refuse one beyond the limits of a scene. subject: its
 * name in messages */
struct ms_shape;
msim_status ms_grid_count(struct ms_shape *shape, const char *subject, msim_error *err);

#endif
