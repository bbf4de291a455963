/* recorder - write and resume trajectory files (msim_recorder_*), by plugins for their formats
 *
 * Where several ranks share the scene, rank 0 opens the file. All write rows of each frame and a
 * part of its checkpoint (rank_frames.h) if the plugin provides for that, else rank 0 has all rows.
 * Each function ends with an agreement on its status. */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/plugin.h"
#include "checkpoint/checkpoint.h"
#include "record/output_file.h"
#include "record/rank_frames.h"
#include "record/recording.h"
#include "record/recorders.h"
#include "record/strain.h"
#include "sim/frames.h"
#include "sim/rank_section.h"

struct msim_recorder {
  msim_sim *sim;
  ms_scene *scene; /* while the file is opened: the whole one, with arrays on rank 0 */
  const msim_recorder_type *type;
  void *self; /* NULL: closed, or on another rank than 0 that writes no rows */
  ms_plugin_host host;
  ms_output_file file;
  void *checkpoint;     /* buffer; NULL: the format has none, or ranks do not write parts */
  size_t part_capacity; /* its size: for the part of this rank */
  size_t capacity;      /* of a whole checkpoint; 0: none */
  ms_strain strain;
  double *poses;     /* 6 ncolliders */
  int64_t step_kept; /* of the last frame in a resumed file; -1: there is none */
  double t_kept;
  int64_t edits;         /* sim->edits when the recorder was opened */
  uint64_t springs_hash; /* of particles and springs then */
  ms_rank_frames frames; /* of a rank that writes rows */
};

/*------------------------------------- edited sims ----------------------------------------------*/

static uint64_t hash_springs(const ms_scene *s) {
  const uint64_t hash = ms_archive_hash((uint64_t)s->nparticles, &s->nsprings, sizeof s->nsprings);
  return ms_archive_hash(hash, s->ij, 2 * (size_t)s->nsprings * sizeof *s->ij);
}

/* The rows of the file belong to the particles and springs that the sim had when it was opened. */
static msim_status check_topology(const msim_recorder *r, msim_error *err) {
  if (r->sim->edits == r->edits || hash_springs(r->sim->scene) == r->springs_hash) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "the sim has other particles or springs than when its recorder was opened; "
                      "close that, and open one for another file");
}

/*------------------------------------- opening --------------------------------------------------*/

static ms_recording_source describe_source(const msim_recorder *r) {
  return (ms_recording_source){.sim = r->sim,
                               .scene = r->scene,
                               .type = r->type,
                               .path = r->file.path,
                               .checkpoint_capacity = r->capacity};
}

static msim_status make_recording(const msim_recorder *r, ms_recording *a, msim_error *err) {
  const ms_recording_source source = describe_source(r);
  return ms_recording_create(&source, a, err);
}

static int is_msim_trajectory(const msim_recorder *r, const char *path) {
  return MS_RECORDERS_HAS(r->type, recognize) && r->type->recognize(&r->host.base, path);
}

/* Under a temporary name */
static msim_status create_trajectory(msim_recorder *r, ms_recording *a, msim_error *err) {
  msim_status status = ms_output_file_create(&r->file, err);
  if (status) return status;
  a->what.path = r->file.temporary_name.data;
  status = r->type->open(&r->host.base, &a->what, &r->self);
  return status ? ms_plugin_fail(&r->host, r->type->name, status, err) : MSIM_OK;
}

/* A new file gets its final name once its metadata are written and nothing else can fail on any
 * rank: an incomplete file never has it. */
static msim_status commit_trajectory(msim_recorder *r, msim_error *err) {
  if (!r->file.temporary_name.data) return MSIM_OK;
  return ms_output_file_commit(&r->file, r->sim->config.opt.sync, err);
}

