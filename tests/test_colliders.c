/* Tests of colliders: reflection in closed form, corners, bodies of all kinds that stay outside and
 * bounded in energy, threads, restarts. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "checkpoints.h"
#include "colliders.h"
#include "physics/signed_distance.h"
#include "scene/scene.h"
#include "state_hash.h"

/* Options with collision = reflect or, with `events`, event */
static msim_options collision_options(const char *method, double h, int events) {
  msim_options opt = options(method, h);
  opt.collision = events ? MSIM_COLLISION_EVENT : MSIM_COLLISION_REFLECT;
  return opt;
}

/* The least distance of a free particle from all colliders and planes: negative inside */
static double least_distance(const msim_scene *scene, msim_sim *sim) {
  const ms_scene *s = scene->data;
  const double *x = state_of(sim).x;
  double least = INFINITY, unused[3];
  for (int32_t p = 0; p < s->nparticles; p++) {
    for (int32_t i = 0; i < s->ncolliders && !s->pinned[p]; i++)
      least = fmin(least, ms_signed_distance(&s->solids[i], x + 3 * p, unused));
    for (int32_t i = 0; i < s->nplanes && !s->pinned[p]; i++)
      least = fmin(least, ms_vec3_dot(s->planes[i].normal, x + 3 * p) - s->planes[i].offset);
  }
  return least;
}

static double energy_of(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  msim_sim_energy(sim, &e);
  return e.total;
}

/*------------------------------------- closed forms ---------------------------------------------*/

/* The impact of test_reflection.c at the foot of each solid and at the inner side of each: the
 * surface there is the plane z = 0, or curved in y, along which nothing moves. */
static void one_reflection_in_closed_form(void **state) {
  (void)state;
  const double x[3] = {0, 0, 0.1}, v[3] = {3, 0, -2}, e = 0.5, mu = 0.25, h = 0.1;
  /* s = -0.1, J = 1.5 * 2 = 3, |v_t| = 3: tangential part times 1 - 0.25 * 3/3 = 0.75 */
  const double x1[3] = {0.3, 0, 0.05}, v1[3] = {2.25, 0, 1};
  const double below[3] = {0, 0, -1}, above[3] = {0, 0, 1}, along[3] = {4, 0, 0}, up[3] = {0, 0, 1};
  const struct {
    msim_collider c;
    int inside;
  } cases[] = {{box(0, 0, -2, 4, e, mu), 0},
               {box(0, 0, 2, 4, e, mu), 1},
               {round_bar(MSIM_COLLIDER_CAPSULE, below, along, 1, e, mu), 0},
               {round_bar(MSIM_COLLIDER_CAPSULE, above, along, 1, e, mu), 1},
               {round_bar(MSIM_COLLIDER_CYLINDER, below, along, 1, e, mu), 0},
               {round_bar(MSIM_COLLIDER_CYLINDER, above, along, 1, e, mu), 1},
               {round_bar(MSIM_COLLIDER_CYLINDER, below, up, 8, e, mu), 0}};
  for (int32_t m = 0; method_at(m); m++)
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
      if (refuses_planes(method_at(m))) continue;
      msim_scene *scene = make_single_particle(x, v, 0);
      add(scene, sphere(0, 0, -99, 1, 1, 0), 0);
      add(scene, cases[i].c, cases[i].inside);
      msim_options opt = options(method_at(m), h);
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 1, err));
      const msim_state s = state_of(sim);
      for (int c = 0; c < 3; c++) assert_close(s.x[c], x1[c], 2e-15);
      for (int c = 0; c < 3; c++) assert_close(s.v[c], v1[c], 2e-15);
      assert_true(stats_of(sim).contacts > 0);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
}

/* Central and oblique impact on a sphere: at (-1, 0, 0) R from the left, and at 45 degrees, where
 * an elastic particle that flies along x leaves along z. */
