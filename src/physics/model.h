/* model - the constant data of an island that forces and matrices are computed from: springs,
 * masses, features */
#ifndef MS_MODEL_H
#define MS_MODEL_H

#include "base/pool.h"
#include "base/vector.h"
#include "layout/angles.h"
#include "layout/layout.h"

/* The features that a model has to compute: those that could change a result, and those for which
 * the option skip_off has the bit of the same value. */
enum {
  MS_HAS_SPRINGS = MSIM_SKIP_SPRINGS, /* or angular springs */
  MS_HAS_DAMPING = MSIM_SKIP_DAMPING,
  MS_HAS_DRAG = MSIM_SKIP_DRAG,
  MS_HAS_PLANES = MSIM_SKIP_PLANES,              /* or colliders */
  MS_HAS_DIRECTIONS = MSIM_SKIP_ZERO_REST_LENGTH /* forces depend on the directions of springs */
};

struct ms_law_springs;
struct ms_single;
struct ms_rank_model;
struct ms_force_function;

typedef struct ms_model {
  const ms_scene *scene;
  ms_unknowns unknowns;
  ms_springs springs;
  ms_half_edges half_edges; /* the same springs as half-edges */
  ms_shape shape;           /* of the unknowns, in vectors of doubles */
  ms_shape state_shape;     /* of a stepper's vectors: likewise, or of pairs of floats (single) */
  double *mass, *inv_mass;  /* first_pinned, kg, 1/kg: of the unknowns; padding: 1, 0 */
  int32_t *sharers;         /* how many models have these unknowns, springs, half-edges, angular
                               springs and masses (ms_model_create_like) */
  ms_external external;     /* the scene's */
  struct ms_law_springs *laws; /* springs with a law (law_springs.h); NULL: there are none */
  ms_angles angles;            /* angular springs (angle_springs.h) */
  double *force;               /* a vector: the constant forces on particles, N; NULL: none */
  struct ms_force_function *function; /* of the program (force_function.h); NULL: none */
  double *base_force;          /* a vector: `force`, with a function the sum of both; NULL: none */
  double *added_force;         /* a vector that force sweeps add: base_force, the forces of springs
                                  on split rows, of laws and of angular springs; base_force itself
                                  without them */
  int isa;                     /* of the kernels: ms_isa_choose() */
  ms_pool *pool;               /* the sim's; NULL: one thread */
  unsigned features;           /* MS_HAS_... */
  struct ms_moving_pins *pins; /* moving_pins.h; NULL: no pinned particle moves */
  ms_solid *moving_solids;     /* ncolliders: room for the colliders at an instant */
  struct ms_single *single;    /* single.h; NULL: steps compute in double precision */
  struct ms_rank_model *rank_model; /* rank_model.h; NULL: one process computes all unknowns */
} ms_model;

/* The model of an island. skip_off: features to compute in any case. left_out: the axis without a
 * component; -1: none. */
msim_status ms_model_create_island(const ms_scene *scene, const ms_island *island, int32_t left_out,
                                   unsigned skip_off, ms_model *model, msim_error *err);

/* Another model of the same island, with the same unknowns, springs, half-edges, angular springs
 * and masses in the same memory, which the last of these models frees. While there are several,
 * springs must keep their values, and one of the models computes at a time. */
msim_status ms_model_create_like(const ms_model *other, unsigned skip_off, ms_model *model,
                                 msim_error *err);

/* The whole scene as one island, with 2 components if it is planar. */
msim_status ms_model_create(const ms_scene *scene, unsigned skip_off, ms_model *model,
                            msim_error *err);

/* The same particles with some of the springs, those of `springs`, whose `row` is scratch. Shares
 * rows and masses with the whole, which must outlive it. */
msim_status ms_model_create_subset(const ms_model *whole, const ms_island *springs,
                                   unsigned skip_off, ms_model *part, msim_error *err);
void ms_model_destroy_subset(ms_model *part);

/* Copy gravity, drag and constant forces from the scene again. Fails, and changes nothing, only
 * where a scene has constant forces and the one before had none. */
msim_status ms_model_update_forces(ms_model *model, unsigned skip_off, msim_error *err);

/* The constant force of a row over its mass (m/s^2), 0 without */
double ms_model_force_acceleration(const ms_model *model, int32_t row);

/* Remove gravity, drag, constant forces and planes. */
void ms_model_keep_springs_only(ms_model *model);

/* Copy k, rest and damping from the scene again, and find the features anew. */
void ms_model_update_springs(ms_model *model, unsigned skip_off);
void ms_model_destroy(ms_model *model);

#endif
