#include "checkpoint/restore.h"

#include <math.h>
#include <string.h>

#include "checkpoint/saved_scene.h"
#include "layout/planar.h"
#include "sim/frames.h"
#include "sim/precision_check.h"
#include "sim/rank_sim.h"

/*------------------------------------- checks ---------------------------------------------------*/

static msim_status refuse_bytes(const ms_archive *b, msim_error *err) {
  return ms_error_set(err, MSIM_ERR_ARG, "the checkpoint is invalid: %s has an impossible value",
                      b->invalid_item ? b->invalid_item : "its length");
}

/* The end of the run is the loading sim's. If it differs from that of the checkpoint it must not
 * lie before it; with fixed steps h must be the same. */
static msim_status check_end(const msim_sim *sim, const ms_saved_run *r, const ms_plan *plan,
                             msim_error *err) {
  const int64_t steps = r->run.step - r->run.step0;
  const int is_other = plan->t_end != r->t_end;
  if (is_other && sim->config.opt.tol > 0 && plan->t_end >= 0 && r->run.t > plan->t_end)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "t_end = %g s lies before the checkpoint at t = %g s; use a later t_end",
                        plan->t_end, r->run.t);
  if (is_other && plan->steps >= 0 && steps > plan->steps)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the run has %lld steps, but the checkpoint was saved after %lld; use more "
                        "steps or a later t_end",
                        (long long)plan->steps, (long long)steps);
  if (sim->config.opt.tol == 0 && plan->h != r->run.h)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "t_end = %g s requires h = %.17g s, but the checkpoint has h = %.17g s; "
                        "use a t_end that is a whole number of its steps away",
                        plan->t_end, plan->h, r->run.h);
  return MSIM_OK;
}

/* The choice of auto must be for the same tol and collision here, and the run must follow from
 * it. */
static void check_choice(ms_archive *b, const msim_sim *sim, const ms_saved_run *r) {
  const ms_method_choice *here = &sim->config.choice, *there = &r->choice;
  ms_archive_check(b, there->tol == here->tol && there->collision == here->collision,
                   "tol or collision of the choice of a method");
  if (ms_archive_failed(b)) return;
  const ms_candidate *best = ms_choice_best(there);
  ms_archive_check(
      b,
      best->precision == MSIM_PRECISION_DOUBLE ||
          (here->precision == MSIM_PRECISION_AUTO && !ms_precision_find_obstacle(sim->scene)),
      "the precision");
  ms_archive_check(b, r->tol == 0 || r->tol == best->control_tol, "tol");
  ms_archive_check(b, r->first_h > 0, "the step");
}

static const ms_integrator *saved_method(const msim_sim *sim, const ms_saved_run *r) {
  return ms_sim_selects(sim) ? ms_choice_best(&r->choice)->method : sim->config.integrator;
}

static void check_control(ms_archive *b, const ms_integrator *method, double tol,
                          const ms_control *c) {
  const ms_control own = ms_control_make(method, tol, c->span);
  ms_archive_check(b,
                   c->tol == own.tol && c->order == own.order && c->growth == own.growth &&
                       c->safety == own.safety && c->limited == own.limited && c->h > 0 &&
                       c->span > 0,
                   "error control");
}

/* Check the values that no other function checks. */
static void check_run(ms_archive *b, const msim_sim *sim, const ms_saved_run *r) {
  const int32_t axis = ms_planar_find_axis(sim->scene, sim->config.opt.skip_off);
  ms_archive_check(b, r->left_out == -1 || r->left_out == axis, "the omitted axis");
  if (ms_sim_selects(sim)) check_choice(b, sim, r);
  else ms_archive_check(b, r->tol == sim->config.opt.tol, "tol");
  ms_archive_check(b, r->monitor.good.step >= r->run.step0 && r->monitor.good.step <= r->run.step,
                   "the last good step");
  ms_archive_check(b, r->saves_last_step ? r->tol > 0 : !(r->tol > 0) || r->run.t_shown == r->run.t,
                   "the last step");
  if (ms_archive_failed(b) || r->tol == 0) return;
  check_control(b, saved_method(sim, r), r->tol, &r->run.control);
  check_control(b, saved_method(sim, r), r->tol, &r->monitor.good.control);
}

