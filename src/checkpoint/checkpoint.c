/* checkpoint - save a run to memory, and continue it from there with identical results
 *
 *   header       magic, byte order, version, lengths, a hash of everything
 *   fingerprint  of scene and options (fingerprint.h), as lines "name=value"
 *   run          step and time, with its rounding error; the step controller: next h, last error;
 *                length of the run, to which its tolerance refers; frames shown; stats; what
 *                integrator = auto has chosen; which axis is left out; the h that solvers were
 *                chosen for; the bounds of the energy monitor
 *   forces       gravity, drag and constant forces, if they were changed (saved_scene.h)
 *   springs      that solvers were chosen for, if msim_sim_set_springs has set others since
 *   islands      at rest or not; the stepper (integrate/method_state.h), its error scales, the
 *                solver (linear/solver_state.c); the last good state, if it is another one
 *
 * Everything else is computed anew: models, the order of their unknowns, split springs, analyses
 * and aggregates follow from scene and options; so do bounds, and the plan except its end. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "integrate/method_state.h"
#include "layout/planar.h"
#include "linear/solver_state.h"
#include "checkpoint/fingerprint.h"
#include "checkpoint/saved_scene.h"
#include "choose/method_choice.h"
#include "sim/frames.h"
#include "sim/step_driver.h"

#define MAGIC   "msimsave"
#define ORDER   0x01020304u
#define VERSION 9u

typedef struct header {
  char magic[8];
  uint32_t order, version;
  uint64_t length, hash; /* hash: of all bytes, with 0 in its place */
  uint64_t fingerprint;  /* bytes of the fingerprint */
} header;

/* The hash of all bytes, where h replaces the header. */
static uint64_t hash_of(const header *h, const void *from) {
  header without = *h;
  without.hash = 0;
  return ms_archive_hash(ms_archive_hash(0, &without, sizeof without),
                         (const char *)from + sizeof without, (size_t)h->length - sizeof without);
}

/*------------------------------------- fingerprint ----------------------------------------------*/

/* Write one line per entry. MS_ARCHIVE_COUNT reserves room for the longest number, as values may
 * change. */
static void write_entry(void *data, const char *name, const char *value, int is_hash) {
  enum { LONGEST_NUMBER = 24 };
  ms_archive *b = data;
  const void *const parts[] = {name, "=", value, "\n"};
  (void)is_hash;
  for (int i = 0; i < 4; i++) ms_archive_transfer(b, (void *)(uintptr_t)parts[i], strlen(parts[i]));
  if (b->direction == MS_ARCHIVE_COUNT && strlen(value) < LONGEST_NUMBER)
    b->position += LONGEST_NUMBER - strlen(value);
}

/*------------------------------------- the run --------------------------------------------------*/

typedef struct saved_run {
  ms_run_state run;
  double t0;
  double fps, t_end; /* with `every`: these number the frames */
  int64_t every;
  double solver_h; /* s: solvers were chosen for this h; 0: no solver */
  int32_t left_out;
  int32_t saves_last_step; /* 1: a frame lies inside the last step, which is saved, too */
  int32_t h_from_auto;     /* 1: h was chosen from the stability limit */
  int32_t other_springs;   /* 1: solvers were chosen for other springs */
  double tol, first_h;
  ms_method_choice choice;
  msim_stats stats;
  ms_energy_monitor monitor;
  ms_error_growth error_growth;
} saved_run;

