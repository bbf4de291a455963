/* Tests of edits, which remove and add particles and springs: of scenes against scenes built anew,
 * and of running sims against new sims in the same state, for every method; islands that stay, and
 * energy less work. */
#include "edits.h"
#include "sim/sim.h"
#include "state_hash.h"

static void expect_equal(const msim_scene *a, const msim_scene *b) {
  const msim_scene_view s = view_of(a), t = view_of(b);
  const size_t n = (size_t)t.nparticles, m = (size_t)t.nsprings, real = sizeof(double);
  assert_int_equal(s.nparticles, t.nparticles);
  assert_int_equal(s.nsprings, t.nsprings);
  assert_int_equal(s.nfaces, t.nfaces);
  assert_memory_equal(s.x, t.x, 3 * n * real);
  assert_memory_equal(s.v, t.v, 3 * n * real);
  assert_memory_equal(s.mass, t.mass, n * real);
  assert_memory_equal(s.pinned, t.pinned, n);
  assert_memory_equal(s.force, t.force, 3 * n * real);
  assert_memory_equal(s.ij, t.ij, 2 * m * sizeof *s.ij);
  assert_memory_equal(s.k, t.k, m * real);
  assert_memory_equal(s.rest, t.rest, m * real);
  assert_memory_equal(s.damping, t.damping, m * real);
  if (t.law) assert_memory_equal(s.law, t.law, m * sizeof *s.law);
  assert_memory_equal(s.faces, t.faces, 3 * (size_t)t.nfaces * sizeof *s.faces);
  assert_int_equal(s.nmotions, t.nmotions);
  msim_motion p = {.size = sizeof p}, q = p;
  for (int32_t i = 0; i < t.nmotions; i++) {
    assert_int_equal(msim_scene_get_motion(a, i, &p), MSIM_OK);
    assert_int_equal(msim_scene_get_motion(b, i, &q), MSIM_OK);
    assert_int_equal(p.n, q.n);
    assert_memory_equal(p.particles, q.particles, (size_t)p.n * sizeof *p.particles);
    assert_memory_equal(p.x, q.x, 3 * (size_t)p.n * (size_t)p.nt * real);
  }
}

static void scenes_are_edited(void **state) {
  (void)state;
  for (unsigned seed = 0; seed < 100; seed++) {
    random_edit r;
    msim_scene *scene = make_scene("rk4", (int)seed % KINDS);
    const msim_scene_view s = view_of(scene);
    fill_edit(&s, 1, seed, &r);
    msim_scene *expected = build_edited(scene, &r);
    assert_ok(msim_scene_edit(scene, &r.is, err));
    expect_equal(scene, expected);
    msim_scene_destroy(scene), msim_scene_destroy(expected);
  }
}

/* Without given lengths springs have those of the scene, or, in a sim, those of its state. */
static void springs_fit_their_length(void **state) {
  (void)state;
  const int32_t ij[4] = {1, 2, 0, N};
  const double k[2] = {10, 10}, x[3] = {0, 0, 1}, mass = 1;
  const msim_edit edit = {
      .size = sizeof edit, .nparticles = 1, .x = x, .mass = &mass, .nsprings = 2, .ij = ij, .k = k};
  msim_scene *scene = make_scene("rk4", PLAIN);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 100, err));
  assert_ok(msim_sim_edit(sim, &edit, err));
  double elongation[MOST];
  assert_int_equal(msim_sim_springs(sim, NULL, elongation, NULL), MSIM_OK);
  const int32_t n = view_of(scene).nsprings;
  assert_true(elongation[n] == 0 && elongation[n + 1] == 0);
  assert_ok(msim_scene_edit(scene, &edit, err));
  assert_close(view_of(scene).rest[n], 0.2, 1e-15);
  assert_close(view_of(scene).rest[n + 1], 1, 1e-15);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/*------------------------------------- running sims ---------------------------------------------*/

/* The state after an edit, from that before it */
typedef struct full_state {
  msim_state is;
  double x[3 * (N + ADDED)], v[3 * (N + ADDED)];
} full_state;