/* Open a new file, in place of an older trajectory of msim, or with `force` of any file. */
static msim_status open_new_trajectory(msim_recorder *r, const char *path, int force,
                                       msim_error *err) {
  ms_recording a;
  int taken;
  msim_status status = ms_output_file_lock(&r->file, &r->sim->alloc, path, &taken, err);
  if (!status && taken && !force && !is_msim_trajectory(r, path))
    status = ms_error_set(err, MSIM_ERR_IO,
                          "%s exists and is not a trajectory of msim; use another name, or --force "
                          "(msim_recorder_replace) to replace it",
                          path);
  if (!status) status = make_recording(r, &a, err);
  if (status) return status;
  status = create_trajectory(r, &a, err);
  ms_recording_free(&r->sim->alloc, &a);
  return status;
}

/* Resume a file, and find its last checkpoint. A file without a frame is begun anew. */
static msim_status resume_trajectory(msim_recorder *r, ms_recording *a, msim_resumption *from,
                                     msim_error *err) {
  const msim_status status = r->type->resume(&r->host.base, &a->what, from, &r->self);
  if (status) return ms_plugin_fail(&r->host, r->type->name, status, err);
  if (from->frames > 0) return MSIM_OK;
  r->type->close(r->self);
  r->self = NULL;
  from->checkpoint_length = 0;
  return create_trajectory(r, a, err);
}

static msim_status open_for_resume(msim_recorder *r, const char *path, msim_resumption *from,
                                   msim_error *err) {
  ms_recording a;
  int taken = 0;
  if (!MS_RECORDERS_HAS(r->type, resume))
    return ms_error_set(
        err, MSIM_ERR_UNSUPPORTED,
        "%s cannot be resumed, because this format has no checkpoints; use a .vtkhdf file", path);
  msim_status status = ms_output_file_lock(&r->file, &r->sim->alloc, path, &taken, err);
  if (!status && !taken)
    status = ms_error_set(err, MSIM_ERR_IO,
                          "%s does not exist, so that no run can be resumed from it", path);
  if (!status) status = make_recording(r, &a, err);
  if (status) return status;
  status = resume_trajectory(r, &a, from, err);
  ms_recording_free(&r->sim->alloc, &a);
  return status;
}

static int has_file(const msim_sim *sim) { return !sim->ranks || sim->ranks->rank == 0; }

/* Open the file, which rank 0 has opened, for the rows of this rank. */
static msim_status join_file(msim_recorder *r, msim_error *err) {
  msim_recording what;
  const ms_recording_source source = describe_source(r);
  msim_status status = has_file(r->sim) ? MSIM_OK : ms_recording_describe(&source, &what, err);
  if (status || has_file(r->sim)) return status;
  status = r->type->join(&r->host.base, &what, &r->self);
  return status ? ms_plugin_fail(&r->host, r->type->name, status, err) : MSIM_OK;
}

/* Set the sim to the state of a checkpoint, which rank 0 passes to all; collective. */
static msim_status load_checkpoint(msim_sim *sim, const msim_resumption *from, msim_error *err) {
  int64_t length = (int64_t)from->checkpoint_length;
  void *copy = NULL;
  ms_ranks_broadcast(sim->ranks, 0, sizeof length, &length);
  if (sim->ranks) copy = ms_memory_allocate(&sim->alloc, (size_t)length, 1);
  msim_status status = MSIM_OK;
  if (sim->ranks && !copy) status = ms_error_set_memory(err, "a checkpoint");
  status = ms_ranks_agree(sim->ranks, status, err);
  if (!status && copy && has_file(sim)) memcpy(copy, from->checkpoint, (size_t)length);
  if (!status) ms_ranks_broadcast(sim->ranks, 0, length, copy);
  if (!status) status = msim_sim_load(sim, copy ? copy : from->checkpoint, (size_t)length, err);
  ms_memory_free(&sim->alloc, copy);
  return status;
}

/* Continue from the last frame of the file, which rank 0 has opened; collective. */
static msim_status continue_run(msim_recorder *r, const msim_resumption *from, msim_error *err) {
  msim_error why;
  int64_t frames = from->frames;
  ms_ranks_broadcast(r->sim->ranks, 0, sizeof frames, &frames);
  if (frames == 0) return MSIM_OK;
  r->frames.part.frame = frames;
  msim_status status = load_checkpoint(r->sim, from, &why);
  if (!status) status = check_topology(r, &why);
  if (status) return ms_error_set(err, status, "%s cannot be resumed: %s", r->file.path, why.text);
  r->step_kept = r->sim->run.step;
  r->t_kept = ms_sim_time(r->sim);
  return MSIM_OK;
}

