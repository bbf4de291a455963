/* recorder - the front end of output: one file, its kind by its name, one frame after another */
#define _POSIX_C_SOURCE 200809L /* stat */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "base/clock.h"
#include "base/plugin.h"
#include "msim/recorder.h"
#include "sim/csv.h"
#include "sim/sim.h"

struct msim_recorder {
  msim_sim *sim;
  const msim_recorder_type *type;
  void *self; /* NULL: closed */
  ms_host host;
};

/*------------------------------------- kinds ----------------------------------------------------*/

static const struct {
  const char *name, *extension;
} kinds[] = {{"csv", ".csv"}, {"hdf5", ".vtkhdf"}};
enum { NKINDS = sizeof kinds / sizeof *kinds };

#define X(name) const msim_recorder_type *msim_recorder_##name(void);
MSIM_LINKED_RECORDERS
#undef X

static const msim_recorder_type *linked_in(const char *name) {
  if (strcmp(name, "csv") == 0) return ms_recorder_csv();
#define X(recorder) \
  if (strcmp(name, #recorder) == 0) return msim_recorder_##recorder();
  MSIM_LINKED_RECORDERS
#undef X
  return NULL;
}

static msim_status find(const char *name, const char *plugin_path, const msim_recorder_type **type,
                        ms_text *where, msim_error *err) {
  *type = linked_in(name);
  if (*type) return MSIM_OK;
  void *symbol;
  msim_error why;
  msim_status status = ms_plugin_open("recorder", name, plugin_path, &symbol, where, &why);
  if (status) return ms_fail(err, status, "recorder '%s': %s", name, why.text);
  msim_recorder_entry_fn *entry;
  memcpy(&entry, &symbol, sizeof entry); /* ISO C has no cast from void * to a function */
  *type = entry();
  if (!*type) return ms_fail(err, MSIM_ERR_PLUGIN, "%s gave no table of functions", where->data);
  status = ms_plugin_check("recorder", name, where->data, (*type)->abi, MSIM_RECORDER_ABI,
                           (*type)->size, MSIM_RECORDER_SIZE_1, (*type)->name, err);
  if (status) return status;
  const ms_plugin_member members[] = {{"library", !(*type)->library},
                                      {"license", !(*type)->license},
                                      {"open", !(*type)->open},
                                      {"write", !(*type)->write},
                                      {"close", !(*type)->close}};
  return ms_plugin_check_members(where->data, members, sizeof members / sizeof *members, err);
}

static const char *kind_of(const char *path) {
  const char *dot = strrchr(path, '.');
  for (int i = 0; i < NKINDS && dot; i++)
    if (strcmp(dot, kinds[i].extension) == 0) return kinds[i].name;
  return NULL;
}

int32_t msim_recorder_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                           msim_error *err) {
  if (i < 0 || i >= NKINDS) return 0;
  ms_ok(err);
  const msim_allocator alloc = ms_allocator(NULL);
  ms_text where = {.alloc = &alloc};
  const msim_recorder_type *type;
  int found = find(kinds[i].name, plugin_path, &type, &where, err) == MSIM_OK;
  *entry = (msim_plugin_entry){.name = kinds[i].name,
                               .library = found ? type->library : "",
                               .license = found ? type->license : "",
                               .available = found,
                               .note = ""};
  if (found) ms_fail(err, MSIM_OK, "%s", where.length ? where.data : "built in");
  if (err) entry->note = err->text;
  ms_text_free(&where);
  return 1;
}

/*------------------------------------- opening --------------------------------------------------*/

/* The planned time of every frame. */
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

/* A file takes another file's place, but not that of a device, a pipe or a folder. */
static msim_status check_place(const char *path, msim_error *err) {
  struct stat there;
  if (stat(path, &there) != 0 || S_ISREG(there.st_mode)) return MSIM_OK;
  return ms_fail(err, MSIM_ERR_IO, "%s is there already, and it is not a file", path);
}

/* The file gets its name once its frame of metadata stands: half a file never bears it. */
static msim_status open_part(msim_recorder *r, const char *path, const msim_recording *what,
                             msim_error *err) {
  msim_status status = r->type->open(&r->host.base, what, &r->self);
  if (status) {
    remove(what->path);
    return ms_host_fail(&r->host, r->type->name, status, err);
  }
  if (rename(what->path, path) == 0) return MSIM_OK;
  int why = errno;
  r->type->close(r->self);
  r->self = NULL;
  remove(what->path);
  return ms_fail(err, MSIM_ERR_IO, "%s could not be created: %s", path, strerror(why));
}

static msim_status open_file(msim_recorder *r, const char *path, msim_error *err) {
  const msim_sim *sim = r->sim;
  const ms_scene *scene = sim->scene;
  const int64_t planned = ms_plan_count_frames(&sim->plan, &sim->opt, MS_MOST_FRAMES + 1);
  const int64_t nframes = planned < 0 ? 1 : planned; /* csv takes what comes */
  if (planned < 0 && r->type != ms_recorder_csv())
    return ms_fail(
        err, MSIM_ERR_ARG,
        "%s wants to know how many frames come, but under error control nobody knows how "
        "many steps; give fps in place of every",
        path);
  if (nframes > MS_MOST_FRAMES)
    return ms_fail(err, MSIM_ERR_ARG, "%s would get more than %d frames; raise every or lower fps",
                   path, MS_MOST_FRAMES);
  ms_text text = {.alloc = &sim->alloc}, part = {.alloc = &sim->alloc};
  double *times = plan_times(sim, nframes);
  ms_print(&part, "%s.part", path);
  msim_status status = times && !part.failed ? ms_scene_to_json(scene, &text, err)
                                             : ms_fail_memory(err, "the plan of frames");
  if (!status) {
    const msim_recording what = {.size = sizeof what,
                                 .path = part.data,
                                 .name = path,
                                 .n = scene->nparticles,
                                 .nsprings = scene->nsprings,
                                 .ij = scene->ij,
                                 .mass = scene->mass,
                                 .k = scene->k,
                                 .rest = scene->rest,
                                 .nframes = nframes,
                                 .times = times,
                                 .scene = text.data,
                                 .scene_length = text.length};
    status = open_part(r, path, &what, err);
  }
  ms_delete(&sim->alloc, times);
  ms_text_free(&text);
  ms_text_free(&part);
  return status;
}

msim_status msim_recorder_open(msim_sim *sim, const char *path, msim_recorder **recorder,
                               msim_error *err) {
  if (!sim || !path || !recorder)
    return ms_fail(err, MSIM_ERR_ARG, "sim, path or recorder is NULL");
  *recorder = NULL;
  const char *kind = kind_of(path);
  if (!kind)
    return ms_fail(err, MSIM_ERR_NAME, "%s: a trajectory's name ends in .vtkhdf or .csv", path);
  if (sim->plan.t_end < 0)
    return ms_fail(err, MSIM_ERR_ARG, "%s: recording needs an end: set steps or t_end", path);
  msim_status status = check_place(path, err);
  if (status) return status;
  const msim_recorder_type *type;
  ms_text where = {.alloc = &sim->alloc};
  status = find(kind, sim->opt.plugin_path, &type, &where, err);
  ms_text_free(&where);
  if (status) return status;
  msim_recorder *r = ms_new(&sim->alloc, 1, sizeof *r);
  if (!r) return ms_fail_memory(err, "a recorder");
  r->sim = sim;
  r->type = type;
  ms_host_init(&r->host, &sim->alloc);
  double start = ms_clock();
  status = open_file(r, path, err);
  ms_sim_count_output(sim, ms_clock() - start);
  if (status) {
    ms_delete(&sim->alloc, r);
    return status;
  }
  *recorder = r;
  return ms_ok(err);
}

/*------------------------------------- writing --------------------------------------------------*/

msim_status msim_recorder_write(msim_recorder *recorder, msim_error *err) {
  if (!recorder) return ms_fail(err, MSIM_ERR_ARG, "recorder is NULL");
  msim_status status = ms_watch_check(recorder->sim, err);
  if (status) return status;
  double start = ms_clock();
  msim_state state = {.size = sizeof state};
  msim_energy energy = {.size = sizeof energy};
  msim_sim_state(recorder->sim, &state);
  msim_sim_energy(recorder->sim, &energy);
  const msim_frame frame = {.size = sizeof frame,
                            .step = state.step,
                            .t = state.t,
                            .x = state.x,
                            .v = state.v,
                            .kinetic = energy.kinetic,
                            .potential = energy.elastic + energy.gravitational};
  if (!isfinite(energy.total))
    return ms_fail(err, MSIM_NOT_FINITE, "step %lld, t = %g s: energy is beyond all numbers",
                   (long long)state.step, state.t);
  status = recorder->type->write(recorder->self, &frame);
  ms_sim_count_output(recorder->sim, ms_clock() - start);
  return status ? ms_host_fail(&recorder->host, recorder->type->name, status, err) : ms_ok(err);
}

msim_status msim_recorder_close(msim_recorder *recorder, msim_error *err) {
  if (!recorder) return ms_ok(err);
  double start = ms_clock();
  msim_status status = recorder->type->close(recorder->self);
  ms_sim_count_output(recorder->sim, ms_clock() - start);
  if (status) ms_host_fail(&recorder->host, recorder->type->name, status, err);
  else ms_ok(err);
  ms_delete(&recorder->sim->alloc, recorder);
  return status;
}
