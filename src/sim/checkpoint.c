/* checkpoint - save a run to memory, and continue it from there with identical results
 *
 *   header       magic, byte order, version, lengths, a hash of everything
 *   fingerprint  of scene and options (marks.h), as lines "name=value"
 *   run          step and time, with its rounding error; the step controller: next h, last error;
 *                length of the run, to which its tolerance refers; frames shown; stats; what
 *                integrator = auto has chosen; which axis is left out; the h that solvers were
 *                chosen for; the bounds of the energy monitor
 *   springs      that solvers were chosen for, if msim_sim_set_springs has set others since
 *   islands      at rest or not; the stepper (integrate/history.h), its error scales, the solver
 *                (linear/history.c); the last good state, if it is another one (watch.h)
 *
 * Everything else is computed anew: models, the order of their unknowns, split springs, analyses
 * and aggregates follow from scene and options; so do bounds, and the plan except its end. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "integrate/history.h"
#include "layout/flat.h"
#include "sim/drive.h"

#define MAGIC   "msimsave"
#define ORDER   0x01020304u
#define VERSION 8u

typedef struct header {
  char magic[8];
  uint32_t order, version;
  uint64_t length, hash; /* hash: of all bytes, with 0 in its place */
  uint64_t marks;        /* bytes of the fingerprint */
} header;

/* The hash of all bytes, where h replaces the header. */
static uint64_t hash_of(const header *h, const void *from) {
  header without = *h;
  without.hash = 0;
  return ms_hash(ms_hash(0, &without, sizeof without), (const char *)from + sizeof without,
                 (size_t)h->length - sizeof without);
}

/*------------------------------------- fingerprint ----------------------------------------------*/

/* Write one line per entry. MS_COUNT reserves room for the longest number, as values may change. */
static void put_mark(void *data, const char *name, const char *value, int is_hash) {
  enum { LONGEST_NUMBER = 24 };
  ms_bytes *b = data;
  const void *const parts[] = {name, "=", value, "\n"};
  (void)is_hash;
  for (int i = 0; i < 4; i++) ms_bytes_pass(b, (void *)(uintptr_t)parts[i], strlen(parts[i]));
  if (b->direction == MS_COUNT && strlen(value) < LONGEST_NUMBER)
    b->used += LONGEST_NUMBER - strlen(value);
}

/* The sim's fingerprint, compared with that of the checkpoint */
typedef struct comparison {
  const char *next, *end; /* lines not compared yet */
  msim_status status;
  msim_error *err;
} comparison;

/* Up to the first difference both have the same names in the same order. */
static void compare_mark(void *data, const char *name, const char *value, int is_hash) {
  comparison *c = data;
  if (c->status) return;
  const size_t length = strlen(name);
  const char *line = c->next, *end = memchr(line, '\n', (size_t)(c->end - line));
  if (!end || (size_t)(end - line) <= length || memcmp(line, name, length) != 0 ||
      line[length] != '=') {
    c->status = ms_fail(c->err, MSIM_ERR_ARG, "the checkpoint says nothing of %s", name);
    return;
  }
  const char *there = line + length + 1;
  const size_t size = (size_t)(end - there);
  c->next = end + 1;
  if (size == strlen(value) && memcmp(there, value, size) == 0) return;
  if (is_hash)
    c->status = ms_fail(c->err, MSIM_ERR_ARG, "%s differs from that in the checkpoint", name);
  else
    c->status = ms_fail(c->err, MSIM_ERR_ARG, "%s is %s here and %.*s in the checkpoint", name,
                        *value ? value : "not given", size ? (int)(size < 100 ? size : 100) : 9,
                        size ? there : "not given");
}

static msim_status compare_marks(const msim_sim *sim, const char *marks, size_t size,
                                 msim_error *err) {
  comparison c = {.next = marks, .end = marks + size, .err = err};
  ms_sim_marks(sim, compare_mark, &c);
  return c.status;
}

