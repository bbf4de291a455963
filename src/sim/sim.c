#include "sim/sim.h"

#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "integrate/events.h"
#include "layout/flat.h"

/*------------------------------------- creation -------------------------------------------------*/

static msim_status own_string(msim_sim *sim, const char **member, char **own, msim_error *err) {
  if (!*member) return MSIM_OK;
  *own = ms_strdup(&sim->alloc, *member);
  *member = *own;
  return *own ? MSIM_OK : ms_fail_memory(err, "the options");
}

static msim_status take_options(msim_sim *sim, const msim_options *opt, msim_error *err) {
  msim_status status = ms_options_copy(opt, &sim->opt, err);
  if (!status) status = ms_options_check(&sim->opt, err);
  if (!status) status = own_string(sim, &sim->opt.solver, &sim->solver, err);
  if (!status) status = own_string(sim, &sim->opt.plugin_path, &sim->plugin_path, err);
  if (status) return status;
  if (!opt->integrator)
    return ms_fail(err, MSIM_ERR_ARG,
                   "no integrator was chosen; explicit-euler, heun, verlet, "
                   "linearly-implicit-euler and others are there");
  status = ms_integrator_find(opt->integrator, &sim->integrator, err);
  if (status) return status;
  sim->opt.integrator = sim->integrator->entry.name;
  if (sim->opt.collision == MSIM_COLLISION_EVENT && sim->integrator->sync)
    return ms_fail(
        err, MSIM_ERR_ARG,
        "integrator '%s' carries v(t - h/2), which no impact at another time can change: "
        "with collision = event take velocity-verlet, the same method with v(t)",
        sim->opt.integrator);
  if (sim->opt.collision == MSIM_COLLISION_EVENT && sim->integrator->splits)
    return ms_fail(err, MSIM_ERR_ARG,
                   "integrator '%s' never has all forces at once, which collision = event needs "
                   "where particles rest: take velocity-verlet",
                   sim->opt.integrator);
  return MSIM_OK;
}

void ms_sim_warn(const msim_sim *sim, const char *format, ...) {
  msim_error note;
  va_list args;
  va_start(args, format);
  ms_vfail(&note, MSIM_OK, format, args);
  va_end(args);
  if (sim->opt.warn) sim->opt.warn(note.text, sim->opt.warn_user);
}

/* Says so where an h that was given had to be lowered, once for each h. */
msim_status ms_sim_make_plan(msim_sim *sim, double t0, msim_error *err) {
  ms_plan plan;
  msim_status status = ms_plan_create(&sim->opt, t0, &plan, err);
  if (status) return status;
  if (plan.h != plan.h_asked && plan.h != sim->plan.h && !sim->advice.chosen)
    ms_sim_warn(sim, "h is lowered from %g to %.17g s, so that %lld steps end at t_end = %g",
                plan.h_asked, plan.h, (long long)plan.steps, sim->opt.t_end);
  sim->plan = plan;
  return MSIM_OK;
}

msim_status ms_sim_check_forces(const msim_sim *sim, const double *damping, msim_error *err) {
  const ms_scene *scene = sim->scene;
  const char *name = sim->integrator->entry.name;
  if (!sim->integrator->separable) return MSIM_OK;
  if (scene->drag > 0)
    return ms_fail(err, MSIM_ERR_ARG, "integrator '%s' takes forces of positions alone: no drag",
                   name);
  for (int32_t e = 0; e < scene->nsprings; e++)
    if (damping[e] > 0)
      return ms_fail(err, MSIM_ERR_ARG,
                     "integrator '%s' takes forces of positions alone, but spring %d is damped",
                     name, e);
  return MSIM_OK;
}

static msim_status allocate_flat(msim_sim *sim, msim_error *err) {
  const size_t n = 3 * (size_t)sim->scene->nparticles;
  const int sync = sim->integrator->sync != NULL;
  sim->flat_x = ms_new(&sim->alloc, n, sizeof(double));
  sim->flat_v = ms_new(&sim->alloc, n, sizeof(double));
  if (sync) sim->flat_v_half = ms_new(&sim->alloc, n, sizeof(double));
  if (sim->flat_x && sim->flat_v && (!sync || sim->flat_v_half)) return MSIM_OK;
  return ms_fail_memory(err, "the state");
}