static msim_status plan_run(msim_sim *sim, const ms_saved_run *r, msim_error *err) {
  if (ms_sim_selects(sim)) {
    sim->config.choice = r->choice;
    sim->config.integrator = saved_method(sim, r);
    sim->config.opt.collision = ms_choice_best(&r->choice)->collision;
    sim->config.opt.precision = ms_choice_best(&r->choice)->precision;
    sim->config.opt.integrator = sim->config.integrator->entry.name;
    sim->config.opt.tol = r->tol, sim->config.opt.h = r->first_h;
    sim->config.step_limit =
        (ms_step_limit){.from_auto = r->h_from_auto, .warned = sim->config.step_limit.warned};
  }
  if (sim->config.opt.steps >= 0) {
    sim->config.opt.steps += sim->run.spent - r->run.spent;
    if (sim->config.opt.steps < 0)
      return ms_error_set(err, MSIM_ERR_ARG,
                          "the run has fewer steps than the checkpoint has made; use more steps");
  }
  ms_plan plan;
  msim_options opt = sim->config.opt;
  if (ms_sim_selects(sim) && r->tol == 0) opt.h = r->run.h; /* h stays, also if the end differs */
  msim_status status = ms_plan_create(&opt, r->t0, &plan, err);
  plan.h_asked = sim->config.opt.h;
  if (!status) status = check_end(sim, r, &plan, err);
  if (status) return status;
  plan.h = r->run.h;
  sim->config.plan = plan;
  return MSIM_OK;
}

/* Build islands and read them. Solvers are chosen again for the h and springs of the first
 * choice, of which those that broke later were whole. */
static msim_status read_islands(msim_sim *sim, ms_archive *b, const ms_saved_run *r,
                                ms_scene *there, msim_error *err) {
  ms_scene *scene = sim->scene;
  const msim_state start = {
      .size = sizeof start, .n = scene->nparticles, .x = scene->x, .v = scene->v};
  sim->run.h = r->solver_h > 0 ? r->solver_h : r->run.h;
  if (there) sim->scene = there;
  sim->scene->hides_broken = 1;
  msim_status status = ms_sim_create_islands(sim, r->left_out, err);
  sim->scene->hides_broken = 0;
  sim->run.h = r->run.h, sim->scene = scene;
  if (!status && there) status = ms_sim_reserve_springs(sim, err);
  if (status) return status;
  if (there || scene->broken) ms_sim_replace_scene(sim, scene);
  ms_sim_start_islands(sim, &start);
  status = ms_saved_run_archive_islands(b, sim, r, err);
  if (!status && (ms_archive_failed(b) || b->position != b->size)) status = refuse_bytes(b, err);
  if (status > 0)
    status = ms_error_set(err, MSIM_ERR_ARG,
                          "the checkpoint's matrix factorization could not be recomputed");
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status) ms_energy_monitor_finish_reading(sim, r->monitor.good.step == r->run.step);
  return status;
}

/* If frames have the same times their count goes on, else it starts at the time shown last. */
static void set_next_frame(msim_sim *sim, const ms_saved_run *r) {
  const msim_options *opt = &sim->config.opt;
  if (!ms_options_have_frame_times(opt)) return;
  const int same =
      r->fps == opt->fps && r->every == opt->every && r->t_end == sim->config.plan.t_end;
  sim->run.frame = same ? r->run.frame : ms_frames_after(&sim->config.plan, opt, r->run.t_shown);
}

/* Copy the run into the sim; this cannot fail. Springs may be others than those that its islands
 * were built for. */
static void set_run(msim_sim *sim, const ms_saved_run *r) {
  const ms_scene *scene = sim->scene;
  const size_t bytes = 3 * (size_t)scene->nparticles * sizeof(double);
  sim->run = r->run;
  sim->stats = r->stats;
  sim->monitor = r->monitor;
  sim->error_growth = r->error_growth;
  set_next_frame(sim, r);
  ms_sim_set_pins(sim);
  ms_sim_set_bounds(sim);
  /* what no vector holds: particles that belong to no island, and the axis left out */
  if (sim->state_x) memcpy(sim->state_x, scene->x, bytes);
  if (sim->state_v) memcpy(sim->state_v, scene->v, bytes);
  if (sim->state_v_half) memcpy(sim->state_v_half, scene->v, bytes);
  sim->state_is_current = 0;
  sim->contacts_known = 0;
}

/*------------------------------------- islands in use -------------------------------------------*/

/* 1: islands that are built for the saved run would be those in use: they follow from the scene,
 * which is the same, and from these. */
