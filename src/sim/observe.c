/* observe - read a sim: state, energies, forces, statistics and plan (msim.h) */
#include <math.h>
#include <string.h>

#include "base/sized.h"
#include "integrate/interpolate.h"
#include "layout/planar.h"
#include "physics/energy.h"
#include "physics/force_function.h"
#include "physics/fused_step.h"
#include "physics/moving_pins.h"
#include "physics/reference.h"
#include "physics/single.h"
#include "scene/laws.h"
#include "sim/rank_section.h"

const ms_island_sim *ms_sim_largest_island(const msim_sim *sim) {
  const ms_island_sim *largest = sim->islands;
  for (int32_t i = 1; i < sim->nislands; i++)
    if (sim->islands[i].model.unknowns.nfree > largest->model.unknowns.nfree)
      largest = &sim->islands[i];
  return largest;
}

/* 1: the time shown is inside the last step of an island that is not at rest. */
static int is_inside_step(const msim_sim *sim, const ms_island_sim *m) {
  return ms_sim_has_control(sim) && sim->run.t_shown != sim->run.t && !m->at_rest;
}

/* The rows of an island in the present state. x_next, v_next and scratch are free between steps. */
static void show_island(const msim_sim *sim, ms_island_sim *m, const double **x, const double **v) {
  const ms_integrator *method = sim->config.integrator;
  ms_stepper *s = &m->stepper;
  *x = s->x, *v = s->v;
  if (is_inside_step(sim, m)) {
    const double theta = 1 - (sim->run.t - sim->run.t_shown) / s->h;
    ms_interpolate(method, s, theta, s->x_spare[0], s->v_spare[0]);
    *x = s->x_spare[0], *v = s->v_spare[0];
  } else if (method->convert_state) {
    method->convert_state(s, s->x_next, s->v_next);
    *x = s->x_next, *v = s->v_next;
  } else if (method->sync) {
    method->sync(s, s->v_next, s->scratch);
    *v = s->v_next;
  }
  *x = ms_single_get_x(&m->model, *x), *v = ms_single_get_v(&m->model, *v);
}

/* Trials have no array for it, as they were made for other methods (choose/pilot_run.h). */
static int shows_v_half(const msim_sim *sim) {
  return sim->config.integrator->sync && sim->state_v_half;
}

static void copy_island_state(msim_sim *sim, ms_island_sim *m) {
  const ms_unknowns *rows = &m->model.unknowns;
  const double *x, *v;
  show_island(sim, m, &x, &v);
  ms_unknowns_scatter(rows, x, sim->state_x);
  ms_unknowns_scatter(rows, v, sim->state_v);
  if (shows_v_half(sim))
    ms_unknowns_scatter(rows, ms_single_get_v(&m->model, m->stepper.v), sim->state_v_half);
}

/* Each rank has the state of its own particles; now all have that of all. */
static void gather_ranks(msim_sim *sim) {
  const int32_t n = sim->scene->nparticles;
  ms_rank_part_gather(sim->part, n, sim->state_x);
  ms_rank_part_gather(sim->part, n, sim->state_v);
  if (shows_v_half(sim)) ms_rank_part_gather(sim->part, n, sim->state_v_half);
}

/* Copy the state to the arrays, at most once per step, and only on demand. */
static void update_state_arrays(msim_sim *sim) {
  for (int32_t i = 0; i < sim->nislands && !sim->state_is_current; i++)
    copy_island_state(sim, &sim->islands[i]);
  if (sim->part && !sim->state_is_current) gather_ranks(sim);
  if (!sim->state_is_current)
    ms_moving_pins_set_arrays(sim->scene, (ms_instant){.t = ms_sim_time(sim)}, sim->state_x,
                              sim->state_v);
  sim->state_is_current = 1;
}

/* The arrays have the present state, in the order of the particles. */
static msim_status provide_state(msim_sim *sim) {
  const msim_status status = ms_sim_provide_arrays(sim, NULL);
  if (status) return status;
  update_state_arrays(sim);
  return sim->ranks ? sim->ranks->failed : MSIM_OK;
}

/* Pinned particles, the axis left out, and the state at the start are as in the scene. */
msim_status ms_sim_update_section(msim_sim *sim, msim_error *err) {
  const msim_status status = ms_rank_section_create(sim, err);
  const double *x, *v;
  if (status) return status;
  if (sim->state_x) {
    update_state_arrays(sim);
    ms_rank_section_copy(sim, sim->state_x, sim->state_v);
  } else if (!sim->state_is_current) {
    show_island(sim, sim->islands, &x, &v);
    ms_rank_section_exchange(sim, x, v);
  }
  return ms_ranks_agree(sim->ranks, MSIM_OK, err);
}

msim_status msim_sim_state(msim_sim *sim, msim_state *state) {
  if (!sim || !state) return MSIM_ERR_ARG;
  const msim_status status = state->size > MSIM_STATE_TIME ? provide_state(sim) : MSIM_OK;
  if (status) return status;
  msim_state full = {.step = sim->run.step,
                     .t = ms_sim_time(sim),
                     .n = ms_rank_scene_count_particles(sim),
                     .x = sim->state_x,
                     .v = sim->state_v,
                     .v_half = shows_v_half(sim) ? sim->state_v_half : NULL,
                     .h = sim->run.h,
                     .work = sim->run.work,
                     .nsprings = ms_rank_scene_count_springs(sim)};
  return ms_sized_write(state, &full, sizeof full);
}

