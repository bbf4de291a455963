/* Runs one cell and classifies its outcome from what the public API returns in each step. */
#define _POSIX_C_SOURCE 200809L /* fork, kill */
#include <float.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "stress.h"

enum { ALLOWED = 100 };

const char *const stress_words[STRESS_OUTCOMES] = {"stable", "bounded", "dissipated", "reported",
                                                   "silent", "crash",   "hang",       "refused"};

/*------------------------------------- bounds ---------------------------------------------------*/

/* A run is SILENT if its status is ok although its energy or its extent exceeded 100 times these
 * bounds at some step, which hold because no motion is prescribed:
 *   K + E <= S = K0 + E0 + S_min + max(0, sum m g.(x - x0)),  L <= L0 + 2 t sqrt(2 S/m_least)
 * K, E: kinetic and elastic energy; L: extent. No particle is faster than the lightest one with all
 * of S. S_min is for scenes that start with little energy, see least_supply.
 *
 * The energy monitor of the library uses the same bounds, so that both agree on what is unstable,
 * but this code is independent of it: it sums energies over particles and springs from the states
 * that a caller gets, checks every step, not one in 160, uses the present work of gravity, not the
 * largest so far, and lets NAN exceed all bounds. A state that is returned with a report is checked
 * as well, by the largest S so far. */

typedef struct motion_sums {
  double motion;       /* kinetic and elastic energy, J */
  double gravity_work; /* sum m g.x, J */
  double extent;       /* of the free particles, m; INFINITY: not a number */
} motion_sums;

typedef struct run_bounds {
  msim_scene_view view;
  motion_sums first;
  double supply, extent, least; /* S without the work of gravity, J; L0, m; m_least, kg */
  double most;                  /* the largest (K + E)/S */
  double most_supply;           /* the largest S, J */
} run_bounds;

static double dot3(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double stretch_of(const msim_scene_view *s, int32_t e, const double *x) {
  const double *a = x + 3 * s->ij[2 * e], *b = x + 3 * s->ij[2 * e + 1];
  const double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  return sqrt(dot3(d, d)) - s->rest[e];
}

static motion_sums sum_motion(const msim_scene_view *s, const double *x, const double *v) {
  motion_sums l = {0};
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (s->pinned[p]) continue;
    l.motion += s->mass[p] * dot3(v + 3 * p, v + 3 * p) / 2;
    l.gravity_work += s->mass[p] * dot3(s->gravity, x + 3 * p);
    for (int32_t q = 0; q < p; q++)
      for (int c = 0; c < 3 && !s->pinned[q]; c++) {
        const double apart = fabs(x[3 * p + c] - x[3 * q + c]);
        l.extent = fmax(l.extent, isnan(apart) ? INFINITY : apart);
      }
  }
  for (int32_t e = 0; e < s->nsprings; e++) l.motion += s->k[e] * pow(stretch_of(s, e, x), 2) / 2;
  return l;
}

/* S_min = M g (fall + g h^2) + sum k d^2/2: a fall through the scene or down to a plane, and of one
 * step; d = sqrt(eps) max |x| + 2 depth: springs stretched by rounding, or by a plane that moves
 * particles behind it to the other side. */
static double least_supply(const msim_scene_view *s, double extent, double h) {
  const double g = sqrt(dot3(s->gravity, s->gravity));
  double mass = 0, k = 0, far = 0, fall = extent, depth = 0;
  for (int32_t e = 0; e < s->nsprings; e++) k += s->k[e];
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (!s->pinned[p]) mass += s->mass[p];
    for (int c = 0; c < 3; c++) far = fmax(far, fabs(s->x[3 * p + c]));
    for (int32_t i = 0; i < s->nplanes; i++) {
      const double above = dot3(s->planes[i].normal, s->x + 3 * p) - s->planes[i].offset;
      fall = fmax(fall, above), depth = fmax(depth, -above);
    }
  }
  const double d = sqrt(DBL_EPSILON) * far + 2 * depth;
  return mass * g * (fall + g * h * h) + k * d * d / 2;
}

static run_bounds make_run_bounds(const msim_scene *scene, double h) {
  run_bounds j = {.view = {.size = sizeof j.view}, .least = INFINITY};
  msim_scene_get(scene, &j.view);
  const msim_scene_view *s = &j.view;
  j.first = sum_motion(s, s->x, s->v);
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (!s->pinned[p]) j.least = fmin(j.least, s->mass[p]);
    for (int32_t q = 0; q < p; q++)
      for (int c = 0; c < 3; c++)
        j.extent = fmax(j.extent, fabs(s->x[3 * p + c] - s->x[3 * q + c]));
  }
  j.supply = j.first.motion + least_supply(s, j.extent, h);
  return j;
}

