#include "checkpoint/saved_run.h"

#include <math.h>
#include <stddef.h>

#include "checkpoint/rank_rows.h"
#include "choose/method_choice.h"
#include "integrate/method_state.h"
#include "linear/solver_state.h"
#include "physics/single.h"
#include "scene/laws.h"
#include "sim/step_driver.h"

ms_saved_run ms_saved_run_collect(const msim_sim *sim) {
  const ms_solver *solver = sim->islands->stepper.solver;
  return (ms_saved_run){.run = sim->run,
                        .t0 = sim->config.plan.t0,
                        .fps = sim->config.opt.fps,
                        .t_end = sim->config.plan.t_end,
                        .every = sim->config.opt.every,
                        .solver_h = solver && !sim->part ? solver->creation_h : 0,
                        .left_out = sim->islands->model.unknowns.dropped_axis,
                        .saves_last_step = ms_step_driver_has_frame_inside(sim),
                        .h_from_auto = sim->config.step_limit.from_auto,
                        .other_springs = sim->chosen_for != NULL,
                        .tol = sim->config.opt.tol,
                        .first_h = sim->config.opt.h,
                        .choice = sim->config.choice,
                        .stats = sim->stats,
                        .monitor = sim->monitor,
                        .error_growth = sim->error_growth};
}

/* All counts; that of incomplete steps with the option which makes them, that of broken springs
 * where they break. Seconds are left out, so that identical runs have identical checkpoints. */
static void archive_stats(ms_archive *b, const msim_sim *sim, msim_stats *s) {
  int64_t *counts[] = {&s->steps,
                       &s->force_evaluations,
                       &s->assemblies,
                       &s->analyses,
                       &s->factorizations,
                       &s->solves,
                       &s->iterations,
                       &s->newton_iterations,
                       &s->contacts,
                       &s->indefinite_steps,
                       &s->coarse_factors,
                       &s->kept_factors,
                       &s->refinements,
                       &s->fallbacks,
                       &s->steps_at_rest,
                       &s->islands_at_rest,
                       &s->spring_evaluations,
                       &s->rejected_steps};
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
    ms_archive_transfer_count(b, counts[i]);
  if (sim->config.opt.incomplete) ms_archive_transfer_count(b, &s->incomplete_steps);
  if (ms_scene_breaks(sim->scene)) ms_archive_transfer_count(b, &s->broken);
  enum { SECONDS = 7, OPTIONAL = 2 }; /* new counts of msim_stats have to be added above */
  _Static_assert(sizeof *s - offsetof(msim_stats, steps) ==
                     8 * (sizeof counts / sizeof *counts + OPTIONAL + SECONDS),
                 "all counts are in a checkpoint");
}

void ms_saved_run_archive(ms_archive *b, const msim_sim *sim, ms_saved_run *r) {
  int64_t *counts[] = {&r->run.step, &r->run.step0, &r->run.spent, &r->run.frame, &r->every};
  double *numbers[] = {&r->t0,          &r->run.h,   &r->run.t,    &r->run.t_rounding,
                       &r->run.t_shown, &r->fps,     &r->t_end,    &r->solver_h,
                       &r->tol,         &r->first_h, &r->run.work, &r->run.pin_energy,
                       &r->run.moved};
  int32_t *flags[] = {&r->left_out, &r->saves_last_step, &r->h_from_auto, &r->other_springs};
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
    ms_archive_transfer_count(b, counts[i]);
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    MS_ARCHIVE_TRANSFER(b, *numbers[i]);
    ms_archive_check(b, isfinite(*numbers[i]), "a time");
  }
  for (size_t i = 0; i < sizeof flags / sizeof *flags; i++) MS_ARCHIVE_TRANSFER(b, *flags[i]);
  ms_control_archive(b, &r->run.control);
  archive_stats(b, sim, &r->stats);
  if (ms_sim_selects(sim)) ms_method_choice_archive(b, &r->choice);
  ms_energy_monitor_archive(b, sim, &r->run, &r->monitor);
  if (r->tol > 0) r->monitor.good.h = r->monitor.good.control.h;
  ms_error_growth_archive(b, &r->error_growth);
  ms_archive_check(b, r->run.step >= r->run.step0 && r->run.h > 0 && r->solver_h >= 0, "the step");
  ms_archive_check_rounding(b, r->run.t, r->run.t_rounding, "a time");
}

/* Error scales are those of the state that the run started from. */
static void archive_scales(ms_archive *b, ms_norm *norm) {
  for (int32_t i = 0; i < norm->n; i++) {
    ms_norm_body *p = &norm->body[i];
    double *numbers[] = {&p->extent, &p->speed, &p->rounding};
    for (int k = 0; k < 3; k++) {
      MS_ARCHIVE_TRANSFER(b, *numbers[k]);
      ms_archive_check(b, isfinite(*numbers[k]) && *numbers[k] > 0, "a scale");
    }
  }
}

