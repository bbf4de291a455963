/* Tests of faces: those of cloths and lattices, in scene files, refused where wrong, and given to
 * recorders. */
#include <math.h>

#include "msim/recorder.h"
#include "scene_check.h"
#include "scenes.h"

static msim_scene *empty(void) {
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  return scene;
}

/* A lattice of a x b x c particles in a box of 2 x 3 x 4 m, behind another particle */
static msim_scene *block(int32_t a, int32_t b, int32_t c) {
  const double x[3] = {9, 9, 9}, mass = 5;
  const msim_lattice lattice = {.size = sizeof lattice,
                                .n = {a, b, c},
                                .origin = {-1, 0, 1},
                                .extent = {a > 1 ? 2 : 0, b > 1 ? 3 : 0, c > 1 ? 4 : 0},
                                .mass = 8};
  msim_scene *scene = empty();
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  assert_ok(msim_scene_add_lattice(scene, &lattice, err));
  return scene;
}

static const double *corner(const msim_scene_view *s, int32_t face, int c) {
  return s->x + 3 * s->faces[3 * face + c % 3];
}

static void cross(const double a[3], const double b[3], double to[3]) {
  for (int i = 0; i < 3; i++)
    to[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Area, and volume by the divergence theorem: sum of p . (q x r)/6 over all faces (p, q, r) */
static void measure(const msim_scene_view *s, double *area, double *volume) {
  *area = *volume = 0;
  for (int32_t f = 0; f < s->nfaces; f++) {
    const double *p = corner(s, f, 0), *q = corner(s, f, 1), *r = corner(s, f, 2);
    const double a[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]},
                 b[3] = {r[0] - p[0], r[1] - p[1], r[2] - p[2]};
    double n[3], m[3];
    cross(a, b, n), cross(q, r, m);
    *area += sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2;
    *volume += (p[0] * m[0] + p[1] * m[1] + p[2] * m[2]) / 6;
  }
}

/* How often an edge runs from particle p to q */
static int edges(const msim_scene_view *s, int32_t p, int32_t q) {
  int count = 0;
  for (int32_t f = 0; f < s->nfaces; f++)
    for (int c = 0; c < 3; c++)
      count += s->faces[3 * f + c] == p && s->faces[3 * f + (c + 1) % 3] == q;
  return count;
}

static void a_block_has_a_closed_surface(void **state) {
  (void)state;
  msim_scene *scene = block(3, 4, 5);
  const msim_scene_view s = view_of(scene);
  double area, volume;
  measure(&s, &area, &volume);
  assert_int_equal(s.nfaces, 2 * 2 * (2 * 3 + 3 * 4 + 4 * 2));
  assert_close(area, 2 * (2 * 3 + 3 * 4 + 4 * 2), 1e-14);
  assert_close(volume, 2 * 3 * 4, 1e-14); /* positive: corners are counterclockwise from outside */
  for (int32_t f = 0; f < s.nfaces; f++)
    for (int c = 0; c < 3; c++) {
      const int32_t p = s.faces[3 * f + c], q = s.faces[3 * f + (c + 1) % 3];
      assert_int_equal(edges(&s, p, q), 1);
      assert_int_equal(edges(&s, q, p), 1);
    }
  msim_scene_destroy(scene);
}

static void a_layer_has_one_sheet(void **state) {
  (void)state;
  const int32_t n[][3] = {{1, 3, 4}, {3, 1, 4}, {3, 4, 1}, {1, 1, 4}, {1, 1, 1}};
  const double areas[] = {12, 8, 6, 0, 0};
  for (int i = 0; i < 5; i++) {
    msim_scene *scene = block(n[i][0], n[i][1], n[i][2]);
    const msim_scene_view s = view_of(scene);
    double area, volume;
    measure(&s, &area, &volume);
    assert_int_equal(s.nfaces, i < 3 ? 12 : 0);
    assert_close(area, areas[i], 1e-14);
    msim_scene_destroy(scene);
  }
}

static void a_cloth_has_two_faces_a_cell(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 1, 0);
  const msim_scene_view s = view_of(scene);
  static const int32_t faces[][3] = {{0, 3, 4}, {0, 4, 1}, {1, 4, 5}, {1, 5, 2},
                                     {3, 6, 7}, {3, 7, 4}, {4, 7, 8}, {4, 8, 5}};
  assert_int_equal(s.nfaces, 8);
  assert_memory_equal(s.faces, faces, sizeof faces);
  msim_scene_destroy(scene);
}

/* Particles of an array, springs of an object: faces may name both. */
static const char text[] =
    "{\"msim\": 1, \"particles\": {\"x\": [[0, 0, 0], [1, 0, 0]], \"mass\": 1},"
    " \"objects\": [{\"type\": \"cloth\", \"n\": [2, 2], \"origin\": [0, 0, 1], \"row\": [1, 0, 0],"
    " \"column\": [0, 1, 0], \"mass\": 1, \"k\": 5}], \"faces\": [[0, 1, 5], [5, 1, 3]]}";