static msim_status set_up(msim_sim *sim, const msim_options *opt, msim_error *err) {
  msim_status status = take_options(sim, opt, err);
  if (!status) status = ms_sim_check_forces(sim, sim->scene->damping, err);
  if (!status) status = ms_sim_settle_step(sim, &sim->opt.h, err);
  if (!status) status = ms_sim_make_plan(sim, 0, err);
  if (!status) status = allocate_flat(sim, err);
  if (!status) status = ms_sim_build(sim, ms_flat_axis(sim->scene, sim->opt.skip_off), err);
  if (status) return status;
  const msim_state start = {
      .size = sizeof start, .n = sim->scene->nparticles, .x = sim->scene->x, .v = sim->scene->v};
  return msim_sim_set_state(sim, &start, err);
}

msim_status msim_sim_create(const msim_scene *scene, const msim_options *opt, msim_sim **sim,
                            msim_error *err) {
  if (!scene || !opt || !sim) return ms_fail(err, MSIM_ERR_ARG, "scene, opt or sim is NULL");
  *sim = NULL;
  ms_scene *data = scene->data;
  if (data->nparticles == 0) return ms_fail(err, MSIM_ERR_ARG, "the scene holds no particles");
  msim_sim *s = ms_new(&data->alloc, 1, sizeof *s);
  if (!s) return ms_fail_memory(err, "a sim");
  s->alloc = data->alloc;
  s->scene = ms_scene_share(data);
  s->explanation.alloc = &s->alloc;
  atomic_init(&s->stop, 0);
  msim_status status = set_up(s, opt, err);
  if (status) {
    msim_sim_destroy(s);
    return status;
  }
  *sim = s;
  return ms_ok(err);
}

void msim_sim_destroy(msim_sim *sim) {
  if (!sim) return;
  ms_sim_drop_matrix(sim);
  ms_sim_take_down(sim);
  ms_pool_destroy(sim->pool);
  ms_text_free(&sim->explanation);
  void *arrays[] = {sim->flat_x, sim->flat_v, sim->flat_v_half, sim->solver, sim->plugin_path};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) ms_delete(&sim->alloc, arrays[i]);
  ms_scene_release(sim->scene);
  msim_allocator alloc = sim->alloc;
  ms_delete(&alloc, sim);
}

/*------------------------------------- stepping -------------------------------------------------*/

double ms_sim_time(const msim_sim *sim) {
  return sim->t0 + (double)(sim->step - sim->step0) * sim->plan.h;
}

/* What went wrong in the step after the present one, with step, time and particle. */
static msim_status blame(const msim_sim *sim, const ms_motion *m, msim_status status,
                         const msim_error *why, msim_error *err) {
  char particle[32] = "";
  int32_t row = m->stepper.culprit;
  if (row >= 0) snprintf(particle, sizeof particle, ", particle %d", m->model.rows.particle[row]);
  return ms_fail(err, status, "step %lld, t = %g s%s: %s", (long long)(sim->step + 1),
                 ms_sim_time(sim) + sim->plan.h, particle,
                 *why->text ? why->text : msim_status_text(status));
}

/* A step from rest that stays there, and meets no plane: as x and v are what they were and v is 0,
 * so is every force, and the next step does the same. The method's own vectors follow from x and v
 * then. The first row that moves ends the search. */
static int stays_at_rest(const msim_sim *sim, const ms_motion *m, int64_t contacts) {
  const ms_stepper *s = &m->stepper;
  const ms_shape shape = m->model.shape;
  return !(sim->opt.skip_off & MSIM_SKIP_AT_REST) && s->stats->contacts == contacts &&
         ms_is_zero(shape, s->v_next) && ms_is_zero(shape, s->v) &&
         ms_is_same(shape, s->x, s->x_next);
}

/* The next state of one island, refused if it is not finite. The present one stays as it is. */
static msim_status step_island(msim_sim *sim, ms_motion *m, msim_error *err) {
  ms_stepper *s = &m->stepper;
  const int64_t contacts = s->stats->contacts;
  s->culprit = -1;
  s->finite = 0;
  msim_status status = ms_step(sim->integrator, s, err);
  if (!status && !s->finite) {
    s->culprit = ms_find_bad(m->model.shape, s->x_next);
    if (s->culprit < 0) s->culprit = ms_find_bad(m->model.shape, s->v_next);
    if (s->culprit >= 0) status = MSIM_NOT_FINITE;
  }
  m->at_rest_next = !status && stays_at_rest(sim, m, contacts);
  return status;
}