/* Ranks save none, as the factors of each depend on their number; they pass over that of one
 * process. */
static msim_status archive_solver(ms_archive *b, ms_solver *solver, const ms_saved_run *r,
                                  msim_error *err) {
  const int there = solver && MS_ARCHIVE_OPTIONAL(b, r->solver_h > 0) && !ms_archive_failed(b);
  if (there && b->rows && b->direction == MS_ARCHIVE_READ)
    ms_solver_state_skip(b, solver, b->rows->n);
  else if (there) return ms_solver_state_archive(b, solver, r->in_use, err);
  return MSIM_OK;
}

/* order: hash of the particles of all rows */
static msim_status archive_island(ms_archive *b, msim_sim *sim, const ms_saved_run *r,
                                  ms_island_sim *m, uint64_t order, msim_error *err) {
  const uint64_t here = order;
  MS_ARCHIVE_TRANSFER(b, order);
  MS_ARCHIVE_TRANSFER(b, m->at_rest);
  ms_archive_check(b, order == here, "the order of particles");
  ms_archive_check(b, (m->at_rest | 1) == 1, "the flag of rest");
  if (m->model.single) ms_single_archive(b, m->model.single);
  ms_method_state_archive(b, sim->config.integrator, &m->stepper, r->saves_last_step);
  archive_scales(b, &m->norm);
  const msim_status status = archive_solver(b, m->stepper.solver, r, err);
  if (!status && !ms_archive_failed(b))
    ms_energy_monitor_archive_island(b, sim, r->monitor.good.step == r->run.step, &m->stepper,
                                     &m->last_good);
  if (ms_sim_selects(sim)) ms_step_verification_archive_island(b, &m->verification);
  ms_error_growth_archive_island(b, m);
  return status;
}

/* The only island of a rank has the flags that all islands of the checkpoint share: what rests in
 * some of them, or is cached in some, is computed again in all. */
static void share_flags(const ms_island_sim *before, ms_island_sim *m) {
  m->at_rest &= before->at_rest;
  m->last_good.at_rest &= before->last_good.at_rest;
  if (m->stepper.cached_stage != before->stepper.cached_stage) m->stepper.cached_stage = 0;
  if (m->last_good.tag != before->last_good.tag) m->last_good.tag = 0;
}

/* Of one process, by the rows that this rank has of them */
static msim_status archive_whole_islands(ms_archive *b, msim_sim *sim, const ms_saved_run *r,
                                         msim_error *err) {
  const ms_whole_islands *whole = &sim->part->whole;
  ms_island_sim *m = sim->islands;
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < whole->n && !status && !ms_archive_failed(b); i++) {
    const ms_island_sim before = *m;
    ms_rank_rows_select((ms_rank_rows *)b->rows, i);
    status = archive_island(b, sim, r, m, whole->hash[i], err);
    if (b->direction == MS_ARCHIVE_READ && i > 0) share_flags(&before, m);
  }
  return status;
}

msim_status ms_saved_run_archive_islands(ms_archive *b, msim_sim *sim, const ms_saved_run *r,
                                         msim_error *err) {
  msim_status status = MSIM_OK;
  if (b->rows) return archive_whole_islands(b, sim, r, err);
  for (int32_t i = 0; i < sim->nislands && !status && !ms_archive_failed(b); i++) {
    ms_island_sim *m = &sim->islands[i];
    status = archive_island(b, sim, r, m, ms_unknowns_hash(&m->model.unknowns), err);
  }
  return status;
}

/* 1: particles touch planes at the end of the last step. */
static int has_contacts(const msim_sim *sim) {
  int any = 0;
  for (int32_t i = 0; i < sim->nislands; i++)
    any |= ms_stepper_has_contacts(&sim->islands[i].stepper);
  return any;
}

void ms_saved_run_prepare_islands(msim_sim *sim) {
  if (has_contacts(sim)) ms_step_driver_prepare_dense_output(sim);
}

msim_status ms_saved_run_pack_islands(msim_sim *sim, const ms_saved_run *r, ms_archive *b,
                                      msim_error *err) {
  ms_archive count = {.direction = MS_ARCHIVE_COUNT};
  ms_saved_run_archive_islands(&count, sim, r, NULL);
  *b = (ms_archive){.direction = MS_ARCHIVE_WRITE, .size = count.position};
  b->data = ms_memory_allocate(&sim->alloc, count.position, 1);
  if (!b->data) return ms_error_set_memory(err, "a copy of the run");
  ms_saved_run_archive_islands(b, sim, r, NULL);
  b->direction = MS_ARCHIVE_READ, b->size = b->position, b->position = 0;
  return MSIM_OK;
}
