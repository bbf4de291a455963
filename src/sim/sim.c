#include "sim/sim.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "layout/planar.h"
#include "linear/backends.h"
#include "methods/methods.h"
#include "sim/breaking.h"
#include "sim/precision_check.h"
#include "sim/self_contact_prepare.h"
#include "sim/rank_load.h"
#include "sim/rank_section.h"
#include "sim/rank_sim.h"
#include "contact/reflection.h"
#include "sim/start_check.h"
#include "sim/step_driver.h"
#include "physics/external_force.h"

/*------------------------------------- creation -------------------------------------------------*/

static msim_status own_string(msim_sim *sim, const char **member, char **own, msim_error *err) {
  if (!*member) return MSIM_OK;
  *own = ms_memory_copy_string(&sim->alloc, *member);
  *member = *own;
  return *own ? MSIM_OK : ms_error_set_memory(err, "the options");
}

/* Copies of all texts among the options, of which the program keeps its own. */
static msim_status own_strings(msim_sim *sim, msim_error *err) {
  msim_options *opt = &sim->config.opt;
  msim_status status = own_string(sim, &opt->solver, &sim->solver, err);
  if (!status) status = own_string(sim, &opt->solver_options, &sim->solver_options, err);
  return status ? status : own_string(sim, &opt->plugin_path, &sim->plugin_path, err);
}

static msim_status set_method(msim_sim *sim, msim_error *err) {
  msim_status status = ms_methods_find(sim->config.opt.integrator, &sim->config.integrator, err);
  if (status) return status;
  sim->config.opt.integrator = sim->config.integrator->entry.name;
  return ms_step_driver_choose_control(sim, err);
}

/* ms_method_choice_make chooses the method later, when all other options are known. */
static msim_status set_auto(msim_sim *sim, msim_error *err) {
  msim_options usual;
  msim_options_init(&usual, sizeof usual);
  if (sim->config.opt.steps >= 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator 'auto' and steps exclude each other, because tol determines "
                        "the number of steps; use t_end in place of steps");
  if (sim->config.opt.h != usual.h && sim->config.opt.h != MSIM_H_AUTO)
    ms_sim_warn(
        sim, "h is ignored: integrator 'auto' chooses h by tol; remove h, or name an integrator");
  if (sim->config.opt.tol == 0) sim->config.opt.tol = MS_DEFAULT_TOL;
  sim->config.choice.tol = sim->config.opt.tol;
  sim->config.choice.collision = sim->config.opt.collision;
  sim->config.choice.precision = sim->config.opt.precision;
  return MSIM_OK;
}

/* Error control locates impacts, whatever `collision` says, because their error counts towards
 * tol. */
static msim_status set_collision(msim_sim *sim, msim_error *err) {
  if (!ms_sim_selects(sim) && ms_sim_has_control(sim) && ms_scene_has_obstacles(sim->scene))
    sim->config.opt.collision = MSIM_COLLISION_EVENT;
  if (sim->config.opt.collision != MSIM_COLLISION_EVENT || ms_sim_selects(sim)) return MSIM_OK;
  if (sim->config.integrator->sync)
    return ms_error_set(
        err, MSIM_ERR_ARG,
        "integrator '%s' stores v(t - h/2) and cannot apply an impact at another time; with "
        "collision = event use velocity-verlet, the same method with v(t)",
        sim->config.opt.integrator);
  if (sim->config.integrator->is_multirate)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator '%s' never evaluates all forces at the same time, which "
                        "collision = event requires for resting particles; use velocity-verlet",
                        sim->config.opt.integrator);
  return MSIM_OK;
}

/* Motions need a method that evaluates forces at known times, and no pilot runs. */
msim_status ms_sim_check_motions(const msim_sim *sim, msim_error *err) {
  const ms_integrator *method = sim->config.integrator;
  if (ms_sim_selects(sim) && ms_collider_motion_is_there(sim->scene))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator 'auto' does not support colliders that move; use dop853 or "
                        "velocity-verlet, or remove the motions");
  if (sim->scene->nmotions == 0) return MSIM_OK;
  if (ms_sim_selects(sim) || method->is_multirate || method->convert_state)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator '%s' does not support motions of pinned particles; use dop853, "
                        "velocity-verlet or implicit-midpoint, or remove the motions",
                        ms_sim_selects(sim) ? MS_AUTO : method->entry.name);
  return MSIM_OK;
}

