/* recorder - write and resume trajectory files (msim_recorder_*), by plugins for their formats */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/plugin.h"
#include "sim/csv.h"
#include "sim/place.h"
#include "sim/recorders.h"
#include "sim/sim.h"

struct msim_recorder {
  msim_sim *sim;
  const msim_recorder_type *type;
  void *self; /* NULL: closed */
  ms_host host;
  ms_place place;
  void *checkpoint; /* buffer; NULL: the recorder cannot resume files */
  size_t capacity;
  int64_t step_kept; /* of the last frame in a resumed file; -1: there is none */
  double t_kept;
};

/*------------------------------------- plan of the frames ---------------------------------------*/

/* The planned times of all frames */
static double *plan_times(const msim_sim *sim, int64_t nframes) {
  double *times = ms_new(&sim->alloc, (size_t)nframes, sizeof *times);
  const int has_times = ms_plan_has_times(&sim->opt);
  int64_t step = 0;
  for (int64_t i = 0; times && i < nframes; i++) {
    times[i] = has_times ? ms_plan_frame_time(&sim->plan, &sim->opt, i)
                         : sim->t0 + (double)step * sim->plan.h;
    if (!has_times) step = ms_plan_next_frame(&sim->plan, &sim->opt, step);
  }
  return times;
}

static msim_status count_frames(const msim_recorder *r, int64_t *nframes, msim_error *err) {
  const msim_sim *sim = r->sim;
  const char *path = r->place.path;
  const int64_t planned = ms_plan_count_frames(&sim->plan, &sim->opt, MS_MOST_FRAMES + 1);
  *nframes = planned < 0 ? 1 : planned; /* csv does not need their number */
  if (planned < 0 && r->type != ms_recorder_csv())
    return ms_fail(
        err, MSIM_ERR_ARG,
        "%s wants to know how many frames come, but under error control nobody knows how "
        "many steps; give fps in place of every",
        path);
  if (planned > MS_MOST_FRAMES)
    return ms_fail(err, MSIM_ERR_ARG, "%s would get more than %d frames; raise every or lower fps",
                   path, MS_MOST_FRAMES);
  return MSIM_OK;
}

/* Arguments of a plugin's open() and resume() */
typedef struct announcement {
  msim_recording what;
  double *times;
  ms_text scene;
} announcement;

static void withdraw(const msim_recorder *r, announcement *a) {
  ms_delete(&r->sim->alloc, a->times);
  ms_text_free(&a->scene);
}

static msim_status announce(const msim_recorder *r, announcement *a, msim_error *err) {
  const ms_scene *scene = r->sim->scene;
  int64_t nframes;
  *a = (announcement){.scene = {.alloc = &r->sim->alloc}};
  msim_status status = count_frames(r, &nframes, err);
  if (status) return status;
  a->times = plan_times(r->sim, nframes);
  status = a->times ? ms_scene_to_json(scene, &a->scene, err)
                    : ms_fail_memory(err, "the plan of frames");
  a->what = (msim_recording){.size = sizeof a->what,
                             .path = r->place.path,
                             .name = r->place.path,
                             .n = scene->nparticles,
                             .nsprings = scene->nsprings,
                             .ij = scene->ij,
                             .mass = scene->mass,
                             .k = scene->k,
                             .rest = scene->rest,
                             .nframes = nframes,
                             .times = a->times,
                             .scene = a->scene.data,
                             .scene_length = a->scene.length,
                             .checkpoint_capacity = r->capacity,
                             .sync = r->sim->opt.sync};
  if (status) withdraw(r, a);
  return status;
}

/*------------------------------------- opening --------------------------------------------------*/

static int is_ours(const msim_recorder *r, const char *path) {
  return MS_RECORDER_HAS(r->type, recognize) && r->type->recognize(&r->host.base, path);
}

/* The file gets its final name once its metadata are written: an incomplete file never has it. */
static msim_status create(msim_recorder *r, announcement *a, msim_error *err) {
  msim_status status = ms_place_begin(&r->place, err);
  if (status) return status;
  a->what.path = r->place.part.data;
  status = r->type->open(&r->host.base, &a->what, &r->self);
  if (status) return ms_host_fail(&r->host, r->type->name, status, err);
  return ms_place_fill(&r->place, a->what.sync, err);
}

