#include "run.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../common/clock.h"
#include "../common/files.h"
#include "../common/message.h"
#include "../common/mpirun.h"
#include "final.h"
#include "mesh_note.h"
#include "progress.h"
#include "ranks.h"
#include "report.h"
#include "scene_precheck.h"
#include "setup.h"
#include "stopping.h"
#include "tables.h"
#include "targets.h"

typedef struct run {
  const arguments *args;
  setup made;
  msim_sim *sim;
  msim_recorder *recorder; /* NULL: no --out */
  output_file final;
  table tables[NTABLES];
  progress bar;
  report report;
  msim_state first;   /* first state, without its arrays */
  msim_state from;    /* state where the run starts or resumes: `first`, or a file's last frame */
  double h;           /* s */
  double t_end;       /* s */
  int64_t end;        /* the last step to make; -1: unknown */
  double t_recorded;  /* s: time of the last frame in the file; NAN: none */
  msim_status failed; /* result of writing a frame */
  msim_error why;
} run;

/*------------------------------------- before the run -------------------------------------------*/

static void print_note(const char *text, void *user) {
  run *r = user;
  progress_hide(&r->bar);
  report_error("note: %s", text);
  r->report.notes++;
}

static void note_meshes(run *r) {
  const mesh_note note = mesh_note_make(r->made.scene);
  if (*note.text && ranks_has_files()) print_note(note.text, r);
}

/* Find the last step; the plan counts from the first state. */
static void find_end(run *r) {
  msim_plan plan = {.size = sizeof plan};
  r->first.size = MSIM_STATE_TIME;
  msim_sim_state(r->sim, &r->first);
  msim_sim_plan(r->sim, &plan);
  r->h = plan.h;
  r->t_end = plan.t_end;
  r->end = plan.tol > 0                             ? -1
           : plan.steps > INT64_MAX - r->first.step ? INT64_MAX
                                                    : r->first.step + plan.steps;
}

/* 1: --final or a table refers to the arrays of the whole scene. */
static int needs_scene(const arguments *args) {
  int nusers = args->final != NULL;
  for (int i = 0; i < NTABLES; i++) nusers += i != TABLE_ENERGIES && args->tables[i];
  return nusers > 0;
}

/* Several ranks keep parts of the scene (docs/ranks.md): let the arrays of the file go. */
static void release_scene(run *r) {
  if (!r->made.options.comm || needs_scene(r->args)) return;
  setup_free(&r->made);
  r->made.scene = NULL;
}

/* Each of several ranks reads a part. The check starts a process, which MPI may not support later.
 */
static int load_scene(run *r) {
  const arguments *args = r->args;
  const int whole = needs_scene(args), n = mpirun_size(), divides = !whole && n > 1;
  int status = precheck_scene(args->scene, divides ? mpirun_rank() : 0, divides ? n : 1);
  if (ranks_open(args)) return EXIT_ERROR;
  if (!status)
    status = setup_read(args, whole ? 0 : ranks_number(), whole ? 1 : ranks_count(), &r->made);
  return ranks_join(args, status, &r->made.options.comm);
}

static int make_sim(run *r) {
  const arguments *args = r->args;
  msim_options *options = &r->made.options;
  msim_error err;
  if (load_scene(r)) return EXIT_ERROR;
  if (!options->integrator)
    return report_usage_error("run",
                              "no integrator is given, neither on the command line nor in the "
                              "scene's run; use --integrator NAME, as --integrator auto "
                              "('msim_cli explain %s' compares four, 'msim_cli list' lists all)",
                              args->scene);
  if (options->steps < 0 && options->t_end < 0)
    return report_usage_error("run",
                              "the run has no end, neither on the command line nor in the scene's "
                              "run; use --steps N or --t_end SECONDS");
  if (ranks_agree(ranks_has_files() ? check_targets(args) : EXIT_OK)) return EXIT_ERROR;
  if (!args->quiet) {
    options->warn = print_note;
    options->warn_user = r;
    note_meshes(r);
  }
  msim_status status = msim_sim_create(r->made.scene, options, &r->sim, &err);
  if (status) return setup_report_error(status, &err);
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(r->made.scene, &view);
  snprintf(r->report.name, sizeof r->report.name, "%s", view.name);
  r->report.self_contact = view.self_thickness > 0;
  release_scene(r);
  if (args->init && final_read(args->init, r->sim)) return EXIT_ERROR;
  find_end(r);
  return EXIT_OK;
}