/*------------------------------------- the run --------------------------------------------------*/

typedef struct run {
  int64_t step, step0, spent, frame;
  double t0, h, t, t_lost, t_shown;
  ms_control control;
  double fps, t_end; /* with `every`: these number the frames */
  int64_t every;
  double solver_h; /* s: solvers were chosen for this h; 0: no solver */
  int32_t left_out;
  int32_t inside; /* 1: a frame lies inside the last step, which is saved, too */
  int32_t chosen; /* 1: h was chosen from the stability limit */
  int32_t others; /* 1: solvers were chosen for other springs */
  double tol, first_h;
  ms_selection selection;
  msim_stats stats;
  ms_watch watch;
  ms_sensitivity sensitivity;
} run;

/* 1: the frame shown last, or the next one, lies inside the last step. */
static int is_inside(const msim_sim *sim) {
  if (!ms_plan_has_times(&sim->opt) || sim->step == sim->step0) return 0;
  return sim->t_shown < sim->t || ms_plan_frame_time(&sim->plan, &sim->opt, sim->frame) < sim->t;
}

static run run_of(const msim_sim *sim) {
  const ms_solver *solver = sim->motion->stepper.solver;
  return (run){.step = sim->step,
               .step0 = sim->step0,
               .spent = sim->spent,
               .frame = sim->frame,
               .t0 = sim->t0,
               .h = sim->plan.h,
               .t = sim->t,
               .t_lost = sim->t_lost,
               .t_shown = sim->t_shown,
               .control = sim->control,
               .fps = sim->opt.fps,
               .t_end = sim->plan.t_end,
               .every = sim->opt.every,
               .solver_h = solver ? solver->planned : 0,
               .left_out = sim->motion->model.rows.left_out,
               .inside = is_inside(sim),
               .chosen = sim->advice.chosen,
               .others = sim->chosen_for != NULL,
               .tol = sim->opt.tol,
               .first_h = sim->opt.h,
               .selection = sim->selection,
               .stats = sim->stats,
               .watch = sim->watch,
               .sensitivity = sim->sensitivity};
}

/* All counts. Seconds are left out, so that identical runs have identical checkpoints. */
static void pass_stats(ms_bytes *b, msim_stats *s) {
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
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) ms_bytes_pass_count(b, counts[i]);
  enum { SECONDS = 7 }; /* new counts of msim_stats have to be added above */
  _Static_assert(
      sizeof *s - offsetof(msim_stats, steps) == 8 * (sizeof counts / sizeof *counts + SECONDS),
      "all counts are in a checkpoint");
}

static void pass_run(ms_bytes *b, const msim_sim *sim, run *r) {
  int64_t *counts[] = {&r->step, &r->step0, &r->spent, &r->frame, &r->every};
  double *numbers[] = {&r->t0,  &r->h,     &r->t,        &r->t_lost, &r->t_shown,
                       &r->fps, &r->t_end, &r->solver_h, &r->tol,    &r->first_h};
  int32_t *flags[] = {&r->left_out, &r->inside, &r->chosen, &r->others};
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) ms_bytes_pass_count(b, counts[i]);
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    MS_BYTES_PASS(b, *numbers[i]);
    ms_bytes_check(b, isfinite(*numbers[i]), "a time");
  }
  for (size_t i = 0; i < sizeof flags / sizeof *flags; i++) MS_BYTES_PASS(b, *flags[i]);
  ms_control_history(b, &r->control);
  pass_stats(b, &r->stats);
  if (ms_sim_selects(sim)) ms_selection_history(b, &r->selection);
  ms_watch_history(b, sim, &r->watch);
  ms_sensitivity_archive(b, &r->sensitivity);
  ms_bytes_check(b, r->step >= r->step0 && r->h > 0 && r->solver_h >= 0, "the step");
}

