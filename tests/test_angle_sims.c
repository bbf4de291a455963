/* Tests of sims with angular springs: islands, planar scenes, threads, restarts, step-size limits,
 * moving pins, changes in a run, and refusals. */
#include <math.h>

#include "angle_scenes.h"
#include "checkpoints.h"
#include "physics/reference.h"
#include "sim/sim.h"

enum { N = 7 };

/*------------------------------------- layout ---------------------------------------------------*/

/* Islands: chains that only angular springs join move as one, and alone as in a common system. */
static void islands_follow_angles(void **state) {
  (void)state;
  enum { SIDE = 24, CLOTH = SIDE * SIDE };
  for (int joined = 0; joined < 2; joined++) {
    msim_scene *scene = bending_cloth(SIDE, 300, 0.01, 0);
    const msim_cloth other = {.size = sizeof other,
                              .rows = SIDE,
                              .columns = SIDE,
                              .origin = {3, 0, 0},
                              .row = {0, 1, 0},
                              .column = {1, 0.2, 0.1},
                              .mass = 0.2,
                              .k_structural = 100,
                              .k_shear = 50};
    assert_ok(msim_scene_add_cloth(scene, &other, err));
    const double k = 0.2, rest = 2;
    const int32_t bridge[3] = {CLOTH - 1, CLOTH - 2, CLOTH};
    if (joined) assert_ok(msim_scene_add_angles(scene, 1, bridge, &k, &rest, NULL, err));
    const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler"};
    for (int i = 0; i < 2; i++) {
      msim_options opt = options(methods[i], 1e-3);
      opt.solver_rtol = 1e-12;
      msim_sim *apart = make_sim(scene, &opt);
      opt.skip_off |= MSIM_SKIP_ISLANDS;
      msim_sim *whole = make_sim(scene, &opt);
      assert_int_equal(apart->nislands, joined ? 1 : 2);
      assert_ok(msim_sim_step(apart, 30, err));
      assert_ok(msim_sim_step(whole, 30, err));
      const msim_state s = state_of(apart), t = state_of(whole);
      for (int c = 0; c < 6 * CLOTH; c++) assert_close(s.x[c], t.x[c], 1e-11);
      msim_sim_destroy(apart), msim_sim_destroy(whole);
    }
    msim_scene_destroy(scene);
  }
}

/* The speed that errors of velocities are compared with, for three particles of 2 kg at rest under
 * no force but that of an angular spring of energy E: each gets E/3, so that U^2 = 2 E/(3 m). With
 * E = k (angle - rest)^2/2, U = |angle - rest| sqrt(k/(3 m)). */
static void angles_count_in_the_error_norm(void **state) {
  (void)state;
  const double x[9] = {0, 0, 1, 0, 0, 0, 1, 0, 0}, mass[3] = {2, 2, 2}, k = 6, rest = 2.5;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){0, 1, 2}, &k, &rest, NULL, err));
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-6, opt.steps = -1, opt.t_end = 1;
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(sim->islands[0].norm.n, 1);
  assert_close(sim->islands[0].norm.body[0].speed, 2.5 - acos(-1) / 2, 1e-14);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* An angle to a pinned particle that no spring reaches */
static void pinned_corners_belong_to_the_island(void **state) {
  (void)state;
  const double x[9] = {0, 0, 1, 1, 0, 0, 2, 0, 0}, mass[3] = {1, 1, 1}, k = 1, rest = 2.5;
  for (int pinned = 0; pinned < 3; pinned++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
    assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){0, 1, 2}, &k, &rest, NULL, err));
    assert_ok(msim_scene_pin(scene, 1, &pinned, err));
    const msim_options opt = accurate(1);
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_of(sim).total;
    run_to(sim);
    assert_close(energy_of(sim).total, start, 1e-12);
    assert_true(energy_of(sim).kinetic > 0.001);
    msim_sim_destroy(sim);
    const msim_options implicit = options("linearly-implicit-euler", 1e-3);
    sim = make_sim(scene, &implicit); /* no component is free, whose momentum would be conserved */
    assert_int_equal(sim->islands->stepper.solver->components.n, 0);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