static msim_status find_recorder(const msim_sim *sim, const char *path,
                                 const msim_recorder_type **type, msim_error *err) {
  const msim_status status = ms_recorders_find(path, &sim->config.opt, &sim->alloc, type, err);
  if (status) return status;
  if (sim->config.plan.t_end < 0)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "%s: the run has no end, which recording requires; set steps or t_end",
                        path);
  return MSIM_OK;
}

/* Make a recorder that has no file yet. */
static msim_status create_recorder(msim_sim *sim, const char *path, msim_recorder **recorder,
                                   msim_error *err) {
  const msim_recorder_type *type;
  msim_status status = find_recorder(sim, path, &type, err);
  if (status) return status;
  msim_recorder *r = *recorder = ms_memory_allocate(&sim->alloc, 1, sizeof *r);
  if (!r) return ms_error_set_memory(err, "a recorder");
  r->sim = sim;
  r->type = type;
  r->step_kept = -1;
  r->edits = sim->edits, r->springs_hash = hash_springs(sim->scene);
  r->file = (ms_output_file){
      .path = path, .temporary_name.alloc = &sim->alloc, .fd = -1, .replaced_fd = -1};
  ms_plugin_init_host(&r->host, &sim->alloc);
  if (!MS_NEW(&sim->alloc, r->poses, 6 * (size_t)sim->scene->ncolliders))
    return ms_error_set_memory(err, "a recorder");
  return ms_rank_frames_init(&r->frames, type, sim, err);
}

/* x and v: of its rows; NULL: of none yet */
static ms_strain_section find_section(const msim_recorder *r, const double *x, const double *v) {
  msim_sim *sim = r->sim;
  const ms_section all = ms_section_whole(sim->scene);
  if (!r->frames.ranks) return (ms_strain_section){all, sim->scene, all, x, v};
  return (ms_strain_section){sim->section->in_whole, ms_rank_section_scene(sim),
                             ms_rank_section_numbers(sim), x, v};
}

/* What a frame has beside the state */
static msim_status allocate_frame(msim_recorder *r, msim_error *err) {
  msim_sim *sim = r->sim;
  const ms_strain_section section = find_section(r, NULL, NULL);
  msim_status status = MSIM_OK;
  if (r->frames.ranks || has_file(sim))
    status = ms_strain_init(&r->strain, &section, ms_rank_scene_count_particles(sim), has_file(sim),
                            &sim->alloc, err);
  if (status || !r->capacity) return status;
  r->part_capacity = ms_checkpoint_part_capacity(sim);
  r->checkpoint = ms_memory_allocate(&sim->alloc, r->part_capacity, 1);
  return r->checkpoint ? MSIM_OK : ms_error_set_memory(err, "a checkpoint");
}

static void destroy_recorder(msim_recorder *r) {
  if (!r) return;
  ms_output_file_release(&r->file);
  MS_FREE(&r->sim->alloc, r->checkpoint, r->poses);
  ms_strain_free(&r->strain, &r->sim->alloc);
  ms_rank_frames_free(&r->frames, &r->sim->alloc);
  ms_memory_free(&r->sim->alloc, r);
}

enum { NEW, REPLACE, RESUME };

static msim_status open_file(msim_recorder *r, const char *path, int how, msim_resumption *from,
                             msim_error *err) {
  if (!has_file(r->sim)) return MSIM_OK;
  return how == RESUME ? open_for_resume(r, path, from, err)
                       : open_new_trajectory(r, path, how == REPLACE, err);
}

static void return_scene(msim_recorder *r) {
  ms_rank_scene_return(r->sim, r->scene);
  r->scene = NULL;
}

/* Rank 0 writes what all frames share, of the whole scene, which it has before it has its section.
 * The others have what is not an array of the scene, until they join. */