static void warn_unused_end(const msim_sim *sim) {
  const msim_options *opt = &sim->config.opt;
  if (opt->steps < 0 || opt->t_end < 0) return;
  ms_sim_warn(sim, "t_end = %g s is ignored: steps = %lld ends the run; remove one of them",
              opt->t_end, (long long)opt->steps);
}

static msim_status refuse_function(const msim_sim *sim, const char *why, msim_error *err) {
  return ms_error_set(err, MSIM_ERR_ARG,
                      "integrator '%s' does not support force function '%s'%s; use dop853, "
                      "velocity-verlet or implicit-midpoint, or remove the function",
                      ms_sim_selects(sim) ? MS_AUTO : sim->config.integrator->entry.name,
                      sim->scene->force_function.name, why);
}

/* Force functions need a method that evaluates forces only in steps, at known times. */
static msim_status check_force_function(const msim_sim *sim, msim_error *err) {
  const ms_integrator *method = sim->config.integrator;
  if (!ms_scene_has_function(sim->scene)) return MSIM_OK;
  if (ms_sim_selects(sim) || method->is_multirate || method->convert_state || method->sync)
    return refuse_function(sim, "", err);
  if (method->separable && ms_scene_function_has(sim->scene, MSIM_FORCE_VELOCITY))
    return refuse_function(sim, ", which depends on velocities", err);
  return MSIM_OK;
}

static msim_status check_contacts(const msim_sim *sim, msim_error *err) {
  if (sim->config.opt.contacts == MSIM_CONTACTS_OFF || !ms_sim_selects(sim)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "contacts = on requires a method that is named, not auto; use "
                      "velocity-verlet, or remove contacts");
}

static msim_status set_options(msim_sim *sim, const msim_options *opt, msim_error *err) {
  msim_status status = ms_options_copy(opt, &sim->config.opt, err);
  if (!status) status = ms_options_check(&sim->config.opt, err);
  if (!status) status = own_strings(sim, err);
  if (status) return status;
  if (!opt->integrator)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "no integrator is given; set the option integrator, for example to "
                        "velocity-verlet, linearly-implicit-euler or auto");
  status = strcmp(opt->integrator, MS_AUTO) == 0 ? set_auto(sim, err) : set_method(sim, err);
  if (!status) status = ms_backends_check_name(&sim->config.opt, &sim->alloc, err);
  if (!status) warn_unused_end(sim);
  if (!status) status = set_collision(sim, err);
  if (!status) status = check_force_function(sim, err);
  if (!status) status = check_contacts(sim, err);
  return status ? status : ms_sim_check_motions(sim, err);
}

msim_status ms_sim_check_method_forces(const msim_sim *sim, const double *damping,
                                       msim_error *err) {
  const ms_scene *scene = sim->scene;
  const char *name = sim->config.integrator->entry.name;
  const char *obstacles = scene->nplanes ? "planes" : "colliders";
  if (sim->config.integrator->convert_state && ms_scene_has_obstacles(scene) &&
      !sim->config.choice.verification.planes_far)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator '%s' does not support %s; use force-gradient, or remove the %s",
                        name, obstacles, obstacles);
  if (sim->config.integrator->is_multirate && scene->angles.n)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator '%s' does not support angular springs; use velocity-verlet, or "
                        "remove the angles",
                        name);
  if (!sim->config.integrator->separable) return MSIM_OK;
  if (ms_external_has_velocity(&scene->external))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "integrator '%s' requires forces that depend on positions only, but drag "
                        "is set; use dop853, rk4 or velocity-verlet",
                        name);
  for (int32_t e = 0; e < scene->nsprings; e++)
    if (damping[e] > 0)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "integrator '%s' requires forces that depend on positions only, but "
                          "spring %d is damped; use dop853, rk4 or velocity-verlet",
                          name, e);
  for (int32_t e = 0; e < scene->angles.n; e++)
    if (scene->angles.damping[e] > 0)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "integrator '%s' requires forces that depend on positions only, but "
                          "angle %d is damped; use dop853, rk4 or velocity-verlet",
                          name, e);
  return MSIM_OK;
}

/* 1: the sim has arrays of the state from the beginning. Several ranks need them where something in
 * a step refers to particles of other ranks. */
static int needs_arrays(const msim_sim *sim) {
  return !sim->part || sim->scene->nmotions > 0 || sim->scene->broken;
}