static void edit_state(const msim_state *now, const random_edit *r, full_state *to) {
  int32_t number[N + ADDED];
  to->is = *now;
  to->is.n = number_particles(r, now->n, number);
  for (int32_t p = 0; p < now->n + ADDED; p++) {
    if (number[p] < 0) continue;
    const double *x = p < now->n ? now->x + 3 * p : r->x + 3 * (p - now->n);
    const double *v = p < now->n ? now->v + 3 * p : r->v + 3 * (p - now->n);
    memcpy(to->x + 3 * number[p], x, 3 * sizeof *x),
        memcpy(to->v + 3 * number[p], v, 3 * sizeof *v);
  }
  to->is.x = to->x, to->is.v = to->v, to->is.v_half = NULL;
}

static void expect_fresh(const char *method, int kind, int controlled, unsigned seed) {
  random_edit r;
  full_state now;
  msim_scene *scene = make_scene(method, kind);
  const msim_scene_view s = view_of(scene);
  msim_options opt = run_options(method, kind, controlled);
  opt.threads = 1 + (int32_t)seed % 2;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 20, err));
  fill_edit(&s, !takes_positions_only(method), seed, &r);
  const msim_state before = state_of(sim);
  edit_state(&before, &r, &now);
  msim_scene *edited = build_edited(scene, &r);
  assert_ok(msim_sim_edit(sim, &r.is, err));
  if (opt.steps >= 0) opt.steps -= 20;
  msim_sim *fresh = make_sim(edited, &opt);
  assert_ok(msim_sim_set_state(fresh, &now.is, err));
  msim_plan plan = {.size = sizeof plan}, expected = plan;
  assert_int_equal(msim_sim_plan(sim, &plan), MSIM_OK);
  assert_int_equal(msim_sim_plan(fresh, &expected), MSIM_OK);
  assert_int_equal(plan.steps, expected.steps);
  for (int k = 0; k < 4; k++) {
    assert_int_equal(state_of(sim).n, now.is.n);
    if (hash_sim(sim) != hash_sim(fresh))
      fail_msg("%s%s, scene %d, seed %u: differs from a new sim after %d steps", method,
               controlled ? ", tol" : "", kind, seed, 8 * k);
    assert_ok(msim_sim_step(sim, 8, err));
    assert_ok(msim_sim_step(fresh, 8, err));
  }
  msim_sim_destroy(sim), msim_sim_destroy(fresh);
  msim_scene_destroy(scene), msim_scene_destroy(edited);
}

static void edits_continue_as_new_sims(void **state) {
  (void)state;
  const char *method;
  for (int32_t i = 0; (method = method_or_auto(i)) != NULL; i++)
    for (int kind = 0; kind < KINDS; kind++) {
      if (takes(method, kind, 0)) expect_fresh(method, kind, 0, 10 * (unsigned)i + (unsigned)kind);
      if (takes(method, kind, 1)) expect_fresh(method, kind, 1, 10 * (unsigned)i + (unsigned)kind);
    }
}

/*------------------------------------- energy ---------------------------------------------------*/