static msim_status open_with_scene(msim_recorder *r, const char *path, int how,
                                   msim_resumption *from, msim_error *err) {
  msim_sim *sim = r->sim;
  msim_status status = r->frames.ranks ? MSIM_OK : ms_rank_scene_gather(sim, err);
  if (MS_RECORDERS_HAS(r->type, resume) && (!sim->ranks || r->frames.ranks))
    r->capacity = msim_sim_save_size(sim);
  if (!status) status = ms_rank_scene_borrow(sim, &r->scene, err);
  if (!status) status = ms_ranks_agree(sim->ranks, open_file(r, path, how, from, err), err);
  if (has_file(sim)) return_scene(r);
  return status;
}

/* What each rank needs for its rows, or rank 0 for all. Collective */
static msim_status prepare_frames(msim_recorder *r, msim_error *err) {
  ms_ranks *ranks = r->sim->ranks;
  msim_status status = r->frames.ranks ? ms_rank_section_create(r->sim, err) : MSIM_OK;
  if (!status) status = ms_ranks_agree(ranks, allocate_frame(r, err), err);
  if (!status) status = ms_ranks_agree(ranks, commit_trajectory(r, err), err);
  if (!status && r->frames.ranks) status = ms_ranks_agree(ranks, join_file(r, err), err);
  return status;
}

