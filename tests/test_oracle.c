/* Tests of every run in tests/oracle by the methods of this version, against results in exact
 * arithmetic, within the tolerance that each run states. The argument is the linear solver.
 *
 * Direct solvers: tol_x and tol_v as stored; iterative ones: at least 100 rtol max(1, |x|). Runs
 * with the flag `unstable` must stop with a status or grow. `indefinite`: solved without clamping
 * by a solver that can, stopped with MSIM_NOT_SPD by others. `degenerate`, `chaotic`: the energy is
 * bounded. */
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "scenes.h"

#define RTOL        1e-14
#define NEWTON_RTOL 1e-13

static const char *solver = "pcg";
static int direct, symmetric, runs, failures;

/*------------------------------------- reading --------------------------------------------------*/

static double number(const json_t *object, const char *key) {
  return json_number_value(json_object_get(object, key));
}

static void triples(const json_t *rows, double *flat) {
  for (size_t i = 0; i < json_array_size(rows); i++)
    for (size_t c = 0; c < 3; c++)
      flat[3 * i + c] = json_number_value(json_array_get(json_array_get(rows, i), c));
}

static double *vector(const json_t *rows) {
  double *flat = calloc(3 * json_array_size(rows) + 1, sizeof *flat);
  triples(rows, flat);
  return flat;
}

static double at(const json_t *list, size_t i) {
  return json_number_value(json_array_get(list, i));
}

static void add_springs(const json_t *springs, msim_scene *scene) {
  for (size_t e = 0; e < json_array_size(springs); e++) {
    const json_t *s = json_array_get(springs, e);
    const int32_t ij[2] = {(int32_t)at(s, 0), (int32_t)at(s, 1)};
    const double k = at(s, 2), rest = at(s, 3), damping = at(s, 4);
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, &damping, err));
  }
}

static void add_planes(const json_t *planes, msim_scene *scene) {
  for (size_t i = 0; i < json_array_size(planes); i++) {
    const json_t *p = json_array_get(planes, i), *n = json_object_get(p, "n");
    const msim_plane plane = {
        {at(n, 0), at(n, 1), at(n, 2)}, number(p, "d"), number(p, "e"), number(p, "mu")};
    assert_ok(msim_scene_add_plane(scene, &plane, err));
  }
}

static msim_scene *build(const json_t *s) {
  msim_scene *scene;
  double gravity[3], *x = vector(json_object_get(s, "x")), *v = vector(json_object_get(s, "v"));
  const json_t *masses = json_object_get(s, "mass"), *pinned = json_object_get(s, "pinned");
  const int32_t n = (int32_t)json_array_size(masses);
  double *mass = calloc((size_t)n, sizeof *mass);
  for (int32_t i = 0; i < n; i++) mass[i] = at(masses, (size_t)i);
  for (size_t c = 0; c < 3; c++) gravity[c] = at(json_object_get(s, "gravity"), c);
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, n, x, v, mass, err));
  add_springs(json_object_get(s, "springs"), scene);
  add_planes(json_object_get(s, "planes"), scene);
  for (size_t i = 0; i < json_array_size(pinned); i++) {
    const int32_t p = (int32_t)at(pinned, i);
    assert_ok(msim_scene_pin(scene, 1, &p, err));
  }
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  assert_ok(msim_scene_set_drag(scene, number(s, "drag"), err));
  free(x), free(v), free(mass);
  return scene;
}

/*------------------------------------- one run --------------------------------------------------*/

static int flagged(const json_t *run, const char *flag) {
  size_t i;
  json_t *value;
  json_array_foreach(json_object_get(run, "flags"), i, value) {
    if (strcmp(json_string_value(value), flag) == 0) return 1;
  }
  return 0;
}

/* "velocity_verlet" is velocity-verlet, "linimp_euler" is linearly-implicit-euler. NULL: not in
 * this version. */
