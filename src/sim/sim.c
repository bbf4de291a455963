#include "sim/sim.h"

#include <string.h>

#include "base/clock.h"
#include "layout/flat.h"
#include "physics/planes.h"
#include "sim/drive.h"

/*------------------------------------- creation -------------------------------------------------*/

static msim_status own_string(msim_sim *sim, const char **member, char **own, msim_error *err) {
  if (!*member) return MSIM_OK;
  *own = ms_strdup(&sim->alloc, *member);
  *member = *own;
  return *own ? MSIM_OK : ms_fail_memory(err, "the options");
}

static msim_status take_method(msim_sim *sim, msim_error *err) {
  msim_status status = ms_integrator_find(sim->opt.integrator, &sim->integrator, err);
  if (status) return status;
  sim->opt.integrator = sim->integrator->entry.name;
  return ms_drive_choose(sim, err);
}

void ms_sim_warn(const msim_sim *sim, const char *format, ...) {
  msim_error note;
  va_list args;
  va_start(args, format);
  ms_vfail(&note, MSIM_OK, format, args);
  va_end(args);
  if (sim->opt.warn) sim->opt.warn(note.text, sim->opt.warn_user);
}

/* ms_sim_select chooses the method later, when all other options are known. */
static msim_status take_auto(msim_sim *sim, msim_error *err) {
  msim_options usual;
  msim_options_init(&usual, sizeof usual);
  if (sim->opt.steps >= 0)
    return ms_fail(err, MSIM_ERR_ARG,
                   "integrator 'auto' and steps exclude each other: tol says how many steps there "
                   "are; give t_end");
  if (sim->opt.h != usual.h && sim->opt.h != MSIM_H_AUTO)
    ms_sim_warn(sim, "h is not used: integrator 'auto' chooses its steps, by tol");
  if (sim->opt.tol == 0) sim->opt.tol = MS_DEFAULT_TOL;
  sim->selection.tol = sim->opt.tol;
  sim->selection.collision = sim->opt.collision;
  return MSIM_OK;
}

/* Error control locates impacts, whatever `collision` says, because their error counts towards
 * tol. */
static msim_status take_collision(msim_sim *sim, msim_error *err) {
  if (!ms_sim_selects(sim) && ms_sim_has_control(sim) && sim->scene->nplanes > 0)
    sim->opt.collision = MSIM_COLLISION_EVENT;
  if (sim->opt.collision != MSIM_COLLISION_EVENT || ms_sim_selects(sim)) return MSIM_OK;
  if (sim->integrator->sync)
    return ms_fail(
        err, MSIM_ERR_ARG,
        "integrator '%s' carries v(t - h/2), which no impact at another time can change: "
        "with collision = event take velocity-verlet, the same method with v(t)",
        sim->opt.integrator);
  if (sim->integrator->splits)
    return ms_fail(err, MSIM_ERR_ARG,
                   "integrator '%s' never has all forces at once, which collision = event needs "
                   "where particles rest: take velocity-verlet",
                   sim->opt.integrator);
  return MSIM_OK;
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
  status = strcmp(opt->integrator, MS_AUTO) == 0 ? take_auto(sim, err) : take_method(sim, err);
  if (status) return status;
  return take_collision(sim, err);
}

/* Warn that the plan has lowered the given h, once for each h. */
static void tell_lowered(const msim_sim *sim, const ms_plan *plan) {
  if (sim->advice.chosen || ms_sim_selects(sim)) return;
  if (plan->h == plan->h_asked || plan->h == sim->plan.h) return;
  ms_sim_warn(sim, "h is lowered from %g to %.17g s, so that %lld steps end at t_end = %g",
              plan->h_asked, plan->h, (long long)plan->steps, sim->opt.t_end);
}

