/* Tests of colliders in scenes: files, copies, what is refused, and what is reported. */
#include <math.h>
#include <string.h>

#include "checkpoints.h"
#include "colliders.h"
#include "scene_check.h"

/*------------------------------------- files ----------------------------------------------------*/

static const char file[] =
    "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 9]], \"mass\": 1}, \"colliders\": [\n"
    " {\"type\": \"sphere\", \"center\": [1, 2, 3], \"radius\": 0.1},\n"
    " {\"type\": \"capsule\", \"from\": [1, 2, 3], \"to\": [4, 5, 7], \"radius\": 2, \"inside\": "
    "true},\n"
    " {\"type\": \"cylinder\", \"from\": [0, 0, 3], \"to\": [0, 0, 7], \"radius\": 3, \"inside\": "
    "false,\n"
    "  \"restitution\": 0.5, \"friction\": 0.25},\n"
    " {\"type\": \"box\", \"center\": [0, 0, 3], \"size\": [1, 2, 3], \"rotation\": [0.1, 0.2, "
    "0.3]},\n"
    " {\"type\": \"box\", \"center\": [0, 0, 3], \"size\": [1, 2, 3]}]}";

static msim_scene *parse(const char *text) {
  msim_scene *scene;
  assert_ok(msim_scene_parse(NULL, "text", text, strlen(text), &scene, err));
  return scene;
}

static void assert_same_colliders(const msim_scene *a, const msim_scene *b) {
  const ms_scene *s = a->data, *t = b->data;
  assert_int_equal(s->ncolliders, t->ncolliders);
  assert_memory_equal(s->colliders, t->colliders, (size_t)s->ncolliders * sizeof *s->colliders);
  assert_memory_equal(s->solids, t->solids, (size_t)s->ncolliders * sizeof *s->solids);
}

static void files_contain_colliders(void **state) {
  (void)state;
  msim_scene *scene = parse(file), *built = new_scene();
  const double from[3] = {1, 2, 3};
  msim_collider c = sphere(0, 0, 0, 2, 1, 0), b = box(0, 0, 3, 0, 1, 0);
  add(built, sphere(1, 2, 3, 0.1, 1, 0), 0);
  c.type = MSIM_COLLIDER_CAPSULE;
  memcpy(c.from, from, sizeof from);
  c.to[0] = 4, c.to[1] = 5, c.to[2] = 7;
  add(built, c, 1);
  c = (msim_collider){.size = sizeof c, .type = MSIM_COLLIDER_CYLINDER, .from = {0, 0, 3}};
  c.to[2] = 7, c.radius = 3, c.restitution = 0.5, c.friction = 0.25;
  add(built, c, 0);
  memcpy(b.extent, from, sizeof from);
  for (int i = 0; i < 3; i++) b.rotation[i] = (i + 1) / 10.;
  b.rotation[2] = 0.3;
  add(built, b, 0);
  memset(b.rotation, 0, sizeof b.rotation);
  add(built, b, 0);
  assert_same_colliders(scene, built);
  msim_scene_destroy(scene), msim_scene_destroy(built);
}

static void written_colliders_are_read_back_to_the_bit(void **state) {
  (void)state;
  msim_scene *scene = parse(file);
  msim_collider c = sphere(0.1, 1e-300, -1e9, 1. / 3, 2. / 3, 1e5);
  add(scene, c, 1);
  c.type = MSIM_COLLIDER_BOX, c.extent[0] = 1e-9, c.extent[1] = 0.7, c.extent[2] = 1e9;
  c.rotation[0] = -0.0, c.rotation[1] = 1. / 3;
  add(scene, c, 1);
  char *text = text_of(scene->data);
  msim_scene *again = parse(text);
  assert_same_colliders(scene, again);
  free(text);
  msim_scene_destroy(scene), msim_scene_destroy(again);
}