static void energy_is_balanced(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(SIDE, 50, 0);
  const msim_scene_view s = view_of(scene);
  msim_options opt = options("dop853", 1e-3);
  opt.tol = 1e-12, opt.steps = -1, opt.t_end = 100;
  msim_sim *sim = make_sim(scene, &opt);
  const double start = energy_less_work(sim);
  for (unsigned seed = 1; seed < 5; seed++) {
    random_edit r;
    fill_edit(&s, 0, seed, &r);
    r.is.nremoved_particles = 2;
    r.is.ij = NULL, r.is.nsprings = 0, r.is.nparticles = 2; /* as many as are removed */
    for (int i = 0; i < 2; i++) r.particles[i] = (int32_t)seed + 7 * i;
    for (int i = 0; i < 8; i++) r.springs[i] /= 2;
    assert_ok(msim_sim_edit(sim, &r.is, err));
    assert_ok(msim_sim_step(sim, 30, err));
    assert_close(energy_less_work(sim), start, 2e-11);
  }
  assert_true(fabs(state_of(sim).work) > 0.01);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- islands --------------------------------------------------*/

enum { BODY = 24 * 24, BODIES = 5 };
enum { NOTHING, BENDING, MOTIONS, FUNCTION, EXTRAS }; /* what islands have beside springs */

/* Forces by the numbers of particles, which edits change */
static int32_t push_by_number(void *data, const msim_force_batch *b) {
  (void)data;
  for (int32_t i = 0; i < b->n; i++) b->f[3 * i] = 1e-3 * (b->particles[i] % 7);
  return 0;
}

static msim_scene *five_cloths(int extra) {
  const msim_force_function push = {
      .size = sizeof push, .name = "push", .evaluate = push_by_number};
  const double g[3] = {0, 0, -9.81};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int i = 0; i < BODIES; i++) {
    const int32_t corners[2] = {0, 23};
    const msim_cloth cloth = {.size = sizeof cloth,
                              .rows = 24,
                              .columns = 24,
                              .origin = {0, 0, i},
                              .row = {0, 1, 0},
                              .column = {1, 0, 0},
                              .mass = 0.3,
                              .k_structural = 100,
                              .k_shear = 100,
                              .damping = 0.01,
                              .npinned = 2,
                              .pinned = corners,
                              .bending = extra == BENDING ? 0.01 : 0};
    const int32_t moved[2] = {3 * BODY, i * BODY}; /* the last two cloths share a motion */
    assert_ok(msim_scene_add_cloth(scene, &cloth, err));
    if (extra == MOTIONS && i != 3) add_motion(scene, i < 4 ? 1 : 2, moved + (i < 4));
  }
  if (extra == FUNCTION) assert_ok(msim_scene_set_force_function(scene, &push, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

/* One spring of the second of five cloths is removed: the others keep their solvers. The bits are
 * those of a new sim. */
static void other_islands_stay(void **state) {
  (void)state;
  const char *const methods[] = {"linearly-implicit-euler", "implicit-midpoint", "velocity-verlet"};
  for (int k = 0; k < 3 * EXTRAS; k++) {
    const int i = k % 3;
    msim_scene *scene = five_cloths(k / 3);
    msim_options opt = options(methods[i], 1.0 / 4096);
    const char *solver = k < 3 ? "klu" : "cholmod"; /* the latter is faster */
    const int counts = i < 2 && is_solver_available(solver);
    opt.steps = 100, opt.threads = 2;
    if (counts) opt.solver = solver;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 5, err));
    const int64_t analyses = stats_of(sim).analyses;
    const struct ms_solver *kept = sim->islands[3].stepper.solver;
    const int32_t cut = view_of(scene).nsprings / BODIES + 500, gone[2] = {BODY + 300, 3 * BODY};
    const msim_edit edit = {.size = sizeof edit, .nremoved_springs = 1, .removed_springs = &cut};
    const msim_edit smaller = {
        .size = sizeof edit, .nremoved_particles = 2, .removed_particles = gone};
    msim_state now = state_of(sim);
    assert_ok(msim_sim_edit(sim, &edit, err));
    assert_ok(msim_scene_edit(scene, &edit, err));
    opt.steps = 95;
    msim_sim *fresh = make_sim(scene, &opt);
    now = state_of(sim);
    assert_ok(msim_sim_set_state(fresh, &now, err));
    for (int n = 0; n < 3; n++) {
      assert_ok(msim_sim_step(sim, 5, err));
      assert_ok(msim_sim_step(fresh, 5, err));
      assert_true(hash_sim(sim) == hash_sim(fresh));
    }
    if (counts) assert_int_equal(stats_of(sim).analyses, analyses + 1);
    assert_true(sim->islands[3].stepper.solver == kept);
    /* particles of the second and the fourth cloth are removed: indices of the others shift */
    assert_ok(msim_sim_edit(sim, &smaller, err));
    assert_ok(msim_scene_edit(scene, &smaller, err));
    msim_sim_destroy(fresh);
    opt.steps = 80;
    fresh = make_sim(scene, &opt);
    now = state_of(sim);
    assert_ok(msim_sim_set_state(fresh, &now, err));
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(fresh, 5, err));
    assert_true(hash_sim(sim) == hash_sim(fresh));
    if (counts) assert_int_equal(stats_of(sim).analyses, analyses + 3);
    msim_sim_destroy(sim), msim_sim_destroy(fresh);
    msim_scene_destroy(scene);
  }
}

