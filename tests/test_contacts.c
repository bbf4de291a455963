/* Tests of msim_sim_contacts: which particles touched what with which impulse, the balance of
 * momentum, and that recording changes no bit of a run. */
#include <math.h>

#include "base/vec3.h"
#include "checkpoints.h"
#include "colliders.h"
#include "state_hash.h"
#include "stiff_bodies.h"

typedef struct contacts {
  int32_t n;
  const msim_contact *all;
} contacts;

static contacts contacts_of(msim_sim *sim) {
  contacts c;
  assert_int_equal(msim_sim_contacts(sim, &c.n, &c.all), MSIM_OK);
  return c;
}

static msim_options recording(const char *method, double h, int32_t collision) {
  msim_options opt = options(method, h);
  opt.contacts = MSIM_CONTACTS_ON;
  opt.collision = collision;
  return opt;
}

static void momentum_of(msim_sim *sim, double p[3]) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  for (int c = 0; c < 3; c++) p[c] = e.momentum[c];
}

/* One impact in closed form, as in test_reflection.c: m = 1, e = 0.5, mu = 0.25, v = (3, 0, -2):
 * J_n = 3, friction 0.25 * 3. */
static void an_impact_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.1}, v[3] = {3, 0, -2};
  for (int32_t m = 0; method_at(m); m++)
    for (int kind = 0; kind < 2; kind++) {
      if (refuses_planes(method_at(m))) continue;
      msim_scene *scene = make_single_particle(x, v, 0);
      add(scene, sphere(0, 0, -99, 1, 1, 0), 0);
      plane(scene, 0, 0, 1, -50, 1, 0);
      if (kind) add(scene, box(0, 0, -2, 4, 0.5, 0.25), 0);
      else plane(scene, 0, 0, 1, 0, 0.5, 0.25);
      const msim_options opt = recording(method_at(m), 0.1, MSIM_COLLISION_REFLECT);
      msim_sim *sim = make_sim(scene, &opt);
      assert_int_equal(contacts_of(sim).n, 0);
      assert_ok(msim_sim_step(sim, 1, err));
      const contacts c = contacts_of(sim);
      assert_int_equal(c.n, 1);
      assert_int_equal(c.all->particle, 0);
      assert_int_equal(c.all->plane, kind ? -1 : 1);
      assert_int_equal(c.all->collider, kind ? 1 : -1);
      const double point[3] = {0.3, 0, 0}, normal[3] = {0, 0, 1}, impulse[3] = {-0.75, 0, 3};
      for (int k = 0; k < 3; k++) {
        assert_close(c.all->point[k], point[k], 4e-15);
        assert_close(c.all->normal[k], normal[k], 0);
        assert_close(c.all->impulse[k], impulse[k], 4e-15);
      }
      assert_ok(msim_sim_step(sim, 1, err));
      assert_int_equal(contacts_of(sim).n, 0);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* A block that lands on a plane and in the corner of two, or on colliders */
static msim_scene *landing_block(int which, double k) {
  msim_scene *scene = falling_block(k);
  const double e = which % 2 ? 0.5 : 0, mu = which < 2 ? 0.3 : 0;
  plane(scene, 0.1, 0.05, 1, 0, e, mu);
  if (which > 0) plane(scene, -1, 0, 0.2, -0.101, e, mu);
  if (which > 2) add(scene, sphere(0.05, 0, -0.1, 0.2, e, 0.2), 0);
  return scene;
}

/* Change of momentum of the body in each step: m g h + the sum of impulses, to rounding; implicit
 * methods to that of their solves. pull: most that a surface may, N s */
static void expect_balance(const char *method, int which, double k, double h, int32_t collision,
                           double pull, double tol) {
  const int steps = h < 1e-2 ? 400 : 40;
  msim_scene *scene = landing_block(which, k);
  msim_options opt = recording(method, h, collision);
  opt.solver_rtol = 1e-13, opt.newton_rtol = 1e-13;
  msim_sim *sim = make_sim(scene, &opt);
  int64_t touched = 0;
  double total[3] = {0}, start[3], end[3];
  momentum_of(sim, start);
  for (int step = 0; step < steps; step++) {
    double p[3], q[3], sum[3] = {0};
    momentum_of(sim, p);
    assert_ok(msim_sim_step(sim, 1, err));
    momentum_of(sim, q);
    const contacts c = contacts_of(sim);
    for (int32_t i = 0; i < c.n; i++) {
      ms_vec3_axpy(1, c.all[i].impulse, sum);
      if (!(ms_vec3_dot(c.all[i].impulse, c.all[i].normal) >= -pull))
        fail_msg("%s, %d, step %d: a surface pulls", method, which, step);
      if (i > 0) assert_true(c.all[i].particle >= c.all[i - 1].particle);
    }
    touched += c.n;
    for (int d = 0; d < 3; d++) {
      const double off = q[d] - p[d] - (d == 2 ? -9.81 * 2 * h : 0) - sum[d];
      if (!(fabs(off) <= tol)) fail_msg("%s, %d, step %d: off by %g N s", method, which, step, off);
      total[d] += sum[d];
    }
  }
  momentum_of(sim, end);
  assert_true(touched > steps / 4);
  for (int c = 0; c < 3; c++)
    assert_close(end[c] - start[c], total[c] - (c == 2) * 9.81 * 2 * steps * h, steps * tol);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void momentum_is_balanced(void **state) {
  (void)state;
  for (int which = 0; which < 5; which++)
    for (int32_t m = 0; method_at(m); m++) {
      const char *method = method_at(m);
      /* `verlet` shows velocities of another time than those that it reflects, and the impulses of
       * stages */
      if (refuses_planes(method) || !strcmp(method, "verlet") || !strcmp(method, "explicit-euler"))
        continue;
      expect_balance(method, which, 200, 1e-3, MSIM_COLLISION_REFLECT, 1e-12,
                     is_implicit(method) ? 1e-10 : 1e-13);
    }
  for (int which = 0; which < 3; which++)
    expect_balance("velocity-verlet", which, 200, 1e-3, MSIM_COLLISION_EVENT, 1e-12, 1e-13);
}

/* With h omega = 16 contacts are in the matrix. Such a contact lasts for the whole step, so that
 * its mean force may pull in the step in which it ends. */
static void momentum_is_balanced_in_stiff_contact(void **state) {
  (void)state;
  for (int which = 3; which < 5; which++)
    for (int32_t m = 0; method_at(m); m++)
      if (is_implicit(method_at(m)))
        expect_balance(method_at(m), which, 2000, 1. / 60, MSIM_COLLISION_REFLECT, 1,
                       strcmp(method_at(m), "linearly-implicit-euler") ? 1e-8 : 1e-10);
}

/* Steps with a defect of momentum of a cloth that falls on a collider */
static int count_unbalanced_steps(int i, double e, double mu) {
  enum { FALL = 60 };
  const double h = 1. / 60, weight = 9.81 * 0.3;
  msim_scene *scene = stiff_body(i, 300, e, mu);
  msim_options opt = recording("linearly-implicit-euler", h, MSIM_COLLISION_REFLECT);
  opt.solver_rtol = 1e-13;
  msim_sim *sim = make_sim(scene, &opt);
  int unbalanced = 0;
  for (int step = 0; step < FALL; step++) {
    double p[3], q[3];
    momentum_of(sim, p);
    assert_ok(msim_sim_step(sim, 1, err));
    momentum_of(sim, q);
    const contacts c = contacts_of(sim);
    for (int32_t k = 0; k < c.n; k++) ms_vec3_axpy(1, c.all[k].impulse, p);
    p[2] -= weight * h;
    ms_vec3_axpy(-1, p, q);
    unbalanced += ms_vec3_norm(q) > 1e-10;
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return unbalanced;
}

/* After the solves of a step other particles may be inside, in some ten of 60 steps here, and are
 * reflected: these impulses count, too. The few steps that are shortened lose momentum. */
static void reflections_after_solves_are_balanced(void **state) {
  (void)state;
  for (int n = 0; n < 8; n++)
    assert_in_range(count_unbalanced_steps(n / 4, 0.5 * (n % 2), 0.3 * (n / 2 % 2)), 0, 4);
}

/* A particle at rest on a plane: the reaction, m g, times h, also while its step is skipped */
static void resting_contacts_report_the_reaction(void **state) {
  (void)state;
  const double x[3] = {1, 2, 0}, v[3] = {0};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  plane(scene, 0, 0, 1, 0, 0.3, 0.5);
  const msim_options opt = recording("velocity-verlet", 0.01, MSIM_COLLISION_EVENT);
  msim_sim *sim = make_sim(scene, &opt);
  for (int step = 0; step < 20; step++) {
    assert_ok(msim_sim_step(sim, 1, err));
    const contacts c = contacts_of(sim);
    assert_int_equal(c.n, 1);
    assert_close(c.all->impulse[2], 9.81 * 0.01, 1e-15);
    for (int k = 0; k < 3; k++) assert_close(c.all->point[k], x[k], 1e-15);
  }
  assert_true(stats_of(sim).steps_at_rest > 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Two particles that a box sunk into the floor leaves no room: they stay where they were, at rest,
 * and the impulses on each are -m v. */
static void stopped_particles_are_balanced(void **state) {
  (void)state;
  const double x[6] = {-1, 0.1, 0.05, -1, -0.2, 0.05}, v[6] = {60, 0, 0, 55, 0, 0},
               mass[2] = {1, 2};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, v, mass, err));
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  add(scene, box(0, 0, 0.4, 1, 0.5, 0), 0);
  const msim_options opt = recording("symplectic-euler", 1. / 60, MSIM_COLLISION_REFLECT);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  const contacts found = contacts_of(sim);
  double sum[2][3] = {{0}};
  for (int32_t i = 0; i < found.n; i++)
    ms_vec3_axpy(1, found.all[i].impulse, sum[found.all[i].particle]);
  for (int p = 0; p < 2; p++)
    for (int c = 0; c < 3; c++) {
      assert_close(state_of(sim).v[3 * p + c], 0, 0);
      assert_close(sum[p][c], -mass[p] * v[3 * p + c], 1e-11);
    }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A particle that slides along a groove of 90 degrees: each plane carries m g h cos 45 along its
 * normal, and mu times that against the motion. */
static void planes_share_friction(void **state) {
  (void)state;
  const double x[3] = {0}, v[3] = {0, 1, 0}, h = 1e-3, mu = 0.3, push = 9.81 * h * sqrt(0.5);
  msim_scene *scene = make_single_particle(x, v, 9.81);
  plane(scene, 1, 0, 1, 0, 0, mu), plane(scene, -1, 0, 1, 0, 0, mu);
  const msim_options opt = recording("velocity-verlet", h, MSIM_COLLISION_EVENT);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 10, err));
  const contacts c = contacts_of(sim);
  assert_int_equal(c.n, 2);
  for (int i = 0; i < 2; i++) {
    assert_int_equal(c.all[i].plane, i);
    assert_close(ms_vec3_dot(c.all[i].impulse, c.all[i].normal), push, 1e-14);
    assert_close(c.all[i].impulse[1], -mu * push, 1e-14);
  }
  msim_state now = state_of(sim);
  assert_ok(msim_sim_set_state(sim, &now, err));
  assert_int_equal(contacts_of(sim).n, 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static int see_contacts(msim_sim *sim, void *user) {
  *(int64_t *)user += contacts_of(sim).n;
  return 0;
}

/* Recording, from an observer, changes no bit; contacts are gone after a state is set or loaded. */
static void recording_changes_nothing(void **state) {
  (void)state;
  msim_scene *scene = bodies(0.4, 0.5);
  for (int threads = 1; threads <= 2; threads++) {
    msim_options opt = recording("velocity-verlet", 1e-3, MSIM_COLLISION_REFLECT);
    opt.threads = threads, opt.t_end = 0.4, opt.every = 1;
    msim_sim *sim = make_sim(scene, &opt), *copy;
    opt.contacts = MSIM_CONTACTS_OFF;
    msim_sim *plain = make_sim(scene, &opt);
    int64_t seen = 0;
    contacts c;
    assert_ok(msim_sim_run(sim, see_contacts, &seen, err));
    assert_ok(msim_sim_run(plain, NULL, NULL, err));
    assert_true(hash_sim(sim) == hash_sim(plain));
    assert_true(seen > 1000 && contacts_of(sim).n > 0);
    assert_int_equal(msim_sim_contacts(plain, &c.n, &c.all), MSIM_ERR_ARG);
    const checkpoint saved = save(plain);
    assert_ok(msim_sim_clone(sim, &copy, err));
    assert_int_equal(contacts_of(copy).n, 0);
    assert_ok(msim_sim_load(sim, saved.bytes, saved.length, err));
    assert_int_equal(contacts_of(sim).n, 0);
    assert_ok(msim_sim_step(sim, 5, err));
    assert_ok(msim_sim_step(copy, 5, err));
    const contacts a = contacts_of(sim);
    const msim_contact first = a.all[0];
    assert_true(a.n > 0 && a.n == contacts_of(copy).n);
    assert_memory_equal(&first, contacts_of(copy).all, sizeof first);
    free(saved.bytes);
    msim_sim_destroy(sim), msim_sim_destroy(plain), msim_sim_destroy(copy);
  }
  msim_scene_destroy(scene);
}

static void what_cannot_record_is_refused(void **state) {
  (void)state;
  const double x[3] = {0, 0, 1}, v[3] = {0};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  plane(scene, 0, 0, 1, 0, 1, 0);
  msim_options opt = recording("auto", 1e-3, MSIM_COLLISION_REFLECT);
  opt.t_end = 1;
  msim_sim *sim;
  msim_error err;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &err), MSIM_ERR_ARG);
  if (!strstr(err.text, "a method that is named")) fail_msg("%s", err.text);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(an_impact_in_closed_form),
                                     cmocka_unit_test(momentum_is_balanced),
                                     cmocka_unit_test(momentum_is_balanced_in_stiff_contact),
                                     cmocka_unit_test(reflections_after_solves_are_balanced),
                                     cmocka_unit_test(resting_contacts_report_the_reaction),
                                     cmocka_unit_test(stopped_particles_are_balanced),
                                     cmocka_unit_test(planes_share_friction),
                                     cmocka_unit_test(recording_changes_nothing),
                                     cmocka_unit_test(what_cannot_record_is_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
