/* Tests of msim_sim_explain, line by line, with scenes from which each number follows. */
#include "scenes.h"

/* A mass of 2 kg on a spring of 8 N/m: omega = 2/s. */
static const char pendulum[] =
    "{\"msim\": 1, \"name\": \"a pair\", \"gravity\": [0, 0, -9.81], \"particles\": {\"x\": [[0, "
    "0, 0],"
    " [1, 0, 0.5]], \"mass\": [1, 2], \"pinned\": [0]},"
    " \"springs\": {\"ij\": [[0, 1]], \"k\": 8, \"rest\": 0.5}}";

/* The same, 1 m long, and 1 kg on a spring of 2 m: omega = 3/s, and with drag a rate of 3.5/s. The
 * speed scales sqrt(g L) (scales.h) are sqrt(8) and sqrt(16) m/s. */
static const char two_over_a_plane[] =
    "{\"msim\": 1, \"gravity\": [0, 0, -8], \"drag\": 0.5, \"particles\": {\"x\": [[0, 0, 1], [1, "
    "0, 1],"
    " [0, 1, 1], [0, 3, 1]], \"mass\": [1, 2, 1, 1], \"pinned\": [0, 2]}, \"springs\": {\"ij\": "
    "[[0, 1],"
    " [2, 3]], \"k\": [8, 9], \"rest\": [1, 2], \"damping\": [0, 3]},"
    " \"planes\": [{\"normal\": [0, 0, 1], \"offset\": 0, \"restitution\": 0.5}]}";

/* The text with @ for the numbers of the line of cost, which test_estimate.c checks */
static void hide_cost(const char *said, size_t size, char *text) {
  const char *cost = strstr(said, "\ncost          "), *end = strchr(cost + 1, '\n');
  snprintf(text, size, "%.*s@%s", (int)(cost + 15 - said), said, end);
}

