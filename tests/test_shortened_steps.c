/* Tests of steps under error control that end at an impact by dense output: when they may, that the
 * state there and frames inside such a step are accurate, and that few steps are made twice. */
#include <math.h>

#include "checkpoints.h"
#include "integrate/control.h"
#include "sim/sim.h"

#define OMEGA 10.

/* A mass on a spring without rest length, which bounces at a plane: from its equilibrium, 1 m above
 * the plane, downwards at twice the speed that reaches the plane */
static msim_scene *make_bouncer(double restitution, double friction) {
  const double x[6] = {0, 0, 1, 0, 0, 1}, v[6] = {0, 0, 0, 0, 0, -2 * OMEGA};
  msim_scene *scene = make_oscillator(x, v, OMEGA * OMEGA);
  plane(scene, 0, 0, 1, 0, restitution, friction);
  return scene;
}

/* z = 1 + A cos phase between impacts, where cos phase = -1/A: an elastic bounce reflects the
 * phase, which goes from -acos(-1/A) to acos(-1/A). */
static void find_exact(double t, double *z, double *v) {
  const double A = 2, first_impact = asin(1 / A), between = 2 * acos(-1 / A);
  const double since = OMEGA * t - first_impact;
  const double phase = since < 0 ? OMEGA * t + acos(0) : fmod(since, between) - between / 2;
  *z = 1 + A * cos(phase), *v = -A * OMEGA * sin(phase);
}

/* 1: the state shown is inside a step that was shortened. */
static int is_in_shortened_step(const msim_sim *sim) {
  return sim->islands->stepper.h_made > 0 && sim->run.t_shown < sim->run.t;
}

typedef struct frames {
  double error; /* the largest, relative to amplitude and speed */
  int n, inside;
} frames;

static int compare_frame(msim_sim *sim, void *user) {
  frames *f = user;
  const msim_state s = state_of(sim);
  double z, v;
  find_exact(s.t, &z, &v);
  f->n++, f->inside += is_in_shortened_step(sim);
  if (z < 0.01) return 0; /* so near to an impact v may have the other sign */
  f->error = fmax(f->error, fmax(fabs(s.x[5] - z) / 2, fabs(s.v[5] - v) / (2 * OMEGA)));
  return 0;
}

static void frames_are_accurate(void **state) {
  (void)state;
  msim_scene *scene = make_bouncer(1, 0);
  for (double tol = 1e-3; tol > 1e-11; tol /= 10) {
    msim_options opt = options("dop853", MSIM_H_AUTO);
    opt.tol = tol, opt.t_end = 3.1, opt.steps = -1, opt.fps = 301;
    msim_sim *sim = make_sim(scene, &opt);
    frames f = {0};
    assert_ok(msim_sim_run(sim, compare_frame, &f, err));
    const msim_stats s = stats_of(sim);
    print_message(
        "  tol %.0e: error/tol %.2g in %d frames, %d in shortened steps; %lld impacts, "
        "%lld steps rejected\n",
        tol, f.error / tol, f.n, f.inside, (long long)s.contacts, (long long)s.rejected_steps);
    assert_true(f.error <= tol && f.inside > 10);
    assert_true(s.contacts == 8 && s.rejected_steps < s.contacts);
    msim_sim_destroy(sim);
  }
  msim_scene_destroy(scene);
}