static void spheres_deflect(void **state) {
  (void)state;
  const double d = sqrt(0.5), h = 1e-6;
  for (int oblique = 0; oblique < 2; oblique++) {
    const double z = oblique ? d : 0, x[3] = {-(oblique ? d : 1) - 0.3 * h, 0, z}, v[3] = {1, 0, 0};
    msim_scene *scene = make_single_particle(x, v, 0);
    add(scene, sphere(0, 0, 0, 1, 1, 0), 0);
    const msim_options opt = options("velocity-verlet", h);
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 1, err));
    assert_close(state_of(sim).v[0], oblique ? 0 : -1, 2 * h);
    assert_close(state_of(sim).v[2], oblique ? 1 : 0, 2 * h);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A sphere of 1e7 m, outside and inside, is the plane that touches it, up to 1/R. */
static void a_large_sphere_is_a_plane(void **state) {
  (void)state;
  const double R = 1e7, e = 0.7, mu = 0.2, x[3] = {0, 0, 0.3}, v[3] = {1, 0.5, 0};
  for (int inside = 0; inside < 2; inside++) {
    msim_scene *scenes[2] = {make_single_particle(x, v, 9.81), make_single_particle(x, v, 9.81)};
    msim_sim *sims[2];
    plane(scenes[0], 0, 0, 1, 0, e, mu);
    add(scenes[1], sphere(0, 0, inside ? R : -R, R, e, mu), inside);
    const msim_options opt = options("symplectic-euler", 1e-3);
    for (int i = 0; i < 2; i++) {
      sims[i] = make_sim(scenes[i], &opt);
      assert_ok(msim_sim_step(sims[i], 1500, err));
    }
    assert_int_equal(stats_of(sims[0]).contacts, stats_of(sims[1]).contacts);
    for (int c = 0; c < 3; c++) assert_close(state_of(sims[0]).x[c], state_of(sims[1]).x[c], 1e-5);
    for (int c = 0; c < 3; c++) assert_close(state_of(sims[0]).v[c], state_of(sims[1]).v[c], 1e-4);
    for (int i = 0; i < 2; i++) msim_sim_destroy(sims[i]), msim_scene_destroy(scenes[i]);
  }
}

/*------------------------------------- corners --------------------------------------------------*/

/* Particles that cannot leave narrow places: under a sphere that touches or pierces the floor, in a
 * box sunk into the floor, between two spheres, in the corner of a box inside out, in the seam of
 * overlapping spheres; fast and slow, elastic and not. */
static msim_scene *narrow_place(int which, const double x[3], const double v[3], double e) {
  msim_scene *scene = make_single_particle(x, v, 9.81);
  const double center[3] = {0, 0, 1}, along[3] = {0.5, 0, 0};
  switch (which) {
    case 0:
    case 1:
      plane(scene, 0, 0, 1, 0, e, 0.1);
      add(scene, sphere(0, 0, which ? 0.9 : 1, 1, e, 0.1), 0);
      break;
    case 2:
      plane(scene, 0, 0, 1, 0, e, 0.1);
      add(scene, box(0, 0, 0.4, 1, e, 0.1), 0);
      break;
    case 3:
      add(scene, sphere(-1, 0, 0, 1, e, 0), 0), add(scene, sphere(1, 0, 0, 1, e, 0), 0);
      break;
    case 4:
      add(scene, box(0, 0, 1, 2, e, 0), 1), add(scene, sphere(0, 0, 0, 1, e, 0), 0);
      break;
    default:
      add(scene, sphere(0, 0, 1, 1, e, 0), 1);
      add(scene, round_bar(MSIM_COLLIDER_CAPSULE, center, along, 0.6, e, 0.3), 1);
  }
  return scene;
}