static void step_by_one(void *data, int32_t i) {
  msim_sim *sim = data;
  ms_motion *m = &sim->motion[i];
  if (m->by_one && !m->at_rest) m->status = step_island(sim, m, NULL);
}

/* What that came to. Its seconds passed in all threads at once. */
static msim_status collect(msim_sim *sim, ms_motion *m) {
  const double threads = ms_pool_threads(sim->pool);
  sim->stats.force_evaluations += m->stats.force_evaluations;
  sim->stats.spring_evaluations += m->stats.spring_evaluations;
  sim->stats.contacts += m->stats.contacts;
  sim->stats.force_s += m->stats.force_s / threads;
  sim->stats.collide_s += m->stats.collide_s / threads;
  m->stats = (msim_stats){0};
  return m->status;
}

static void accept(ms_motion *m) {
  ms_stepper *s = &m->stepper;
  double *x = s->x, *v = s->v;
  s->x = s->x_next, s->x_next = x;
  s->v = s->v_next, s->v_next = v;
  s->warm = s->warm_next;
  m->at_rest = m->at_rest_next;
}

/* All islands that are not at rest, or none: where one fails, the state stays as it was. */
static msim_status one_step(msim_sim *sim, msim_error *err) {
  msim_error why = {0, ""};
  int32_t resting = 0;
  if (sim->any_by_one) ms_pool_run(sim->pool, step_by_one, sim, sim->nislands);
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++) {
    resting += m->at_rest;
    if (m->at_rest) continue;
    msim_status status = m->by_one ? collect(sim, m) : step_island(sim, m, &why);
    if (status) return blame(sim, m, status, &why, err);
  }
  for (ms_motion *m = sim->motion; m < sim->motion + sim->nislands; m++)
    if (!m->at_rest) accept(m);
  sim->step++;
  sim->stats.steps++;
  sim->stats.islands_at_rest += resting;
  sim->stats.steps_at_rest += resting == sim->nislands;
  if (resting < sim->nislands) sim->flat_is_current = 0;
  return MSIM_OK;
}

msim_status msim_sim_step(msim_sim *sim, int64_t n, msim_error *err) {
  if (!sim || n < 0) return ms_fail(err, MSIM_ERR_ARG, "sim is NULL, or n is negative");
  double start = ms_clock();
  msim_status status = MSIM_OK;
  for (int64_t i = 0; i < n && !status; i++) {
    status = one_step(sim, err);
    if (!status && atomic_exchange(&sim->stop, 0))
      status = ms_fail(err, MSIM_STOPPED, "stopped on request after step %lld, t = %g s",
                       (long long)sim->step, ms_sim_time(sim));
  }
  sim->stats.total_s += ms_clock() - start;
  return status ? status : ms_ok(err);
}

void msim_sim_stop(msim_sim *sim) { atomic_store(&sim->stop, 1); }

int64_t msim_sim_next_frame(const msim_sim *sim) {
  return sim->step0 + ms_plan_next_frame(&sim->plan, &sim->opt, sim->step - sim->step0);
}

msim_status msim_sim_run(msim_sim *sim, msim_observer *observer, void *user, msim_error *err) {
  if (!sim) return ms_fail(err, MSIM_ERR_ARG, "sim is NULL");
  if (sim->plan.steps < 0)
    return ms_fail(err, MSIM_ERR_ARG, "the run has no end: set options.steps or options.t_end");
  const int64_t end = sim->step0 + sim->plan.steps;
  if (observer && sim->step == sim->step0 && observer(sim, user))
    return ms_fail(err, MSIM_STOPPED, "stopped by the observer at the start");
  while (sim->step < end) {
    msim_status status = msim_sim_step(sim, msim_sim_next_frame(sim) - sim->step, err);
    if (status) return status;
    if (observer && observer(sim, user))
      return ms_fail(err, MSIM_STOPPED, "stopped by the observer after step %lld, t = %g s",
                     (long long)sim->step, ms_sim_time(sim));
  }
  return ms_ok(err);
}

void ms_sim_count_output(msim_sim *sim, double seconds) {
  sim->stats.output_s += seconds;
  sim->stats.total_s += seconds;
}