/* An edit of a sim of that scene has the bits of a new sim; the scene is edited, too. */
static void expect_edited(msim_scene *scene, msim_sim *sim, const msim_options *opt,
                          const msim_edit *edit) {
  assert_ok(msim_sim_edit(sim, edit, err));
  assert_ok(msim_scene_edit(scene, edit, err));
  const msim_state now = state_of(sim);
  msim_sim *fresh = make_sim(scene, opt);
  assert_ok(msim_sim_set_state(fresh, &now, err));
  assert_ok(msim_sim_step(sim, 5, err));
  assert_ok(msim_sim_step(fresh, 5, err));
  if (hash_sim(sim) != hash_sim(fresh)) fail_msg("%s: differs from a new sim", opt->integrator);
  msim_sim_destroy(fresh);
}

/* A loose particle takes the place of another one; motions get other numbers; solvers chosen for
 * another step are made anew. */
static void similar_islands_are_built_anew(void **state) {
  (void)state;
  const double x[3] = {0.3, 0.2, 0.5}, mass = 0.5;
  const int32_t loose = N, corners[3] = {0, 2 * BODY, 3 * BODY};
  const msim_edit exchange = {.size = sizeof exchange,
                              .nremoved_particles = 1,
                              .removed_particles = &loose,
                              .nparticles = 1,
                              .x = x,
                              .mass = &mass};
  const msim_edit first = {
      .size = sizeof first, .nremoved_particles = 1, .removed_particles = corners};
  msim_scene *scene = hanging_cloth(SIDE, 300, 0.01);
  msim_options opt = options("velocity-verlet", 1.0 / 1024);
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 8, err));
  expect_edited(scene, sim, &opt, &exchange);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
  scene = five_cloths(NOTHING);
  for (int i = 0; i < 3; i++) add_motion(scene, 1, &corners[i]);
  opt = options("linearly-implicit-euler", 1.0 / 1024);
  sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 8, err));
  expect_edited(scene, sim, &opt, &first);
  assert_ok(msim_sim_set_step(sim, 1.0 / 2048, err));
  opt.h = 1.0 / 2048;
  expect_edited(scene, sim, &opt, &first);
  for (int32_t i = 0; i < sim->nislands; i++)
    assert_true(sim->islands[i].stepper.solver->creation_h == opt.h);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* A strip of 2 x 600 particles, cut across its middle, becomes two islands. */
static void islands_are_split(void **state) {
  (void)state;
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 2,
                            .columns = 1200,
                            .row = {0, 1, 0},
                            .column = {100, 0, 0},
                            .mass = 1,
                            .k_structural = 100};
  int32_t cut[2], n = 0;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  const msim_scene_view s = view_of(scene);
  for (int32_t e = 0; e < s.nsprings; e++)
    if (s.ij[2 * e] % 1200 == 599 && s.ij[2 * e + 1] == s.ij[2 * e] + 1) cut[n++] = e;
  assert_int_equal(n, 2);
  const msim_edit edit = {.size = sizeof edit, .nremoved_springs = 2, .removed_springs = cut};
  const msim_options opt = options("implicit-euler", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_int_equal(sim->nislands, 1);
  assert_ok(msim_sim_edit(sim, &edit, err));
  assert_int_equal(sim->nislands, 2);
  assert_ok(msim_sim_step(sim, 3, err));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A rope of 7 particles bends at 5 of them. Without particle 3 it bends at 1 and 5, of which the
 * latter is 4 then. */
static void angular_springs_go_with_their_particles(void **state) {
  (void)state;
  static const int32_t third = 3, left[6] = {0, 1, 2, 3, 4, 5};
  const msim_rope rope = {.size = sizeof rope,
                          .n = 7,
                          .to = {6, 0, 1},
                          .mass = 1,
                          .k = 50,
                          .damping = 0.1,
                          .bending = 2};
  const msim_edit edit = {
      .size = sizeof edit, .nremoved_particles = 1, .removed_particles = &third};
  const double gravity[3] = {0, 1, -9.81};
  const msim_options opt = options("implicit-midpoint", 1e-2);
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  assert_ok(msim_scene_pin(scene, 1, left, err));
  assert_ok(msim_scene_set_gravity(scene, gravity, err));
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 20, err));
  expect_edited(scene, sim, &opt, &edit);
  assert_int_equal(view_of(scene).nangles, 2);
  assert_memory_equal(view_of(scene).ijk, left, sizeof left);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* Angular springs at random, also at added particles, by all methods that take them, but verlet,
 * which shows a rounded v: as a new sim of the scene with them. */
