/* Tests of faulty scene files that ranks read in parts, and of parts that do not fit together: the
 * sentences are those of one process, and the same on all ranks. */
#define _GNU_SOURCE /* mkdtemp, memmem */
#include <stdio.h>
#include <unistd.h>

#include "drawn_scenes.h"
#include "rank_runs.h"
#include "scene_part_file.h"
#include "sim/sim.h"

/*------------------------------------- errors ---------------------------------------------------*/

/* The file, whose bytes a test changes */
typedef struct file_bytes {
  char *bytes;
  size_t length;
} file_bytes;

static file_bytes read_bytes(void) {
  file_bytes f;
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  fseek(file, 0, SEEK_END);
  f.length = (size_t)ftell(file);
  rewind(file);
  f.bytes = malloc(f.length);
  assert_int_equal(fread(f.bytes, 1, f.length, file), f.length);
  fclose(file);
  return f;
}

static void write_bytes(file_bytes f) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(f.bytes, 1, f.length, file), f.length);
  fclose(file);
}

/* Where the file has these bytes, only there */
static char *find_bytes(file_bytes f, const void *bytes, size_t length) {
  char *at = memmem(f.bytes, f.length, bytes, length);
  assert_non_null(at);
  assert_null(memmem(at + 1, f.length - (size_t)(at + 1 - f.bytes), bytes, length));
  return at;
}

/* Of the ranks those fail by which the file is faulty, all with the sentence of one process. */
static void check_errors(int32_t nranks, int nfaulty) {
  msim_scene *scene;
  msim_error alone, why;
  int count = 0;
  const msim_status expected = msim_scene_load(NULL, path, &scene, &alone);
  assert_true(expected < 0);
  for (int32_t r = 0; r < nranks; r++) {
    const msim_status status = msim_scene_load_part(NULL, path, r, nranks, &scene, &why);
    if (!status) msim_scene_destroy(scene);
    if (!status) continue;
    assert_int_equal(status, expected);
    assert_null(scene);
    assert_string_equal(why.text, alone.text);
    count++;
  }
  assert_int_equal(count, nfaulty);
}

/* Write the file with another number at this place. */
static void check_faulty_number(file_bytes f, char *at, const void *number, int nfaulty) {
  char before[8];
  memcpy(before, at, sizeof before), memcpy(at, number, sizeof before);
  write_bytes(f);
  check_errors(2, nfaulty < 2 ? nfaulty : 2);
  check_errors(5, nfaulty);
  memcpy(at, before, sizeof before);
}

/* Each number of an array in turn; nfaulty: of 5 ranks */
static void check_faulty_array(file_bytes f, int32_t n, const void *array, double number,
                               int is_whole, int nfaulty) {
  const int64_t whole = (int64_t)number;
  char *at = find_bytes(f, array, (size_t)n * 8);
  for (int32_t i = 0; i < n; i += 7)
    check_faulty_number(f, at + 8 * i, is_whole ? (const void *)&whole : (const void *)&number,
                        nfaulty);
}

static int64_t *widen(int64_t n, const int32_t *from) {
  int64_t *to = malloc((size_t)n * sizeof *to);
  assert_non_null(to);
  for (int64_t i = 0; i < n; i++) to[i] = from[i];
  return to;
}

static void errors_are_those_of_the_file(void **state) {
  (void)state;
  msim_scene *scene = draw_scene(NULL, 4);
  const ms_scene *s = scene->data;
  save(scene);
  file_bytes f = read_bytes();
  int64_t *ij = widen(2 * (int64_t)s->nsprings, s->ij),
          *faces = widen(3 * (int64_t)s->nfaces, s->faces), pins[64];
  int32_t npins = 0;
  for (int32_t p = 0; p < s->nparticles; p++)
    if (s->pinned[p]) pins[npins++] = p;
  assert_true(s->nfaces > 5 && npins > 1);
  check_faulty_array(f, s->nparticles, s->mass, -1, 0, 1);
  check_faulty_array(f, s->nparticles, s->mass, NAN, 0, 1);
  check_faulty_array(f, 3 * s->nparticles, s->x, INFINITY, 0, 1);
  check_faulty_array(f, s->nsprings, s->k, -2, 0, 1);
  check_faulty_array(f, 2 * s->nsprings, ij, s->nparticles, 1, 1);
  check_faulty_array(f, 2 * s->nsprings, ij, -1, 1, 1);
  check_faulty_array(f, 3 * s->nfaces, faces, s->nparticles, 1, 1);
  check_faulty_array(f, npins, pins, s->nparticles, 1, 5);
  const double one = 1;
  char *v = find_bytes(f, s->v, 3 * (size_t)s->nparticles * 8);
  check_faulty_number(f, v + 24 * pins[1], &one, 1);
  const size_t length = f.length;
  for (f.length = 8; f.length < length; f.length += 97) write_bytes(f), check_errors(3, 3);
  free(f.bytes), free(ij), free(faces);
  msim_scene_destroy(scene);
}