static msim_status open_at(msim_sim *sim, const char *path, int how, msim_recorder **recorder,
                           msim_error *err) {
  if (!sim || !path || !recorder)
    return ms_error_set(err, MSIM_ERR_ARG, "sim, path or recorder is NULL");
  const double start = ms_clock_now();
  *recorder = NULL;
  msim_recorder *r = NULL;
  msim_resumption from = {.size = sizeof from};
  msim_status status = ms_ranks_agree(sim->ranks, create_recorder(sim, path, &r, err), err);
  if (!status) status = open_with_scene(r, path, how, &from, err);
  if (!status) status = prepare_frames(r, err);
  if (!status && how == RESUME)
    status = ms_ranks_agree(sim->ranks, continue_run(r, &from, err), err);
  ms_sim_count_output(sim, ms_clock_now() - start);
  if (r) return_scene(r);
  if (!status) {
    *recorder = r;
    return ms_error_clear(err);
  }
  if (r && r->self) r->type->close(r->self);
  destroy_recorder(r);
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

/* Add the checkpoint, or the part of this rank; none if it exceeds the planned size, as after
 * another state was set. */
static void add_checkpoint(msim_recorder *r, msim_frame *frame) {
  ms_checkpoint_part part = {0};
  frame->checkpoint = NULL;
  if (!r->checkpoint ||
      ms_checkpoint_save_part(r->sim, r->checkpoint, r->part_capacity, &part, NULL) != MSIM_OK)
    part = (ms_checkpoint_part){0};
  frame->checkpoint = part.bytes, frame->checkpoint_length = part.size;
  r->frames.part.checkpoint_first = part.first, r->frames.part.checkpoint_length = part.length;
}

/* The poses of all colliders; NULL: none moves */
static const double *get_poses(msim_recorder *r, double t) {
  const ms_scene *s = r->sim->scene;
  if (!ms_collider_motion_is_there(s)) return NULL;
  for (int32_t i = 0; i < s->ncolliders; i++) {
    double *pose = r->poses + 6 * (size_t)i;
    ms_collider_motion_get_pose(s, i, (ms_instant){.t = t}, pose, pose + 3);
  }
  return r->poses;
}

/* What a frame shows: the rows of a section of the scene; all in one process */
typedef struct frame_state {
  ms_strain_section section;
  msim_energy energy;
} frame_state;

/* Where rank 0 writes all rows, it needs the state of the whole scene, which all ranks gather. */
static msim_status get_whole_state(const msim_recorder *r, frame_state *s, msim_error *err) {
  msim_sim *sim = r->sim;
  msim_state whole = {.size = sizeof whole};
  msim_status status = ms_sim_provide_arrays(sim, err);
  if (!status && sim->part) status = ms_rank_section_create(sim, err);
  if (status) return status;
  msim_sim_state(sim, &whole);
  msim_sim_energy(sim, &s->energy);
  s->section = find_section(r, whole.x, whole.v);
  return ms_ranks_agree(sim->ranks, MSIM_OK, err);
}

static msim_status get_section_state(const msim_recorder *r, frame_state *s, msim_error *err) {
  msim_sim *sim = r->sim;
  const msim_status status = ms_sim_update_section(sim, err);
  if (status) return status;
  s->section = find_section(r, sim->section->x, sim->section->v);
  s->energy = ms_rank_section_sum_energy(sim);
  return ms_ranks_agree(sim->ranks, MSIM_OK, err);
}

static msim_status write_frame(msim_recorder *r, const ms_section *section, msim_frame *frame,
                               msim_error *err) {
  msim_status status = MSIM_OK;
  add_checkpoint(r, frame);
  if (r->frames.ranks)
    return ms_rank_frames_write(&r->frames, r->type, r->self, &r->host, section, frame, err);
  if (has_file(r->sim)) status = r->type->write(r->self, frame);
  return status ? ms_plugin_fail(&r->host, r->type->name, status, err) : MSIM_OK;
}

static msim_status record_state(msim_recorder *r, const frame_state *s, msim_error *err) {
  const msim_sim *sim = r->sim;
  const msim_energy *energy = &s->energy;
  msim_status status = MSIM_OK;
  if (r->frames.ranks || has_file(sim))
    status = ms_strain_compute(&r->strain, &s->section, &sim->alloc, err);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (status) return status;
  msim_frame frame = {.size = sizeof frame,
                      .step = sim->run.step,
                      .t = ms_sim_time(sim),
                      .x = s->section.x,
                      .v = s->section.v,
                      .kinetic = energy->kinetic,
                      .potential = energy->elastic + energy->gravitational,
                      .elastic = energy->elastic,
                      .gravitational = energy->gravitational,
                      .strain = r->strain.strain,
                      .tension = r->strain.tension,
                      .reaction = r->strain.reaction,
                      .poses = get_poses(r, ms_sim_time(sim))};
  if (!isfinite(energy->total))
    return ms_error_set(err, MSIM_NOT_FINITE,
                        "step %lld, t = %g s: the energy is not a finite number; use a smaller h "
                        "or another integrator",
                        (long long)frame.step, frame.t);
  status = ms_ranks_agree(sim->ranks, write_frame(r, &s->section.in_whole, &frame, err), err);
  return status ? status : ms_error_clear(err);
}

msim_status msim_recorder_write(msim_recorder *recorder, msim_error *err) {
  if (!recorder) return ms_error_set(err, MSIM_ERR_ARG, "recorder is NULL");
  msim_sim *sim = recorder->sim;
  msim_status status = ms_energy_monitor_check(sim, err);
  if (status) return status;
  const double start = ms_clock_now();
  status = check_topology(recorder, err);
  if (status) return status;
  if (sim->run.step == recorder->step_kept && ms_sim_time(sim) == recorder->t_kept)
    return ms_error_clear(err);
  frame_state state = {.energy.size = sizeof state.energy};
  status = recorder->frames.ranks ? get_section_state(recorder, &state, err)
                                  : get_whole_state(recorder, &state, err);
  if (!status) status = record_state(recorder, &state, err);
  ms_sim_count_output(sim, ms_clock_now() - start);
  return status;
}

msim_status msim_recorder_close(msim_recorder *recorder, msim_error *err) {
  if (!recorder) return ms_error_clear(err);
  double start = ms_clock_now();
  msim_status status = recorder->self ? recorder->type->close(recorder->self) : MSIM_OK;
  ms_sim_count_output(recorder->sim, ms_clock_now() - start);
  if (status) ms_plugin_fail(&recorder->host, recorder->type->name, status, err);
  else ms_error_clear(err);
  status = ms_ranks_agree(recorder->sim->ranks, status, err);
  destroy_recorder(recorder);
  return status;
}