/* Resume the file; the sim is then in the state of its last frame. */
static msim_status resume_run(run *r, msim_error *err) {
  msim_status status = msim_recorder_resume(r->sim, r->args->out, &r->recorder, err);
  msim_sim_state(r->sim, &r->from);
  r->report.goes_on = r->from.step > r->first.step || r->from.t > r->first.t;
  if (r->report.goes_on) r->t_recorded = r->from.t;
  return status;
}

static msim_status open_recorder(run *r, msim_error *err) {
  const arguments *args = r->args;
  if (args->force) return msim_recorder_replace(r->sim, args->out, &r->recorder, err);
  if (!args->resume) return msim_recorder_open(r->sim, args->out, &r->recorder, err);
  const msim_status status = resume_run(r, err);
  if (status != MSIM_ERR_IO || ranks_maximum(file_exists(args->out)) > 0) return status;
  if (!args->quiet)
    print_note("the file of --out does not exist: the run starts from the beginning", r);
  return msim_recorder_open(r->sim, args->out, &r->recorder, err);
}

/* Open the files of --final and of tables. */
static int open_outputs(run *r) {
  const arguments *args = r->args;
  if (args->final && ranks_has_files() && output_open(&r->final, args->final)) return EXIT_ERROR;
  for (int i = 0; i < NTABLES; i++)
    if (args->tables[i] && table_open(&r->tables[i], (table_kind)i, r->made.scene, args->tables[i]))
      return EXIT_ERROR;
  return EXIT_OK;
}

static int open_files(run *r) {
  const arguments *args = r->args;
  msim_error err;
  r->from = r->first;
  if (ranks_agree(open_outputs(r))) return EXIT_ERROR;
  if (args->out && open_recorder(r, &err) != MSIM_OK) return report_error("%s", err.text);
  for (int i = 0; i < NTABLES; i++)
    if (args->tables[i] && ranks_agree(table_start(&r->tables[i], r->sim, r->report.goes_on)))
      return EXIT_ERROR;
  return EXIT_OK;
}

/*------------------------------------- the run --------------------------------------------------*/

static int64_t least_step(int64_t a, int64_t b) { return a < b ? a : b; }

static int has_frames(const run *r) {
  int ntables = 0;
  for (int i = 0; i < NTABLES; i++) ntables += r->tables[i].stream != NULL;
  return r->recorder || ntables;
}

static msim_status record_frame_at(run *r, double t, msim_error *err) {
  if (t == r->t_recorded) return MSIM_OK;
  msim_status status = r->recorder ? msim_recorder_write(r->recorder, err) : MSIM_OK;
  for (int i = 0; i < NTABLES && !status; i++)
    if (r->tables[i].stream) status = ranks_agree(table_write(&r->tables[i], r->sim, err));
  if (status) return status;
  r->t_recorded = t;
  r->report.frames++;
  return MSIM_OK;
}

/* The number of steps until the clock is read again, after about 50 ms */
static int64_t next_pace(int64_t pace, double seconds) {
  const double wanted = 0.05;
  if (seconds < wanted / 2) return pace < INT64_MAX / 2 ? 2 * pace : pace;
  int64_t slower = (int64_t)((double)pace * wanted / seconds);
  return slower > 1 ? slower : 1;
}

static double step_time(const run *r, int64_t step) {
  return r->first.t + (double)(step - r->first.step) * r->h;
}

/* Simulate to the end in pieces: to the next frame, or until the clock has to be read. Several
 * ranks make the same pieces, and the library stops all of them after the same step. */
static msim_status simulate(run *r, msim_error *err) {
  int64_t step = r->from.step, pace = 1, left = pace;
  double before = clock_seconds();
  msim_status status = has_frames(r) ? record_frame_at(r, step_time(r, step), err) : MSIM_OK;
  while (!status && step < r->end && (!stopping_is_asked() || r->made.options.comm)) {
    int64_t frame = has_frames(r) ? least_step(msim_sim_next_frame(r->sim), r->end) : r->end;
    int64_t n = least_step(frame - step, left);
    status = msim_sim_step(r->sim, n, err);
    if (status) break;
    step += n;
    left -= n;
    if (has_frames(r) && step == frame) status = record_frame_at(r, step_time(r, step), err);
    if (left > 0) continue;
    double now = clock_seconds();
    left = pace = next_pace(pace, ranks_maximum(now - before));
    before = now;
    progress_update(&r->bar, now, step, step_time(r, step), r->t_end);
  }
  return !status && step < r->end ? MSIM_STOPPED : status;
}

