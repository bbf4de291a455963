#include "sim/watch.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec3.h"
#include "integrate/history.h"
#include "sim/sim.h"

/* The multiple of the bounds that is allowed, and the number of explicit steps between checks */
enum { ALLOWED = 100, INTERVAL = 160 };

static int is_on(const msim_sim *sim) { return sim->opt.watch == MSIM_WATCH_ON; }

msim_status ms_watch_create(const msim_sim *sim, const ms_model *model, ms_guard *guard,
                            msim_error *err) {
  if (!is_on(sim)) return MSIM_OK;
  double **vectors[] = {&guard->kept.x, &guard->kept.v, &guard->last.x, &guard->last.v};
  int there = 1;
  for (int i = 0; i < 4; i++)
    there &= (*vectors[i] = ms_rows_vector(sim->scene, &model->rows)) != NULL;
  guard->parts = ms_new(&sim->alloc, (size_t)ms_totals_parts(model), sizeof *guard->parts);
  return there && guard->parts ? MSIM_OK : ms_fail_memory(err, "the state to keep");
}

void ms_watch_destroy(const ms_model *model, ms_guard *guard) {
  if (!model->scene) return;
  void *arrays[] = {guard->kept.x, guard->kept.v, guard->last.x, guard->last.v, guard->parts};
  for (int i = 0; i < 5; i++) ms_delete(&model->scene->alloc, arrays[i]);
}

/*------------------------------------- measuring ------------------------------------------------*/

static double time_of(const msim_sim *sim) {
  return ms_sim_has_control(sim) ? sim->t : ms_sim_time(sim);
}

/* Sum over all free particles in the present state. Islands that stay at rest have not changed. */
static ms_totals measure(msim_sim *sim) {
  ms_totals sum = ms_totals_none();
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    ms_guard *g = &m->guard;
    if (!(m->at_rest && g->at_rest))
      g->totals = ms_totals_compute(&m->model, m->stepper.x, m->stepper.v, &g->last, g->parts);
    ms_totals_add(&g->totals, &sum);
  }
  return sum;
}

static double extent_of(const ms_totals *t) {
  double extent = 0;
  for (int c = 0; c < 3; c++) extent = fmax(extent, t->high[c] - t->low[c]);
  return extent;
}

/* The bounds in the present state; `most` is kept if that state is good. */
typedef struct bounds {
  double supply, extent;
  double most; /* the largest energy bound so far */
} bounds;

static bounds bounds_at(const msim_sim *sim, const ms_totals *now) {
  const ms_watch *w = &sim->watch;
  const double work = ms_dot3(sim->scene->gravity, now->moment) - w->work;
  const double supply = w->energy + fmax(0, work), most = fmax(w->supply, supply);
  const double speed = w->least > 0 ? sqrt(2 * most / w->least) : 0;
  return (bounds){supply, w->extent + 2 * (time_of(sim) - w->t0) * speed, most};
}

static int is_good(const ms_totals *now, const bounds *b) {
  return now->kinetic + now->elastic <= ALLOWED * b->supply &&
         !(extent_of(now) > ALLOWED * b->extent);
}

int ms_watch_is_due(const msim_sim *sim) {
  if (!is_on(sim)) return 0;
  if (sim->integrator->entry.implicit || sim->step % INTERVAL == 0) return 1;
  if (ms_sim_has_control(sim)) return sim->t == sim->plan.t_end;
  return sim->step - sim->step0 == sim->plan.steps;
}

/*------------------------------------- starting -------------------------------------------------*/

/* Properties of a scene in a state */
typedef struct facts {
  double mass, least; /* of all free particles and of the lightest one, kg */
  double farthest;    /* the largest |coordinate|, m */
  double height;      /* of the particle highest above a plane, m */
  double depth;       /* of the particle farthest behind a plane, m */
  double stiffness;   /* the sum of all k, N/m */
} facts;

/* Take a particle into account; of a pinned one only the position counts. */
static void look_at_particle(const ms_scene *s, int32_t p, const double x[3], facts *f) {
  for (int c = 0; c < 3; c++) f->farthest = fmax(f->farthest, fabs(x[c]));
  if (s->pinned[p]) return;
  f->mass += s->mass[p];
  f->least = f->least > 0 ? fmin(f->least, s->mass[p]) : s->mass[p];
  for (int32_t i = 0; i < s->nplanes; i++) {
    const double above = ms_dot3(s->planes[i].normal, x) - s->planes[i].offset;
    f->height = fmax(f->height, above), f->depth = fmax(f->depth, -above);
  }
}

