/* model - what the physics of one island needs and never changes: rows, springs, masses, passes */
#ifndef MS_MODEL_H
#define MS_MODEL_H

#include "base/pool.h"
#include "base/vector.h"
#include "layout/layout.h"

typedef struct ms_model {
  const ms_scene *scene;
  ms_rows rows;
  ms_springs springs;
  ms_halves halves;        /* the same springs, seen from their rows */
  ms_shape shape;          /* of the unknowns */
  double *mass, *inv_mass; /* first_pinned, kg, 1/kg: of each unknown row; padding: 1, 0 */
  double gravity[3], drag; /* the scene's: m/s^2, N s/m */
  double *part_force;      /* what springs do to rows in parts; NULL: there are none */
  int isa;                 /* of the kernels: ms_isa_best() */
  ms_pool *pool;           /* the sim's; NULL: one thread */
  unsigned passes;         /* MSIM_SKIP_...: the passes that a step makes */
} ms_model;

/* What an island needs, and what skip_off insists on. left_out: the axis that has no component; -1:
 * none. */
msim_status ms_model_create_island(const ms_scene *scene, const ms_island *island, int32_t left_out,
                                   unsigned skip_off, ms_model *model, msim_error *err);

/* All of the scene as one island, with components as it needs them. */
msim_status ms_model_create(const ms_scene *scene, unsigned skip_off, ms_model *model,
                            msim_error *err);

/* The same particles with some of the springs: the island's, and its rows are scratch. Shares rows
 * and masses with the whole, which must outlive it. */
msim_status ms_model_create_part(const ms_model *whole, const ms_island *springs, unsigned skip_off,
                                 ms_model *part, msim_error *err);
void ms_model_destroy_part(ms_model *part);

/* No gravity, no drag, no planes. */
void ms_model_keep_springs_only(ms_model *model);

/* The scene's springs have other k, rest or damping. */
void ms_model_update(ms_model *model, unsigned skip_off);
void ms_model_destroy(ms_model *model);

#endif
