#include "statics.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../common/message.h"
#include "../common/output.h"
#include "final.h"
#include "setup.h"
#include "stopping.h"
#include "targets.h"

const char modes_beginning[] = "{\"msim\": 1, \"frequency\": [";

typedef struct statics {
  const arguments *args;
  setup made;
  msim_sim *sim;
  output_file file; /* of --final or --json */
} statics;

/* A sim at the start of the scene, or in the state of --init, and the file to be written. The
 * method makes no step. */
static int begin_statics(const arguments *args, const char *path, statics *s) {
  msim_options options;
  msim_error err;
  *s = (statics){.args = args};
  if (setup_load(args, &s->made) || check_targets(args)) return EXIT_ERROR;
  msim_options_init(&options, sizeof options);
  options.integrator = "velocity-verlet";
  options.solver = s->made.options.solver;
  options.solver_options = s->made.options.solver_options;
  options.threads = s->made.options.threads;
  options.plugin_path = s->made.options.plugin_path;
  const msim_status status = msim_sim_create(s->made.scene, &options, &s->sim, &err);
  if (status) return setup_report_error(status, &err);
  if (args->init && final_read(args->init, s->sim)) return EXIT_ERROR;
  stopping_catch_signals(s->sim);
  return path ? output_open(&s->file, path) : EXIT_OK;
}

static int end_statics(statics *s, int status) {
  stopping_forget_sim();
  output_discard(&s->file);
  msim_sim_destroy(s->sim);
  setup_free(&s->made);
  return status;
}

/*------------------------------------- rest -----------------------------------------------------*/

static double length(const double *v) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* The sum of the external forces on free particles */
static double external_force(const statics *s) {
  msim_scene_view view = {.size = sizeof view};
  double sum = 0;
  msim_scene_get(s->made.scene, &view);
  for (int32_t p = 0; p < view.nparticles; p++) {
    if (view.pinned[p]) continue;
    sum += view.mass[p] * length(view.gravity);
    if (view.force) sum += length(view.force + 3 * (size_t)p);
  }
  return sum;
}

static double largest_tension(const statics *s) {
  msim_state now = {.size = sizeof now};
  double largest = 0;
  msim_sim_state(s->sim, &now);
  double *tension = calloc((size_t)now.nsprings + 1, sizeof *tension);
  if (tension) msim_sim_springs(s->sim, tension, NULL, NULL);
  for (int32_t e = 0; e < now.nsprings && tension; e++)
    if (fabs(tension[e]) > largest) largest = fabs(tension[e]);
  free(tension);
  return largest;
}

static double larger(double a, double b) { return a > b ? a : b; }

/* The largest force on a particle in the present state */
static double largest_force(const statics *s) {
  msim_state now = {.size = sizeof now};
  double largest = 0;
  msim_sim_state(s->sim, &now);
  double *force = calloc(3 * (size_t)now.n + 1, sizeof *force);
  if (force) msim_sim_force(s->sim, now.x, now.v, force);
  for (int32_t p = 0; p < now.n && force; p++)
    largest = larger(largest, length(force + 3 * (size_t)p));
  free(force);
  return largest;
}

/* The largest k rest, of which tensions have rounding errors */
static double largest_stiffness(const statics *s) {
  msim_scene_view view = {.size = sizeof view};
  double largest = 0;
  msim_scene_get(s->made.scene, &view);
  for (int32_t e = 0; e < view.nsprings; e++) largest = larger(largest, view.k[e] * view.rest[e]);
  return largest;
}

/* 1e-9 of the external forces, or, without any, of the forces and tensions in the present state,
 * but above their rounding errors */
static double default_ftol(const statics *s) {
  const double external = external_force(s), tension = largest_tension(s);
  const double wanted = 1e-9 * (external > 0 ? external : larger(tension, largest_force(s)));
  const double least = larger(1e-13 * tension, 1e-15 * largest_stiffness(s));
  return wanted > 0 || least > 0 ? larger(wanted, least) : 1e-9;
}

static int read_ftol(const statics *s, double *ftol) {
  const char *text = s->args->ftol;
  char *end;
  if (!text) return *ftol = default_ftol(s), EXIT_OK;
  *ftol = strtod(text, &end);
  if (end != text && !*end && *ftol > 0 && isfinite(*ftol)) return EXIT_OK;
  return report_usage_error("rest", "--ftol is '%s'; it must be a number > 0", text);
}