static void planar_scenes_stay_planar(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "dop853", "implicit-euler",
                                 "linearly-implicit-euler"};
  for (int i = 0; i < 4; i++) {
    chain c = {N, 20, 0.02, i % 2 ? 0.01 : 0, 1};
    msim_scene *scene = make_chain(c);
    double x[3 * N], v[3 * N];
    bend_state(N, x, v);
    for (int p = 0; p < N; p++) x[3 * p + 2] = v[3 * p + 2] = 0;
    msim_options opt = options(methods[i], 1e-3);
    opt.solver_rtol = opt.newton_rtol = 1e-12;
    msim_sim *flat = make_sim(scene, &opt);
    opt.skip_off |= MSIM_SKIP_TWO_D;
    msim_sim *spatial = make_sim(scene, &opt);
    assert_int_equal(flat->islands->model.unknowns.dims, 2);
    const msim_state to = {.size = sizeof to, .n = N, .x = x, .v = v};
    assert_ok(msim_sim_set_state(flat, &to, err));
    assert_ok(msim_sim_set_state(spatial, &to, err));
    assert_ok(msim_sim_step(flat, 100, err));
    assert_ok(msim_sim_step(spatial, 100, err));
    const msim_state s = state_of(flat), t = state_of(spatial);
    for (int k = 0; k < 3 * N; k++) assert_close(s.x[k], t.x[k], 1e-12);
    for (int p = 0; p < N; p++) assert_true(t.x[3 * p + 2] == 0);
    msim_sim_destroy(flat), msim_sim_destroy(spatial), msim_scene_destroy(scene);
  }
}

/*------------------------------------- the same bits --------------------------------------------*/

static void threads_do_not_change_bits(void **state) {
  (void)state;
  const char *const methods[] = {"velocity-verlet", "dop853", "implicit-euler",
                                 "linearly-implicit-euler"};
  for (int i = 0; i < 4; i++) {
    msim_scene *scene =
        i < 2 ? bent_scene((chain){3000, 20, 0.02, 0.01, 0}) : bending_cloth(50, 1e4, 0.5, 1e-4);
    msim_options opt = options(methods[i], i < 2 ? 1e-4 : 0.01);
    opt.threads = 1, opt.solver = "pcg";
    msim_sim *one = make_sim(scene, &opt);
    opt.threads = 2;
    msim_sim *two = make_sim(scene, &opt);
    assert_ok(msim_sim_step(one, 4, err));
    assert_ok(msim_sim_step(two, 4, err));
    expect_same(one, two, methods[i]);
    msim_sim_destroy(one), msim_sim_destroy(two), msim_scene_destroy(scene);
  }
}

static void runs_resume_bit_for_bit(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++) {
    if (!takes_angles(method, 0)) continue;
    msim_scene *scene = bent_scene((chain){N, 20, 0.02, takes_angles(method, 1) ? 0.01 : 0, 0});
    const msim_options opt = options(method, 1e-3);
    expect_resumable(scene, &opt, 20, 2, (const int64_t[]){7, 13}, method);
    msim_scene_destroy(scene);
  }
}

static void checkpoints_of_other_angles_are_refused(void **state) {
  (void)state;
  msim_scene *scene = bent_scene((chain){N, 20, 0.02, 0, 0}),
             *other = bent_scene((chain){N, 20, 0.03, 0, 0});
  const msim_options opt = options("rk4", 1e-3);
  msim_sim *sim = make_sim(scene, &opt), *there = make_sim(other, &opt);
  msim_error why;
  const checkpoint c = save(sim);
  assert_int_equal(msim_sim_load(there, c.bytes, c.length, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "angles differs from that in the checkpoint"));
  free(c.bytes);
  msim_sim_destroy(sim), msim_sim_destroy(there);
  msim_scene_destroy(scene), msim_scene_destroy(other);
}

enum { STAR = 400 };