/* Open a new file, in place of an older trajectory of msim, or with `force` of any file. */
static msim_status open_new(msim_recorder *r, const char *path, int force, msim_error *err) {
  announcement a;
  int taken;
  msim_status status = ms_place_claim(&r->place, &r->sim->alloc, path, &taken, err);
  if (!status && taken && !force && !is_ours(r, path))
    status = ms_fail(err, MSIM_ERR_IO,
                     "%s is there already, and no trajectory of msim: it is not replaced unless "
                     "that is asked for",
                     path);
  if (!status) status = announce(r, &a, err);
  if (status) return status;
  status = create(r, &a, err);
  withdraw(r, &a);
  return status;
}

/* Resume a file, and set the sim to its last checkpoint. A file without a frame is begun anew. */
static msim_status go_on(msim_recorder *r, announcement *a, msim_error *err) {
  msim_error why;
  msim_resumption from = {.size = sizeof from};
  msim_status status = r->type->resume(&r->host.base, &a->what, &from, &r->self);
  if (status) return ms_host_fail(&r->host, r->type->name, status, err);
  if (from.frames == 0) {
    r->type->close(r->self);
    r->self = NULL;
    return create(r, a, err);
  }
  status = msim_sim_load(r->sim, from.checkpoint, from.checkpoint_length, &why);
  if (status) return ms_fail(err, status, "%s cannot be gone on with: %s", r->place.path, why.text);
  r->step_kept = r->sim->step;
  r->t_kept = ms_sim_time(r->sim);
  return MSIM_OK;
}

static msim_status open_old(msim_recorder *r, const char *path, msim_error *err) {
  announcement a;
  int taken = 0;
  if (!MS_RECORDER_HAS(r->type, resume))
    return ms_fail(err, MSIM_ERR_UNSUPPORTED,
                   "%s: nothing goes on with such a file, as it holds no checkpoints; a .vtkhdf "
                   "file does",
                   path);
  msim_status status = ms_place_claim(&r->place, &r->sim->alloc, path, &taken, err);
  if (!status && !taken)
    status = ms_fail(err, MSIM_ERR_IO, "%s is not there, so there is nothing to go on with", path);
  if (!status) status = announce(r, &a, err);
  if (status) return status;
  status = go_on(r, &a, err);
  withdraw(r, &a);
  return status;
}

static msim_status check_target(const msim_sim *sim, const char *path, const char **kind,
                                msim_error *err) {
  *kind = ms_recorder_kind(path);
  if (!*kind)
    return ms_fail(err, MSIM_ERR_NAME, "%s: a trajectory's name ends in .vtkhdf or .csv", path);
  if (sim->plan.t_end < 0)
    return ms_fail(err, MSIM_ERR_ARG, "%s: recording needs an end: set steps or t_end", path);
  return MSIM_OK;
}

/* Make a recorder that has no file yet. */
static msim_status make(msim_sim *sim, const char *path, msim_recorder **recorder,
                        msim_error *err) {
  const char *kind;
  ms_text where = {.alloc = &sim->alloc};
  msim_status status = check_target(sim, path, &kind, err);
  if (status) return status;
  msim_recorder *r = *recorder = ms_new(&sim->alloc, 1, sizeof *r);
  if (!r) return ms_fail_memory(err, "a recorder");
  r->sim = sim;
  r->step_kept = -1;
  r->place = (ms_place){.path = path, .part.alloc = &sim->alloc, .fd = -1, .before = -1};
  ms_host_init(&r->host, &sim->alloc);
  status = ms_recorder_find(kind, sim->opt.plugin_path, &r->type, &where, err);
  ms_text_free(&where);
  if (status || !MS_RECORDER_HAS(r->type, resume)) return status;
  r->capacity = msim_sim_save_size(sim);
  r->checkpoint = ms_new(&sim->alloc, r->capacity, 1);
  return r->checkpoint ? MSIM_OK : ms_fail_memory(err, "a checkpoint");
}