static const char *method_of(const json_t *run) {
  static char name[64];
  snprintf(name, sizeof name, "%s", json_string_value(json_object_get(run, "integrator")));
  if (strcmp(name, "linimp_euler") == 0) return "linearly-implicit-euler";
  for (char *c = name; *c; c++)
    if (*c == '_') *c = '-';
  const msim_integrator_entry *entry;
  for (int32_t i = 0; (entry = msim_integrator_info(i)) != NULL; i++)
    if (strcmp(entry->name, name) == 0) return entry->order ? name : NULL;
  return NULL;
}

static msim_options options_of(const json_t *run, const char *method) {
  const json_t *given = json_object_get(run, "options");
  const char *start = json_string_value(json_object_get(given, "start"));
  const char *collision = json_string_value(json_object_get(given, "collision"));
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method;
  opt.h = number(run, "h");
  opt.steps = (int64_t)number(run, "steps"); /* dop853 then takes that many fixed steps */
  opt.solver = solver;
  opt.solver_rtol = RTOL;
  opt.newton_rtol = NEWTON_RTOL;
  opt.jacobian =
      json_is_true(json_object_get(given, "clamp")) ? MSIM_JACOBIAN_CLAMP : MSIM_JACOBIAN_EXACT;
  opt.indefinite = symmetric ? MSIM_INDEFINITE_SOLVE : MSIM_INDEFINITE_STOP;
  if (start) assert_ok(msim_options_set(&opt, "verlet.start", start, err));
  if (collision) assert_ok(msim_options_set(&opt, "heun.collision", collision, err));
  return opt;
}

static double farthest(size_t n, const double *a, const double *b) {
  double largest = 0;
  for (size_t i = 0; i < n; i++) {
    double d = fabs(a[i] - b[i]);
    if (!(d <= largest)) largest = d;
  }
  return largest;
}

static double largest(size_t n, const double *a) {
  double most = 0;
  for (size_t i = 0; i < n; i++) most = fmax(most, fabs(a[i]));
  return most;
}

/* The tolerance of v(t) if v(t - h/2) is accurate to tv and x to tx: h/2 times the bounds of dF/dx
 * and dF/dv over the mass. */
static double synchronised_tolerance(const json_t *run, const msim_scene *scene, double tx,
                                     double tv) {
  msim_scene_view s = {.size = sizeof s};
  msim_scene_get(scene, &s);
  double worst_k = 0, worst_c = 0;
  for (int32_t p = 0; p < s.nparticles; p++) {
    double k = 0, c = s.drag;
    for (int32_t e = 0; e < s.nsprings; e++)
      if (s.ij[2 * e] == p || s.ij[2 * e + 1] == p) k += 2 * s.k[e], c += 2 * s.damping[e];
    worst_k = fmax(worst_k, k / s.mass[p]), worst_c = fmax(worst_c, c / s.mass[p]);
  }
  return tv + number(run, "h") / 2 * (worst_k * tx + worst_c * tv);
}

static void expect(int good, const char *name, const json_t *run, const char *what, double found,
                   double limit) {
  if (good) return;
  failures++;
  print_error("%s %s: %s %.3g, limit %.3g\n", name, json_string_value(json_object_get(run, "id")),
              what, found, limit);
}

static void compare(const char *name, const json_t *run, const msim_scene *scene,
                    const msim_state *state) {
  const size_t n = 3 * (size_t)state->n;
  double *x = vector(json_object_get(run, "x")), *v = vector(json_object_get(run, "v"));
  double tx = number(run, "tol_x"), tv = number(run, "tol_v");
  if (!direct && is_implicit(method_of(run))) {
    /* the errors of Newton's method in each step, and of the linear solver */
    const int linear = strcmp(method_of(run), "linearly-implicit-euler") == 0;
    const double share = linear ? 100 * RTOL : number(run, "steps") * NEWTON_RTOL;
    tx = fmax(tx, share * fmax(1, largest(n, x)));
    tv = fmax(tv, share * fmax(1, largest(n, v)));
  }
  double d = farthest(n, state->x, x);
  expect(d <= tx, name, run, "x is off by", d, tx);
  if (state->v_half) {
    double *sync = vector(json_object_get(run, "v_sync"));
    double ts = synchronised_tolerance(run, scene, tx, tv);
    d = farthest(n, state->v_half, v);
    expect(d <= tv, name, run, "v_half is off by", d, tv);
    d = farthest(n, state->v, sync);
    expect(d <= ts, name, run, "v is off by", d, ts);
    free(sync);
  } else {
    d = farthest(n, state->v, v);
    expect(d <= tv, name, run, "v is off by", d, tv);
  }
  free(x), free(v);
}