static int islands_fit(const msim_sim *sim, const ms_saved_run *r) {
  const ms_stepper *first = &sim->islands->stepper;
  return !ms_sim_selects(sim) && !sim->chosen_for && !r->other_springs &&
         sim->islands->model.unknowns.dropped_axis == r->left_out &&
         (!first->solver || r->solver_h == 0 || first->solver->creation_h == r->solver_h) &&
         (!sim->config.integrator->is_multirate || first->h == r->run.h);
}

/* 1: read to the last byte, on all ranks */
static int read_all_islands(msim_sim *sim, ms_archive *b, const ms_saved_run *r) {
  const int done = !ms_saved_run_archive_islands(b, sim, r, NULL) && !ms_archive_failed(b) &&
                   b->position == b->size;
  if (ms_ranks_agree(sim->ranks, done ? MSIM_OK : MSIM_ERR_ARG, NULL)) return 0;
  ms_energy_monitor_finish_reading(sim, r->monitor.good.step == r->run.step);
  return 1;
}

/* Without a saved state solvers begin anew. */
static void discard_factors(msim_sim *sim, const ms_saved_run *r) {
  for (int32_t i = 0; i < sim->nislands && (sim->part || r->solver_h == 0); i++)
    if (sim->islands[i].stepper.solver) ms_solver_discard_factors(sim->islands[i].stepper.solver);
}

/* Read the islands in use; on failure, 0, they and b stay as they were. now: the present run.
 * Factors are computed again from the same numbers then, which fails only where a library is out of
 * memory for the second time: it goes on without them, as after ms_solver_discard_factors(). */
static int read_islands_in_use(msim_sim *sim, ms_archive *b, ms_saved_run *r, ms_saved_run *now) {
  ms_archive undo;
  const size_t start = b->position;
  r->in_use = now->in_use = 1;
  msim_status status = ms_saved_run_pack_islands(sim, now, &undo, NULL);
  status = ms_ranks_agree(sim->ranks, status, NULL);
  if (status) {
    ms_memory_free(&sim->alloc, undo.data);
    return 0;
  }
  if (sim->scene->broken) ms_sim_replace_scene(sim, sim->scene); /* others are broken */
  const int done = read_all_islands(sim, b, r);
  if (!done) {
    b->position = start, b->invalid_item = NULL;
    read_all_islands(sim, &undo, now);
  } else {
    discard_factors(sim, r);
  }
  ms_memory_free(&sim->alloc, undo.data);
  r->in_use = 0;
  return done;
}

/*------------------------------------- whole runs -----------------------------------------------*/

/* Read new islands in place of those in use; on failure these stay. */
static msim_status replace_islands(msim_sim *sim, ms_archive *b, const ms_saved_run *r,
                                   ms_scene *there, msim_error *err) {
  const ms_island_sims old = ms_sim_detach_islands(sim);
  const msim_status status = read_islands(sim, b, r, there, err);
  if (status) {
    ms_sim_restore_islands(sim, &old);
    return status;
  }
  ms_sim_destroy_detached(sim, &old);
  ms_sim_set_solver_scene(sim, there);
  return MSIM_OK;
}

/* Read what follows the changes of the scene, which the sim's scene has; on failure the sim stays
 * as it was. in_use: 1 if its islands are those of this scene. */
static msim_status restore_in_scene(msim_sim *sim, ms_archive *b, const ms_saved_run *from,
                                    int in_use, msim_error *err) {
  const ms_config config = sim->config;
  const ms_run_state run = sim->run;
  const msim_stats stats = sim->stats;
  ms_saved_run now = ms_saved_run_collect(sim), r = *from;
  ms_scene *there = NULL;
  check_run(b, sim, &r);
  if (ms_archive_failed(b)) return refuse_bytes(b, err);
  msim_status status = r.other_springs ? ms_saved_scene_read_springs(b, sim, &there, err) : MSIM_OK;
  if (!status && ms_archive_failed(b)) status = refuse_bytes(b, err);
  if (!status) status = plan_run(sim, &r, err);
  if (!status && !(in_use && islands_fit(sim, &r) && read_islands_in_use(sim, b, &r, &now)))
    status = replace_islands(sim, b, &r, there, err);
  if (!status) {
    set_run(sim, &r);
    return MSIM_OK;
  }
  ms_scene_release(there);
  sim->config = config, sim->run = run, sim->stats = stats;
  return status;
}

/* Record which scenes the sim had before it was changed and edited. before: the one in use until
 * now */