/* What a rank does by itself before the islands */
static msim_status prepare_sim(msim_sim *sim, const msim_options *opt, const msim_state *start,
                               ms_sim_choose *choose, msim_error *err) {
  msim_status status = set_options(sim, opt, err);
  if (!status) status = ms_rank_sim_check(sim, err);
  if (!status) status = ms_precision_check(sim, err);
  if (!status) status = ms_self_contact_prepare(sim, err);
  if (!status) status = ms_breaking_prepare(sim, err);
  if (!status) status = ms_reflection_check(sim->scene, err);
  if (!status && !sim->kept) ms_start_check_warn(sim);
  if (!status && ms_sim_selects(sim)) status = choose(sim, 0, start, err);
  return status ? status : ms_sim_check_method_forces(sim, sim->scene->damping, err);
}

/* Steps, and room for the state */
static msim_status plan_sim(msim_sim *sim, msim_error *err) {
  msim_status status = MSIM_OK;
  if (!ms_sim_has_control(sim)) status = ms_step_limit_resolve_auto(sim, &sim->config.opt.h, err);
  if (!status) status = ms_sim_make_plan(sim, 0, sim->scene->x, sim->scene->v, err);
  if (!status && needs_arrays(sim)) status = ms_sim_reserve_state(sim, sim->scene->nparticles, err);
  return ms_ranks_agree(sim->ranks, status, err);
}

/* NULL: out of memory. */
static msim_sim *allocate_sim(ms_scene *scene, msim_error *err) {
  msim_sim *s = ms_memory_allocate(&scene->alloc, 1, sizeof *s);
  if (!s) {
    ms_error_set_memory(err, "a sim");
    return NULL;
  }
  s->alloc = scene->alloc;
  s->scene = ms_scene_retain(scene);
  s->explanation.alloc = &s->alloc;
  atomic_init(&s->stop, 0);
  return s;
}

msim_status ms_sim_create_empty_copy(const msim_sim *from, msim_sim **sim, msim_error *err) {
  msim_sim *s = *sim = allocate_sim(from->scene, err);
  if (!s) return MSIM_ERR_MEMORY;
  s->config = from->config, s->run = from->run;
  if (from->created_from) s->created_from = ms_scene_retain(from->created_from);
  if (from->edited_from) s->edited_from = ms_scene_retain(from->edited_from);
  s->edits = from->edits;
  msim_status status = own_strings(s, err);
  if (!status) status = ms_breaking_prepare(s, err);
  return status ? status : ms_sim_reserve_state(s, s->scene->nparticles, err);
}

static msim_state initial_state(const ms_scene *scene) {
  return (msim_state){
      .size = sizeof(msim_state), .n = scene->nparticles, .x = scene->x, .v = scene->v};
}

/* A sim without islands; NULL after an error. Ranks do this each for itself, and agree on the
 * status. Takes over `ranks`, and what `load` has of parts. */
static msim_status create_prepared(ms_rank_load *load, ms_ranks *ranks, const msim_options *opt,
                                   ms_sim_choose *choose, msim_sim **sim, msim_error *err) {
  ms_scene *scene = load->scene;
  msim_sim *s = allocate_sim(scene, err);
  msim_status status = s ? MSIM_OK : MSIM_ERR_MEMORY;
  const msim_state start = initial_state(scene);
  if (s) s->kept = load->kept, s->part = load->part, load->kept = NULL, load->part = NULL;
  if (s && ranks && !s->kept) status = ms_rank_part_create(scene, ranks, &s->part, err);
  if (!status) status = prepare_sim(s, opt, &start, choose, err);
  status = ms_ranks_agree(ranks, status, err);
  if (s) s->ranks = ranks;
  else ms_ranks_destroy(&scene->alloc, ranks);
  if (status) msim_sim_destroy(s);
  else *sim = s;
  return status;
}

/* Where ranks have slices the axis is one that all of them leave out, at the level of the first
 * particle. */
static int32_t find_axis(const msim_sim *sim) {
  const unsigned skip_off = sim->config.opt.skip_off;
  if (!sim->kept) return ms_planar_find_axis(sim->scene, skip_off);
  const ms_scene *slice = sim->kept->slice;
  double level[3] = {slice->x[0], slice->x[1], slice->x[2]}, moves[3];
  int32_t axis = 2;
  ms_ranks_broadcast(sim->ranks, 0, sizeof level, level);
  for (int32_t c = 0; c < 3; c++) moves[c] = !ms_planar_has_axis(slice, skip_off, c, level[c]);
  ms_ranks_maximum(sim->ranks, 3, moves);
  while (axis >= 0 && moves[axis] != 0) axis--;
  return axis;
}