/* Supports of pinned particles exert minus the force that these had without pins. */
static void check_reactions(msim_scene *scene, const double *force) {
  const int32_t pins[3] = {0, 4, 9};
  double reaction[3 * STAR];
  const msim_options opt = options("symplectic-euler", 1e-6);
  assert_ok(msim_scene_pin(scene, 3, pins, err));
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(msim_sim_reactions(sim, reaction), MSIM_OK);
  for (int i = 0; i < 3 * STAR; i++) {
    const double expected = scene->data->pinned[i / 3] ? -force[i] : 0;
    assert_close(reaction[i], expected, 1e-11 * (1 + fabs(force[i])));
  }
  msim_sim_destroy(sim);
}

/* An angular spring at a hub of many springs, some with a law, and constant forces: all act on
 * the same particles. */
static void forces_of_all_kinds_add_up(void **state) {
  (void)state;
  double x[3 * STAR], mass[STAR], force[3 * STAR], there[3 * STAR];
  const double k = 3, bend = 0.7;
  const double zero[3 * STAR] = {0};
  for (int i = 0; i < STAR; i++) {
    mass[i] = 1;
    x[3 * i] = cos(i) * i, x[3 * i + 1] = sin(i) * i, x[3 * i + 2] = 0.1 * (i % 7);
    for (int c = 0; c < 3; c++) force[3 * i + c] = cos(3 * i + c);
  }
  msim_scene *scene;
  const msim_law law = {.size = sizeof law, .kind = MSIM_LAW_TENSION};
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, STAR, x, NULL, mass, err));
  assert_ok(msim_scene_add_law(scene, &law, NULL, err));
  for (int32_t i = 1; i < STAR; i++) {
    const double rest = 0.5 * i;
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){0, i}, &k, &rest, NULL, err));
    if (i % 5 == 0) assert_ok(msim_scene_set_law(scene, 1, &(int32_t){i - 1}, 1, err));
    if (i % 3 == 0 && i + 2 < STAR)
      assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){i, i % 2 ? 0 : i + 2, i + 1}, &bend, &k,
                                      NULL, err));
  }
  assert_ok(msim_scene_set_forces(scene, force, err));
  const msim_options opt = options("symplectic-euler", 1e-6);
  msim_sim *sim = make_sim(scene, &opt);
  assert_true(sim->islands->model.half_edges.nparts > 0 && sim->islands->model.laws);
  ms_reference_compute_force(scene->data, x, zero, there);
  for (int again = 0; again < 2; again++) {
    msim_sim_force(sim, x, zero, force);
    for (int i = 0; i < 3 * STAR; i++)
      assert_close(force[i], there[i], 1e-11 * (1 + fabs(there[i])));
  }
  msim_sim_destroy(sim);
  check_reactions(scene, there);
  msim_scene_destroy(scene);
}

/*------------------------------------- limits, pins, refusals -----------------------------------*/

/* For a straight chain the bound is 4/a sqrt(k/m), which the shortest waves reach; velocity Verlet
 * with h = auto is stable. */
static void step_limits_follow_angles(void **state) {
  (void)state;
  enum { LONG = 100 };
  double x[3 * LONG] = {0}, mass[LONG], k[LONG];
  int32_t ijk[3 * LONG];
  for (int i = 0; i < LONG; i++) {
    x[3 * i] = 0.1 * i, mass[i] = 0.02, k[i] = 0.3;
    ijk[3 * i] = i, ijk[3 * i + 1] = i + 1, ijk[3 * i + 2] = i + 2;
  }
  const double omega = 4 / 0.1 * sqrt(0.3 / 0.02);
  msim_scene *scene;
  ms_bounds bounds;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, LONG, x, NULL, mass, err));
  assert_ok(msim_scene_add_angles(scene, LONG - 2, ijk, k, NULL, k, err));
  for (int tight = 0; tight < 2; tight++) {
    assert_ok(ms_bounds_compute(scene->data, tight, &bounds, err));
    assert_true(bounds.omega >= 0.99 * omega && bounds.omega <= 1.02 * omega);
    assert_true(bounds.rate >= 0.99 * omega * omega && bounds.rate <= 1.03 * omega * omega);
    assert_close(bounds.ratio, 1, 1e-12);
  }
  ms_model m;
  assert_ok(ms_model_create(scene->data, 0, &m, err));
  const ms_bounds island = ms_bounds_compute_island(&m);
  assert_close(island.omega, omega, 1e-12 * omega);
  assert_close(island.rate, omega * omega, 1e-12 * island.rate);
  ms_model_destroy(&m), msim_scene_destroy(scene);
  scene = bent_scene((chain){20, 20, 0.5, 0, 0});
  msim_options opt = options("velocity-verlet", MSIM_H_AUTO);
  opt.steps = -1, opt.t_end = 2;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_of(sim).total;
  const char *text;
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "angular springs 18, evaluated apart from springs"));
  assert_non_null(strstr(text, "1/s while edges of angles are as long as at the start"));
  run_to(sim);
  assert_close(energy_of(sim).total, start, 0.2 * start);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* Energy less the work of a pin that moves, at a corner that no spring reaches */
