/* truth - where a scene really comes to, and how well that is known
 *
 * The error of an end x, as everywhere in this bench:
 *   sqrt(sum m_i |x_i - x*_i|^2 / sum m_i) / D, x* the truth,
 *   D the largest of sqrt(sum m_i |x_i(t) - x_i(0)|^2 / sum m_i) in the run: the scene's motion.
 *
 * x* is dop853's. Beside it runs another family, rkn6, or rk4 where forces depend on velocities;
 * both halve their steps until they agree, or time is up. The error that x* may have is the larger
 * of what they differ by and of what halving changed. */
#ifndef BENCH_TRUTH_H
#define BENCH_TRUTH_H

#include "precision_scenes.h"
#include "trial.h"

typedef struct truth {
  const precision_scene *kind;
  msim_scene *scene;
  msim_scene_view view;
  msim_sim *judge;       /* tells energies and forces */
  double t_end, limit;   /* s; limit: the longest stable step of Verlet */
  double motion, speed;  /* D, m; the largest root mean square of v, m/s */
  double extent;         /* m: longest side of the box around all particles, at the start */
  double kinetic;        /* the largest in the run, J */
  double mass, *inverse; /* of all particles, kg; 1/m of 3n coordinates, 0 where pinned */
  ending end;            /* x* */
  msim_energy energy;    /* there */
  const char *other;     /* the method beside dop853 */
  int64_t steps;         /* of both */
  double error;          /* that x* may have */
  double growth;         /* of a disturbance of 1e-10 D until the end */
  msim_error err;
} truth;

/* seconds: that it may take. 0 where it failed, and why in t->err. Call truth_free in any case. */
int truth_find(const precision_scene *kind, int quick, int32_t threads, double seconds,
               double until, truth *t);
void truth_free(truth *t);

/* The errors of an end: of its positions; of its energy, over the largest kinetic energy; of its
 * momentum, over that of all mass at the largest speed. */
typedef struct verdict {
  double error, energy, momentum;
} verdict;

verdict truth_judge(const truth *t, const double *x, const double *v);

/* Whether an error can be told apart from that of the truth; whether claims of such an error can
 * be made, as disturbances grow. */
int truth_can_tell(const truth *t, double error);
int truth_allows(const truth *t, double claim);

#endif