static void narrow_places_keep_particles_outside(void **state) {
  (void)state;
  unsigned seed = 3;
  for (int i = 0; i < 1200; i++) {
    const int which = i % 6, events = i >= 600;
    const double angle = 6.28 * uniform(&seed), speed = i % 4 ? 3 : 80, e = i / 6 % 3 / 2.;
    const double inner[3] = {0.4 * cos(angle), 0.4 * sin(angle), 1.1};
    const double outer[3] = {1.5 * cos(angle), 1.5 * sin(angle), 0.3};
    const double middle[3] = {0, 0.5 * cos(angle), 1 + 0.2 * sin(angle)};
    const double *x = which < 3 ? outer : which == 3 ? middle : inner;
    const double v[3] = {-speed * cos(angle), -speed * sin(angle), speed * (uniform(&seed) - 0.7)};
    msim_scene *scene = narrow_place(which, x, v, e);
    const msim_options opt = collision_options("velocity-verlet", 0.01, events);
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_of(sim), inside = least_distance(scene, sim);
    if (inside < 0 && which == 4) { /* the sphere in the box reaches there: start elsewhere */
      msim_sim_destroy(sim), msim_scene_destroy(scene);
      continue;
    }
    assert_true(inside >= 0);
    for (int step = 0; step < 200; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const double least = least_distance(scene, sim);
      if (!(least >= -1e-12)) fail_msg("%d, case %d, step %d: %g m inside", i, which, step, -least);
      if (!(energy_of(sim) <= start + (events ? 1e-9 : 9.81 * 0.01 * (speed + 2) * (step + 1))))
        fail_msg("%d, case %d, step %d: energy %g J, %g J at the start", i, which, step,
                 energy_of(sim), start);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* One step of a particle of x and v, without gravity */
static msim_sim *one_step(msim_scene *scene, double h) {
  const msim_options opt = options("symplectic-euler", h);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 1, err));
  return sim;
}

/* The rim of the lens between a bowl and a plane, where the angle is 2.6 degrees: reflections in
 * turn approach it too slowly, so that the particle is moved to the nearest point, which is on
 * both surfaces. */
static void a_sharp_rim_stops_a_particle(void **state) {
  (void)state;
  const double x[3] = {0, 0, -0.9995}, v[3] = {6, 8, 0}, rim = sqrt(1 - 0.999 * 0.999);
  msim_scene *scene = make_single_particle(x, v, 0);
  plane(scene, 0, 0, -1, 0.999, 0, 0);
  add(scene, sphere(0, 0, 0, 1, 0, 0), 1);
  msim_sim *sim = one_step(scene, 0.01);
  const msim_state s = state_of(sim);
  assert_close(s.x[0], 0.6 * rim, 1e-10);
  assert_close(s.x[1], 0.8 * rim, 1e-10);
  assert_close(s.x[2], -0.999, 1e-14);
  for (int c = 0; c < 3; c++) assert_close(s.v[c], 0, 1e-10);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A box sunk into the floor: the nearest way out of it is down, where the floor is. */
static void without_room_particles_stay_at_rest(void **state) {
  (void)state;
  const double x[3] = {-1, 0.1, 0.05}, v[3] = {60, 0, 0}, none[3] = {0};
  msim_scene *scene = make_single_particle(x, v, 0);
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  add(scene, box(0, 0, 0.4, 1, 0.5, 0), 0);
  msim_sim *sim = one_step(scene, 1. / 60);
  assert_memory_equal(state_of(sim).x, x, sizeof x);
  assert_memory_equal(state_of(sim).v, none, sizeof none);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A particle that starts in two spheres leaves both, though each moves it into the other. */
static void particles_in_overlapping_solids_leave(void **state) {
  (void)state;
  const double x[3] = {0.01, 0.3, 0.1}, v[3] = {0};
  for (int slow = 0; slow < 2; slow++) {
    msim_scene *scene = make_single_particle(x, v, 0);
    add(scene, sphere(-0.8, 0, 0, 1, slow ? 0 : 1, 0), 0);
    add(scene, sphere(0.8, 0, 0, 1, slow ? 0 : 1, 0), 0);
    msim_sim *sim = one_step(scene, 0.01);
    assert_true(least_distance(scene, sim) >= -1e-12);
    assert_true(ms_vec3_norm(state_of(sim).x) < 3);
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/* A spring of 1e4 N/m, one end of which the first step moves out of a sphere, is no instability. */
static void the_energy_bound_covers_a_start_inside(void **state) {
  (void)state;
  const double x[6] = {0.5, 0, 0, 2, 0, 0}, mass[2] = {1, 1}, k = 1e4;
  const int32_t ij[2] = {0, 1};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 2, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, 1, ij, &k, NULL, NULL, err));
  add(scene, sphere(0, 0, 0, 1, 0, 0), 0);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 640, err));
  assert_true(state_of(sim).x[0] >= 1 - 1e-12);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- bodies ---------------------------------------------------*/

/* With e < 1, friction and damping: never inside, and never above the energy at the start but for
 * the small lift of a reflection. */
static void bodies_stay_outside_with_bounded_energy(void **state) {
  (void)state;
  static const char *const methods[] = {
      "velocity-verlet",         "symplectic-euler",  "rk4", "respa",
      "linearly-implicit-euler", "implicit-midpoint", "bdf2"};
  for (size_t i = 0; i < 2 * sizeof methods / sizeof *methods; i++) {
    const int events = i % 2;
    const char *method = methods[i / 2];
    if (events && strcmp(method, "respa") == 0) continue;
    msim_scene *scene = bodies(0.4, 0.3);
    const msim_options opt = collision_options(method, 1e-3, events);
    msim_sim *sim = make_sim(scene, &opt);
    const double start = energy_of(sim);
    for (int step = 0; step < 1500; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const double least = least_distance(scene, sim), energy = energy_of(sim);
      if (!(least >= -1e-12)) fail_msg("%s, step %d: %g m inside", method, step, -least);
      if (!(energy <= start + (events ? 0.002 : 0.05)))
        fail_msg("%s, step %d: %g J, and %g J at the start", method, step, energy, start);
    }
    assert_true(stats_of(sim).contacts > (events ? 400 : 1000));
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- random scenes --------------------------------------------*/

static msim_collider random_collider(unsigned *seed) {
  const double x[3] = {2 * uniform(seed) - 1, 2 * uniform(seed) - 1, -0.2 - uniform(seed)};
  const double along[3] = {uniform(seed), uniform(seed) - 0.5, uniform(seed) - 0.5};
  const double e = uniform(seed), mu = uniform(seed), size = 0.1 + 0.5 * uniform(seed);
  const int32_t type = MSIM_COLLIDER_SPHERE + (int32_t)(4 * uniform(seed));
  if (type == MSIM_COLLIDER_SPHERE) return sphere(x[0], x[1], x[2], size, e, mu);
  if (type != MSIM_COLLIDER_BOX) return round_bar(type, x, along, size, e, mu);
  msim_collider c = box(x[0], x[1], x[2], size, e, mu);
  for (int i = 0; i < 3; i++) c.rotation[i] = 3 * along[i];
  return c;
}

/* A rope above several colliders, which may overlap and pierce the floor, in a box inside out */
static msim_scene *random_scene(unsigned *seed) {
  msim_scene *scene = new_scene();
  const msim_rope rope = {.size = sizeof rope,
                          .n = 12,
                          .from = {uniform(seed) - 0.5, uniform(seed) - 0.5, 0.9},
                          .to = {uniform(seed) - 0.5, uniform(seed) - 0.5, 1.2},
                          .mass = 0.1,
                          .k = 200 * uniform(seed),
                          .damping = 0.01};
  assert_ok(msim_scene_add_rope(scene, &rope, err));
  for (int i = 0; i < 5; i++) add(scene, random_collider(seed), 0);
  add(scene, box(0, 0, 0.4, 3, uniform(seed), 0.1), 1);
  plane(scene, 0.1, 0, 1, -0.9, uniform(seed), 0.2);
  return scene;
}

/* With events, linearly-implicit-euler makes steps of h omega up to 5. */
static void random_scenes_stay_outside_and_resume(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler", "heun"};
  const int64_t at[1] = {180};
  unsigned seed = 11;
  int64_t contacts = 0;
  for (int i = 0; i < 200; i++) {
    const int events = i >= 100;
    msim_scene *scene = random_scene(&seed);
    const msim_options opt =
        collision_options(methods[i % 3], events && i % 3 == 1 ? 1. / 60 : 2e-3, events);
    msim_sim *sim = make_sim(scene, &opt);
    for (int step = 0; step < 400; step++) {
      assert_ok(msim_sim_step(sim, 1, err));
      const double least = least_distance(scene, sim);
      if (!(least >= (events ? -1e-10 : -1e-12))) /* 1e-11 of the size of the scene is contact */
        fail_msg("scene %d, step %d: %g m inside", i, step, -least);
    }
    contacts += stats_of(sim).contacts;
    msim_sim_destroy(sim);
    expect_resumable(scene, &opt, 400, 1, at, methods[i % 3]);
    msim_scene_destroy(scene);
  }
  assert_true(contacts > 9000);
}

/*------------------------------------- threads, islands -----------------------------------------*/

static void threads_do_not_matter(void **state) {
  (void)state;
  static const char *const methods[] = {"velocity-verlet", "linearly-implicit-euler"};
  for (int i = 0; i < 4; i++) {
    uint64_t hash[2];
    for (int threads = 1; threads <= 2; threads++) {
      msim_scene *scene = bodies(0.4, 0.5);
      msim_options opt = collision_options(methods[i % 2], i / 2 ? 1. / 60 : 1e-3, i / 2);
      if (i == 2) opt.h = 1e-3;
      opt.threads = threads;
      msim_sim *sim = make_sim(scene, &opt);
      assert_ok(msim_sim_step(sim, 400, err));
      hash[threads - 1] = hash_sim(sim);
      msim_sim_destroy(sim);
      msim_scene_destroy(scene);
    }
    assert_true(hash[0] == hash[1]);
  }
}

/* Without gravity: a body at rest on a sphere is skipped, one that falls on another is not. */
static void bodies_at_rest_on_colliders_are_skipped(void **state) {
  (void)state;
  const double x[24] = {0, 0, 1,   0, 0, 2,   0, 0, 3,   0, 0, 4,
                        9, 0, 1.5, 9, 0, 2.5, 9, 0, 3.5, 9, 0, 4.5};
  double v[24] = {0}, mass[8], k[6];
  int32_t ij[12];
  for (int i = 0; i < 8; i++) mass[i] = 1, v[3 * i + 2] = i < 4 ? 0 : -1;
  for (int i = 0; i < 6; i++) {
    ij[2 * i] = i < 3 ? i : i + 1, ij[2 * i + 1] = ij[2 * i] + 1;
    k[i] = 10;
  }
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 8, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, 6, ij, k, NULL, NULL, err));
  add(scene, sphere(0, 0, 0, 1, 0, 0), 0), add(scene, sphere(9, 0, 0, 1, 0, 0), 0);
  for (int skips = 0; skips < 4; skips++) {
    msim_options opt = collision_options("velocity-verlet", 0.01, skips / 2);
    opt.skip_off = skips % 2 ? 0 : MSIM_SKIP_AT_REST;
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_step(sim, 100, err));
    assert_memory_equal(state_of(sim).x, x, 12 * sizeof *x);
    assert_true(stats_of(sim).contacts > 0);
    assert_true(least_distance(scene, sim) >= 0);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(one_reflection_in_closed_form),
                                     cmocka_unit_test(spheres_deflect),
                                     cmocka_unit_test(a_large_sphere_is_a_plane),
                                     cmocka_unit_test(narrow_places_keep_particles_outside),
                                     cmocka_unit_test(a_sharp_rim_stops_a_particle),
                                     cmocka_unit_test(without_room_particles_stay_at_rest),
                                     cmocka_unit_test(particles_in_overlapping_solids_leave),
                                     cmocka_unit_test(the_energy_bound_covers_a_start_inside),
                                     cmocka_unit_test(bodies_stay_outside_with_bounded_energy),
                                     cmocka_unit_test(random_scenes_stay_outside_and_resume),
                                     cmocka_unit_test(threads_do_not_matter),
                                     cmocka_unit_test(bodies_at_rest_on_colliders_are_skipped)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