static void work_of_pins_is_counted(void **state) {
  (void)state;
  for (int vertex = 0; vertex < 3; vertex++) {
    msim_scene *scene = make_chain((chain){6, 20, 0.05, 0, 0});
    const double k = 0.1, rest = 2, t[3] = {0, 0.5, 1}, end[3] = {0.1, 0.3, 0.4};
    const double x[3] = {-0.2, 0.2, 0.1}, mass = 1;
    double points[9];
    int32_t ijk[3] = {6, 0, 1};
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    ijk[0] = ijk[vertex], ijk[vertex] = 6;
    assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, &rest, NULL, err));
    const int32_t pins[2] = {6, 5};
    assert_ok(msim_scene_pin(scene, 2, pins, err));
    memcpy(points, x, sizeof x), memcpy(points + 6, end, sizeof end);
    for (int c = 0; c < 3; c++) points[3 + c] = 0.3 * x[c] + 0.7 * end[c];
    const msim_motion motion = {.size = sizeof motion,
                                .n = 1,
                                .particles = pins,
                                .nt = 3,
                                .t = t,
                                .x = points,
                                .interpolation = MSIM_MOTION_CUBIC};
    assert_ok(msim_scene_add_motion(scene, &motion, err));
    const msim_options opt = accurate(1);
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_of(sim).total;
    run_to(sim);
    assert_true(fabs(energy_of(sim).work) > 1e-4);
    assert_close(energy_of(sim).total - energy_of(sim).work, start, 1e-9);
    msim_sim_destroy(sim), msim_scene_destroy(scene);
  }
}

/* Pins that are set and let go, and other springs, in a running sim, make a new sim's bits. */
static void changes_in_a_run_keep_angles(void **state) {
  (void)state;
  msim_scene *scene = bent_scene((chain){N, 20, 0.02, 0, 0});
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const int32_t first = 0;
  double k[N - 1];
  for (int e = 0; e < N - 1; e++) k[e] = 30;
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_set_pinned(sim, 1, &first, 1, err));
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_sim_set_pinned(sim, 1, &first, 0, err));
  assert_ok(msim_sim_set_springs(sim, k, NULL, NULL, err));
  const msim_state now = state_of(sim);
  msim_scene_view w = {.size = sizeof w};
  msim_scene *fresh;
  msim_scene_get(scene, &w);
  assert_ok(msim_scene_create(NULL, &fresh, err));
  assert_ok(msim_scene_add_particles(fresh, N, now.x, now.v, w.mass, err));
  assert_ok(msim_scene_add_springs(fresh, w.nsprings, w.ij, k, w.rest, w.damping, err));
  assert_ok(msim_scene_add_angles(fresh, w.nangles, w.ijk, w.angle_k, w.angle_rest, w.angle_damping,
                                  err));
  msim_sim *other = make_sim(fresh, &opt);
  assert_ok(msim_sim_step(sim, 20, err));
  assert_ok(msim_sim_step(other, 20, err));
  const msim_state s = state_of(sim), t = state_of(other);
  assert_memory_equal(s.x, t.x, 3 * N * sizeof *s.x);
  msim_sim_destroy(sim), msim_sim_destroy(other);
  msim_scene_destroy(scene), msim_scene_destroy(fresh);
}

