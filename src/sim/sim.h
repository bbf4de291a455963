/* sim - one scene in motion: its plan, its state, its method, and what watches it */
#ifndef MS_SIM_H
#define MS_SIM_H

#include <stdatomic.h>
#include <string.h>

#include "integrate/control.h"
#include "scene/options.h"
#include "sim/advice.h"
#include "sim/marks.h"
#include "sim/plan.h"
#include "sim/select.h"
#include "sim/sensitivity.h"
#include "sim/watch.h"

/* One island in motion. Nothing couples it with others. */
typedef struct ms_motion {
  ms_model model;
  ms_stepper stepper; /* its solver: NULL where the method needs none */
  int at_rest;        /* the last step changed no bit, and no step to come will */
  int at_rest_next;   /* the same of the step that is being made */
  int by_one;         /* one thread steps it, while others step others */
  msim_stats stats;   /* by_one: what that has counted, until it is added to the sim's */
  msim_status status; /* by_one: of the step that is being made */
  ms_norm norm;       /* under error control */
  double error;       /* of the step that is being made, over what is allowed */
  ms_guard guard;
  ms_check check;
  ms_disturbance disturbance;
} ms_motion;

struct msim_sim {
  msim_allocator alloc;
  ms_scene *scene;            /* shared */
  ms_scene *chosen_for;       /* whose springs its solvers were chosen for; NULL: this scene's */
  msim_options opt;           /* its strings are the sim's own */
  char *solver, *plugin_path; /* what opt's pointers point to; nullable */
  ms_plan plan;
  ms_advice advice;
  ms_selection selection;  /* of the method, by integrator = auto */
  ms_pool *pool;           /* NULL: one thread */
  int32_t threads_planned; /* more than the pool has where not all could be started */
  const ms_integrator *integrator;
  msim_stats stats;
  atomic_int stop;

  int64_t step, step0; /* t = t0 + (step - step0) h, but under error control, which has: */
  double t0;
  ms_control control;
  double t, t_lost; /* the sum of all steps, and what rounding took from it */
  double t_shown;   /* of the state that is looked at: t, or within the last step */
  int64_t frame;    /* that msim_sim_run shows next, where frames are at times of their own */
  int64_t spent;    /* steps that msim_sim_set_step took off opt.steps */

  int32_t nislands;  /* at least 1 */
  ms_motion *motion; /* nislands: replaced where the components of space are others */
  int any_by_one;    /* 1: some are stepped at the same time */

  uint64_t marks[MS_SCENE_MARKS]; /* of its scene, once they were asked for: see marks.h */
  int is_marked;

  double *flat_x, *flat_v, *flat_v_half; /* 3n: what somebody asked for last */
  int flat_is_current;

  ms_watch watch;
  ms_sensitivity sensitivity;

  ms_text explanation;
  struct ms_whole *whole; /* for msim_sim_matrix; NULL: nobody asked */
};

/* A plain struct, as much of it as the caller's has room for. */
#define MS_GIVE(to, full) \
  memcpy(to, &(full), (full).size < sizeof(full) ? (full).size : sizeof(full))

/* Steps are as long as their error allows. */
static inline int ms_sim_has_control(const msim_sim *sim) { return sim->opt.tol > 0; }

/* Of integrator = auto */
static inline int ms_sim_selects(const msim_sim *sim) { return sim->selection.tol > 0; }

/* The time of the present state, as it is looked at. */
double ms_sim_time(const msim_sim *sim);

/* Make models, solvers and vectors anew, without components along the axis left_out (-1: none);
 * keeps the old ones where that fails. The state is yet to be set. */
msim_status ms_sim_build(msim_sim *sim, int32_t left_out, msim_error *err);

/* What that replaces. */
typedef struct ms_motions {
  int32_t n;
  ms_motion *motion;
  int any_by_one;
} ms_motions;

/* The same step by step: put the old ones aside, make new ones, then drop the old ones, or drop
 * the new ones, half built too, and put the old ones back. */
ms_motions ms_sim_put_aside(msim_sim *sim);
msim_status ms_sim_make_motions(msim_sim *sim, int32_t left_out, msim_error *err);
void ms_sim_drop(msim_sim *sim, const ms_motions *old);
void ms_sim_put_back(msim_sim *sim, const ms_motions *old);

/* Solvers are chosen for the springs of that scene from here on, whose reference is taken; NULL:
 * for those that are there. */
void ms_sim_choose_for(msim_sim *sim, ms_scene *scene);

/* The scene becomes the sim's, and models are as its springs are; no reference changes. */
void ms_sim_use_scene(msim_sim *sim, ms_scene *scene);

/* The same again, in the present state. */
msim_status ms_sim_rebuild(msim_sim *sim, msim_error *err);

/* Does the method allow such springs in this scene? damping: one a spring. */
msim_status ms_sim_check_forces(const msim_sim *sim, const double *damping, msim_error *err);

/* Free them; what is half built too. */
void ms_sim_take_down(msim_sim *sim);

/* The island of most free particles, and of those the first: it stands for all where one has to. */
const ms_motion *ms_sim_largest(const msim_sim *sim);

/* Forget the matrix that somebody looked at. */
void ms_sim_drop_matrix(msim_sim *sim);

/* One sentence to who listens. */
void ms_sim_warn(const msim_sim *sim, const char *format, ...) MS_PRINTF(2, 3);

/* A run from that state on, which is good. */
msim_status ms_sim_start(msim_sim *sim, const msim_state *state, msim_error *err);

/* Let the islands start in that state, as it is planned. */
void ms_sim_start_islands(msim_sim *sim, const msim_state *state);

/* Planes count from here on: a method for impacts is chosen in the present state, whose steps
 * divide those that are planned; under error control the method stays. */
msim_status ms_sim_meet_planes(msim_sim *sim, msim_error *err);

/* Plan the run from t0 and x, v (flat 3n) on; keeps the old plan where that fails. */
msim_status ms_sim_make_plan(msim_sim *sim, double t0, const double *x, const double *v,
                             msim_error *err);

/* Seconds spent on output belong to the sim's stats. */
void ms_sim_count_output(msim_sim *sim, double seconds);

#endif
