/* single - what a model needs for steps in single precision: springs and masses as floats, and the
 * origin of positions
 *
 * The vectors of a stepper then have floats (ms_model.state_shape), positions as x - origin. The
 * origin is the middle of the island at the start of a run, so that the distance of a scene from
 * that of its coordinates costs no digits. Functions that read a state get it as doubles from here,
 * and steps do not depend on them. Sums (energies, time) are doubles.
 *
 * Sums x + h v and v + h a keep what floats lose of them (vector.h), which costs 6 % of a step:
 * without that, a fall was measured to be off by 1e-4 after 1e4 steps, and in proportion to their
 * number. Forces are computed from the floats of x and v alone. */
#ifndef MS_SINGLE_H
#define MS_SINGLE_H

#include "base/archive.h"
#include "physics/model.h"

typedef struct ms_single {
  /* k, k L/2 and c/4, as kernels multiply by 2/l, in the order of half_edges.k; padding: 0 */
  float *k, *half_k_rest, *quarter_damping;
  size_t room;              /* of these arrays */
  float *mass, *inv_mass;   /* first_pinned; padding: 1, 0 */
  double origin[3];         /* m */
  double *x, *v, *x_before; /* room for vectors of doubles; x_before: only with MS_HAS_PLANES */
} ms_single;

/* Make a new model compute in single precision. */
msim_status ms_single_create(ms_model *model, msim_error *err);
void ms_single_destroy(const ms_scene *scene, ms_single *single);

/* MSIM_ERR_ARG: a mass of the scene, or one of these springs, is beyond what steps in floats can
 * compute with. Nullable: k, rest, damping. */
msim_status ms_single_check_scene(const ms_scene *scene, msim_error *err);
msim_status ms_single_check_springs(int32_t n, const double *k, const double *rest,
                                    const double *damping, msim_error *err);

/* Copy k, rest and damping from the half-edges again; before, make room for as many as these have
 * room for. On failure nothing changes. */
void ms_single_update_springs(ms_model *model);
msim_status ms_single_reserve_springs(ms_model *model, msim_error *err);

/* The functions below are for models of both precisions. */

/* Transfer what steps change beside the vectors: the origin. */
void ms_single_archive(ms_archive *b, ms_single *single);

/* Set the origin for positions x (n x 3, in particle order). */
void ms_single_set_origin(const ms_model *model, const double *x);

/* Positions and velocities, from arrays in particle order to vectors of a stepper */
void ms_single_gather_x(const ms_model *model, const double *array, void *vec);
void ms_single_gather_v(const ms_model *model, const double *array, void *vec);

/* Positions and velocities of a stepper as vectors of doubles: `vec` itself, or in single precision
 * a copy that lasts until the next call */
const double *ms_single_get_x(const ms_model *model, const void *vec);
const double *ms_single_get_v(const ms_model *model, const void *vec);

/* a - b of positions, or of velocities, as a vector of doubles: in `to`, or in single precision
 * likewise */
const double *ms_single_subtract_x(const ms_model *model, const void *a, const void *b, double *to);
const double *ms_single_subtract_v(const ms_model *model, const void *a, const void *b, double *to);

/* f = s M a for the result `a` of a force sweep, as a vector of doubles; and such a vector as one
 * that a stepper adds to its sums: itself, or in single precision rounded, in `to` */
void ms_single_weigh(const ms_model *model, double s, const void *a, double *f);
const void *ms_single_round(const ms_model *model, const double *vec, void *to);

/* For models in single precision: the unknowns likewise to a vector of the caller; and back to the
 * stepper the numbers of single->x and v that differ from its own */
void ms_single_widen_x(const ms_model *model, const void *vec, double *to);
void ms_single_widen_v(const ms_model *model, const void *vec, double *to);
void ms_single_take_changes(const ms_model *model, void *x, void *v);

#endif
