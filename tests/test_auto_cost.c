/* Tests of integrator = auto: the cost of the choice and of the run, compared with the best
 * method. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "auto_scenes.h"
#include "choose/pilot_run.h"

/*------------------------------------- error and work -------------------------------------------*/

typedef struct result {
  double x[MOST], v[MOST];
  double work; /* force evaluations; iterations and factorizations are converted by their flops */
} result;

typedef struct target {
  const example *of;
  msim_scene *scene;
  ms_scales scales;
  result exact;
} target;

/* At least one evaluation per step: without springs implicit methods count none. */
static double work_of(const msim_sim *sim) {
  return fmax(ms_pilot_run_count_work(sim), (double)stats_of(sim).steps);
}

/* 1: the run reached its end with at most so much work. */
static int run(const msim_scene *scene, const msim_options *opt, double most, result *r) {
  msim_sim *sim;
  if (msim_sim_create(scene, opt, &sim, NULL)) return 0; /* the method does not take such forces */
  msim_status status = MSIM_OK;
  while (!status && state_of(sim).t < opt->t_end * (1 - 1e-12) && work_of(sim) <= most)
    status = msim_sim_step(sim, 1, NULL);
  const msim_state now = state_of(sim);
  const int done = !status && now.t >= opt->t_end * (1 - 1e-12);
  memcpy(r->x, now.x, 3 * (size_t)now.n * sizeof *now.x);
  memcpy(r->v, now.v, 3 * (size_t)now.n * sizeof *now.v);
  r->work = work_of(sim);
  msim_sim_destroy(sim);
  return done;
}

/* In the norm of the error control */
static double error_of(const target *t, const result *r) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(t->scene, &view);
  double sum = 0;
  for (size_t i = 0; i < 3 * (size_t)view.nparticles; i++) {
    const double dx = (r->x[i] - t->exact.x[i]) / t->scales.extent;
    const double dv = (r->v[i] - t->exact.v[i]) / t->scales.speed;
    if (!view.pinned[i / 3]) sum += view.mass[i / 3] * (dx * dx + dv * dv);
  }
  return sqrt(sum / (2 * t->scales.mass));
}

static void find_exact(const example *of, double tol, target *t) {
  msim_scene_view view = {.size = sizeof view};
  *t = (target){.of = of, .scene = of->make()};
  msim_scene_get(t->scene, &view);
  assert_true(3 * view.nparticles <= MOST);
  assert_ok(ms_scales_compute(t->scene->data, view.x, view.v, of->t_end, &t->scales, err));
  const msim_options opt = options_of("dop853", tol, of->t_end);
  assert_true(run(t->scene, &opt, INFINITY, &t->exact));
}

/*------------------------------------- the best method ------------------------------------------*/

/* The cost of a method against its error, in a sweep over tol or h */
enum { RUNS = 12 };
typedef struct curve {
  const char *method;
  int fixed, n;
  double error[RUNS], work[RUNS];
} curve;

/* The first step of a sweep: the stability limit, or a tenth of the run. 0: the method does not
 * take the scene, or eliminates unknowns, which ms_pilot_run_count_work() does not count. */
static double first_step(const target *t, msim_options opt, int fixed) {
  msim_sim *sim;
  if (fixed) opt.h = MSIM_H_AUTO;
  msim_status status = msim_sim_create(t->scene, &opt, &sim, NULL);
  if (fixed && status) {
    opt.h = t->of->t_end / 10;
    status = msim_sim_create(t->scene, &opt, &sim, NULL);
  }
  if (status) return 0;
  const ms_solver *solver = ms_sim_largest_island(sim)->stepper.solver;
  const double h = solver && solver->elimination.a ? 0 : sim->run.h;
  msim_sim_destroy(sim);
  return h;
}