static void pass_springs(ms_bytes *b, ms_scene *s) {
  double *arrays[] = {s->k, s->rest, s->damping};
  for (int i = 0; i < 3; i++) {
    ms_bytes_pass(b, arrays[i], (size_t)s->nsprings * sizeof(double));
    for (int32_t e = 0; e < s->nsprings && b->direction == MS_TAKE; e++)
      ms_bytes_check(b, isfinite(arrays[i][e]) && arrays[i][e] >= 0, "a spring");
  }
}

/* Error scales are those of the state that the run started from. */
static void pass_norm(ms_bytes *b, ms_norm *norm) {
  for (int32_t i = 0; i < norm->n; i++) {
    ms_part *p = &norm->part[i];
    double *numbers[] = {&p->extent, &p->speed, &p->rounding};
    for (int k = 0; k < 3; k++) {
      MS_BYTES_PASS(b, *numbers[k]);
      ms_bytes_check(b, isfinite(*numbers[k]) && *numbers[k] > 0, "a scale");
    }
  }
}

static msim_status pass_islands(ms_bytes *b, msim_sim *sim, const run *r, msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < sim->nislands && !status && !ms_bytes_failed(b); i++) {
    ms_motion *m = &sim->motion[i];
    const ms_rows *rows = &m->model.rows;
    const uint64_t here = ms_hash(0, rows->particle, (size_t)rows->stride * sizeof *rows->particle);
    uint64_t order = here;
    MS_BYTES_PASS(b, order);
    MS_BYTES_PASS(b, m->at_rest);
    ms_bytes_check(b, order == here, "the order of particles");
    ms_bytes_check(b, (m->at_rest | 1) == 1, "what is at rest");
    ms_stepper_history(b, sim->integrator, &m->stepper, r->inside);
    pass_norm(b, &m->norm);
    if (m->stepper.solver && !ms_bytes_failed(b))
      status = ms_solver_history(b, m->stepper.solver, err);
    if (!status && !ms_bytes_failed(b))
      ms_guard_history(b, sim, r->watch.step == r->step, &m->stepper, &m->guard);
    if (ms_sim_selects(sim)) ms_check_history(b, &m->check);
    ms_sensitivity_archive_island(b, m);
  }
  return status;
}

/*------------------------------------- save -----------------------------------------------------*/

/* For MS_COUNT and MS_PUT; take() reads and checks part by part. */
static void put_sim(ms_bytes *b, msim_sim *sim, run *r) {
  pass_run(b, sim, r);
  if (r->others) pass_springs(b, sim->chosen_for);
  pass_islands(b, sim, r, NULL);
}

/* Bytes that a method for impacts, chosen once planes count, may need beyond those of the present
 * one: for carried vectors, and for particles at rest on planes. */
static size_t room_for_impacts(const msim_sim *sim) {
  enum { VECTORS = 4, REST = 64 };
  return (size_t)sim->scene->nparticles * 3 * VECTORS * sizeof(double) +
         (size_t)sim->nislands * REST;
}

size_t msim_sim_save_size(const msim_sim *sim) {
  ms_bytes b = {.direction = MS_COUNT, .used = sizeof(header)};
  run r = run_of(sim);
  r.inside = ms_plan_has_times(&sim->opt);
  ms_sim_marks(sim, put_mark, &b);
  put_sim(&b, (msim_sim *)(uintptr_t)sim, &r);
  if (sim->selection.verification.away) b.used += room_for_impacts(sim);
  return b.used;
}