msim_status msim_sim_energy(msim_sim *sim, msim_energy *energy) {
  if (!sim || !energy) return MSIM_ERR_ARG;
  msim_energy full = {0};
  const msim_status status = sim->part ? ms_sim_update_section(sim, NULL) : provide_state(sim);
  if (status) return status;
  if (sim->part) full = ms_rank_section_sum_energy(sim);
  else ms_energy_compute(sim->scene, sim->state_x, sim->state_v, &full);
  if (sim->part && sim->ranks->failed) return sim->ranks->failed;
  full.work = sim->run.work;
  return ms_sized_write(energy, &full, sizeof full);
}

msim_status msim_sim_stats(const msim_sim *sim, msim_stats *stats) {
  if (!sim || !stats) return MSIM_ERR_ARG;
  return ms_sized_write(stats, &sim->stats, sizeof sim->stats);
}

msim_status msim_sim_plan(const msim_sim *sim, msim_plan *plan) {
  if (!sim || !plan) return MSIM_ERR_ARG;
  const ms_solver *linear = ms_sim_largest_island(sim)->stepper.solver;
  msim_plan full = {.h = sim->run.h,
                    .steps = sim->config.plan.steps,
                    .integrator = sim->config.integrator->entry.name,
                    .solver = linear ? linear->linear->name : "none",
                    .threads = ms_pool_thread_count(sim->pool),
                    .tol = sim->config.opt.tol,
                    .t_end = sim->config.plan.t_end};
  return ms_sized_write(plan, &full, sizeof full);
}

static void add_island_force(const ms_island_sim *m, double t, const double *x, const double *v,
                             double *force) {
  const ms_stepper *s = &m->stepper;
  const ms_unknowns *rows = &m->model.unknowns;
  double *x_there = s->x_spare[0] ? s->x_spare[0] : s->x_next; /* dense output needs x_next */
  double *v_there = s->v_spare[0] ? s->v_spare[0] : s->v_next;
  ms_unknowns_gather(rows, x, x_there);
  ms_unknowns_gather(rows, v, v_there);
  if (m->model.function) m->model.function->status = MSIM_OK;
  ms_fused_step_run(&m->model,
                    &(ms_fused_step){.t = t, .x = x_there, .v = v_there, .f = s->scratch});
  ms_unknowns_scatter(rows, s->scratch, force);
  /* restore the pinned particles, as steps expect them */
  ms_vector_copy_all(m->model.shape, s->x, x_there);
  ms_vector_clear_all(m->model.shape, v_there);
}

void msim_sim_force(msim_sim *sim, const double *x, const double *v, double *force) {
  if (ms_rank_scene_gather(sim, NULL)) {
    for (size_t i = 0; i < 3 * (size_t)sim->kept->nparticles; i++) force[i] = NAN;
    return;
  }
  const ms_scene *scene = sim->scene;
  const int32_t left_out = sim->islands->model.unknowns.dropped_axis;
  if (sim->part || sim->islands->model.single ||
      (left_out >= 0 && !ms_planar_is_in_plane(scene, left_out, x, v))) {
    ms_reference_compute_force(scene, x, v, force);
    return;
  }
  memset(force, 0, 3 * (size_t)scene->nparticles * sizeof *force);
  for (int32_t i = 0; i < sim->nislands; i++)
    add_island_force(&sim->islands[i], ms_sim_time(sim), x, v, force);
  for (int32_t p = 0; p < scene->nparticles; p++)
    if (scene->pinned[p]) memset(force + 3 * (size_t)p, 0, 3 * sizeof *force);
}

msim_status msim_sim_reactions(msim_sim *sim, double *reaction) {
  if (!sim || !reaction) return MSIM_ERR_ARG;
  const msim_status status = provide_state(sim);
  if (status) return status;
  const ms_section all = ms_section_whole(sim->scene);
  ms_reference_compute_reactions(sim->scene, &all, sim->state_x, sim->state_v, reaction);
  return MSIM_OK;
}

msim_status msim_sim_broken(const msim_sim *sim, uint8_t *broken) {
  if (!sim || !broken) return MSIM_ERR_ARG;
  for (int32_t e = 0; e < ms_rank_scene_count_springs(sim); e++)
    broken[e] = !sim->kept && ms_scene_is_broken(sim->scene, e); /* scenes with laws are whole */
  return MSIM_OK;
}

msim_status msim_sim_springs(msim_sim *sim, double *tension, double *elongation, double *strain) {
  if (!sim) return MSIM_ERR_ARG;
  const ms_scene *scene = sim->scene;
  const msim_status status = provide_state(sim);
  if (status) return status;
  for (int32_t e = 0; e < scene->nsprings; e++) {
    double more;
    const double pull = ms_reference_compute_tension(scene, e, sim->state_x, sim->state_v, &more);
    if (tension) tension[e] = pull;
    if (elongation) elongation[e] = more;
    if (strain) strain[e] = scene->rest[e] > 0 ? more / scene->rest[e] : 0;
  }
  return MSIM_OK;
}