/* Creation from a part on every rank fails on all of them with one sentence. */
typedef struct wrong_parts {
  const char *other; /* the file that rank 1 reads; NULL: all read the same */
  int32_t nranks;    /* for so many parts; 0: as many as there are ranks */
  int adds;          /* 1: rank 1 adds a particle */
  const char *says;
} wrong_parts;

static const char *check_wrong_parts(msim_comm *comm, void *data) {
  const wrong_parts *w = data;
  const double x[3] = {0}, mass = 1;
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_sim *sim;
  msim_scene *part;
  const char *name = w->other && comm->rank == 1 ? w->other : path;
  const int32_t n = w->nranks ? w->nranks : comm->nranks;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, name, comm->rank, n, &part, &why) == MSIM_OK);
  if (w->adds && comm->rank == 1)
    EXPECT(msim_scene_add_particles(part, 1, x, NULL, &mass, &why) == MSIM_OK);
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_ERR_ARG && !sim);
  EXPECT(strstr(why.text, w->says) && has_same_text(comm, why.text));
  msim_scene_destroy(part);
  return NULL;
}

static void parts_that_do_not_fit_are_refused(void **state) {
  (void)state;
  msim_scene *scene = draw_scene(NULL, 8), *part;
  const wrong_parts cases[] = {{.nranks = 4, .says = "of rank 0 of 4 ranks"},
                               {.other = "other.h5", .says = "parts of different scenes"},
                               {.other = "scene.json", .says = "parts of different scenes"},
                               {.adds = 1, .says = "cannot be added to a part"}};
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim;
  msim_error why;
  const int32_t pin = 0;
  const double x[3] = {0}, mass = 1;
  save(scene);
  assert_ok(msim_scene_save(scene, "scene.json", err));
  assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
  assert_ok(msim_scene_save(scene, "other.h5", err));
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    wrong_parts w = cases[i];
    const char *wrong = run_ranks(3, check_wrong_parts, &w);
    if (wrong) fail_msg("case %d: %s", (int)i, wrong);
  }
  assert_ok(msim_scene_load_part(NULL, path, 1, 3, &part, err));
  assert_int_equal(msim_sim_create(part, &opt, &sim, &why), MSIM_ERR_ARG);
  assert_non_null(strstr(why.text, "the part of rank 1 of 3 ranks, but this is rank 0 of 1"));
  assert_int_equal(msim_scene_pin(part, 1, &pin, &why), MSIM_ERR_ARG);
  assert_int_equal(msim_scene_save(part, "part.h5", &why), MSIM_ERR_ARG);
  msim_scene_destroy(part);
  for (int32_t r = -1; r < 4; r += 4)
    assert_int_equal(msim_scene_load_part(NULL, path, r, 3, &part, &why), MSIM_ERR_ARG);
  msim_scene_destroy(scene);
}

/* Rank 1 changes gravity of its part, which creation refuses; on all ranks it is that of a run. */
static const char *change_gravity(msim_comm *comm, void *data) {
  const int *only = data;
  const double g[3] = {0, 1, 0};
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_state whole = {.size = sizeof whole};
  msim_sim *sim;
  msim_scene *part;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  if (!*only || comm->rank == 1) EXPECT(msim_scene_set_gravity(part, g, &why) == MSIM_OK);
  const msim_status status = msim_sim_create(part, &opt, &sim, &why);
  EXPECT(status == (*only ? MSIM_ERR_ARG : MSIM_OK));
  EXPECT(!sim || sim->scene->external.gravity[1] == 1);
  EXPECT(!sim || msim_sim_state(sim, &whole) == MSIM_OK); /* gathers the scene */
  EXPECT(!sim || sim->scene->external.gravity[1] == 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(part);
  return NULL;
}

static void gravity_of_parts_can_be_changed(void **state) {
  (void)state;
  msim_scene *scene = draw_scene(NULL, 3);
  save(scene);
  for (int only = 0; only < 2; only++) {
    const char *wrong = run_ranks(3, change_gravity, &only);
    if (wrong) fail_msg("%s", wrong);
  }
  msim_scene_destroy(scene);
}

int main(void) {
  char folder[] = "/tmp/msim_rank_load_errors_XXXXXX";
  if (!mkdtemp(folder) || chdir(folder)) return 1;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(errors_are_those_of_the_file),
      cmocka_unit_test(parts_that_do_not_fit_are_refused),
      cmocka_unit_test(gravity_of_parts_can_be_changed),
  };
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (const char *const *name = (const char *[]){path, "scene.json", "other.h5", NULL}; *name;
       name++)
    remove(*name);
  return chdir("/") || rmdir(folder) || failed;
}