static int at_frame(msim_sim *sim, void *user) {
  run *r = user;
  msim_state now = {.size = MSIM_STATE_TIME};
  msim_sim_state(sim, &now);
  if (has_frames(r)) r->failed = record_frame_at(r, now.t, &r->why);
  progress_update(&r->bar, clock_seconds(), now.step, now.t, r->t_end);
  return r->failed != MSIM_OK;
}

/* Under error control the library shows each frame at its time, inside the step that passes it. */
static msim_status simulate_by_error(run *r, msim_error *err) {
  int looks = has_frames(r) || r->bar.wanted;
  msim_status status = msim_sim_run(r->sim, looks ? at_frame : NULL, r, err);
  if (r->failed) *err = r->why;
  return r->failed ? r->failed : status;
}

/*------------------------------------- after the run --------------------------------------------*/

static msim_status close_recorder(run *r, msim_error *err) {
  msim_recorder *recorder = r->recorder;
  r->recorder = NULL;
  return msim_recorder_close(recorder, err);
}

/* Write the last state as a frame, and close the file. Returns the first error. */
static msim_status end_recording(run *r, msim_status status, msim_state *last, msim_error *err) {
  msim_error second = {MSIM_OK, ""};
  msim_status failed = MSIM_OK;
  if (!has_frames(r)) return status;
  if (status >= 0) failed = record_frame_at(r, last->t, &second);
  if (failed > 0) { /* the last state was not good, and the sim has returned to the last good one */
    status = failed, *err = second;
    msim_sim_state(r->sim, last);
    failed = record_frame_at(r, last->t, &second);
  }
  if (!failed) failed = close_recorder(r, &second);
  if (!failed || status < 0) return status;
  *err = second;
  return failed;
}

static void print_advice(msim_sim *sim) {
  char text[1024];
  msim_sim_advice(sim, text, sizeof text);
  for (char *line = text, *end; *line; line = end) {
    end = line + strcspn(line, "\n");
    if (*end) *end++ = 0;
    report_error("try: %s", line);
  }
}

static void print_end(msim_status status, const msim_state *last, const msim_error *err) {
  if (status == MSIM_STOPPED)
    report_error("stopped at step %" PRId64 ", t = %g s; all results up to then are kept",
                 last->step, last->t);
  else if (status) report_error("%s", err->text);
}

static int finish(run *r, msim_status status, msim_error *err) {
  msim_state last = {.size = MSIM_STATE_TIME};
  msim_sim_state(r->sim, &last);
  if (status == MSIM_STOPPED && last.t >= r->t_end) status = MSIM_OK;
  status = end_recording(r, status, &last, err);
  progress_hide(&r->bar);
  r->report.wall_s = clock_seconds() - r->bar.started;
  print_end(status, &last, err);
  if (status > 0) print_advice(r->sim);
  if (status < 0) return EXIT_ERROR;
  if (r->args->final && ranks_agree(final_write(&r->final, r->made.scene, r->sim, status)))
    return EXIT_ERROR;
  if (!r->args->quiet) report_run(&r->report, r->args, r->sim);
  return status ? EXIT_EVENT : EXIT_OK;
}

static void start_report(run *r) {
  r->report.first = r->from;
  r->report.start.size = sizeof r->report.start;
  if (!r->args->quiet) msim_sim_energy(r->sim, &r->report.start);
}

static int run_simulation(run *r) {
  msim_error err = {MSIM_OK, ""};
  stopping_catch_signals(r->sim);
  if (open_files(r)) return EXIT_ERROR;
  start_report(r);
  progress_start(&r->bar, r->args->quiet || !ranks_has_files(), r->from.step, r->end, r->from.t);
  msim_status status = r->end < 0 ? simulate_by_error(r, &err) : simulate(r, &err);
  return finish(r, status, &err);
}

int run_command(const arguments *args) {
  run r = {.args = args, .t_recorded = NAN};
  int status = make_sim(&r);
  if (!status) status = run_simulation(&r);
  stopping_forget_sim();
  if (r.recorder) msim_recorder_close(r.recorder, NULL);
  output_discard(&r.final);
  for (int i = 0; i < NTABLES; i++) table_close(&r.tables[i]);
  msim_sim_destroy(r.sim);
  setup_free(&r.made);
  return status;
}