static void set_origins(msim_sim *sim, ms_scene *before, int32_t changed) {
  const int was_edited = sim->edited_from != NULL;
  ms_scene *unedited = ms_scene_retain(was_edited ? sim->edited_from : before);
  if (sim->scene != before) ms_sim_free_matrix(sim); /* its model refers to the scene before */
  if (sim->scene != before && (was_edited || changed == MS_SCENE_EDITED)) sim->edits++;
  if (changed != MS_SCENE_EDITED) {
    ms_sim_set_edited_from(sim, NULL);
    ms_sim_set_created_scene(sim, changed ? unedited : NULL);
  } else if (!was_edited) {
    ms_sim_set_edited_from(sim, ms_scene_retain(unedited));
  }
  ms_scene_release(unedited);
}

/* Exchange the flags of broken springs. */
static void exchange_broken(ms_scene *scene, uint8_t **broken) {
  uint8_t *before = scene->broken;
  scene->broken = *broken, *broken = before;
}

/* The flags of the checkpoint; NULL: no spring of the scene breaks. */
static msim_status read_broken(ms_archive *b, const ms_scene *s, uint8_t **broken,
                               msim_error *err) {
  *broken = NULL;
  if (!s->broken) return MSIM_OK;
  if (!MS_NEW(&s->alloc, *broken, s->spring_capacity))
    return ms_error_set_memory(err, "the broken springs");
  ms_saved_scene_archive_broken(b, s, *broken);
  return MSIM_OK;
}

/* 1: islands were built for the same broken springs. */
static int have_same_solvers(const ms_scene *s, const uint8_t *broken) {
  for (int32_t e = 0; e < s->nsprings && broken; e++)
    if ((s->broken[e] == MS_BROKEN_BEFORE) != (broken[e] == MS_BROKEN_BEFORE)) return 0;
  return 1;
}

/* With the scene of the checkpoint and its broken springs, which get those before on failure */
static msim_status restore_with_scene(msim_sim *sim, ms_archive *b, const ms_saved_run *r,
                                      ms_scene *scene, uint8_t **broken, msim_error *err) {
  ms_scene *before = sim->scene;
  const int in_use = scene == before && have_same_solvers(scene, *broken);
  sim->scene = scene;
  exchange_broken(scene, broken);
  const msim_status status = restore_in_scene(sim, b, r, in_use, err);
  if (!status) return MSIM_OK;
  exchange_broken(scene, broken);
  sim->scene = before;
  if (*broken && in_use) ms_sim_replace_scene(sim, before);
  return status;
}

/* Ranks divide the scene that they were created with. */
static msim_status check_ranks(const msim_sim *sim, const ms_saved_run *r, int32_t changed,
                               msim_error *err) {
  if (!changed && !r->other_springs) return MSIM_OK;
  return ms_rank_sim_refuse(sim, "the checkpoint of a scene that was changed", err);
}

msim_status ms_restore_run(msim_sim *sim, ms_archive *b, msim_error *err) {
  ms_saved_run_prepare_islands(sim);
  const msim_allocator alloc = sim->alloc;
  ms_scene *before = sim->scene, *scene = NULL;
  uint8_t *broken = NULL;
  int32_t changed = 0;
  ms_saved_run r = ms_saved_run_collect(sim);
  ms_saved_run_archive(b, sim, &r);
  msim_status status = ms_saved_scene_read_changes(b, sim, &scene, &changed, err);
  if (!status && scene) status = read_broken(b, scene, &broken, err);
  if (ms_archive_failed(b)) status = refuse_bytes(b, err);
  if (!status && (!sim->part || sim->state_x))
    status = ms_sim_reserve_state(sim, scene->nparticles, err);
  if (!status) status = check_ranks(sim, &r, changed, err);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status) status = restore_with_scene(sim, b, &r, scene, &broken, err);
  ms_memory_free(&alloc, broken);
  if (status) {
    ms_scene_release(scene);
    return status;
  }
  set_origins(sim, before, changed);
  ms_scene_release(before);
  return MSIM_OK;
}

msim_status ms_restore_copy(msim_sim *copy, ms_scene *chosen_for, ms_archive *islands,
                            const ms_saved_run *r, msim_error *err) {
  const msim_status status = read_islands(copy, islands, r, chosen_for, err);
  if (status) return status;
  if (chosen_for) ms_sim_set_solver_scene(copy, ms_scene_retain(chosen_for));
  set_run(copy, r);
  return MSIM_OK;
}