msim_status msim_sim_save(msim_sim *sim, void *to, size_t capacity, size_t *length,
                          msim_error *err) {
  if (!sim || !to || !length) return ms_fail(err, MSIM_ERR_ARG, "sim, to or length is NULL");
  ms_bytes b = {.direction = MS_PUT, .at = to, .size = capacity};
  header h = {.magic = MAGIC, .order = ORDER, .version = VERSION};
  run r = run_of(sim);
  MS_BYTES_PASS(&b, h);
  ms_sim_hash_scene(sim);
  ms_sim_marks(sim, put_mark, &b);
  h.marks = b.used - sizeof h;
  put_sim(&b, sim, &r);
  if (b.used > capacity)
    return ms_fail(err, MSIM_ERR_ARG, "the checkpoint takes %zu bytes; there is room for %zu",
                   b.used, capacity);
  h.length = *length = b.used;
  h.hash = hash_of(&h, to);
  memcpy(to, &h, sizeof h);
  return ms_ok(err);
}

/*------------------------------------- load -----------------------------------------------------*/

/* Check that the bytes are a complete, undamaged checkpoint of this version. */
static msim_status check_bytes(const void *from, size_t length, header *h, msim_error *err) {
  if (length < sizeof *h || memcmp(from, MAGIC, sizeof h->magic) != 0)
    return ms_fail(err, MSIM_ERR_ARG, "the %zu bytes are no checkpoint of msim", length);
  memcpy(h, from, sizeof *h);
  if (h->order != ORDER)
    return ms_fail(err, MSIM_ERR_ARG, "the checkpoint is of a machine with another byte order");
  if (h->version != VERSION)
    return ms_fail(err, MSIM_ERR_ARG, "the checkpoint is of version %u; msim %s reads version %u",
                   h->version, msim_version(), VERSION);
  if (h->length != length)
    return ms_fail(err, MSIM_ERR_ARG, "the checkpoint has %llu bytes, and %zu are there",
                   (unsigned long long)h->length, length);
  if (h->marks > length - sizeof *h || hash_of(h, from) != h->hash)
    return ms_fail(err, MSIM_ERR_ARG,
                   "the checkpoint is damaged: its bytes are not those that were written");
  return MSIM_OK;
}

static msim_status refuse_bytes(const ms_bytes *b, msim_error *err) {
  return ms_fail(err, MSIM_ERR_ARG, "the checkpoint cannot be: %s is not as it was written",
                 b->wrong ? b->wrong : "its length");
}

/* The end of the run is the loading sim's. If it differs from that of the checkpoint it must not
 * lie before it; with fixed steps h must be the same. */
static msim_status check_end(const msim_sim *sim, const run *r, const ms_plan *plan,
                             msim_error *err) {
  const int64_t steps = r->step - r->step0;
  const int is_other = plan->t_end != r->t_end;
  if (is_other && sim->opt.tol > 0 && plan->t_end >= 0 && r->t > plan->t_end)
    return ms_fail(err, MSIM_ERR_ARG, "the run ends at t = %g s, but the checkpoint is of t = %g s",
                   plan->t_end, r->t);
  if (is_other && plan->steps >= 0 && steps > plan->steps)
    return ms_fail(err, MSIM_ERR_ARG,
                   "the run ends after %lld steps, but the checkpoint is of step %lld",
                   (long long)plan->steps, (long long)steps);
  if (sim->opt.tol == 0 && plan->h != r->h)
    return ms_fail(err, MSIM_ERR_ARG,
                   "to end at t_end = %g s, h is %.17g s here and %.17g s in the checkpoint",
                   plan->t_end, plan->h, r->h);
  return MSIM_OK;
}

/* The choice of auto must be for the same tol and collision here, and the run must follow from
 * it. */
static void check_selection(ms_bytes *b, const msim_sim *sim, const run *r) {
  const ms_selection *here = &sim->selection, *there = &r->selection;
  ms_bytes_check(b, there->tol == here->tol && there->collision == here->collision,
                 "what the choice of a method is by");
  if (ms_bytes_failed(b)) return;
  const int controlled = there->candidates[there->best].controlled;
  ms_bytes_check(b, r->tol == (controlled ? there->tol : 0), "tol");
  ms_bytes_check(b, r->first_h > 0, "the step");
}

static const ms_integrator *method_of(const msim_sim *sim, const run *r) {
  return ms_sim_selects(sim) ? r->selection.candidates[r->selection.best].method : sim->integrator;
}