static void refused(const msim_scene *scene, const char *method, const char *sentence) {
  const msim_options opt = options(method, 1e-3);
  msim_sim *sim;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  if (!strstr(why.text, sentence)) fail_msg("\"%s\" lacks \"%s\"", why.text, sentence);
}

static void methods_without_angles_refuse(void **state) {
  (void)state;
  msim_scene *scene = bent_scene((chain){N, 20, 0.02, 0, 0});
  refused(scene, "respa", "'respa' does not support angular springs; use velocity-verlet");
  msim_scene_destroy(scene);
  scene = bent_scene((chain){4, 20, 0.02, 0, 0});
  const double k = 1, rest = 1, damping = 0.1;
  assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){0, 1, 3}, &k, &rest, &damping, err));
  refused(scene, "rkn6", "but angle 2 is damped; use dop853, rk4 or velocity-verlet");
  refused(scene, "force-gradient", "but angle 2 is damped");
  msim_scene_destroy(scene);
}

/* auto chooses a method that takes them, damped ones, too, and keeps its tolerance. */
static void auto_takes_angles(void **state) {
  (void)state;
  for (int damped = 0; damped < 2; damped++) {
    msim_scene *scene = bent_scene((chain){80, 2000, 0.05, 0, 0});
    const double k = 0.01, rest = 1, damping = 1e-4;
    if (damped)
      assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){0, 1, 3}, &k, &rest, &damping, err));
    msim_options opt = options("auto", 1e-3);
    opt.tol = 1e-4, opt.steps = -1, opt.t_end = 0.1;
    msim_sim *sim = make_sim(scene, &opt), *exact;
    run_to(sim);
    opt = accurate(0.1), opt.tol = 1e-10;
    exact = make_sim(scene, &opt);
    run_to(exact);
    const msim_state s = state_of(sim), t = state_of(exact);
    for (int c = 0; c < 240; c++) assert_close(s.x[c], t.x[c], 1e-2);
    msim_sim_destroy(sim), msim_sim_destroy(exact), msim_scene_destroy(scene);
  }
}

/* Away from rest the bound of w^2 is 1 + |theta - rest| times that at rest. */
static void bounds_grow_away_from_rest(void **state) {
  (void)state;
  double omega[2];
  for (int away = 0; away < 2; away++) {
    const double x[9] = {-1, 0, 0, 0, 0, 0, 1, 0, 0}, mass[3] = {1, 1, 1}, k = 1;
    const double rest = away ? 1 : PI;
    msim_scene *scene;
    ms_bounds bounds;
    assert_ok(msim_scene_create(NULL, &scene, err));
    assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
    assert_ok(msim_scene_add_angles(scene, 1, (int32_t[]){0, 1, 2}, &k, &rest, NULL, err));
    assert_ok(ms_bounds_compute(scene->data, 0, &bounds, err));
    omega[away] = bounds.omega;
    msim_scene_destroy(scene);
  }
  assert_close(omega[0] * omega[0], 2 * 4, 1e-12); /* exact: 1 + 4 + 1 */
  assert_close(omega[1] * omega[1], PI * 2 * 4, 1e-12);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(angles_count_in_the_error_norm),
                                     cmocka_unit_test(forces_of_all_kinds_add_up),
                                     cmocka_unit_test(islands_follow_angles),
                                     cmocka_unit_test(pinned_corners_belong_to_the_island),
                                     cmocka_unit_test(planar_scenes_stay_planar),
                                     cmocka_unit_test(threads_do_not_change_bits),
                                     cmocka_unit_test(runs_resume_bit_for_bit),
                                     cmocka_unit_test(checkpoints_of_other_angles_are_refused),
                                     cmocka_unit_test(step_limits_follow_angles),
                                     cmocka_unit_test(work_of_pins_is_counted),
                                     cmocka_unit_test(changes_in_a_run_keep_angles),
                                     cmocka_unit_test(methods_without_angles_refuse),
                                     cmocka_unit_test(auto_takes_angles),
                                     cmocka_unit_test(bounds_grow_away_from_rest)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
