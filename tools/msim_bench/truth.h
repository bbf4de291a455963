/* truth - the reference solution of a scene, and an estimate of its error
 *
 * The error of a final state x, everywhere in this benchmark:
 *   sqrt(sum m_i |x_i - x*_i|^2 / sum m_i) / D, x* the reference solution,
 *   D the maximum over the run of sqrt(sum m_i |x_i(t) - x_i(0)|^2 / sum m_i), the scene's motion.
 *
 * x* is that of dop853. rkn6, or rk4 if forces depend on velocities, runs for comparison; both
 * halve their steps until they agree or the time is up. The estimated error of x* is the larger of
 * their difference and the change by halving. */
#ifndef BENCH_TRUTH_H
#define BENCH_TRUTH_H

#include "precision_scenes.h"
#include "trial.h"

typedef struct truth {
  const precision_scene *kind;
  msim_scene *scene;
  msim_scene_view view;
  msim_sim *judge;       /* computes energies and forces */
  double t_end, limit;   /* s; limit: longest stable step of velocity Verlet */
  double motion, speed;  /* D, m; maximum over the run of the root mean square of v, m/s */
  double extent;         /* m: longest side of the bounding box at the start */
  double kinetic;        /* maximum over the run, J */
  double mass, *inverse; /* total, kg; 1/m of 3n coordinates, 0 for pinned particles */
  ending end;            /* x* */
  msim_energy energy;    /* of the final state */
  const char *other;     /* the method that x* is compared with */
  int64_t steps;         /* of both */
  double error;          /* estimated, of x* */
  double growth;         /* of a disturbance of 1e-10 D until the end */
  msim_error err;
} truth;

/* seconds: time limit. Returns 0 on failure and sets t->err. Call truth_free in any case. */
int truth_find(const precision_scene *kind, int quick, int32_t threads, double seconds,
               double until, truth *t);
void truth_free(truth *t);

/* Errors of a final state: of the positions; of the energy, relative to the largest kinetic energy;
 * of the momentum, relative to the total mass times the largest speed. */
typedef struct verdict {
  double error, energy, momentum;
} verdict;

verdict truth_judge(const truth *t, const double *x, const double *v);

/* Whether an error can be measured against x*; whether results at such an error are meaningful, as
 * disturbances grow. */
int truth_can_tell(const truth *t, double error);
int truth_allows(const truth *t, double claim);

#endif