static void angular_springs_are_added(void **state) {
  (void)state;
  enum { BENT = 6 };
  const char *method;
  for (int32_t m = 0; (method = method_at(m)) != NULL; m++)
    for (unsigned seed = 1; seed <= 4; seed++) {
      if (!strcmp(method, "respa") || !strcmp(method, "verlet")) continue;
      if (seed % 2 == 0 && !strcmp(method, "takahashi-imada")) continue;
      msim_scene *scene = make_scene(method, seed % 2 ? PLAIN : MOVING);
      const msim_options opt = options(method, 1.0 / 4096);
      const msim_scene_view s = view_of(scene);
      random_edit r;
      int32_t ijk[3 * BENT], number[N + ADDED];
      double k[BENT], rest[BENT], damping[BENT];
      unsigned random = seed;
      fill_edit(&s, !takes_positions_only(method), seed, &r);
      number_particles(&r, N, number);
      for (int e = 0; e < BENT; e++) {
        for (int c = 0; c < 3; c++) do
            ijk[3 * e + c] = pick(&random, N + ADDED);
          while (number[ijk[3 * e + c]] < 0 || (c > 0 && ijk[3 * e + c] == ijk[3 * e + c - 1]) ||
                 (c > 1 && ijk[3 * e + c] == ijk[3 * e]));
        k[e] = 0.01 * uniform(&random), rest[e] = 3 * uniform(&random);
        damping[e] = takes_positions_only(method) ? 0 : 1e-4 * uniform(&random);
      }
      r.is.nangles = BENT, r.is.ijk = ijk, r.is.angle_k = k, r.is.angle_rest = rest;
      r.is.angle_damping = damping;
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 10, err));
      expect_edited(scene, sim, &opt, &r.is);
      const msim_scene_view edited = view_of(scene);
      assert_int_equal(edited.nangles, BENT);
      for (int i = 0; i < 3 * BENT; i++) assert_int_equal(edited.ijk[i], number[ijk[i]]);
      assert_memory_equal(edited.angle_rest, rest, sizeof rest);
      msim_sim_destroy(sim), msim_scene_destroy(scene);
    }
}

/* An angular spring goes with a pinned particle, to which no spring leads, and another one comes:
 * as many as before, with the same free particles. Then there is one more; then there is none. */
static void angular_springs_are_exchanged(void **state) {
  (void)state;
  const double x[15] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 2, 0, 1, 0, 2, 1}, mass[5] = {1, 1, 1, 1, 1};
  const double k[2] = {0.5, 0.5}, rest[2] = {1, 2}, other = 1.5;
  const int32_t ij[4] = {0, 1, 1, 2}, ijk[6] = {0, 1, 3, 1, 2, 4}, pins[2] = {3, 4},
                to[3] = {0, 1, 4}, more[3] = {0, 2, 3};
  msim_edit edit = {.size = sizeof edit, .nremoved_particles = 1, .removed_particles = pins};
  edit.nangles = 1, edit.ijk = to, edit.angle_k = k, edit.angle_rest = &other;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 5, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 2, ij, (double[]){9, 9}, NULL, NULL, err));
  assert_ok(msim_scene_add_angles(scene, 2, ijk, k, rest, NULL, err));
  assert_ok(msim_scene_pin(scene, 2, pins, err));
  const msim_options opt = options("implicit-midpoint", 1e-2);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 5, err));
  expect_edited(scene, sim, &opt, &edit);
  assert_true(view_of(scene).angle_rest[0] == rest[1] && view_of(scene).angle_rest[1] == other);
  edit.nremoved_particles = 0, edit.ijk = more;
  expect_edited(scene, sim, &opt, &edit);
  edit.nremoved_particles = 1, edit.nangles = 0;
  expect_edited(scene, sim, &opt, &edit);
  assert_int_equal(view_of(scene).nangles, 0);
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

