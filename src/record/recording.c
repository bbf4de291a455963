#include "record/recording.h"

#include <string.h>

#include "record/recorders.h"
#include "sim/frames.h"

/*------------------------------------- frames ---------------------------------------------------*/

/* The planned times of all frames */
static double *plan_times(const msim_sim *sim, int64_t nframes) {
  double *times = ms_memory_allocate(&sim->alloc, (size_t)nframes, sizeof *times);
  const int has_times = ms_options_have_frame_times(&sim->config.opt);
  int64_t step = 0;
  for (int64_t i = 0; times && i < nframes; i++) {
    times[i] = has_times ? ms_frames_time(&sim->config.plan, &sim->config.opt, i)
                         : sim->config.plan.t0 + (double)step * sim->run.h;
    if (!has_times) step = ms_frames_next_step(&sim->config.plan, &sim->config.opt, step);
  }
  return times;
}

static msim_status count_frames(const ms_recording_source *source, int64_t *nframes,
                                msim_error *err) {
  const ms_config *config = &source->sim->config;
  const int64_t planned = ms_frames_count(&config->plan, &config->opt, MS_FRAMES_MAX + 1);
  *nframes = planned < 0 ? 1 : planned; /* an open-ended recorder does not read it */
  if (planned < 0 && !(MS_RECORDERS_HAS(source->type, open_ended)))
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%s requires the number of frames in advance, but under error control the "
                        "number of steps is unknown; use fps in place of every",
                        source->path);
  if (planned > MS_FRAMES_MAX)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%s would have more than %d frames; use a larger every or a lower fps",
                        source->path, MS_FRAMES_MAX);
  return MSIM_OK;
}

/*------------------------------------- the text of the scene ------------------------------------*/

typedef struct text_reader {
  msim_status (*put)(void *user, const char *piece, size_t length);
  void *user;
  msim_status status;
} text_reader;

static int pass_piece(void *user, const char *piece, size_t length) {
  text_reader *r = user;
  r->status = r->put(r->user, piece, length);
  return r->status == MSIM_OK;
}

static msim_status read_scene(const msim_recording *what,
                              msim_status (*put)(void *user, const char *piece, size_t length),
                              void *user) {
  const ms_scene *scene = what->scene_source;
  text_reader reader = {put, user, MSIM_OK};
  ms_text text = {.alloc = &scene->alloc, .take = pass_piece, .user = &reader};
  const msim_status status = ms_scene_write_json(scene, &text, NULL);
  ms_text_free(&text);
  return reader.status ? reader.status : status;
}

static int count_piece(void *user, const char *piece, size_t length) {
  (void)piece;
  *(size_t *)user += length;
  return 1;
}

/* The text that the scene was read from, or else one that is written here: where ranks share memory
 * with the arrays of the whole scene in pieces, of which the length is needed first. */
static msim_status provide_text(const ms_recording_source *source, ms_recording *a,
                                msim_error *err) {
  msim_recording *what = &a->what;
  if (source->scene->source) {
    what->scene = source->scene->source, what->scene_length = strlen(what->scene);
    return MSIM_OK;
  }
  const int in_pieces = source->sim->ranks && MS_RECORDERS_HAS(source->type, reads_scene);
  if (in_pieces) a->scene.take = count_piece, a->scene.user = &what->scene_length;
  const msim_status status = ms_scene_write_json(source->scene, &a->scene, err);
  if (in_pieces) what->read_scene = read_scene, what->scene_source = source->scene;
  else what->scene = a->scene.data, what->scene_length = a->scene.length;
  return status;
}

/*------------------------------------- the whole ------------------------------------------------*/

msim_status ms_recording_describe(const ms_recording_source *source, msim_recording *what,
                                  msim_error *err) {
  const ms_scene *scene = source->scene;
  *what = (msim_recording){.size = sizeof *what,
                           .path = source->path,
                           .name = source->path,
                           .n = scene->nparticles,
                           .nsprings = scene->nsprings,
                           .checkpoint_capacity = source->checkpoint_capacity,
                           .sync = source->sim->config.opt.sync,
                           .nfaces = scene->nfaces,
                           .nplanes = scene->nplanes,
                           .planes = scene->planes,
                           .title = scene->name,
                           .ncolliders = scene->ncolliders,
                           .colliders = scene->colliders};
  memcpy(what->gravity, scene->external.gravity, sizeof what->gravity);
  return count_frames(source, &what->nframes, err);
}

static void add_arrays(const ms_scene *scene, msim_recording *what) {
  what->ij = scene->ij, what->k = scene->k, what->rest = scene->rest;
  what->damping = scene->damping, what->faces = scene->faces;
  what->mass = scene->mass, what->pinned = scene->pinned;
}

msim_status ms_recording_create(const ms_recording_source *source, ms_recording *a,
                                msim_error *err) {
  *a = (ms_recording){.scene = {.alloc = &source->sim->alloc}};
  msim_status status = ms_recording_describe(source, &a->what, err);
  if (status) return status;
  add_arrays(source->scene, &a->what);
  a->what.times = a->times = plan_times(source->sim, a->what.nframes);
  status =
      a->times ? provide_text(source, a, err) : ms_error_set_memory(err, "the times of the frames");
  if (status) ms_recording_free(&source->sim->alloc, a);
  return status;
}

void ms_recording_free(const msim_allocator *alloc, ms_recording *a) {
  ms_memory_free(alloc, a->times);
  ms_text_free(&a->scene);
}