/* Copy on write: a collider added later is not in a sim made before. */
static void sims_keep_their_colliders(void **state) {
  (void)state;
  msim_scene *scene = parse(file), *same = parse(file);
  const msim_options opt = options("velocity-verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  const char *text;
  for (int i = 0; i < 9; i++) add(scene, sphere(0, 0, 0, 1, 1, 0), 0);
  assert_int_equal(view_of(scene).ncolliders, 14);
  assert_memory_equal(view_of(scene).colliders, view_of(same).colliders, 5 * sizeof(msim_collider));
  assert_ok(msim_sim_explain(sim, &text, err));
  assert_non_null(strstr(text, "; colliders: sphere, capsule (inside), cylinder, box, box\n"));
  msim_sim_destroy(sim);
  msim_scene_destroy(scene), msim_scene_destroy(same);
}

/*------------------------------------- what is refused ------------------------------------------*/

static void bad_colliders_are_refused(void **state) {
  (void)state;
  msim_scene *scene = new_scene();
  const double at[3] = {0}, along[3] = {1, 0, 0};
  const double mass = 1;
  assert_ok(msim_scene_add_particles(scene, 1, at, NULL, &mass, err));
  add(scene, sphere(0, 0, 0, 1, 1, 0), 0);
  const msim_collider ball = sphere(0, 0, 0, 1, 1, 0), cube = box(0, 0, 0, 1, 1, 0),
                      bar = round_bar(MSIM_COLLIDER_CYLINDER, at, along, 1, 1, 0);
  msim_collider c = ball;
#define REFUSED(from, member, value, words)                                \
  do {                                                                     \
    c = from;                                                              \
    c.member = value;                                                      \
    assert_refused(scene, msim_scene_add_collider(scene, &c, err), words); \
  } while (0)
  REFUSED(ball, type, 0, "type is 0; it must be MSIM_COLLIDER_SPHERE, _CAPSULE");
  REFUSED(ball, type, 7, "type is 7");
  REFUSED(ball, inside, 2, "inside is 2; it must be 0 or 1");
  REFUSED(ball, radius, 0, "radius is 0; it must be a finite number > 0");
  REFUSED(bar, radius, -1, "radius is -1");
  REFUSED(ball, center[1], NAN, "center[1] is nan; it must be a finite number");
  REFUSED(bar, to[2], INFINITY, "to[2] is inf");
  REFUSED(bar, to[0], -1, "from and to are the same point; they must be the two ends");
  REFUSED(bar, to[0], 1e308,
          "from and to are so large that distances are beyond the range of double");
  REFUSED(cube, extent[2], 0, "size[2] is 0; it must be a finite number > 0");
  REFUSED(ball, center[2], 1.7e308, "center or size is so large");
  REFUSED(cube, rotation[0], NAN, "rotation[0] is nan");
  REFUSED(cube, restitution, 1.1, "restitution is 1.1; it must be a number in [0, 1]");
  REFUSED(ball, friction, -1, "friction is -1; it must be a finite number >= 0");
#undef REFUSED
  assert_refused(scene, msim_scene_add_collider(scene, NULL, err), "scene or collider is NULL");
  assert_int_equal(msim_scene_add_collider(NULL, &ball, NULL), MSIM_ERR_ARG);
  c = ball, c.size = offsetof(msim_collider, friction);
  assert_int_equal(msim_scene_add_collider(scene, &c, NULL), MSIM_ERR_SIZE);
  msim_scene_destroy(scene);
}

/* Members of other types are ignored: they may hold anything. */
static void members_of_other_types_are_ignored(void **state) {
  (void)state;
  msim_scene *scene = new_scene();
  msim_collider c = sphere(1, 2, 3, 4, 0.5, 0.25);
  c.from[0] = NAN, c.extent[1] = -1, c.rotation[2] = INFINITY;
  add(scene, c, 1);
  const msim_collider *kept = view_of(scene).colliders;
  assert_int_equal(view_of(scene).ncolliders, 1);
  assert_int_equal(kept->size, sizeof *kept);
  assert_true(kept->from[0] == 0 && kept->extent[1] == 0 && kept->rotation[2] == 0);
  assert_true(kept->type == MSIM_COLLIDER_SPHERE && kept->inside == 1 && kept->radius == 4);
  assert_memory_equal(kept->center, c.center, sizeof c.center);
  assert_true(kept->restitution == 0.5 && kept->friction == 0.25);
  msim_scene_destroy(scene);
}

static void methods_that_change_their_state_refuse_colliders(void **state) {
  (void)state;
  msim_scene *scene = bodies(0.4, 0.5);
  for (int events = 0; events < 2; events++) {
    msim_options opt = options("takahashi-imada", 1e-3);
    if (events) opt.collision = MSIM_COLLISION_EVENT;
    msim_sim *sim;
    msim_error why;
    assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
    if (!strstr(why.text, "integrator 'takahashi-imada' does not support colliders; use "))
      fail_msg("\"%s\"", why.text);
    assert_null(sim);
  }
  msim_scene_destroy(scene);
}

/* With collision = event, tol and auto */
static void auto_refuses_colliders_that_move(void **state) {
  (void)state;
  const double t[2] = {0, 1}, x[6] = {0, 0, 0, 1, 0, 0};
  const msim_collider_motion motion = {
      .size = sizeof motion, .collider = 1, .nt = 2, .t = t, .x = x};
  msim_scene *scene = bodies(0.4, 0.5);
  assert_ok(msim_scene_set_collider_motion(scene, &motion, err));
  msim_options opt = options("auto", MSIM_H_AUTO);
  opt.steps = -1, opt.t_end = 1;
  msim_sim *sim;
  msim_error why;
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &why), MSIM_ERR_ARG);
  if (!strstr(why.text, "integrator 'auto' does not support colliders that move; use dop853"))
    fail_msg("\"%s\"", why.text);
  assert_null(sim);
  msim_scene_destroy(scene);
}

/*------------------------------------- what is reported -----------------------------------------*/