static void sweep(const target *t, const char *method, int fixed, double most, curve *c) {
  *c = (curve){.method = method, .fixed = fixed};
  msim_options opt = options_of(method, fixed ? 0 : 0.1, t->of->t_end);
  result r = {.work = 0};
  const double h = first_step(t, opt, fixed);
  if (fixed) opt.h = h;
  for (int i = 0; i < RUNS && h > 0 && r.work <= most; i++, opt.tol /= 10) {
    if (run(t->scene, &opt, most, &r)) c->error[c->n] = error_of(t, &r), c->work[c->n++] = r.work;
    if (fixed) opt.h /= 2;
  }
}

/* Interpolated between two points of the sweep: the work is a power of the error */
static double work_at(const curve *c, double error) {
  double least = INFINITY;
  for (int i = 0; i < c->n; i++) {
    if (c->error[i] > error) continue;
    double work = c->work[i];
    if (i > 0 && c->error[i - 1] > error)
      work *=
          pow(c->work[i - 1] / work, log(error / c->error[i]) / log(c->error[i - 1] / c->error[i]));
    least = fmin(least, work);
  }
  return least;
}

/* All methods that a user could name, with tol and with fixed steps; these not in scenes with
 * planes, where they are accurate by chance. */
enum { CURVES = 46 };
static int sweep_all(const target *t, double most, curve curves[CURVES]) {
  const int kinds = t->scene->data->nplanes > 0 ? 1 : 2;
  const msim_integrator_entry *entry;
  int n = 0;
  for (int32_t m = 0; (entry = msim_integrator_info(m)) != NULL; m++)
    for (int fixed = 0; fixed < kinds && entry->order > 0; fixed++) {
      assert_true(n < CURVES);
      sweep(t, entry->name, fixed, most, &curves[n++]);
    }
  return n;
}

static double find_best(const curve *curves, int n, double error, const curve **best) {
  double least = INFINITY;
  *best = &curves[0];
  for (int i = 0; i < n; i++) {
    const double work = work_at(&curves[i], error);
    if (work < least) least = work, *best = &curves[i];
  }
  return least;
}

static void choose(const target *t, double tol, result *r, const ms_candidate **c,
                   ms_method_choice *s) {
  const msim_options opt = options_of("auto", tol, t->of->t_end);
  msim_sim *sim = make_sim(t->scene, &opt);
  *s = sim->config.choice;
  *c = &s->candidates[s->best];
  assert_string_equal(sim->config.integrator->entry.name, (*c)->method->entry.name);
  msim_sim_destroy(sim);
  assert_true(run(t->scene, &opt, INFINITY, r));
}

/* Maximum and mean over the runs of a table */
typedef struct summary {
  double most, sum;
  int n;
} summary;

static void add(summary *s, double value) {
  s->most = fmax(s->most, value), s->sum += value, s->n++;
}

static void assert_summary(const char *what, const summary *s, double most, double mean) {
  print_message("  %s: %.3g at most, %.3g on average\n", what, s->most, s->sum / s->n);
  assert_true(s->most <= most && s->sum / s->n <= mean);
}

/* The run keeps tol. It costs little more than the best method, found by a sweep, at the same
 * error, and at an error of tol; the choice costs less than the run. Bounds are a tenth above
 * measured values. */