static void destroy(msim_recorder *r) {
  if (!r) return;
  ms_place_leave(&r->place);
  ms_delete(&r->sim->alloc, r->checkpoint);
  ms_delete(&r->sim->alloc, r);
}

enum { NEW, REPLACE, RESUME };

static msim_status open_at(msim_sim *sim, const char *path, int how, msim_recorder **recorder,
                           msim_error *err) {
  if (!sim || !path || !recorder)
    return ms_fail(err, MSIM_ERR_ARG, "sim, path or recorder is NULL");
  const double start = ms_clock();
  *recorder = NULL;
  msim_recorder *r = NULL;
  msim_status status = make(sim, path, &r, err);
  if (!status)
    status = how == RESUME ? open_old(r, path, err) : open_new(r, path, how == REPLACE, err);
  ms_sim_count_output(sim, ms_clock() - start);
  if (!status) {
    *recorder = r;
    return ms_ok(err);
  }
  if (r && r->self) r->type->close(r->self);
  destroy(r);
  return status;
}

msim_status msim_recorder_open(msim_sim *sim, const char *path, msim_recorder **recorder,
                               msim_error *err) {
  return open_at(sim, path, NEW, recorder, err);
}

msim_status msim_recorder_replace(msim_sim *sim, const char *path, msim_recorder **recorder,
                                  msim_error *err) {
  return open_at(sim, path, REPLACE, recorder, err);
}

msim_status msim_recorder_resume(msim_sim *sim, const char *path, msim_recorder **recorder,
                                 msim_error *err) {
  return open_at(sim, path, RESUME, recorder, err);
}

/*------------------------------------- writing --------------------------------------------------*/

/* Add the checkpoint; none if it exceeds the planned size, as after another state was set. */
static void add_checkpoint(msim_recorder *r, msim_frame *frame) {
  if (r->checkpoint &&
      msim_sim_save(r->sim, r->checkpoint, r->capacity, &frame->checkpoint_length, NULL) == MSIM_OK)
    frame->checkpoint = r->checkpoint;
}

static msim_status write_state(msim_recorder *r, const msim_state *state, msim_error *err) {
  msim_energy energy = {.size = sizeof energy};
  msim_sim_energy(r->sim, &energy);
  msim_frame frame = {.size = sizeof frame,
                      .step = state->step,
                      .t = state->t,
                      .x = state->x,
                      .v = state->v,
                      .kinetic = energy.kinetic,
                      .potential = energy.elastic + energy.gravitational};
  if (!isfinite(energy.total))
    return ms_fail(err, MSIM_NOT_FINITE, "step %lld, t = %g s: energy is beyond all numbers",
                   (long long)state->step, state->t);
  add_checkpoint(r, &frame);
  const msim_status status = r->type->write(r->self, &frame);
  return status ? ms_host_fail(&r->host, r->type->name, status, err) : ms_ok(err);
}

msim_status msim_recorder_write(msim_recorder *recorder, msim_error *err) {
  if (!recorder) return ms_fail(err, MSIM_ERR_ARG, "recorder is NULL");
  msim_status status = ms_watch_check(recorder->sim, err);
  if (status) return status;
  const double start = ms_clock();
  msim_state state = {.size = sizeof state};
  msim_sim_state(recorder->sim, &state);
  if (state.step == recorder->step_kept && state.t == recorder->t_kept) return ms_ok(err);
  status = write_state(recorder, &state, err);
  ms_sim_count_output(recorder->sim, ms_clock() - start);
  return status;
}

msim_status msim_recorder_close(msim_recorder *recorder, msim_error *err) {
  if (!recorder) return ms_ok(err);
  double start = ms_clock();
  msim_status status = recorder->type->close(recorder->self);
  ms_sim_count_output(recorder->sim, ms_clock() - start);
  if (status) ms_host_fail(&recorder->host, recorder->type->name, status, err);
  else ms_ok(err);
  destroy(recorder);
  return status;
}