/* Steps from one impact to the next: free fall is a polynomial of time, which steps reproduce. */
static void free_fall_takes_few_steps(void **state) {
  (void)state;
  const double g = 9.81, fall = sqrt(2 / g), x[3] = {0, 0, 1}, v[3] = {0};
  msim_scene *scene = make_single_particle(x, v, g);
  plane(scene, 0, 0, 1, 0, 1, 0);
  msim_options opt = options("dop853", MSIM_H_AUTO);
  opt.tol = 1e-6, opt.t_end = 20 * fall, opt.steps = -1;
  msim_sim *sim = make_sim(scene, &opt);
  while (state_of(sim).t < opt.t_end) {
    assert_ok(msim_sim_step(sim, 1, err));
    const double t = state_of(sim).t, since = fmod(t + fall, 2 * fall) - fall;
    assert_close(state_of(sim).x[2], 1 - g * since * since / 2, 1e-10);
  }
  assert_int_equal(stats_of(sim).contacts, 10);
  assert_true(stats_of(sim).steps <= 40 && stats_of(sim).rejected_steps == 0);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A step of 0.1 s in a run of 1 s whose relative error is r, with an impact in it: that may add 0.1
 * tol, of 4 r tol h/T times the amplification, a tenth of that in the first 0.3 of the step. */
static void slow_impacts_are_made_anew(void **state) {
  (void)state;
  const struct {
    double r, impact, amplification;
    ms_verdict expected;
  } cases[] = {{0.5, 0.5, 0.45, MS_SHORTENED},     {0.5, 0.5, 0.55, MS_TRY_AGAIN},
               {0.01, 0.5, 24, MS_SHORTENED},      {0.01, 0.5, 26, MS_TRY_AGAIN},
               {0.5, 0.5, INFINITY, MS_TRY_AGAIN}, {0, 0.5, INFINITY, MS_TRY_AGAIN},
               {0.5, 2, 1, MS_ACCEPTED},           {1.1, 0.5, 0, MS_TRY_AGAIN},
               {0, 0.5, 0, MS_SHORTENED},          {0.5, 0.29, 4.5, MS_SHORTENED},
               {0.5, 0.29, 5.5, MS_TRY_AGAIN},     {0.5, 0.31, 0.55, MS_TRY_AGAIN}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    const ms_integrator method = {.entry = {.order = 8}, .two_estimates = 1};
    ms_control c = ms_control_make(&method, 1e-3, 1);
    c.h = 0.1;
    ms_attempt a = ms_control_begin_attempt(&c, 0, 0.8);
    const ms_attempt_result result = {.error = cases[i].r,
                                      .impact = cases[i].impact,
                                      .amplification = cases[i].amplification,
                                      .change = MS_NOWHERE};
    const ms_verdict verdict = ms_control_judge_attempt(&c, &a, &result);
    assert_int_equal(verdict, cases[i].expected);
    if (verdict == MS_SHORTENED || (cases[i].r <= 1 && verdict == MS_TRY_AGAIN))
      assert_close(a.h, 0.1 * cases[i].impact, 1e-15);
    if (verdict == MS_SHORTENED) assert_true(c.h > 0.05 && c.previous == 0);
  }
}

/* A bouncer with gravity, and particles that slide beside it until friction stops each at another
 * time. While steps end at impacts they stay on the plane to the last bit and keep tol; impulses of
 * contacts add up to what gravity leaves. */
static void sliders_stay_on_the_plane(void **state) {
  (void)state;
  enum { SLIDERS = 40 };
  const double g = 9.81, mu = 0.05, mass = 2, tol = 1e-7, down[3] = {0, 0, -g};
  msim_scene *scene = make_bouncer(0.9, mu);
  for (int i = 0; i < SLIDERS; i++) {
    const double x[3] = {1, i, 0}, v[3] = {0.2 + 0.02 * i, 0, 0};
    assert_ok(msim_scene_add_particles(scene, 1, x, v, &mass, err));
  }
  assert_ok(msim_scene_set_gravity(scene, down, err));
  msim_options opt = options("dop853", MSIM_H_AUTO);
  opt.tol = tol, opt.t_end = 2.2, opt.steps = -1, opt.contacts = MSIM_CONTACTS_ON;
  msim_sim *sim = make_sim(scene, &opt);
  int shortened = 0;
  double impulse = 0;
  while (state_of(sim).t < opt.t_end) {
    const msim_contact *log;
    int32_t n;
    assert_ok(msim_sim_step(sim, 1, err));
    assert_int_equal(msim_sim_contacts(sim, &n, &log), MSIM_OK);
    for (int32_t i = 0; i < n; i++)
      if (log[i].particle >= 2) impulse += log[i].impulse[2];
    const msim_state s = state_of(sim);
    assert_close(impulse, SLIDERS * mass * g * s.t, 1e-7);
    for (int i = 0; i < SLIDERS; i++) assert_true(s.x[3 * (2 + i) + 2] == 0);
    shortened += sim->islands->stepper.h_made > 0;
  }
  const msim_state s = state_of(sim);
  double off = 0;
  for (int i = 0; i < SLIDERS; i++)
    off = fmax(off, fabs(s.x[6 + 3 * i] - 1 - pow(0.2 + 0.02 * i, 2) / (2 * mu * g)));
  print_message("  %d steps shortened, ways are off by %.2g tol\n", shortened, off / tol);
  assert_true(shortened >= 3 && off <= 10 * tol);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* Sets the state to one in which the first n particles vibrate along x. */
static void shake(msim_sim *sim, int n) {
  const msim_state now = state_of(sim);
  msim_state to = now;
  double *v = malloc(3 * (size_t)now.n * sizeof *v);
  memcpy(v, now.v, 3 * (size_t)now.n * sizeof *v);
  for (int p = 0; p < n; p++)
    if (!sim->scene->pinned[p]) v[3 * p] = 0.02 * sin(p);
  to.v = v;
  assert_ok(msim_sim_set_state(sim, &to, err));
  free(v);
}

/* Balls bounce; a rope hangs far from the plane, or a second one lies on it, both pinned. Where the
 * balls end a step at an impact, the first rope ends its by dense output. The second one has none:
 * all steps are made anew. */
static void end_together(int ropes) {
  enum { BALLS = 600, LINKS = 600 };
  static double x[3 * BALLS], v[3 * BALLS], mass[BALLS];
  const int32_t pin = 0;
  const double tol = 1e-5, g[3] = {2, 0, -9.81};
  msim_state end[2];
  msim_sim *sims[2];
  for (int i = 0; i < 2; i++) {
    msim_scene *scene;
    assert_ok(msim_scene_create(NULL, &scene, err));
    for (int lies = 0; lies < ropes; lies++) {
      const double z = lies ? 0 : 20;
      const msim_rope rope = {.size = sizeof rope,
                              .n = LINKS,
                              .from = {0, 5 * lies, z},
                              .to = {10, 5 * lies, z},
                              .mass = 1,
                              .k = 2e3,
                              .npinned = 1,
                              .pinned = &pin};
      assert_ok(msim_scene_add_rope(scene, &rope, err));
    }
    for (int b = 0; b < BALLS; b++)
      x[3 * b] = 0.1 * b, x[3 * b + 1] = -5, x[3 * b + 2] = 0.05, mass[b] = 1;
    if (i == 1) assert_ok(msim_scene_add_particles(scene, BALLS, x, v, mass, err));
    assert_ok(msim_scene_set_gravity(scene, g, err));
    plane(scene, 0, 0, 1, 0, 0.9, 0);
    msim_options opt = options("dop853", MSIM_H_AUTO);
    opt.tol = i == 1 ? tol : 1e-11, opt.t_end = 0.4, opt.steps = -1;
    sims[i] = make_sim(scene, &opt);
    assert_int_equal(sims[i]->nislands, ropes + i);
    shake(sims[i], ropes * LINKS);
    int shortened = 0;
    while (state_of(sims[i]).t < opt.t_end) {
      assert_ok(msim_sim_step(sims[i], 1, err));
      shortened += sims[i]->islands->stepper.h_made > 0;
    }
    if (i == 1) assert_true(stats_of(sims[i]).rejected_steps <= 8);
    if (i == 1) assert_true(ropes == 1 ? shortened >= 2 : shortened == 0);
    end[i] = state_of(sims[i]);
    msim_scene_destroy(scene);
  }
  for (int lies = 0; lies < ropes; lies++) {
    const size_t at = 3 * (size_t)LINKS * (size_t)lies;
    const double off = largest_difference(end[0].x + at, end[1].x + at, 3 * LINKS) / 10;
    print_message("  a rope is off by %.2g tol\n", off / tol);
    assert_true(off <= 0.01 * tol);
  }
  msim_sim_destroy(sims[0]), msim_sim_destroy(sims[1]);
}

static void islands_end_together(void **state) {
  (void)state;
  end_together(1);
  end_together(2);
}

/* Stops at the frame after `*user` other ones. */
static int count_down(msim_sim *sim, void *user) {
  (void)sim;
  int *left = user;
  return (*left)-- == 0;
}

/* Checkpoints at frames inside shortened steps: the same dense output, and the same end */
static void runs_resume_inside(void **state) {
  (void)state;
  enum { FRAMES = 400 };
  msim_scene *scene = make_bouncer(0.8, 0);
  msim_options opt = options("dop853", MSIM_H_AUTO);
  opt.tol = 1e-5, opt.t_end = 1, opt.steps = -1, opt.fps = FRAMES;
  msim_sim *whole = make_sim(scene, &opt);
  int inside = 0;
  assert_ok(msim_sim_run(whole, NULL, NULL, err));
  for (int frame = 1; frame < FRAMES; frame++) {
    int left = frame, next = 1;
    msim_sim *sim = make_sim(scene, &opt);
    assert_int_equal(msim_sim_run(sim, count_down, &left, NULL), MSIM_STOPPED);
    if (is_in_shortened_step(sim)) {
      checkpoint c = save(sim);
      msim_sim *other = resume(scene, &opt, &c);
      expect_same_motion(sim, other);
      inside++;
      left = 1;
      msim_sim_run(sim, count_down, &left, NULL), msim_sim_run(other, count_down, &next, NULL);
      expect_same_motion(sim, other);
      assert_ok(msim_sim_run(other, NULL, NULL, err));
      expect_same_motion(whole, other);
      free(c.bytes);
      msim_sim_destroy(other);
    }
    msim_sim_destroy(sim);
  }
  print_message("  %d of %d frames in shortened steps\n", inside, FRAMES);
  assert_true(inside > 10);
  msim_sim_destroy(whole);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(frames_are_accurate),        cmocka_unit_test(free_fall_takes_few_steps),
      cmocka_unit_test(slow_impacts_are_made_anew), cmocka_unit_test(sliders_stay_on_the_plane),
      cmocka_unit_test(islands_end_together),       cmocka_unit_test(runs_resume_inside)};
  return cmocka_run_group_tests_name("shortened_steps", tests, NULL, NULL);
}