static msim_status find_first_step(const msim_sim *sim, const double *x, const double *v,
                                   ms_plan *plan, msim_error *err) {
  const ms_control control = ms_control_of(sim->integrator, sim->opt.tol, ms_plan_span(plan));
  ms_scales scales;
  if (plan->h > 0) return MSIM_OK;
  const msim_status status = ms_scales_compute(sim->scene, x, v, control.span, &scales, err);
  if (!status) plan->h = plan->h_asked = ms_control_first(&control, &scales);
  return status;
}

msim_status ms_sim_make_plan(msim_sim *sim, double t0, const double *x, const double *v,
                             msim_error *err) {
  ms_plan plan;
  msim_status status = ms_plan_create(&sim->opt, t0, &plan, err);
  if (!status && ms_sim_has_control(sim)) status = find_first_step(sim, x, v, &plan, err);
  if (status) return status;
  tell_lowered(sim, &plan);
  sim->plan = plan;
  return MSIM_OK;
}

msim_status ms_sim_check_forces(const msim_sim *sim, const double *damping, msim_error *err) {
  const ms_scene *scene = sim->scene;
  const char *name = sim->integrator->entry.name;
  if (sim->integrator->show && scene->nplanes > 0 && !sim->selection.verification.away)
    return ms_fail(err, MSIM_ERR_ARG,
                   "integrator '%s' carries other variables than x and v, which planes cannot "
                   "reflect: take force-gradient",
                   name);
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
  const int sync = sim->integrator->sync || ms_sim_selects(sim); /* auto may choose such a method
                                                                    later */
  sim->flat_x = ms_new(&sim->alloc, n, sizeof(double));
  sim->flat_v = ms_new(&sim->alloc, n, sizeof(double));
  if (sync) sim->flat_v_half = ms_new(&sim->alloc, n, sizeof(double));
  if (sim->flat_x && sim->flat_v && (!sync || sim->flat_v_half)) return MSIM_OK;
  return ms_fail_memory(err, "the state");
}

static msim_status set_up(msim_sim *sim, const msim_options *opt, msim_error *err) {
  msim_status status = take_options(sim, opt, err);
  if (!status) status = ms_planes_check(sim->scene, err);
  if (!status && ms_sim_selects(sim))
    status = ms_sim_select(sim, 0, 0, sim->scene->x, sim->scene->v, err);
  if (!status) status = ms_sim_check_forces(sim, sim->scene->damping, err);
  if (!status && !ms_sim_has_control(sim)) status = ms_sim_settle_step(sim, &sim->opt.h, err);
  if (!status) status = ms_sim_make_plan(sim, 0, sim->scene->x, sim->scene->v, err);
  if (!status) status = allocate_flat(sim, err);
  if (!status) status = ms_sim_build(sim, ms_flat_axis(sim->scene, sim->opt.skip_off), err);
  if (status) return status;
  const msim_state start = {
      .size = sizeof start, .n = sim->scene->nparticles, .x = sim->scene->x, .v = sim->scene->v};
  return ms_sim_start(sim, &start, err);
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
  ms_scene_release(sim->chosen_for);
  msim_allocator alloc = sim->alloc;
  ms_delete(&alloc, sim);
}

/*------------------------------------- stepping -------------------------------------------------*/

double ms_sim_time(const msim_sim *sim) {
  if (ms_sim_has_control(sim)) return sim->t_shown;
  return sim->t0 + (double)(sim->step - sim->step0) * sim->plan.h;
}

static msim_status make_steps(msim_sim *sim, int64_t n, msim_error *err) {
  double start = ms_clock();
  msim_status status = MSIM_OK;
  for (int64_t i = 0; i < n && !status; i++) {
    status = ms_drive_step(sim, err);
    if (status > 0) ms_watch_retreat(sim, err);
    const int stopped = !status && atomic_exchange(&sim->stop, 0);
    if (!status && (stopped || ms_watch_is_due(sim))) status = ms_watch_check(sim, err);
    if (!status && stopped)
      status = ms_fail(err, MSIM_STOPPED, "stopped on request after step %lld, t = %g s",
                       (long long)sim->step, ms_sim_time(sim));
  }
  sim->stats.total_s += ms_clock() - start;
  return status;
}