static void as_good_as_the_best(void **state) {
  (void)state;
  const double tols[] = {1e-2, 1e-4, 1e-6, 1e-8};
  enum { NTOLS = 4 };
  summary as_good = {0}, enough = {0}, choice = {0};
  for (int i = 0; i < NEXAMPLES; i++) {
    target t;
    result r[NTOLS];
    const ms_candidate *c[NTOLS];
    ms_method_choice s[NTOLS];
    double most = 0;
    curve curves[CURVES];
    find_exact(&examples[i], 1e-11, &t);
    for (int k = 0; k < NTOLS; k++) {
      choose(&t, tols[k], &r[k], &c[k], &s[k]);
      most = fmax(most, r[k].work);
    }
    const int n = sweep_all(&t, 1.5 * most, curves);
    for (int k = 0; k < NTOLS; k++) {
      const curve *best;
      const double at_tol = find_best(curves, n, tols[k], &best);
      const double error = error_of(&t, &r[k]), least = find_best(curves, n, error, &best);
      print_message(
          "  %-14s tol %.0e  %-15s %-10s  error %.1e  evaluations %6.0f + %4.0f, %4.2f of %s%s, "
          "%4.2f of the best at tol\n",
          t.of->name, tols[k], c[k]->method->entry.name,
          c[k]->control_tol > 0 ? "controlled" : "fixed", error, r[k].work, s[k].total_cost,
          r[k].work / least, best->method, best->fixed ? ", fixed" : "", r[k].work / at_tol);
      assert_true(error < t.of->error_limit * tols[k]);
      add(&as_good, r[k].work / least);
      add(&enough, r[k].work / at_tol);
      add(&choice, s[k].total_cost / r[k].work);
    }
    msim_scene_destroy(t.scene);
  }
  assert_summary("cost over that of the best method at the same error", &as_good, 3.3, 1.9);
  assert_summary("cost over that of the best method at tol", &enough, 5.2, 2.5);
  assert_summary("cost of the choice over that of the run", &choice, 0.8, 0.22);
}

/*------------------------------------- tr-bdf2 --------------------------------------------------*/

static msim_scene *wire(void) { return swinging_rope(3, 1e9, 1e4); }

/* Two stiff damped springs that swing slowly: long implicit steps are much less expensive. */
static void implicit_where_it_costs_less(void **state) {
  (void)state;
  const example swinging = {"wire", wire, 0.4, 1};
  const double tol = 1e-2;
  target t;
  result r;
  const ms_candidate *c;
  ms_method_choice s;
  find_exact(&swinging, 1e-6, &t);
  choose(&t, tol, &r, &c, &s);
  const double error = error_of(&t, &r);
  double by_explicit = INFINITY;
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (!s.candidates[i].method->entry.implicit)
      by_explicit = fmin(by_explicit, s.candidates[i].cost_rate);
  print_message("  %s error %.1e, evaluations per second %.0f, estimated %.0f, explicit %.0f\n",
                c->method->entry.name, error, r.work / t.of->t_end, c->cost_rate, by_explicit);
  assert_string_equal(c->method->entry.name, "tr-bdf2");
  assert_true(error < tol);
  assert_true(isfinite(by_explicit) && 5 * c->cost_rate < by_explicit);
  assert_true(s.total_cost < 0.3 * by_explicit * t.of->t_end);
  assert_true(4 * r.work < by_explicit * t.of->t_end);
  msim_scene_destroy(t.scene);
}

/*------------------------------------- smooth motion --------------------------------------------*/

enum { TRAMPOLINE = 12, JUMPERS = 3 * TRAMPOLINE * TRAMPOLINE };

/* A cloth pinned at its edge, all springs stretched by a ninth, with one wave of velocity */
static msim_scene *trampoline(void) {
  enum { SIDE = TRAMPOLINE, SPRINGS = 6 * SIDE * SIDE };
  const double pi = 3.14159265358979323846;
  msim_scene *cloth = hanging_cloth(SIDE, 1000, 0), *scene;
  msim_scene_view view = {.size = sizeof view};
  double v[JUMPERS] = {0}, rest[SPRINGS];
  int32_t edge[4 * SIDE], n = 0;
  msim_scene_get(cloth, &view);
  assert_true(view.nsprings <= SPRINGS);
  for (int32_t i = 0; i < SIDE * SIDE; i++) {
    const int32_t row = i / SIDE, column = i % SIDE;
    const int outer = row % (SIDE - 1) == 0 || column % (SIDE - 1) == 0;
    if (outer) edge[n++] = i;
    else v[3 * i + 2] = 0.2 * sin(pi * view.x[3 * i]) * sin(pi * view.x[3 * i + 1]);
  }
  for (int32_t e = 0; e < view.nsprings; e++) rest[e] = 0.9 * view.rest[e];
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, SIDE * SIDE, view.x, v, view.mass, err));
  assert_ok(msim_scene_add_springs(scene, view.nsprings, view.ij, view.k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, n, edge, err));
  msim_scene_destroy(cloth);
  return scene;
}

