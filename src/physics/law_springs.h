/* law_springs - the springs of an island that have a law: what they add to forces, matrix and
 * energies
 *
 * The loops over half-edges treat them as springs with k = 0, of which only the damping acts; so
 * linear springs need no instruction more. The springs with a law are sorted by law and evaluated
 * in batches of one law (law.h), in fixed order; then each row adds what its own ones contribute.
 * Both ends of a spring get the same numbers. */
#ifndef MS_LAW_SPRINGS_H
#define MS_LAW_SPRINGS_H

#include "physics/force.h"
#include "physics/law.h"

/* Up to MS_LAW_BATCH springs of one law, in the slots [begin, end). All runs begin at multiples of
 * MS_SLICE, so that kernels process whole registers; the slots between two runs hold no spring. */
typedef struct ms_law_run {
  const ms_law *law; /* of the scene */
  int32_t begin, end;
} ms_law_run;

/* One end of a spring at an unknown */
typedef struct ms_law_end {
  int32_t slot;      /* of the spring */
  int32_t half_edge; /* its half-edge there */
  double sign;       /* 1 at the first particle of the spring, -1 at the second one */
} ms_law_end;

struct ms_law_springs {
  int32_t nslots, nruns, nrows;
  int32_t nsingle; /* rows of one end that are not split */
  int in_sweep;    /* 1: without damping the sweep over half-edges computes all forces of springs,
                      with the bits of ms_law_springs_add_forces: all have linear laws, and there
                      are neither split rows nor angular springs */
  ms_law_run *run;
  int32_t *i, *j;   /* nslots: rows of the ends; 0 between runs */
  int32_t *spring;  /* nslots: index in ms_springs */
  double *k, *rest; /* nslots; k: 0 where broken */
  uint8_t *broken;  /* nslots: 1 where a spring is broken; NULL: none can break */
  int has_limits;   /* 1: `limit` is that of the present springs */
  double *limit;   /* nslots, m: a spring up to this length does not break (law_breaking.h); DBL_MAX
                       where broken or between runs; NULL: none can break */
  double *seen;    /* a vector: the positions at which all springs were last tested */
  double slack;    /* m: all were shorter than their limits by this there; <= 0: unknown */
  double *scratch; /* 3 nslots: the forces on the first ends, by components; or t, g of springs */
  double *sum;     /* nruns: energies of the runs: scratch */
  int32_t *row;    /* nrows: the unknowns with such springs, single ones first, both ascending */
  int32_t *first;  /* nrows + 1: their first ends */
  ms_law_end *end;
};

/* NULL if no spring of the model has a law. */
msim_status ms_law_springs_create(const ms_model *model, struct ms_law_springs **laws,
                                  msim_error *err);
void ms_law_springs_destroy(const ms_scene *scene, struct ms_law_springs *laws);

/* Copy k and rest from the scene again, after it was replaced by one with the same laws. */
void ms_law_springs_update(const ms_model *model);

/* 1: the sweep over half-edges at velocities v (nullable) is to compute the forces of laws. */
static inline int ms_law_springs_are_in_sweep(const ms_model *model, const double *v) {
  return model->laws && model->laws->in_sweep && !(v && (model->features & MS_HAS_DAMPING));
}

/* These need model->laws. Set the rows of model->added_force with such springs: to their elastic
 * forces at x, added to the sums of split rows and to model->base_force elsewhere. */
void ms_law_springs_add_forces(const ms_model *model, const double *x);

/* Add their part of the matrix, of step h, to half-edges and diagonal blocks of `a` (force.h):
 *   t = h^2 f/l,  g = h^2 max(0, f' - f/l)/l^2;  clamp: with max(0, f/l) and max(0, f');
 * where l = 0, t = h^2 f', g = 0. So the stiffness along a spring that softens below f/l is f/l:
 * solvers rely on g >= 0. The matrix is larger than the exact one then, and Newton's method
 * converges linearly. */
void ms_law_springs_add_matrix(const ms_model *model, double h, int clamp, ms_coefficients *a);

/* The sum of their elastic energies at x */
double ms_law_springs_energy(const ms_model *model, const double *x);

/* The sum of E(|e + q|) - E(|e|) - f u.q, e = x_j - x_i, q = s (d_j - d_i): see nonlinearity.h */
double ms_law_springs_nonlinearity(const ms_model *model, const double *x, const double *d,
                                   double s);

#endif