/* Rounding decides the outcome of such a run: its energy may change by three times the change in
 * the reference. */
static void compare_energy(const char *name, const json_t *run, const msim_energy *before,
                           const msim_energy *after) {
  const json_t *e = json_object_get(run, "energy");
  double reference = fabs(at(e, 0) + at(e, 1) + at(e, 2) - before->total);
  double scale = fmax(before->kinetic + before->elastic, at(e, 0) + at(e, 1)) +
                 fabs(at(e, 2) - before->gravitational);
  double change = fabs(after->total - before->total);
  double limit = 3 * fmax(reference, 0.1 * scale);
  expect(change <= limit, name, run, "energy changed by", change, limit);
}

static void judge(const char *name, const json_t *run, const msim_scene *scene, msim_sim *sim) {
  msim_error why = {0, ""};
  msim_energy before = {.size = sizeof before}, after = {.size = sizeof after};
  msim_state state = {.size = sizeof state};
  msim_sim_energy(sim, &before);
  msim_status status = msim_sim_step(sim, (int64_t)number(run, "steps"), &why);
  msim_sim_state(sim, &state);
  msim_sim_energy(sim, &after);
  double size = fmax(largest(3 * (size_t)state.n, state.x), largest(3 * (size_t)state.n, state.v));
  expect(isfinite(size) && isfinite(after.total), name, run, "not finite:", size, INFINITY);
  if (flagged(run, "unstable"))
    expect(status == MSIM_NOT_FINITE || status == MSIM_UNSTABLE || !(number(run, "err_x") > 1e3) ||
               size >= 100,
           name, run, "must blow up, largest number is", size, 100);
  else if (flagged(run, "indefinite") && !symmetric)
    expect(status == MSIM_NOT_SPD, name, run, "must stop as not positive definite, status", status,
           MSIM_NOT_SPD);
  else if (status) expect(0, name, run, why.text, status, 0);
  else if (flagged(run, "degenerate") || flagged(run, "chaotic"))
    compare_energy(name, run, &before, &after);
  else compare(name, run, scene, &state);
}

static void one_case(const char *path, const char *name) {
  json_t *root = json_load_file(path, 0, NULL), *run;
  size_t i;
  assert_non_null(root);
  msim_scene *scene = build(json_object_get(root, "scene"));
  json_array_foreach(json_object_get(root, "runs"), i, run) {
    const char *method = method_of(run);
    if (!method) continue;
    msim_sim *sim;
    msim_options opt = options_of(run, method);
    assert_ok(msim_sim_create(scene, &opt, &sim, err));
    judge(name, run, scene, sim);
    msim_sim_destroy(sim);
    runs++;
  }
  msim_scene_destroy(scene);
  json_decref(root);
}

static void all_cases(void **state) {
  (void)state;
  DIR *folder = opendir(TEST_SOURCE_DIR "/oracle");
  assert_non_null(folder);
  for (struct dirent *file; (file = readdir(folder)) != NULL;) {
    char path[512];
    if (!strstr(file->d_name, ".json")) continue;
    snprintf(path, sizeof path, "%s/oracle/%s", TEST_SOURCE_DIR, file->d_name);
    one_case(path, file->d_name);
  }
  closedir(folder);
  print_message("%d runs, %d deviations\n", runs, failures);
  assert_true(runs > 100);
  assert_int_equal(failures, 0);
}

int main(int argc, char **argv) {
  if (argc > 1) solver = argv[1];
  if (!is_solver_available(solver)) return missing_status(solver);
  direct = !(solver_flags(solver) & MSIM_BACKEND_ITERATIVE);
  symmetric = (solver_flags(solver) & MSIM_BACKEND_SYMMETRIC) != 0;
  const struct CMUnitTest tests[] = {cmocka_unit_test(all_cases)};
  return cmocka_run_group_tests_name("oracle", tests, NULL, NULL);
}