/* The largest error of a coordinate */
static double run_to(const msim_scene *scene, const msim_options *opt, const double *exact,
                     double *x, double *evaluations) {
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const msim_state end = state_of(sim);
  memcpy(x, end.x, JUMPERS * sizeof *x);
  const double most = largest_difference(x, exact, JUMPERS);
  *evaluations = (double)stats_of(sim).force_evaluations;
  print_message("  %s: error %.2g, %.0f evaluations\n", sim->config.integrator->entry.name, most,
                *evaluations);
  msim_sim_destroy(sim);
  return most;
}

/* The first trial of force-gradient, of the longest stable step, is in error by fast modes, which
 * fall faster than h^4: rkn6 with as many evaluations as the method chosen is less accurate. */
static void first_trials_are_not_extrapolated_far(void **state) {
  (void)state;
  static double exact[JUMPERS], x[JUMPERS];
  const double t_end = 0.1, tol = 1e-7;
  double spent;
  msim_scene *scene = trampoline();
  const msim_options reference = options_of("dop853", 1e-12, t_end),
                     opt = options_of("auto", tol, t_end);
  run_to(scene, &reference, x, exact, &spent);
  const double error = run_to(scene, &opt, exact, x, &spent);
  msim_options other = options_of("rkn6", 0, t_end);
  other.h = t_end / floor(spent / 11);
  assert_true(error < tol);
  assert_true(error < run_to(scene, &other, exact, x, &spent));
  msim_scene_destroy(scene);
}

/*------------------------------------- damping --------------------------------------------------*/

/* Force evaluations of a run in double precision, those of the choice included; used: the method
 * that makes it; x: its end */
static double evaluations_of(const msim_scene *scene, const char *method, double tol,
                             const char *used, double *x) {
  msim_options opt = options_of(method, tol, 0.3);
  opt.precision = MSIM_PRECISION_DOUBLE;
  msim_sim *sim = make_sim(scene, &opt);
  const double choice = sim->config.choice.total_cost;
  assert_string_equal(sim->config.integrator->entry.name, used);
  assert_true(sim->config.opt.tol == tol);
  assert_ok(msim_sim_run(sim, NULL, NULL, err));
  const double count = choice + (double)stats_of(sim).force_evaluations;
  const msim_state end = state_of(sim);
  memcpy(x, end.x, 3 * (size_t)end.n * sizeof *x);
  print_message("  %s: %.0f evaluations, %.0f of them for the choice\n", used, count, choice);
  msim_sim_destroy(sim);
  return count;
}

/* Bounds on damping are loose, so that error control takes longer steps than these allow: ssprk104
 * costs less than dop853 and than fixed steps, and keeps tol. */
static void error_control_where_damping_limits_steps(void **state) {
  (void)state;
  enum { N = 3 * 512 };
  double exact[N], x[N];
  const double tol = 1e-3, extent = 0.2;
  msim_scene *scene = damped_solid();
  evaluations_of(scene, "dop853", 1e-9, "dop853", exact);
  const double chosen = evaluations_of(scene, "auto", tol, "ssprk104", x);
  assert_true(largest_difference(x, exact, N) < tol * extent);
  assert_true(chosen < evaluations_of(scene, "dop853", tol, "dop853", x));
  assert_true(chosen < evaluations_of(scene, "velocity-verlet", tol, "velocity-verlet", x));
  msim_scene_destroy(scene);
}