static saved_run collect_run(const msim_sim *sim) {
  const ms_solver *solver = sim->islands->stepper.solver;
  return (saved_run){.run = sim->run,
                     .t0 = sim->config.plan.t0,
                     .fps = sim->config.opt.fps,
                     .t_end = sim->config.plan.t_end,
                     .every = sim->config.opt.every,
                     .solver_h = solver ? solver->creation_h : 0,
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

/* All counts. Seconds are left out, so that identical runs have identical checkpoints. */
static void archive_stats(ms_archive *b, msim_stats *s) {
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
  enum { SECONDS = 7 }; /* new counts of msim_stats have to be added above */
  _Static_assert(
      sizeof *s - offsetof(msim_stats, steps) == 8 * (sizeof counts / sizeof *counts + SECONDS),
      "all counts are in a checkpoint");
}

static void archive_run(ms_archive *b, const msim_sim *sim, saved_run *r) {
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
  archive_stats(b, &r->stats);
  if (ms_sim_selects(sim)) ms_method_choice_archive(b, &r->choice);
  ms_energy_monitor_archive(b, sim, &r->run, &r->monitor);
  if (r->tol > 0) r->monitor.good.h = r->monitor.good.control.h;
  ms_error_growth_archive(b, &r->error_growth);
  ms_archive_check(b, r->run.step >= r->run.step0 && r->run.h > 0 && r->solver_h >= 0, "the step");
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

static msim_status archive_islands(ms_archive *b, msim_sim *sim, const saved_run *r,
                                   msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < sim->nislands && !status && !ms_archive_failed(b); i++) {
    ms_island_sim *m = &sim->islands[i];
    const ms_unknowns *rows = &m->model.unknowns;
    const uint64_t here =
        ms_archive_hash(0, rows->particle, (size_t)rows->stride * sizeof *rows->particle);
    uint64_t order = here;
    MS_ARCHIVE_TRANSFER(b, order);
    MS_ARCHIVE_TRANSFER(b, m->at_rest);
    ms_archive_check(b, order == here, "the order of particles");
    ms_archive_check(b, (m->at_rest | 1) == 1, "the flag of rest");
    ms_method_state_archive(b, sim->config.integrator, &m->stepper, r->saves_last_step);
    archive_scales(b, &m->norm);
    if (m->stepper.solver && !ms_archive_failed(b))
      status = ms_solver_state_archive(b, m->stepper.solver, err);
    if (!status && !ms_archive_failed(b))
      ms_energy_monitor_archive_island(b, sim, r->monitor.good.step == r->run.step, &m->stepper,
                                       &m->last_good);
    if (ms_sim_selects(sim)) ms_step_verification_archive_island(b, &m->verification);
    ms_error_growth_archive_island(b, m);
  }
  return status;
}

/*------------------------------------- save -----------------------------------------------------*/

/* For MS_ARCHIVE_COUNT and MS_ARCHIVE_WRITE; load_run() reads and checks part by part. */
static void write_sim(ms_archive *b, msim_sim *sim, saved_run *r) {
  archive_run(b, sim, r);
  ms_saved_scene_write_forces(b, sim);
  if (r->other_springs) ms_saved_scene_write_springs(b, sim);
  archive_islands(b, sim, r, NULL);
}

/* Bytes that a method for impacts, chosen once planes count, may need beyond those of the present
 * one: for carried vectors, and for particles at rest on planes. */
static size_t reserve_for_impacts(const msim_sim *sim) {
  enum { VECTORS = 4, REST = 64 };
  return (size_t)sim->scene->nparticles * 3 * VECTORS * sizeof(double) +
         (size_t)sim->nislands * REST;
}

size_t msim_sim_save_size(const msim_sim *sim) {
  ms_archive b = {.direction = MS_ARCHIVE_COUNT, .position = sizeof(header)};
  saved_run r = collect_run(sim);
  r.saves_last_step = ms_options_have_frame_times(&sim->config.opt);
  ms_fingerprint_list(sim, write_entry, &b);
  write_sim(&b, (msim_sim *)(uintptr_t)sim, &r);
  if (sim->config.choice.verification.planes_far) b.position += reserve_for_impacts(sim);
  return b.position;
}

/* 1: particles touch planes at the end of the last step. No checkpoint tells which. */
static int has_contacts(const msim_sim *sim) {
  int any = 0;
  for (int32_t i = 0; i < sim->nislands; i++)
    any |= ms_stepper_has_contacts(&sim->islands[i].stepper);
  return any;
}

msim_status msim_sim_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                          msim_error *err) {
  if (!sim || !to || !length) return ms_error_set(err, MSIM_ERR_ARG, "sim, to or length is NULL");
  ms_archive b = {.direction = MS_ARCHIVE_WRITE, .data = to, .size = capacity};
  header h = {.magic = MAGIC, .order = ORDER, .version = VERSION};
  if (has_contacts(sim)) ms_step_driver_prepare_dense_output(sim);
  saved_run r = collect_run(sim);
  MS_ARCHIVE_TRANSFER(&b, h);
  ms_fingerprint_hash_scene(sim);
  ms_fingerprint_list(sim, write_entry, &b);
  h.fingerprint = b.position - sizeof h;
  write_sim(&b, sim, &r);
  if (b.position > capacity)
    return ms_error_set(
        err, MSIM_ERR_ARG,
        "the checkpoint needs %zu bytes, but capacity is %zu; use msim_sim_save_size", b.position,
        capacity);
  h.length = *length = b.position;
  h.hash = hash_of(&h, to);
  memcpy(to, &h, sizeof h);
  return ms_error_clear(err);
}

/*------------------------------------- load -----------------------------------------------------*/

/* Check that the bytes are a complete, undamaged checkpoint of this version. */
static msim_status check_bytes(const void *from, size_t length, header *h, msim_error *err) {
  if (length < sizeof *h || memcmp(from, MAGIC, sizeof h->magic) != 0)
    return ms_error_set(err, MSIM_ERR_ARG, "the %zu bytes are not a checkpoint of msim", length);
  memcpy(h, from, sizeof *h);
  if (h->order != ORDER)
    return ms_error_set(
        err, MSIM_ERR_ARG,
        "the checkpoint was saved on a machine with another byte order; load it on such a machine");
  if (h->version != VERSION)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the checkpoint has format version %u, but msim %s reads version %u; use "
                        "the msim that saved it",
                        h->version, msim_version(), VERSION);
  if (h->length != length)
    return ms_error_set(
        err, MSIM_ERR_ARG,
        "the checkpoint has %llu bytes, but %zu were given; give exactly those that were saved",
        (unsigned long long)h->length, length);
  if (h->fingerprint > length - sizeof *h || hash_of(h, from) != h->hash)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the checkpoint is damaged: its hash does not match its content");
  return MSIM_OK;
}

