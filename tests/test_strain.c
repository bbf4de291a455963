/* Tests of the strain and tension that recorders receive with each frame. */
#include <float.h>
#include <math.h>

#include "msim/recorder.h"
#include "scenes.h"
#include "record/strain.h"

enum { SPRINGS = 5, FACES = 3, CELLS = SPRINGS + FACES };

static float strain[CELLS], tension[CELLS], reaction[3 * 7];
static int has_reactions;

static msim_status open_nothing(const msim_host *host, const msim_recording *what, void **self) {
  (void)host;
  assert_int_equal(what->nsprings + what->nfaces, CELLS);
  *self = strain;
  return MSIM_OK;
}

static msim_status keep_frame(void *self, const msim_frame *frame) {
  (void)self;
  memcpy(strain, frame->strain, sizeof strain);
  memcpy(tension, frame->tension, sizeof tension);
  has_reactions = frame->reaction != NULL;
  if (has_reactions) memcpy(reaction, frame->reaction, sizeof reaction);
  return MSIM_OK;
}

static msim_status do_nothing(void *self) {
  (void)self;
  return MSIM_OK;
}

/* Record the present state of a sim. */
static void record_with(msim_scene *scene) {
  const msim_recorder_type type = {.abi = MSIM_RECORDER_ABI,
                                   .size = sizeof type,
                                   .name = "picture",
                                   .extension = ".picture",
                                   .library = "none",
                                   .license = "MIT",
                                   .open = open_nothing,
                                   .write = keep_frame,
                                   .close = do_nothing};
  const msim_recorder_type *const recorders[] = {&type, NULL};
  msim_recorder *recorder;
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.recorders = recorders, opt.steps = 1;
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_recorder_open(sim, "strain.picture", &recorder, err));
  assert_ok(msim_recorder_write(recorder, err));
  assert_ok(msim_recorder_close(recorder, err));
  remove("strain.picture");
  msim_sim_destroy(sim);
}

/* A square of side 2; springs along its sides but one, a diagonal twice. The third face has no
 * spring at its edges. */
static msim_scene *make_square(double k) {
  static const double x[] = {0, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 0, 5, 5, 5, 6, 5, 5, 5, 6, 5};
  static const int32_t ij[] = {1, 0, 1, 2, 2, 3, 0, 2, 2, 0};
  static const double rest[] = {1, 4, 0, 1, 2}, stiffness[] = {10, 20, 30, 40, 50};
  static const int32_t faces[] = {0, 1, 2, 0, 2, 3, 4, 5, 6};
  msim_scene *scene;
  double mass[7], ks[SPRINGS];
  for (int i = 0; i < 7; i++) mass[i] = 1;
  for (int i = 0; i < SPRINGS; i++) ks[i] = k * stiffness[i];
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_particles(scene, 7, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(scene, SPRINGS, ij, ks, rest, NULL, err));
  assert_ok(msim_scene_add_faces(scene, FACES, faces, err));
  return scene;
}

static void springs_and_faces(void **state) {
  (void)state;
  const double d = sqrt(8.0);
  const float s[] = {1, -0.5f, 0, (float)(d - 1), (float)((d - 2) / 2)};
  const float t[] = {10, -40, 60, (float)(40 * (d - 1)), (float)(50 * (d - 2))};
  msim_scene *scene = make_square(1);
  record_with(scene);
  assert_memory_equal(strain, s, sizeof s);
  assert_memory_equal(tension, t, sizeof t);
  /* of the diagonal the first one counts */
  assert_float_equal(strain[5], (1 - 0.5 + d - 1) / 3, 1e-7);
  assert_float_equal(strain[6], (0 + d - 1) / 2, 1e-7);
  assert_float_equal(tension[6], (60 + 40 * (d - 1)) / 2, 1e-5);
  assert_true(strain[7] == 0 && tension[7] == 0);
  msim_scene_destroy(scene);
}

/* Particle 2 of the square is pulled by a spring of -40 N along -y, one of 60 N along -x, and two
 * along the diagonal: the support balances these. */
static void reactions_of_pins(void **state) {
  (void)state;
  const double d = sqrt(8.0), pull = (40 * (d - 1) + 50 * (d - 2)) / sqrt(2.0);
  const uint8_t pins[7] = {0, 0, 1, 0, 0, 0, 0};
  msim_scene *scene = make_square(1);
  record_with(scene);
  assert_int_equal(has_reactions, 0);
  scene->data->pinned[2] = pins[2];
  record_with(scene);
  assert_int_equal(has_reactions, 1);
  for (int i = 0; i < 21; i++)
    assert_float_equal(reaction[i], (float)(i == 6 ? 60 + pull : i == 7 ? pull - 40 : 0), 1e-4);
  msim_scene_destroy(scene);
}

static void numbers_beyond_single_precision_are_its_largest(void **state) {
  (void)state;
  msim_scene *scene = make_square(1e60);
  record_with(scene);
  assert_true(tension[0] == FLT_MAX && tension[1] == -FLT_MAX);
  assert_true(strain[0] == 1);
  msim_scene_destroy(scene);
}

/* Faces of a cloth have three edges that are springs, if it has shear springs. */
static void faces_find_their_springs_in_large_scenes(void **state) {
  (void)state;
  enum { SIDE = 40 };
  msim_scene *scene;
  msim_cloth cloth = {.size = sizeof cloth,
                      .rows = SIDE,
                      .columns = SIDE,
                      .row = {0, 1, 0},
                      .column = {1, 0, 0},
                      .mass = 1,
                      .k_structural = 1,
                      .k_shear = 1};
  ms_strain s;
  const msim_allocator alloc = ms_memory_allocator(NULL);
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  const ms_scene *data = scene->data;
  const ms_section all = ms_section_whole(data);
  const ms_strain_section section = {.in_whole = all, .scene = data, .numbers = all};
  assert_ok(ms_strain_init(&s, &section, data->nparticles, 0, &alloc, err));
  assert_int_equal(data->nfaces, 2 * (SIDE - 1) * (SIDE - 1));
  for (int32_t e = 0; e < 3 * data->nfaces; e++) {
    const int32_t a = data->faces[e], b = data->faces[e - e % 3 + (e + 1) % 3];
    const int32_t *ends = data->ij + 2 * s.edge[e];
    assert_in_range(s.edge[e], 0, data->nsprings - 1);
    assert_true((ends[0] == a && ends[1] == b) || (ends[0] == b && ends[1] == a));
  }
  ms_strain_free(&s, &alloc);
  msim_scene_destroy(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(springs_and_faces),
      cmocka_unit_test(reactions_of_pins),
      cmocka_unit_test(numbers_beyond_single_precision_are_its_largest),
      cmocka_unit_test(faces_find_their_springs_in_large_scenes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