static void check_control(ms_bytes *b, const ms_integrator *method, double tol,
                          const ms_control *c) {
  const ms_control own = ms_control_of(method, tol, c->span);
  ms_bytes_check(b,
                 c->tol == own.tol && c->order == own.order && c->growth == own.growth &&
                     c->safety == own.safety && c->h > 0 && c->span > 0,
                 "error control");
}

/* Check the values that no other function checks. */
static void check_run(ms_bytes *b, const msim_sim *sim, const run *r) {
  const int32_t flat = ms_flat_axis(sim->scene, sim->opt.skip_off);
  ms_bytes_check(b, r->left_out == -1 || r->left_out == flat, "the axis left out");
  if (ms_sim_selects(sim)) check_selection(b, sim, r);
  else ms_bytes_check(b, r->tol == sim->opt.tol, "tol");
  ms_bytes_check(b, r->watch.step >= r->step0 && r->watch.step <= r->step, "the last good step");
  ms_bytes_check(b, r->inside ? r->tol > 0 : !(r->tol > 0) || r->t_shown == r->t, "the last step");
  if (ms_bytes_failed(b) || r->tol == 0) return;
  check_control(b, method_of(sim, r), r->tol, &r->control);
  check_control(b, method_of(sim, r), r->tol, &r->watch.control);
}

static msim_status plan_run(msim_sim *sim, const run *r, msim_error *err) {
  if (ms_sim_selects(sim)) {
    sim->selection = r->selection;
    sim->integrator = method_of(sim, r);
    sim->opt.collision = r->selection.candidates[r->selection.best].collision;
    sim->opt.integrator = sim->integrator->entry.name;
    sim->opt.tol = r->tol, sim->opt.h = r->first_h;
    sim->advice = (ms_advice){.chosen = r->chosen, .warned = sim->advice.warned};
  }
  if (sim->opt.steps >= 0) {
    sim->opt.steps += sim->spent - r->spent;
    if (sim->opt.steps < 0)
      return ms_fail(err, MSIM_ERR_ARG, "the run ends before the checkpoint does");
  }
  ms_plan plan;
  msim_options opt = sim->opt;
  if (ms_sim_selects(sim) && r->tol == 0) opt.h = r->h; /* h stays, also if the end differs */
  msim_status status = ms_plan_create(&opt, r->t0, &plan, err);
  plan.h_asked = sim->opt.h;
  if (!status) status = check_end(sim, r, &plan, err);
  if (status) return status;
  plan.h = r->h;
  sim->plan = plan;
  return MSIM_OK;
}

/* *there: the scene whose springs solvers were chosen for; NULL: they are the present ones. */
static msim_status take_springs(ms_bytes *b, const msim_sim *sim, const run *r, ms_scene **there,
                                msim_error *err) {
  msim_scene copy = {sim->scene};
  *there = NULL;
  if (!r->others) return MSIM_OK;
  ms_scene_share(sim->scene);
  *there = ms_scene_writable(&copy, err);
  if (!*there) {
    ms_scene_release(sim->scene);
    return MSIM_ERR_MEMORY;
  }
  pass_springs(b, *there);
  return ms_bytes_failed(b) ? refuse_bytes(b, err) : MSIM_OK;
}

/* Build islands and read them. Solvers are chosen again for the h and springs of the first
 * choice. */
static msim_status make_islands(msim_sim *sim, ms_bytes *b, const run *r, ms_scene *there,
                                msim_error *err) {
  ms_scene *scene = sim->scene;
  const msim_state start = {
      .size = sizeof start, .n = scene->nparticles, .x = scene->x, .v = scene->v};
  if (r->solver_h > 0) sim->plan.h = r->solver_h;
  if (there) sim->scene = there;
  msim_status status = ms_sim_make_motions(sim, r->left_out, err);
  sim->plan.h = r->h, sim->scene = scene;
  if (status) return status;
  if (there) ms_sim_use_scene(sim, scene);
  ms_sim_start_islands(sim, &start);
  status = pass_islands(b, sim, r, err);
  if (!status && (ms_bytes_failed(b) || b->used != b->size)) return refuse_bytes(b, err);
  return status <= 0 ? status : ms_fail(err, MSIM_ERR_ARG, "a factor cannot be made again");
}