static void files_keep_faces(void **state) {
  (void)state;
  static const int32_t faces[][3] = {{0, 1, 5}, {5, 1, 3}, {2, 4, 5}, {2, 5, 3}};
  msim_scene *scene, *again;
  assert_ok(msim_scene_parse(NULL, "text", text, sizeof text - 1, &scene, err));
  assert_ok(msim_scene_set_drag(scene, 1, err)); /* discards the text */
  char *written = text_of(scene->data);
  assert_ok(msim_scene_parse(NULL, "written", written, strlen(written), &again, err));
  const msim_scene_view s = view_of(scene), t = view_of(again);
  assert_int_equal(s.nfaces, 4);
  assert_memory_equal(s.faces, faces, sizeof faces);
  assert_int_equal(t.nfaces, 4);
  assert_memory_equal(t.faces, faces, sizeof faces);
  free(written);
  msim_scene_destroy(scene), msim_scene_destroy(again);
}

static void wrong_faces_are_refused(void **state) {
  (void)state;
  const int32_t outside[] = {0, 1, 2, 0, 1, 9}, negative[] = {-1, 1, 2}, twice[] = {2, 1, 2};
  msim_scene *scene = hanging_cloth(3, 1, 0);
  assert_refused(scene, msim_scene_add_faces(scene, 2, outside, err),
                 "faces[1] refers to particle 9; there are 9 particles, counted from 0");
  assert_refused(scene, msim_scene_add_faces(scene, 1, negative, err),
                 "faces[0] refers to particle -1; there are 9");
  assert_refused(scene, msim_scene_add_faces(scene, 1, twice, err),
                 "faces[0] has particle 2 twice; it must have three different ones");
  assert_refused(scene, msim_scene_add_faces(scene, -1, twice, err),
                 "the number of faces is -1; it must be >= 0");
  assert_refused(scene, msim_scene_add_faces(scene, 1, NULL, err), "scene or corners is NULL");
  msim_scene_destroy(scene);
}

/*------------------------------------- recorders ------------------------------------------------*/

static msim_recording seen;
static int32_t seen_faces[24];
static double elastic, gravitational, potential;

static msim_status keep_recording(const msim_host *host, const msim_recording *what, void **self) {
  (void)host;
  *self = &seen;
  seen = *what;
  memcpy(seen_faces, what->faces, sizeof seen_faces);
  assert_int_equal(what->pinned[0], 1);
  assert_int_equal(what->pinned[1], 0);
  assert_true(what->damping[0] == 0.25);
  assert_true(what->planes[0].offset == -7);
  return MSIM_OK;
}

static msim_status keep_energies(void *self, const msim_frame *frame) {
  (void)self;
  elastic = frame->elastic, gravitational = frame->gravitational, potential = frame->potential;
  return MSIM_OK;
}

static msim_status do_nothing(void *self) {
  (void)self;
  return MSIM_OK;
}

static void recorders_receive_what_a_picture_needs(void **state) {
  (void)state;
  const msim_recorder_type type = {.abi = MSIM_RECORDER_ABI,
                                   .size = sizeof type,
                                   .name = "picture",
                                   .extension = ".picture",
                                   .library = "none",
                                   .license = "MIT",
                                   .open = keep_recording,
                                   .write = keep_energies,
                                   .close = do_nothing};
  const msim_recorder_type *const recorders[] = {&type, NULL};
  msim_scene *scene = hanging_cloth(3, 100, 0.25);
  const msim_plane floor = {.normal = {0, 0, 1}, .offset = -7};
  assert_ok(msim_scene_add_plane(scene, &floor, err));
  msim_options opt = options("velocity-verlet", 0.01);
  opt.recorders = recorders, opt.steps = 10;
  msim_sim *sim = make_sim(scene, &opt);
  msim_recorder *recorder;
  assert_ok(msim_recorder_open(sim, "faces.picture", &recorder, err));
  assert_ok(msim_sim_step(sim, 10, err));
  assert_ok(msim_recorder_write(recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  remove("faces.picture");
  const msim_scene_view s = view_of(scene);
  assert_int_equal(seen.nfaces, 8);
  assert_memory_equal(seen_faces, s.faces, sizeof seen_faces);
  assert_int_equal(seen.nplanes, 1);
  assert_true(elastic > 0 && gravitational < 0 && elastic + gravitational == potential);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A scene that shares its data with a sim is copied when it is changed. */
static void copies_keep_faces(void **state) {
  (void)state;
  msim_scene *scene = block(3, 4, 5);
  msim_options opt = options("verlet", 1e-3);
  msim_sim *sim = make_sim(scene, &opt);
  msim_scene_view shared = {.size = sizeof shared}, own = {.size = sizeof own};
  assert_int_equal(msim_scene_get(scene, &shared), MSIM_OK);
  assert_ok(msim_scene_set_name(scene, "other", err));
  assert_int_equal(msim_scene_get(scene, &own), MSIM_OK);
  assert_ptr_not_equal(own.faces, shared.faces);
  assert_true(own.nfaces == shared.nfaces && own.nfaces > 0);
  assert_memory_equal(own.faces, shared.faces, 3 * (size_t)own.nfaces * sizeof *own.faces);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_block_has_a_closed_surface),
      cmocka_unit_test(a_layer_has_one_sheet),
      cmocka_unit_test(a_cloth_has_two_faces_a_cell),
      cmocka_unit_test(files_keep_faces),
      cmocka_unit_test(copies_keep_faces),
      cmocka_unit_test(wrong_faces_are_refused),
      cmocka_unit_test(recorders_receive_what_a_picture_needs),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