static msim_status refuse_bytes(const ms_archive *b, msim_error *err) {
  return ms_error_set(err, MSIM_ERR_ARG, "the checkpoint is invalid: %s has an impossible value",
                      b->invalid_item ? b->invalid_item : "its length");
}

/* The end of the run is the loading sim's. If it differs from that of the checkpoint it must not
 * lie before it; with fixed steps h must be the same. */
static msim_status check_end(const msim_sim *sim, const saved_run *r, const ms_plan *plan,
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
static void check_choice(ms_archive *b, const msim_sim *sim, const saved_run *r) {
  const ms_method_choice *here = &sim->config.choice, *there = &r->choice;
  ms_archive_check(b, there->tol == here->tol && there->collision == here->collision,
                   "tol or collision of the choice of a method");
  if (ms_archive_failed(b)) return;
  const int controlled = there->candidates[there->best].error_control;
  ms_archive_check(b, r->tol == (controlled ? there->tol : 0), "tol");
  ms_archive_check(b, r->first_h > 0, "the step");
}

static const ms_integrator *saved_method(const msim_sim *sim, const saved_run *r) {
  return ms_sim_selects(sim) ? r->choice.candidates[r->choice.best].method : sim->config.integrator;
}

static void check_control(ms_archive *b, const ms_integrator *method, double tol,
                          const ms_control *c) {
  const ms_control own = ms_control_make(method, tol, c->span);
  ms_archive_check(b,
                   c->tol == own.tol && c->order == own.order && c->growth == own.growth &&
                       c->safety == own.safety && c->h > 0 && c->span > 0,
                   "error control");
}

/* Check the values that no other function checks. */
static void check_run(ms_archive *b, const msim_sim *sim, const saved_run *r) {
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

static msim_status plan_run(msim_sim *sim, const saved_run *r, msim_error *err) {
  if (ms_sim_selects(sim)) {
    sim->config.choice = r->choice;
    sim->config.integrator = saved_method(sim, r);
    sim->config.opt.collision = r->choice.candidates[r->choice.best].collision;
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
 * choice. */
static msim_status read_islands(msim_sim *sim, ms_archive *b, const saved_run *r, ms_scene *there,
                                msim_error *err) {
  ms_scene *scene = sim->scene;
  const msim_state start = {
      .size = sizeof start, .n = scene->nparticles, .x = scene->x, .v = scene->v};
  if (r->solver_h > 0) sim->run.h = r->solver_h;
  if (there) sim->scene = there;
  msim_status status = ms_sim_create_islands(sim, r->left_out, err);
  sim->run.h = r->run.h, sim->scene = scene;
  if (status) return status;
  if (there) ms_sim_replace_scene(sim, scene);
  ms_sim_start_islands(sim, &start);
  status = archive_islands(b, sim, r, err);
  if (!status && (ms_archive_failed(b) || b->position != b->size)) return refuse_bytes(b, err);
  return status <= 0
             ? status
             : ms_error_set(err, MSIM_ERR_ARG,
                            "the checkpoint's matrix factorization could not be recomputed");
}

/* If frames have the same times their count goes on, else it starts at the time shown last. */
static void set_next_frame(msim_sim *sim, const saved_run *r) {
  const msim_options *opt = &sim->config.opt;
  if (!ms_options_have_frame_times(opt)) return;
  const int same =
      r->fps == opt->fps && r->every == opt->every && r->t_end == sim->config.plan.t_end;
  sim->run.frame = same ? r->run.frame : ms_frames_after(&sim->config.plan, opt, r->run.t_shown);
}

/* Copy the run into the sim; this cannot fail. */
static void set_run(msim_sim *sim, const saved_run *r) {
  const ms_scene *scene = sim->scene;
  const size_t bytes = 3 * (size_t)scene->nparticles * sizeof(double);
  sim->run = r->run;
  sim->stats = r->stats;
  sim->monitor = r->monitor;
  sim->error_growth = r->error_growth;
  set_next_frame(sim, r);
  ms_sim_set_pins(sim);
  /* what no vector holds: particles that belong to no island, and the axis left out */
  memcpy(sim->state_x, scene->x, bytes);
  memcpy(sim->state_v, scene->v, bytes);
  if (sim->state_v_half) memcpy(sim->state_v_half, scene->v, bytes);
  sim->state_is_current = 0;
}

/* Load the run behind archive_run() in the sim's scene, which has the forces of the checkpoint. On
 * failure the sim stays as it was. */
static msim_status load_rest(msim_sim *sim, ms_archive *b, const saved_run *from, msim_error *err) {
  const ms_config config = sim->config;
  const ms_run_state run = sim->run;
  const msim_stats stats = sim->stats;
  saved_run r = *from;
  ms_scene *there = NULL;
  check_run(b, sim, &r);
  if (ms_archive_failed(b)) return refuse_bytes(b, err);
  msim_status status = r.other_springs ? ms_saved_scene_read_springs(b, sim, &there, err) : MSIM_OK;
  if (!status && ms_archive_failed(b)) status = refuse_bytes(b, err);
  if (!status) status = plan_run(sim, &r, err);
  const ms_island_sims old = ms_sim_detach_islands(sim);
  if (!status) status = read_islands(sim, b, &r, there, err);
  if (!status) {
    ms_sim_destroy_detached(sim, &old);
    ms_sim_set_solver_scene(sim, there);
    set_run(sim, &r);
    return MSIM_OK;
  }
  ms_sim_restore_islands(sim, &old);
  ms_scene_release(there);
  sim->config = config, sim->run = run, sim->stats = stats;
  return status;
}

/* Load the run; on failure the sim stays as it was. */
static msim_status load_run(msim_sim *sim, ms_archive *b, msim_error *err) {
  ms_scene *before = sim->scene, *scene = NULL;
  int32_t changed = 0;
  saved_run r = collect_run(sim);
  archive_run(b, sim, &r);
  msim_status status = ms_saved_scene_read_forces(b, sim, &scene, &changed, err);
  if (ms_archive_failed(b)) status = refuse_bytes(b, err);
  if (!status) {
    sim->scene = scene;
    status = load_rest(sim, b, &r, err);
    if (status) sim->scene = before;
  }
  if (status) {
    ms_scene_release(scene);
    return status;
  }
  ms_sim_set_created_forces(sim, changed ? before : NULL);
  ms_scene_release(before);
  return MSIM_OK;
}

msim_status msim_sim_load(msim_sim *sim, const void *from, size_t length, msim_error *err) {
  if (!sim || !from) return ms_error_set(err, MSIM_ERR_ARG, "sim or from is NULL");
  header h;
  msim_status status = check_bytes(from, length, &h, err);
  if (status) return status;
  ms_fingerprint_hash_scene(sim);
  status = ms_fingerprint_compare(sim, (const char *)from + sizeof h, (size_t)h.fingerprint, err);
  if (status) return status;
  ms_archive b = {.direction = MS_ARCHIVE_READ,
                  .data = (unsigned char *)(uintptr_t)from,
                  .size = length,
                  .position = sizeof h + (size_t)h.fingerprint};
  status = load_run(sim, &b, err);
  if (status) return status;
  ms_step_limit_warn(sim);
  return ms_error_clear(err);
}