/* The line of the method itself is between the two parts. */
static void expect(const char *text, msim_options *opt, const char *first, const char *second) {
  msim_scene *scene;
  const char *said;
  opt->threads = 1, opt->solver = "pcg";
  assert_ok(msim_scene_parse(NULL, "scene", text, strlen(text), &scene, err));
  char shown[8192];
  msim_sim *sim = make_sim(scene, opt);
  assert_ok(msim_sim_explain(sim, &said, err));
  hide_cost(said, sizeof shown, shown);
  if (strncmp(shown, first, strlen(first)) != 0 || !strstr(shown, second) ||
      strcmp(strstr(shown, second), second) != 0)
    fail_msg("%s\nlacks\n%s...\n%s", shown, first, second);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void a_fixed_step_that_fits_the_end(void **state) {
  (void)state;
  msim_options opt = options("velocity-verlet", 0.3);
  opt.t_end = 1;
  expect(pendulum, &opt,
         "advice        run it: h is 0.25 of the stability limit; its error is not estimated: "
         "integrator = auto with tol finds it\n"
         "method        velocity-verlet, fixed steps of h = 0.25 s\n"
         "cost          @\n"
         "limit         stability, h < 1 s; vibrations take 3.14 s or more, at particle 1, spring "
         "0, k = 8 N/m\n"
         "output        5 frames, about 201 kB as .vtkhdf, 1.5 kB as .csv\n"
         "scene         a pair\n"
         "              particles 2, of them pinned 1; springs 1; planes 0\n"
         "unknowns      sorted by number of springs in windows of 64, to fill SIMD lanes\n"
         "integrator    velocity-verlet, order 2\n",
         "step          h = 0.25 s, lowered from 0.3 s so that the run ends at t_end\n"
         "              4 steps, to t = 1 s; 5 frames if the run is recorded\n"
         "threads       1: as requested\n"
         "solver        none: the method is explicit\n"
         "skipped       assembly, factorization, solver libraries: the method needs no solver\n"
         "              damping of springs: no spring is damped\n"
         "              drag: it is 0\n"
         "              collision detection: there are no planes or colliders\n"
         "              component y: no velocity and no force has this component\n"
         "              pinned particles: they are not unknowns\n"
         "              steps at exact rest: without velocities and forces they change nothing\n"
         "              conversion to particle order, energies: computed only on request\n"
         "stability     angular frequencies <= 2 rad/s, damping rates <= 0 1/s in every state\n"
         "              velocity-verlet is stable for h < 1 s; h is 0.25 times that\n");
}

static void newtons_method(void **state) {
  (void)state;
  msim_options opt = options("implicit-euler", 0.25);
  opt.steps = 8;
  expect(
      pendulum, &opt,
      "advice        run it; its error is not estimated: integrator = auto with tol finds it\n"
      "method        implicit-euler, fixed steps of h = 0.25 s\n"
      "cost          @\n"
      "limit         accuracy, as any h is stable; vibrations take 3.14 s or more, at particle 1, "
      "spring 0, k = 8 N/m\n"
      "output        9 frames, about 201 kB as .vtkhdf, 2.7 kB as .csv\n"
      "scene         a pair\n"
      "              particles 2, of them pinned 1; springs 1; planes 0\n"
      "unknowns      sorted by number of springs in windows of 64, to fill SIMD lanes\n"
      "integrator    implicit-euler, order 1\n",
      "step          h = 0.25 s\n"
      "              8 steps, to t = 2 s; 9 frames if the run is recorded\n"
      "threads       1: as requested\n"
      "solver        pcg (selected by option solver: about 2 iterations; a coarse space would "
      "not be cost-effective)\n"
      "              relative residual 1e-08, checked after every solve\n"
      "matrix        2 unknowns, 2 per free particle\n"
      "newton        to a relative tolerance of 1e-08 in the velocity; the matrix is clamped\n"
      "              until the residual has dropped\n"
      "skipped       damping of springs: no spring is damped\n"
      "              drag: it is 0\n"
      "              collision detection: there are no planes or colliders\n"
      "              component y: no velocity and no force has this component\n"
      "              pinned particles: they are not unknowns\n"
      "              steps at exact rest: without velocities and forces they change nothing\n"
      "              conversion to particle order, energies: computed only on request\n"
      "stability     angular frequencies <= 2 rad/s, damping rates <= 0 1/s in every state\n"
      "              stable for every h if the system is linear\n");
}

static void error_control(void **state) {
  (void)state;
  msim_options opt = options("dop853", 0.125);
  opt.steps = -1, opt.t_end = 1, opt.tol = 1e-4;
  expect(two_over_a_plane, &opt,
         "advice        run it: the error at the end is about tol = 0.0001 of extent and speed\n"
         "method        dop853, steps chosen by error control with tol = 0.0001\n"
         "cost          @\n"
         "limit         accuracy, then stability, h < 1.826 s; vibrations take 2.09 s or more, at "
         "particle 3, spring 1, k = 9 N/m\n"
         "output        201 frames, about 251 kB as .vtkhdf, 121 kB as .csv\n"
         "scene         (no name)\n"
         "              particles 4, of them pinned 2; springs 2; planes 1\n"
         "integrator    dop853, order 8\n",
         "step          chosen by error control; the first h to try is 0.125 s\n"
         "              each step may add tol = 0.0001 times h/T to the relative error, T the "
         "length of the run\n"
         "              errors are relative to the extent, 1 to 2 m, and the speed, 2.828 to 4 "
         "m/s, of each of\n"
         "              2 connected components; the largest error determines the step\n"
         "              growth of errors: measured, and reported if it is large\n"
         "              to t = 1 s; 201 frames if the run is recorded\n"
         "collisions    event: impacts are located inside the step, and resting contact is exact\n"
         "threads       1: as requested\n"
         "solver        none: the method is explicit\n"
         "skipped       assembly, factorization, solver libraries: the method needs no solver\n"
         "              pinned particles: they are not unknowns\n"
         "              steps at exact rest: without velocities and forces they change nothing\n"
         "              conversion to particle order, energies: computed only on request\n"
         "stability     angular frequencies <= 3 rad/s, damping rates <= 3.5 1/s in every state\n"
         "              dop853 is stable for h < 1.82571 s; error control keeps h short enough\n");
}

static void unsymmetric_matrices(void **state) {
  (void)state;
  msim_options opt = options("bdf2", 0.5);
  opt.steps = 2, opt.collision = MSIM_COLLISION_EVENT;
  expect(
      two_over_a_plane, &opt,
      "advice        run it for pictures: it is stable, but distorts vibrations shorter than 3.14 "
      "s; for their error: integrator = auto with tol finds it\n"
      "method        bdf2, fixed steps of h = 0.5 s\n"
      "cost          @\n"
      "limit         accuracy, as any h is stable; vibrations take 2.09 s or more, at particle 3, "
      "spring 1, k = 9 N/m\n"
      "output        3 frames, about 201 kB as .vtkhdf, 1.8 kB as .csv\n"
      "scene         (no name)\n"
      "              particles 4, of them pinned 2; springs 2; planes 1\n"
      "integrator    bdf2, order 2\n",
      "step          h = 0.5 s\n"
      "              2 steps, to t = 1 s; 3 frames if the run is recorded\n"
      "collisions    event: impacts are located inside the step, and resting contact is exact\n"
      "threads       1: as requested\n"
      "solver        pcg (selected by option solver: about 6 iterations; a coarse space would "
      "not be cost-effective)\n"
      "              relative residual 1e-08, checked after every solve\n"
      "matrix        6 unknowns, 3 per free particle\n"
      "newton        to a relative tolerance of 1e-08 in the velocity; the matrix is clamped\n"
      "              until the residual has dropped, and has the non-symmetric damping term if "
      "strong dampers need it\n"
      "skipped       pinned particles: they are not unknowns\n"
      "              steps at exact rest: without velocities and forces they change nothing\n"
      "              conversion to particle order, energies: computed only on request\n"
      "stability     angular frequencies <= 3 rad/s, damping rates <= 3.5 1/s in every state\n"
      "              stable for every h if the system is linear\n");
}

static void a_step_too_long(void **state) {
  (void)state;
  msim_options opt = options("velocity-verlet", 0.75);
  opt.steps = 4;
  expect(two_over_a_plane, &opt,
         "advice        use h = 0.514, or an implicit integrator: h is 1.31 times the stability "
         "limit\n"
         "method        velocity-verlet, fixed steps of h = 0.75 s\n"
         "cost          @\n"
         "limit         stability of damping, h < 0.5714 s; vibrations take 2.09 s or more, at "
         "particle 3, spring 1, k = 9 N/m; impacts are of order 1 in h\n"
         "output        5 frames, about 201 kB as .vtkhdf, 3 kB as .csv\n"
         "scene         (no name)\n"
         "              particles 4, of them pinned 2; springs 2; planes 1\n"
         "integrator    velocity-verlet, order 2\n",
         "step          h = 0.75 s\n"
         "              4 steps, to t = 3 s; 5 frames if the run is recorded\n"
         "collisions    reflect: particles are reflected at the end of a step, of order 1 at each "
         "impact\n"
         "threads       1: as requested\n"
         "solver        none: the method is explicit\n"
         "skipped       assembly, factorization, solver libraries: the method needs no solver\n"
         "              pinned particles: they are not unknowns\n"
         "              steps at exact rest: without velocities and forces they change nothing\n"
         "              conversion to particle order, energies: computed only on request\n"
         "stability     angular frequencies <= 3 rad/s, damping rates <= 3.5 1/s in every state\n"
         "              velocity-verlet is stable for h < 0.571429 s; h is 1.31 times that: the "
         "run may become unstable\n");
}

static void a_clamped_matrix(void **state) {
  (void)state;
  msim_options opt = options("linearly-implicit-euler", 0.25);
  opt.steps = 8, opt.jacobian = MSIM_JACOBIAN_CLAMP;
  expect(
      two_over_a_plane, &opt,
      "advice        use collision = event: particles that are mirrored behind a plane may gain "
      "energy\n"
      "method        linearly-implicit-euler, fixed steps of h = 0.25 s\n"
      "cost          @\n"
      "limit         accuracy, as any h is stable; vibrations take 2.09 s or more, at particle 3, "
      "spring 1, k = 9 N/m; impacts are of order 1 in h\n"
      "output        9 frames, about 202 kB as .vtkhdf, 5.4 kB as .csv\n"
      "scene         (no name)\n"
      "              particles 4, of them pinned 2; springs 2; planes 1\n"
      "integrator    linearly-implicit-euler, order 1\n",
      "step          h = 0.25 s\n"
      "              8 steps, to t = 2 s; 9 frames if the run is recorded\n"
      "collisions    reflect: particles are reflected at the end of a step, of order 1 at each "
      "impact\n"
      "threads       1: as requested\n"
      "solver        pcg (selected by option solver: about 4 iterations; a coarse space would "
      "not be cost-effective)\n"
      "              relative residual 1e-08, checked after every solve\n"
      "matrix        6 unknowns, 3 per free particle\n"
      "              clamped, and so always positive definite\n"
      "skipped       pinned particles: they are not unknowns\n"
      "              steps at exact rest: without velocities and forces they change nothing\n"
      "              conversion to particle order, energies: computed only on request\n"
      "stability     angular frequencies <= 3 rad/s, damping rates <= 3.5 1/s in every state\n"
      "              stable for every h if the system is linear\n");
}

static void a_method_without_a_stable_step(void **state) {
  (void)state;
  msim_scene *scene;
  const char *said;
  const msim_options opt = options("explicit-euler", 0.01);
  assert_ok(msim_scene_parse(NULL, "scene", pendulum, strlen(pendulum), &scene, err));
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_explain(sim, &said, err));
  assert_ptr_equal(strstr(said, "advice        use velocity-verlet: with explicit-euler undamped"),
                   said);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_fixed_step_that_fits_the_end),
                                     cmocka_unit_test(newtons_method),
                                     cmocka_unit_test(error_control),
                                     cmocka_unit_test(unsymmetric_matrices),
                                     cmocka_unit_test(a_step_too_long),
                                     cmocka_unit_test(a_clamped_matrix),
                                     cmocka_unit_test(a_method_without_a_stable_step)};
  return cmocka_run_group_tests_name("explain", tests, NULL, NULL);
}