/* box: that of the free particles; on return it contains pinned ones, too */
static facts look_at_scene(const msim_sim *sim, ms_totals *box) {
  const ms_scene *s = sim->scene;
  facts f = {0};
  for (const ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++)
    for (int32_t r = 0; r < m->model.rows.nfree; r++) {
      double x[3];
      ms_row_get(&m->model.rows, m->stepper.x, r, x);
      look_at_particle(s, m->model.rows.particle[r], x, &f);
    }
  for (int32_t p = 0; p < s->nparticles; p++) {
    const double *x = s->x + 3 * (size_t)p;
    ms_totals one = {.low = {x[0], x[1], x[2]}, .high = {x[0], x[1], x[2]}};
    if (!s->pinned[p]) continue;
    look_at_particle(s, p, x, &f);
    ms_totals_add(&one, box);
  }
  for (int32_t e = 0; e < s->nsprings; e++) f.stiffness += s->k[e];
  return f;
}

/* 1: the tag `warm` may be restored with a kept state. Methods with other variables than x and v
 * set it only in the state that a run started from, for work vectors that no step overwrites. Tags
 * of other methods refer to vectors that steps overwrite. */
static int notes_start(const msim_sim *sim) {
  return sim->integrator->show || sim->integrator->sync;
}

static int start_note(const msim_sim *sim, const ms_stepper *s) {
  return notes_start(sim) ? s->warm : 0;
}

static void keep(msim_sim *sim) {
  ms_watch *w = &sim->watch;
  w->step = sim->step;
  w->t = sim->t, w->t_lost = sim->t_lost, w->control = sim->control;
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    ms_guard *g = &m->guard;
    if (m->at_rest && g->at_rest) continue;
    const ms_totals_copy between = g->kept;
    g->kept = g->last, g->last = between;
    g->h_before = m->stepper.h_before;
    g->warm = start_note(sim, &m->stepper);
    g->at_rest = m->at_rest;
  }
}

void ms_watch_start(msim_sim *sim) {
  if (!is_on(sim)) return;
  ms_watch *w = &sim->watch;
  const double *g3 = sim->scene->gravity, g = ms_norm3(g3), h = sim->plan.h;
  for (int32_t i = 0; i < sim->nislands; i++) sim->motion[i].guard.at_rest = 0;
  ms_totals now = measure(sim);
  const facts f = look_at_scene(sim, &now);
  const double d = sqrt(DBL_EPSILON) * f.farthest + 2 * f.depth;
  w->extent = extent_of(&now);
  w->least = f.least;
  w->t0 = time_of(sim);
  w->work = ms_dot3(g3, now.moment);
  w->energy = now.kinetic + now.elastic + f.mass * g * (fmax(w->extent, f.height) + g * h * h) +
              f.stiffness * d * d / 2;
  w->supply = w->energy;
  keep(sim);
}

/*------------------------------------- returning ------------------------------------------------*/

static void go_back(msim_sim *sim) {
  const ms_watch *w = &sim->watch;
  sim->step = w->step;
  sim->t = sim->t_shown = w->t, sim->t_lost = w->t_lost;
  if (ms_sim_has_control(sim)) sim->control = w->control, sim->plan.h = w->control.h;
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    ms_copy(m->model.shape, m->guard.kept.x, m->stepper.x);
    ms_copy(m->model.shape, m->guard.kept.v, m->stepper.v);
    m->stepper.h_before = m->guard.h_before;
    m->stepper.warm = m->guard.warm;
    if (m->stepper.solver) ms_solver_restart(m->stepper.solver);
    m->at_rest = m->guard.at_rest;
  }
  sim->flat_is_current = 0;
}

/* The free particle farthest from `from`, or, with `fastest` and from = 0, the fastest one; *most:
 * its distance or speed. */
static int32_t find_first(const msim_sim *sim, int fastest, const double from[3], double *most) {
  int32_t first = -1;
  *most = -1;
  for (const ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    const double *of = fastest ? m->stepper.v : m->stepper.x;
    for (int32_t r = 0; r < m->model.rows.nfree; r++) {
      double d[3];
      ms_row_get(&m->model.rows, of, r, d);
      for (int c = 0; c < 3; c++) d[c] -= from[c];
      const double size = hypot(hypot(d[0], d[1]), d[2]);
      if (size > *most) *most = size, first = m->model.rows.particle[r];
    }
  }
  return first;
}