/* If frames have the same times their count goes on, else it starts at the time shown last. */
static void use_frames(msim_sim *sim, const run *r) {
  const msim_options *opt = &sim->opt;
  if (!ms_plan_has_times(opt)) return;
  const int same = r->fps == opt->fps && r->every == opt->every && r->t_end == sim->plan.t_end;
  sim->frame = same ? r->frame : ms_plan_frame_after(&sim->plan, opt, r->t_shown);
}

/* Copy the run into the sim; this cannot fail. */
static void use_run(msim_sim *sim, const run *r) {
  const ms_scene *scene = sim->scene;
  const size_t flat = 3 * (size_t)scene->nparticles * sizeof(double);
  sim->step = r->step, sim->step0 = r->step0, sim->spent = r->spent;
  sim->t0 = r->t0, sim->t = r->t, sim->t_lost = r->t_lost, sim->t_shown = r->t_shown;
  sim->control = r->control;
  sim->stats = r->stats;
  sim->watch = r->watch;
  sim->sensitivity = r->sensitivity;
  use_frames(sim, r);
  /* what no vector holds: particles that belong to no island, and the axis left out */
  memcpy(sim->flat_x, scene->x, flat);
  memcpy(sim->flat_v, scene->v, flat);
  if (sim->flat_v_half) memcpy(sim->flat_v_half, scene->v, flat);
  sim->flat_is_current = 0;
}

/* Load the run; on failure the sim stays as it was. */
static msim_status take(msim_sim *sim, ms_bytes *b, msim_error *err) {
  const ms_plan plan = sim->plan;
  const ms_selection selection = sim->selection;
  const ms_advice advice = sim->advice;
  const ms_integrator *integrator = sim->integrator;
  const msim_options opt = sim->opt;
  const msim_stats stats = sim->stats;
  run r = run_of(sim);
  pass_run(b, sim, &r);
  check_run(b, sim, &r);
  if (ms_bytes_failed(b)) return refuse_bytes(b, err);
  ms_scene *there;
  msim_status status = take_springs(b, sim, &r, &there, err);
  if (!status) status = plan_run(sim, &r, err);
  const ms_motions old = ms_sim_put_aside(sim);
  if (!status) status = make_islands(sim, b, &r, there, err);
  if (!status) {
    ms_sim_drop(sim, &old);
    ms_sim_choose_for(sim, there);
    use_run(sim, &r);
    return MSIM_OK;
  }
  ms_sim_put_back(sim, &old);
  ms_scene_release(there);
  sim->plan = plan, sim->selection = selection, sim->advice = advice;
  sim->integrator = integrator, sim->opt = opt, sim->stats = stats;
  return status;
}

msim_status msim_sim_load(msim_sim *sim, const void *from, size_t length, msim_error *err) {
  if (!sim || !from) return ms_fail(err, MSIM_ERR_ARG, "sim or from is NULL");
  header h;
  msim_status status = check_bytes(from, length, &h, err);
  if (status) return status;
  ms_sim_hash_scene(sim);
  status = compare_marks(sim, (const char *)from + sizeof h, (size_t)h.marks, err);
  if (status) return status;
  ms_bytes b = {.direction = MS_TAKE,
                .at = (unsigned char *)(uintptr_t)from,
                .size = length,
                .used = sizeof h + (size_t)h.marks};
  status = take(sim, &b, err);
  if (status) return status;
  ms_sim_watch_step(sim);
  return ms_ok(err);
}