static int find_rest(statics *s) {
  enum { MOST_ITERATIONS = 100000 };
  msim_equilibrium e = {.size = sizeof e};
  msim_energy energy = {.size = sizeof energy};
  msim_error err;
  double ftol;
  if (read_ftol(s, &ftol)) return EXIT_ERROR;
  const msim_status status = msim_sim_equilibrium(s->sim, ftol, MOST_ITERATIONS, &e, &err);
  if (status) return setup_report_error(status, &err);
  msim_sim_energy(s->sim, &energy);
  if (!s->args->quiet)
    printf(
        "force       %.3g N at most, on particle %d (accepted: %.3g N)\n"
        "iterations  %d of Newton's method; %d saddle points were left\n"
        "minimum     %s\n"
        "energy      elastic %.6g J, gravitational %.6g J\n",
        e.force, (int)e.particle, ftol, (int)e.iterations, (int)e.saddles,
        e.is_minimum ? "yes, the stiffness matrix has no negative eigenvalue"
                     : "not known, because of friction, samples of colliders, or the solver",
        energy.elastic, energy.gravitational);
  return s->file.path ? final_write(&s->file, s->made.scene, s->sim, MSIM_OK) : EXIT_OK;
}

int rest_command(const arguments *args) {
  statics s;
  int status = begin_statics(args, args->final, &s);
  if (!status) status = find_rest(&s);
  return end_statics(&s, status);
}

/*------------------------------------- modes ----------------------------------------------------*/

static int read_count(const arguments *args, int32_t *n) {
  char *end;
  if (!args->count) return *n = 10, EXIT_OK;
  const long count = strtol(args->count, &end, 10);
  *n = (int32_t)count;
  if (end != args->count && !*end && count >= 1 && count <= INT32_MAX) return EXIT_OK;
  return report_usage_error("modes", "-n is '%s'; it must be a whole number >= 1", args->count);
}

/* {"msim": 1, "frequency": [...], "shape": [[[x, y, z], ...], ...]} */
static int write_modes(statics *s, int32_t n, const double *frequency, const double *shape) {
  FILE *to = s->file.stream;
  msim_state now = {.size = sizeof now};
  msim_sim_state(s->sim, &now);
  errno = 0;
  int done = fputs(modes_beginning, to) >= 0;
  for (int32_t j = 0; j < n && done; j++)
    done = fprintf(to, "%s%.17g", j ? ", " : "", frequency[j]) > 0;
  done = done && fputs("],\n \"shape\": [", to) >= 0;
  for (int32_t j = 0; j < n && done; j++) {
    done = fputs(j ? "],\n  [" : "[", to) >= 0;
    for (int32_t p = 0; p < now.n && done; p++, shape += 3)
      done = fprintf(to, "%s[%.17g, %.17g, %.17g]", p ? ",\n   " : "", shape[0], shape[1],
                     shape[2]) > 0;
  }
  done = done && fputs("]]}\n", to) >= 0;
  return output_close(&s->file, done);
}

static int find_modes(statics *s) {
  msim_state now = {.size = sizeof now};
  msim_error err;
  int32_t n;
  if (read_count(s->args, &n)) return EXIT_ERROR;
  msim_sim_state(s->sim, &now);
  double *frequency = calloc((size_t)n, sizeof *frequency);
  double *shape = s->args->json ? calloc((size_t)n, 3 * (size_t)now.n * sizeof *shape) : NULL;
  int status = EXIT_OK;
  if (!frequency || (s->args->json && !shape))
    status = report_error("out of memory for %d modes", (int)n);
  if (!status) {
    const msim_status computed = msim_sim_modes(s->sim, n, frequency, shape, &err);
    if (computed) status = setup_report_error(computed, &err);
  }
  for (int32_t j = 0; j < n && !status && !s->args->quiet; j++)
    printf("%4d  %.9g Hz\n", (int)j + 1, frequency[j]);
  if (!status && shape) status = write_modes(s, n, frequency, shape);
  free(frequency), free(shape);
  return status;
}

int modes_command(const arguments *args) {
  statics s;
  int status = begin_statics(args, args->json, &s);
  if (!status) status = find_modes(&s);
  return end_statics(&s, status);
}