static msim_status start_created(msim_sim *sim, msim_error *err) {
  const msim_state start = initial_state(sim->scene);
  msim_status status = ms_rank_sim_compare(sim, err);
  if (!status) status = plan_sim(sim, err);
  if (!status && sim->kept) ms_start_check_warn(sim);
  if (!status) status = ms_sim_build_islands(sim, find_axis(sim), err);
  if (!status && sim->kept) ms_rank_part_forget_whole(&sim->alloc, sim->part);
  return status ? status : ms_sim_start(sim, &start, err);
}

msim_status ms_sim_create(const msim_scene *scene, const msim_options *opt, ms_sim_choose *choose,
                          const ms_island_sims *like, msim_sim **sim, msim_error *err) {
  *sim = NULL;
  msim_options full;
  ms_ranks *ranks = NULL;
  ms_rank_load load;
  msim_sim *s = NULL;
  if (scene->data->nparticles == 0 && !scene->part)
    return ms_error_set(err, MSIM_ERR_ARG, "the scene has no particles");
  msim_status status = ms_options_copy(opt, &full, err);
  if (!status) status = ms_rank_sim_join(full.comm, &scene->data->alloc, &ranks, err);
  if (status) return status;
  status = ms_rank_load_scene(scene, &full, ranks, &load, err);
  if (status) ms_ranks_destroy(&scene->data->alloc, ranks);
  else status = create_prepared(&load, ranks, opt, choose, &s, err);
  ms_rank_load_destroy(&scene->data->alloc, &load);
  if (!status) s->like = like, status = start_created(s, err);
  if (status) {
    msim_sim_destroy(s);
    return status;
  }
  *sim = s;
  return ms_error_clear(err);
}

void msim_sim_destroy(msim_sim *sim) {
  if (!sim) return;
  if (sim->in_observer) {
    ms_sim_warn(sim, "the sim is not destroyed: its observer must not do that");
    return;
  }
  ms_sim_free_matrix(sim);
  ms_rank_section_destroy(sim);
  ms_sim_destroy_islands(sim);
  ms_pool_destroy(sim->pool);
  ms_text_free(&sim->explanation);
  ms_sim_free_state(sim);
  ms_rank_part_destroy(&sim->alloc, sim->part);
  ms_ranks_destroy(&sim->alloc, sim->ranks);
  MS_FREE(&sim->alloc, sim->solver, sim->solver_options, sim->plugin_path, sim->contacts,
          sim->island_of, sim->island_energies);
  ms_rank_scene_destroy(&sim->alloc, sim->kept);
  ms_scene_release(sim->scene);
  ms_scene_release(sim->chosen_for);
  ms_scene_release(sim->created_from);
  ms_scene_release(sim->edited_from);
  msim_allocator alloc = sim->alloc;
  ms_memory_free(&alloc, sim);
}

/*------------------------------------- stepping -------------------------------------------------*/

msim_status ms_sim_make_steps(msim_sim *sim, int64_t n, msim_error *err) {
  double start = ms_clock_now();
  msim_status status = MSIM_OK;
  for (int64_t i = 0; i < n && !status; i++) {
    status = ms_step_driver_make_step(sim, err);
    if (!status) status = ms_breaking_follow(sim, err);
    if (status > 0) ms_energy_monitor_restore(sim, err);
    const int stopped = !status && ms_rank_sim_takes_stop(sim);
    if (!status && (stopped || ms_energy_monitor_is_due(sim)))
      status = ms_energy_monitor_check(sim, err);
    if (!status && stopped)
      status = ms_error_set(err, MSIM_STOPPED, "stopped on request after step %lld, t = %g s",
                            (long long)sim->run.step, ms_sim_time(sim));
  }
  msim_stats *stats = &sim->stats;
  stats->total_s += ms_clock_now() - start;
  /* as some sweeps are timed for others */
  stats->force_s = fmin(stats->force_s, stats->total_s - stats->output_s - stats->collide_s);
  return sim->last_status = status;
}

void ms_sim_count_output(msim_sim *sim, double seconds) {
  sim->stats.output_s += seconds;
  sim->stats.total_s += seconds;
}