static int warnings;
static char warning[512];
static void keep_warning(const char *text, void *user) {
  (void)user;
  strncpy(warning, text, sizeof warning - 1);
  warnings++;
}

static void particles_inside_at_the_start_are_reported(void **state) {
  (void)state;
  const double x[15] = {0, 0, 5, 0, 0, -0.25, 0.1, 0, 0.9, 3, 0, -1, 0, 0, 0},
               mass[5] = {1, 1, 1, 1, 1};
  const int32_t pinned = 4;
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.warn = keep_warning;
  for (int what = 0; what < 4; what++) {
    msim_scene *scene = new_scene();
    assert_ok(msim_scene_add_particles(scene, 5, x, NULL, mass, err));
    assert_ok(msim_scene_pin(scene, 1, &pinned, err));
    if (what == 0) add(scene, sphere(0, 0, 0, 1, 1, 0), 0);
    if (what == 1) plane(scene, 0, 0, 1, -0.5, 1, 0);
    if (what == 2) add(scene, sphere(0, 0, 0, 4, 1, 0), 1);
    if (what == 3) add(scene, sphere(0, 0, 5, 5, 1, 0), 1), plane(scene, 0, 0, 1, -1, 1, 0);
    warnings = 0;
    msim_sim_destroy(make_sim(scene, &opt));
    assert_int_equal(warnings, 1);
    const char *words =
        what == 0   ? "particle 1 starts 0.75 m inside colliders[0], which will move it at the "
                      "first step (2 such particles in all); change its position or the colliders"
        : what == 1 ? "particle 3 starts 0.5 m behind planes[0], which will move it at the first "
                      "step; change its position or the planes"
        : what == 2 ? "particle 0 starts 1 m outside colliders[0]"
                    : "particle 1 starts 0.25 m outside colliders[0], which will move it at the "
                      "first step (2 such particles in all)";
    if (!strstr(warning, words)) fail_msg("\"%s\" lacks \"%s\"", warning, words);
    msim_scene_destroy(scene);
  }
}

static void plans_name_colliders(void **state) {
  (void)state;
  msim_scene *scene = bodies(0.4, 0.5);
  const msim_options opt = options("velocity-verlet", 1e-3);
  const char *text;
  for (int many = 0; many < 2; many++) {
    msim_sim *sim = make_sim(scene, &opt);
    assert_ok(msim_sim_explain(sim, &text, err));
    assert_non_null(strstr(text, many ? "; colliders 8\n"
                                      : "; planes 0; colliders: sphere, box, capsule, sphere "
                                        "(inside), cylinder\n"));
    assert_non_null(strstr(text, "collisions    reflect"));
    assert_null(strstr(text, "there are no planes"));
    msim_sim_destroy(sim);
    for (int i = 0; i < 3; i++) add(scene, sphere(9, 9, 9, 1, 1, 0), 0);
  }
  msim_scene_destroy(scene);
}

/* A checkpoint belongs to its colliders. */
static void checkpoints_belong_to_their_colliders(void **state) {
  (void)state;
  const msim_options opt = options("velocity-verlet", 1e-3);
  enum { N = 4 };
  msim_scene *scenes[N];
  const char *words[N] = {"", "colliders[5] differs", "colliders[5] differs",
                          "the number of colliders is 5 here and 6"};
  for (int i = 0; i < N; i++) scenes[i] = bodies(0.4, 0.5);
  add(scenes[0], sphere(0, 0, 0, 9, 1, 0), 0), add(scenes[1], sphere(0, 0, 0, 9, 1, 0.5), 0);
  add(scenes[2], sphere(0, 0, 0, 9, 1, 0), 1);
  msim_sim *sim = make_sim(scenes[0], &opt);
  const checkpoint c = save(sim);
  for (int i = 0; i < N; i++) {
    msim_error why = {0, ""};
    msim_sim *other = make_sim(scenes[i], &opt);
    assert_int_equal(msim_sim_load(other, c.bytes, c.length, &why), i ? MSIM_ERR_ARG : MSIM_OK);
    if (!strstr(why.text, words[i])) fail_msg("\"%s\"", why.text);
    msim_sim_destroy(other);
    msim_scene_destroy(scenes[i]);
  }
  free(c.bytes);
  msim_sim_destroy(sim);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(files_contain_colliders),
      cmocka_unit_test(written_colliders_are_read_back_to_the_bit),
      cmocka_unit_test(sims_keep_their_colliders),
      cmocka_unit_test(bad_colliders_are_refused),
      cmocka_unit_test(members_of_other_types_are_ignored),
      cmocka_unit_test(methods_that_change_their_state_refuse_colliders),
      cmocka_unit_test(auto_refuses_colliders_that_move),
      cmocka_unit_test(particles_inside_at_the_start_are_reported),
      cmocka_unit_test(plans_name_colliders),
      cmocka_unit_test(checkpoints_belong_to_their_colliders)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
