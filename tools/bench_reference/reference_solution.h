/* reference_solution - the reference solution of a scene, and an estimate of its error
 *
 * The error of a final state x, everywhere in this benchmark:
 *   sqrt(sum m_i |x_i - x*_i|^2 / sum m_i) / D, x* the reference solution,
 *   D the maximum over the run of sqrt(sum m_i |x_i(t) - x_i(0)|^2 / sum m_i), the scene's motion.
 *
 * x* is that of dop853. rkn6, or rk4 if forces depend on velocities, runs for comparison; both
 * halve their steps until they agree or the time is up. The estimated error of x* is the larger of
 * their difference and the change by halving. */
#ifndef BENCH_REFERENCE_SOLUTION_H
#define BENCH_REFERENCE_SOLUTION_H

#include "scene_run.h"

typedef struct reference_solution {
  const msim_scene *scene;
  msim_scene_view view;
  msim_sim *sim;                 /* computes energies and forces */
  int impacts;                   /* particles hit planes */
  double t_end, limit;           /* s; limit: longest stable step of velocity Verlet */
  double motion, speed;          /* D, m; maximum over the run of the root mean square of v, m/s */
  double extent;                 /* m: longest side of the bounding box at the start */
  double kinetic;                /* maximum over the run, J */
  double mass;                   /* total, kg */
  run_result end;                /* x* */
  msim_energy energy;            /* of the final state */
  const char *comparison_method; /* the method that x* is compared with */
  int64_t steps;                 /* of both */
  double error;                  /* estimated, of x* */
  double growth;                 /* of a disturbance of 1e-10 D until the end */
  msim_error err;
} reference_solution;

/* Of a scene that outlives t. impacts: particles hit planes; damped: forces depend on velocities;
 * seconds: time limit. Returns 0 on failure and sets t->err. Call reference_solution_free in any
 * case. */
int reference_solution_compute(const msim_scene *scene, double t_end, int impacts, int damped,
                               int32_t threads, double seconds, double until,
                               reference_solution *t);
void reference_solution_free(reference_solution *t);

/* Errors of a final state: of the positions; of the energy, relative to the largest kinetic energy;
 * of the momentum, relative to the total mass times the largest speed. */
typedef struct solution_errors {
  double error, energy, momentum;
} solution_errors;

solution_errors reference_solution_errors(const reference_solution *t, const double *x,
                                          const double *v);

/* Whether an error can be measured against x*; whether results at such an error are meaningful, as
 * disturbances grow. */
int reference_solution_resolves(const reference_solution *t, double error);
int reference_solution_supports(const reference_solution *t, double claim);

#endif