/* Error control compares states in double precision, so that none of its candidates has floats. */
static void error_control_has_no_floats(void **state) {
  (void)state;
  msim_scene *scene = damped_solid();
  const msim_options opt = options_of("auto", 1e-3, 0.3);
  msim_sim *sim = make_sim(scene, &opt);
  int single = 0;
  for (int i = 0; i < MS_CANDIDATES; i++) {
    const ms_candidate *c = &sim->config.choice.candidates[i];
    assert_true(c->control_tol == 0 || c->precision == MSIM_PRECISION_DOUBLE);
    single += c->precision == MSIM_PRECISION_SINGLE;
  }
  assert_true(single > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Without obstacles rkc makes the pilot run, an eighth of the whole, with less than half of the two
 * evaluations of each step of velocity Verlet. */
static void a_damped_pilot_run_has_long_steps(void **state) {
  (void)state;
  const double t_end = 0.3;
  msim_scene *scene = hanging_cloth(12, 1000, 3.2);
  const msim_options opt = options_of("auto", 1e-2, t_end);
  msim_sim *sim = make_sim(scene, &opt);
  const ms_method_choice *s = &sim->config.choice;
  assert_string_equal(s->candidates[1].method->entry.name, "velocity-verlet");
  const double by_verlet = 2 * t_end / 8 / s->candidates[1].h;
  print_message("  the choice: %.0f evaluations, a pilot run by velocity Verlet: %.0f\n",
                s->total_cost, by_verlet);
  assert_true(s->total_cost < by_verlet / 2);
  msim_sim_destroy(sim);
  plane(scene, 0, 0, 1, -100, 0, 0);
  sim = make_sim(scene, &opt);
  assert_true(sim->config.choice.total_cost > by_verlet);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A choice for a run of so many steps costs no more than the pilot run's 16384, and three times
 * 1024 for each trial, of which four are the most here; by methods of 13 evaluations at most. */
static void the_choice_for_a_long_run_is_bounded(void **state) {
  (void)state;
  const double pilot = 16384, trials = 4 * 3 * 1024 * 13.;
  msim_scene *scene = hanging_cloth(9, 3e4, 0.05);
  for (double t_end = 1e3; t_end < 1e7; t_end *= 100) {
    const msim_options opt = options_of("auto", 1e-6, t_end);
    msim_sim *sim = make_sim(scene, &opt);
    const ms_method_choice *s = &sim->config.choice;
    print_message("  for %g s the choice costs %.0f evaluations\n", t_end, s->total_cost);
    assert_true(s->total_cost < 2 * pilot + trials);
    assert_true(s->pilot_time < t_end / 8);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* A block at rest meets the plane after a quarter of the run, t = sqrt(2 z/g): the choice costs the
 * steps until there, up to 1/64 of the run more, and two trials, by reflected and by located
 * impacts, of three times 1/14 of the run each, and for paths no more than another one. */
static void an_impact_is_reached_once(void **state) {
  (void)state;
  const double g[3] = {0, 0, -9.81}, t_end = 0.4, impact = t_end / 4,
               z = 9.81 * impact * impact / 2;
  const msim_lattice block = {.size = sizeof block,
                              .n = {5, 5, 5},
                              .origin = {0, 0, z},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 2000};
  const msim_options opt = options_of("auto", 0.1, t_end);
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  plane(scene, 0, 0, 1, 0, 0.8, 0);
  msim_sim *sim = make_sim(scene, &opt);
  const ms_method_choice *s = &sim->config.choice;
  const double h = MS_STABLE_FRACTION * sim->config.step_limit.limit,
               until = (impact + t_end / 64) / h, trial = 3. / 14 * t_end / h;
  print_message("  the choice: %.0f evaluations, until the impact %.0f, trial %.0f\n",
                s->total_cost, until, trial);
  assert_true(s->pilot_time >= impact && s->pilot_time <= impact + t_end / 64);
  assert_true(s->total_cost < 1.1 * (until + 3 * trial));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(as_good_as_the_best),
                                     cmocka_unit_test(implicit_where_it_costs_less),
                                     cmocka_unit_test(first_trials_are_not_extrapolated_far),
                                     cmocka_unit_test(error_control_where_damping_limits_steps),
                                     cmocka_unit_test(error_control_has_no_floats),
                                     cmocka_unit_test(a_damped_pilot_run_has_long_steps),
                                     cmocka_unit_test(the_choice_for_a_long_run_is_bounded),
                                     cmocka_unit_test(an_impact_is_reached_once)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