/* A bend of 120 degrees that the run has made, not the scene */
static void present_angles_are_rest_angles(void **state) {
  (void)state;
  const double x[9] = {1, 0, 0, 0, 0, 0, -1, 0, 0}, mass[3] = {1, 1, 1}, k = 2, zero[9] = {0};
  const double bent[9] = {1, 0, 0, 0, 0, 0, -0.5, 0.86602540378443865, 0};
  const int32_t ijk[6] = {0, 1, 2, 0, 1, 3}, one = 1;
  msim_edit edit = {.size = sizeof edit, .nangles = 1, .ijk = ijk, .angle_k = &k};
  msim_scene *scene;
  msim_error why;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 3, x, NULL, mass, err));
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_state to = {.size = sizeof to, .n = 3, .x = bent, .v = zero, .h = 1e-3};
  assert_ok(msim_sim_set_state(sim, &to, err));
  assert_ok(msim_sim_edit(sim, &edit, err));
  assert_ok(msim_sim_step(sim, 1, err));
  for (int i = 0; i < 9; i++) assert_close(state_of(sim).x[i], bent[i], 1e-15);
  assert_ok(msim_scene_edit(scene, &edit, err));
  assert_true(view_of(scene).angle_rest[0] == 3.14159265358979323846);

  const struct {
    msim_edit edit;
    const char *says;
  } bad[] = {
      {{.nangles = 1, .ijk = ijk + 3, .angle_k = &k}, "angles.ijk[0] refers to particle 3"},
      {{.nangles = 1, .angle_k = &k}, "ijk is NULL"},
      {{.nangles = 1, .ijk = ijk}, "k is NULL"},
      {{.nangles = -1}, "angles"},
      {{.nangles = 1,
        .ijk = ijk,
        .angle_k = &k,
        .nremoved_particles = 1,
        .removed_particles = &one},
       "angles.ijk[0] refers to particle 1, which is removed"},
      {{.nangles = 1, .ijk = ijk + 3, .angle_k = &k, .nparticles = 1, .x = zero, .mass = mass},
       "is not defined"}};
  assert_ok(msim_sim_set_state(sim, &to, err));
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    edit = bad[i].edit, edit.size = sizeof edit;
    assert_int_equal(msim_sim_edit(sim, &edit, &why), MSIM_ERR_ARG);
    if (!strstr(why.text, bad[i].says)) fail_msg("%s", why.text);
    assert_int_equal(msim_scene_edit(scene, &edit, &why), MSIM_ERR_ARG);
    if (!strstr(why.text, bad[i].says)) fail_msg("%s", why.text);
  }
  msim_sim_destroy(sim), msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(scenes_are_edited),
                                     cmocka_unit_test(springs_fit_their_length),
                                     cmocka_unit_test(edits_continue_as_new_sims),
                                     cmocka_unit_test(energy_is_balanced),
                                     cmocka_unit_test(other_islands_stay),
                                     cmocka_unit_test(similar_islands_are_built_anew),
                                     cmocka_unit_test(islands_are_split),
                                     cmocka_unit_test(angular_springs_go_with_their_particles),
                                     cmocka_unit_test(angular_springs_are_added),
                                     cmocka_unit_test(angular_springs_are_exchanged),
                                     cmocka_unit_test(present_angles_are_rest_angles)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