static msim_status report(const msim_sim *sim, const ms_totals *now, const bounds *b,
                          msim_error *err) {
  const double energy = now->kinetic + now->elastic;
  const int fast = !(energy <= ALLOWED * b->supply);
  double from[3] = {0}, size;
  for (int c = 0; c < 3 && !fast; c++) from[c] = 0.5 * (now->low[c] + now->high[c]);
  const int32_t particle = find_first(sim, fast, from, &size);
  const long long step = sim->step, kept = sim->watch.step;
  if (fast)
    return ms_fail(err, MSIM_UNSTABLE,
                   "step %lld, t = %g s, particle %d: it is the fastest, at %.3g m/s, as kinetic "
                   "and elastic energy are %.3g J, more than %d times the %.3g J that the start "
                   "and gravity can supply; the state is that of step %lld again",
                   step, time_of(sim), particle, size, energy, ALLOWED, b->supply, kept);
  return ms_fail(err, MSIM_UNSTABLE,
                 "step %lld, t = %g s, particle %d: it is the farthest out, as the scene is %.3g m "
                 "long, more than %d times the %.3g m that its speed allows; the state is that of "
                 "step %lld again",
                 step, time_of(sim), particle, extent_of(now), ALLOWED, b->extent, kept);
}

msim_status ms_watch_check(msim_sim *sim, msim_error *err) {
  if (!is_on(sim) || sim->watch.step == sim->step) return MSIM_OK;
  const ms_totals now = measure(sim);
  const bounds b = bounds_at(sim, &now);
  if (is_good(&now, &b)) {
    sim->watch.supply = b.most;
    keep(sim);
    return MSIM_OK;
  }
  const msim_status status = report(sim, &now, &b, err);
  go_back(sim);
  return status;
}

void ms_watch_retreat(msim_sim *sim, msim_error *err) {
  if (!is_on(sim) || sim->watch.step == sim->step) return;
  const ms_totals now = measure(sim);
  const bounds b = bounds_at(sim, &now);
  if (is_good(&now, &b)) return;
  go_back(sim);
  if (!err) return;
  const size_t used = strlen(err->text);
  snprintf(err->text + used, sizeof err->text - used,
           "; the motion had grown beyond what energy allows: the state is that of step %lld again",
           (long long)sim->step);
}

/*------------------------------------- checkpoints ----------------------------------------------*/

void ms_watch_history(ms_bytes *b, const msim_sim *sim, ms_watch *w) {
  double *numbers[] = {&w->supply, &w->energy, &w->work, &w->extent,
                       &w->least,  &w->t0,     &w->t,    &w->t_lost};
  if (!is_on(sim)) return;
  ms_bytes_pass_count(b, &w->step);
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) MS_BYTES_PASS(b, *numbers[i]);
  ms_bytes_check(b, isfinite(w->t) && isfinite(w->t_lost), "the time of the last good state");
  ms_control_history(b, &w->control);
}

/* After implicit steps the last good state is the present one, as all are checked. */
void ms_guard_history(ms_bytes *b, const msim_sim *sim, int is_present, const ms_stepper *s,
                      ms_guard *g) {
  const ms_shape shape = s->model->shape;
  if (!is_on(sim)) return;
  MS_BYTES_PASS(b, g->h_before);
  MS_BYTES_PASS(b, g->at_rest);
  ms_bytes_check(b, isfinite(g->h_before) && (g->at_rest | 1) == 1, "the last good state");
  if (b->direction == MS_TAKE) {
    g->totals = ms_totals_compute(s->model, s->x, s->v, &g->kept, g->parts);
    g->warm = start_note(sim, s);
  }
  if (b->direction == MS_COUNT ? sim->integrator->entry.implicit : is_present) return;
  ms_bytes_pass_rows(b, shape, g->kept.x);
  ms_bytes_pass_rows(b, shape, g->kept.v);
  if (!notes_start(sim)) return;
  MS_BYTES_PASS(b, g->warm);
  ms_carried_history(b, sim->integrator, s, g->warm);
}