static double supply_at(const run_bounds *j, const motion_sums *now) {
  return j->supply + fmax(0, now->gravity_work - j->first.gravity_work);
}

static int is_beyond(const run_bounds *j, const motion_sums *now, double t, double supply) {
  const double reach = j->extent + 2 * t * sqrt(2 * supply / j->least);
  return !(now->motion <= ALLOWED * supply && now->extent <= ALLOWED * reach);
}

/*------------------------------------- one cell -------------------------------------------------*/

/* REPORTED: the run ended with a status that names the step, and a state within the bounds.
 * Without a status, and if the bounds held: DISSIPATED if K + E - sum m g.x fell by more than a
 * tenth of the initial S, BOUNDED if K + E exceeded 1.1 S, else STABLE. */
static stress_result classify_run(msim_sim *sim, run_bounds *j, int64_t steps) {
  stress_result r = {.outcome = STABLE, .detection_steps = -1};
  msim_state state = {.size = sizeof state};
  msim_error err;
  msim_status status = MSIM_OK;
  motion_sums last = j->first;
  int64_t step = 0, passed = -1; /* the first step beyond the bounds; -1: none */
  int beyond = 0;
  while (step < steps && !status) {
    status = msim_sim_step(sim, 1, &err);
    step++;
    msim_sim_state(sim, &state);
    last = sum_motion(&j->view, state.x, state.v);
    const double supply = supply_at(j, &last);
    j->most = fmax(j->most, last.motion / supply);
    j->most_supply = fmax(j->most_supply, supply);
    beyond = is_beyond(j, &last, state.t, status ? j->most_supply : supply);
    if (beyond && passed < 0 && !status) passed = state.step;
  }
  const double before = j->first.motion - j->first.gravity_work,
               after = last.motion - last.gravity_work;
  if (status) {
    r.outcome = strstr(err.text, "step ") && !beyond ? REPORTED : SILENT;
    snprintf(r.text, sizeof r.text, "%.200s", err.text);
    if (passed >= 0) r.detection_steps = step - passed;
  } else if (passed >= 0) {
    r.outcome = SILENT;
    snprintf(r.text, sizeof r.text, "bounds exceeded at step %lld without a report",
             (long long)passed);
  } else if (after < before - 0.1 * j->supply) r.outcome = DISSIPATED;
  else if (j->most > 1.1) r.outcome = BOUNDED;
  return r;
}

static stress_result make_and_run(const stress_scene *s, const char *method, double h,
                                  int64_t steps, int watch) {
  stress_result r = {.outcome = UNSUPPORTED, .detection_steps = -1};
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_error err;
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.h = h, opt.steps = steps, opt.threads = 1, opt.watch = watch;
  if (stress_make(s, &scene, &err) == MSIM_OK &&
      msim_sim_create(scene, &opt, &sim, &err) == MSIM_OK) {
    run_bounds j = make_run_bounds(scene, h);
    r = classify_run(sim, &j, steps);
  } else snprintf(r.text, sizeof r.text, "%.200s", err.text);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return r;
}

stress_result stress_run(const stress_scene *s, const char *method, double h, int64_t steps,
                         int watch, unsigned seconds) {
  stress_result r = {.outcome = CRASHED, .detection_steps = -1};
  int ends[2], state = 0;
  fflush(NULL);
  if (pipe(ends) != 0) return r;
  const pid_t child = fork();
  if (child == 0) {
    signal(SIGALRM, SIG_DFL);
    alarm(seconds);
    const stress_result mine = make_and_run(s, method, h, steps, watch);
    const ssize_t written = write(ends[1], &mine, sizeof mine);
    _exit(written != (ssize_t)sizeof mine);
  }
  close(ends[1]);
  const ssize_t got = child > 0 ? read(ends[0], &r, sizeof r) : 0;
  close(ends[0]);
  if (child > 0) waitpid(child, &state, 0);
  if (got == (ssize_t)sizeof r && WIFEXITED(state)) return r;
  r.outcome = WIFSIGNALED(state) && WTERMSIG(state) == SIGALRM ? HUNG : CRASHED;
  return r;
}