/* A later msim_sim_run does not show frames that these steps have passed. */
msim_status msim_sim_step(msim_sim *sim, int64_t n, msim_error *err) {
  if (!sim || n < 0) return ms_fail(err, MSIM_ERR_ARG, "sim is NULL, or n is negative");
  msim_status status = make_steps(sim, n, err);
  if (ms_plan_has_times(&sim->opt)) sim->frame = ms_plan_frame_after(&sim->plan, &sim->opt, sim->t);
  return status ? status : ms_ok(err);
}

void msim_sim_stop(msim_sim *sim) { atomic_store(&sim->stop, 1); }

int64_t msim_sim_next_frame(const msim_sim *sim) {
  if (ms_plan_has_times(&sim->opt)) return sim->step + 1;
  return sim->step0 + ms_plan_next_frame(&sim->plan, &sim->opt, sim->step - sim->step0);
}

static int is_at_end(const msim_sim *sim) {
  if (!ms_sim_has_control(sim)) return sim->step - sim->step0 >= sim->plan.steps;
  if (!ms_plan_has_times(&sim->opt)) return sim->t >= sim->plan.t_end;
  return ms_plan_frame_time(&sim->plan, &sim->opt, sim->frame - 1) >= sim->plan.t_end;
}

static msim_status run_to_step(msim_sim *sim, int64_t due, msim_error *err) {
  msim_status status = MSIM_OK;
  if (!ms_sim_has_control(sim)) return make_steps(sim, due - sim->step, err);
  while (!status && sim->step < due && !is_at_end(sim)) status = make_steps(sim, 1, err);
  return status;
}

/* The frame may lie inside the last step. */
static msim_status run_to_time(msim_sim *sim, double due, msim_error *err) {
  msim_status status = MSIM_OK;
  while (!status && sim->t < due) status = make_steps(sim, 1, err);
  return status;
}

/* Run to the next frame. shown: an observer will get it, so that its state is checked first.
 * *is_there: the frame is reached, also where a request to stop takes effect exactly there; after
 * such a request the next run shows a frame that has a time of its own. */
static msim_status run_to_frame(msim_sim *sim, int shown, int *is_there, msim_error *err) {
  const int has_times = ms_plan_has_times(&sim->opt);
  const int64_t next = msim_sim_next_frame(sim);
  const double due = has_times ? ms_plan_frame_time(&sim->plan, &sim->opt, sim->frame) : 0;
  msim_status status = has_times ? run_to_time(sim, due, err) : run_to_step(sim, next, err);
  if (!status && shown) status = ms_watch_check(sim, err);
  const int stopped_there = status == MSIM_STOPPED && (sim->step == next || is_at_end(sim));
  *is_there = !status || (stopped_there && !has_times);
  if (status || !has_times) return status;
  ms_drive_show(sim, due);
  sim->frame++;
  return MSIM_OK;
}

msim_status msim_sim_run(msim_sim *sim, msim_observer *observer, void *user, msim_error *err) {
  if (!sim) return ms_fail(err, MSIM_ERR_ARG, "sim is NULL");
  if (sim->plan.t_end < 0)
    return ms_fail(err, MSIM_ERR_ARG, "the run has no end: set options.steps or options.t_end");
  if (observer && sim->step == sim->step0 && observer(sim, user))
    return ms_fail(err, MSIM_STOPPED, "stopped by the observer at the start");
  while (!is_at_end(sim)) {
    int is_there;
    const msim_status status = run_to_frame(sim, observer != NULL, &is_there, err);
    const int enough = is_there && observer && observer(sim, user);
    if (status) return status;
    if (enough)
      return ms_fail(err, MSIM_STOPPED, "stopped by the observer after step %lld, t = %g s",
                     (long long)sim->step, ms_sim_time(sim));
  }
  return ms_ok(err);
}

void ms_sim_count_output(msim_sim *sim, double seconds) {
  sim->stats.output_s += seconds;
  sim->stats.total_s += seconds;
}
