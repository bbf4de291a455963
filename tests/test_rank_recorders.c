/* Tests of recorders of several ranks: a plugin that takes rows gets those of one process, each
 * once; the failure of one rank is one of all, and .vtkhdf files have the same bytes. */
#define _GNU_SOURCE /* mkdtemp */
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

#include "msim/recorder.h"
#include "peak_allocator.h"
#include "rank_runs.h"
#include "scene_part_file.h"

/*------------------------------------- a recorder in memory -------------------------------------*/

enum { MOST_FRAMES = 8 };
enum { OPENS, JOINS, BEGINS, PARTS, COMMITS, CLOSES, PIECES, CALLS };

/* The only file, which all ranks write */
static struct {
  int32_t n;
  int64_t ncells;
  double *x, *v;           /* 3 n a frame */
  float *strain, *tension; /* ncells a frame */
  float *reaction;         /* 3 n a frame */
  uint64_t hash[MOST_FRAMES];
  uint64_t text_hash; /* of the text of the scene, and its bytes */
  size_t text_length;
  double t[MOST_FRAMES];
  int committed;
  atomic_int calls[CALLS], rows, cells;
  int fail_call; /* the call of `fail_rank` that fails; -1: none */
} file;

static _Thread_local int32_t rank_here; /* 0 in one process */
static int32_t fail_rank_number;

static msim_status count_call(const msim_host *host, int call) {
  file.calls[call]++;
  if (call != file.fail_call || rank_here != fail_rank_number) return MSIM_OK;
  (host->fail)(host, "call %d of rank %d failed", call, rank_here);
  return MSIM_ERR_IO;
}

static void add_text(const char *text, size_t length) {
  for (size_t i = 0; i < length; i++)
    file.text_hash = (file.text_hash ^ (unsigned char)text[i]) * UINT64_C(0x100000001b3);
  file.text_length += length;
}

static msim_status take_piece(void *user, const char *piece, size_t length) {
  add_text(piece, length);
  return count_call(user, PIECES);
}

/* In pieces where several ranks share a scene without a text of its own */
static msim_status read_text(const msim_host *host, const msim_recording *what) {
  msim_status status = MSIM_OK;
  file.text_hash = file.text_length = 0;
  if (what->scene) add_text(what->scene, what->scene_length);
  else status = what->read_scene(what, take_piece, (void *)(uintptr_t)host);
  return status || file.text_length == what->scene_length ? status : MSIM_ERR_ARG;
}

static msim_status open_file(const msim_host *host, const msim_recording *what, void **self) {
  const msim_status status = read_text(host, what);
  if (status) return status;
  file.n = what->n, file.ncells = (int64_t)what->nsprings + what->nfaces, file.committed = 0;
  const size_t numbers = MOST_FRAMES * 3 * (size_t)what->n * sizeof(double),
               cells = MOST_FRAMES * (size_t)file.ncells * sizeof(float);
  free(file.x), free(file.v), free(file.strain), free(file.tension), free(file.reaction);
  file.x = malloc(numbers), file.v = malloc(numbers);
  file.strain = malloc(cells), file.tension = malloc(cells), file.reaction = malloc(numbers / 2);
  memset(file.x, 0xff, numbers), memset(file.v, 0xff, numbers);
  memset(file.strain, 0xff, cells), memset(file.tension, 0xff, cells);
  memset(file.reaction, 0xff, numbers / 2);
  *self = (void *)(uintptr_t)host;
  return count_call(host, OPENS);
}

static msim_status join_file(const msim_host *host, const msim_recording *what, void **self) {
  const msim_status status = count_call(host, JOINS);
  if (what->n != file.n || what->scene || what->times || what->mass || what->ij)
    return MSIM_ERR_ARG;
  *self = status ? NULL : (void *)(uintptr_t)host;
  return status;
}

static msim_status begin_frame(void *self) { return count_call(self, BEGINS); }

static msim_status write_part(void *self, const msim_frame *f, const msim_frame_part *part,
                              msim_frame_hash *hash) {
  const size_t row = 3 * ((size_t)part->frame * (size_t)file.n + (size_t)part->first),
               rows = 3 * (size_t)part->n * sizeof(double),
               cell = (size_t)(part->frame * file.ncells + part->first_cell),
               cells = (size_t)part->ncells * sizeof(float);
  memcpy(file.x + row, f->x, rows), memcpy(file.v + row, f->v, rows);
  memcpy(file.strain + cell, f->strain, cells), memcpy(file.tension + cell, f->tension, cells);
  file.rows += part->n;
  file.cells += (int)part->ncells;
  *hash = (msim_frame_hash){UINT64_MAX - (uint64_t)part->n, 3}; /* sums exceed 2^64 */
  return count_call(self, PARTS);
}

static msim_status commit_frame(void *self, const msim_frame *f, const msim_frame_part *part,
                                const msim_frame_hash *hash) {
  const msim_status status = count_call(self, COMMITS);
  if (status) return status;
  file.t[file.committed] = f->t;
  if (f->reaction)
    memcpy(file.reaction + 3 * (size_t)(file.committed * file.n), f->reaction,
           3 * (size_t)file.n * sizeof *f->reaction);
  if (part->frame != file.committed || hash->checkpoint % 3) return MSIM_ERR_ARG;
  file.hash[file.committed++] = hash->rows;
  return MSIM_OK;
}

static msim_status write_frame(void *self, const msim_frame *f) {
  const msim_frame_part all = {
      .size = sizeof all, .frame = file.committed, .n = file.n, .ncells = file.ncells};
  msim_frame_hash hash;
  const msim_status status = write_part(self, f, &all, &hash);
  return status ? status : commit_frame(self, f, &all, &hash);
}

static msim_status close_file(void *self) { return count_call(self, CLOSES); }

static const msim_recorder_type in_memory = {.abi = MSIM_RECORDER_ABI,
                                             .size = sizeof in_memory,
                                             .name = "memory",
                                             .extension = ".memory",
                                             .library = "none",
                                             .license = "MIT",
                                             .open = open_file,
                                             .write = write_frame,
                                             .close = close_file,
                                             .join = join_file,
                                             .begin = begin_frame,
                                             .write_part = write_part,
                                             .commit = commit_frame,
                                             .reads_scene = 1};
static const msim_recorder_type *const recorders[] = {&in_memory, NULL};

/*------------------------------------- runs -----------------------------------------------------*/

typedef struct recorded_run {
  const msim_scene *scene;
  const char *path;
  int in_parts; /* reads the scene from its file, each rank a part */
  int resumes;
  int asks; /* for the state of the whole scene, as well */
  int pins; /* changes the pinned particles */
  int32_t steps;
  msim_status expected;
} recorded_run;

static const char *record_rank(msim_comm *comm, void *data) {
  const recorded_run *r = data;
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim;
  msim_recorder *recorder;
  msim_error why = {0};
  const int32_t more[2] = {61, 117};
  rank_here = comm->rank;
  opt.steps = 20, opt.every = 5, opt.comm = comm, opt.recorders = recorders;
  msim_scene *part = NULL;
  if (r->in_parts) EXPECT(!msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &part, &why));
  EXPECT(msim_sim_create(part ? part : r->scene, &opt, &sim, &why) == MSIM_OK);
  msim_scene_destroy(part);
  msim_status status = r->resumes ? msim_recorder_resume(sim, r->path, &recorder, &why)
                                  : msim_recorder_open(sim, r->path, &recorder, &why);
  if (!status) {
    if (!r->resumes) status = msim_recorder_write(recorder, &why);
    while (!status && msim_sim_next_frame(sim) <= r->steps) {
      msim_state now = {.size = r->asks ? sizeof now : MSIM_STATE_TIME};
      EXPECT(msim_sim_state(sim, &now) == MSIM_OK);
      EXPECT(r->asks == (now.x != NULL));
      if (now.step >= r->steps) break;
      EXPECT(msim_sim_step(sim, msim_sim_next_frame(sim) - now.step, &why) == MSIM_OK);
      if (r->pins && now.step == 5) EXPECT(!msim_sim_set_pinned(sim, 2, more, 1, &why));
      if (r->pins && now.step == 10) EXPECT(!msim_sim_set_pinned(sim, 1, more, 0, &why));
      status = msim_recorder_write(recorder, &why);
    }
    const msim_status closed = msim_recorder_close(recorder, status ? NULL : &why);
    if (!status) status = closed;
  }
  EXPECT(status == r->expected);
  EXPECT(!status || strstr(why.text, "failed"));
  msim_sim_destroy(sim);
  return NULL;
}

static void record(const msim_scene *scene, int32_t n, recorded_run r) {
  r.scene = scene;
  const char *wrong = run_ranks(n, record_rank, &r);
  if (wrong) fail_msg("%s, %d ranks: %s", r.path, n, wrong);
}

/* A cloth with faces, of which some have no springs at an edge, and pins of which one is the end of
 * the last springs */
static msim_scene *cloth_with_faces(void) {
  msim_scene *scene = hanging_cloth(11, 300, 0);
  const int32_t faces[6] = {0, 60, 120, 5, 6, 90}, last = 119;
  assert_ok(msim_scene_pin(scene, 1, &last, err));
  assert_ok(msim_scene_add_faces(scene, 2, faces, err));
  return scene;
}

static void set_failure(int32_t rank, int call) {
  fail_rank_number = rank, file.fail_call = call;
  for (int k = 0; k < CALLS; k++) file.calls[k] = 0;
  file.rows = file.cells = 0;
}

/* The same cloth in its plane, whose normal is y */
static msim_scene *upright_cloth(void) {
  const int32_t corners[2] = {0, 10}, faces[6] = {0, 60, 120, 5, 6, 90};
  const double g[3] = {0.5, 0, -9.81};
  const msim_cloth cloth = {.size = sizeof cloth,
                            .rows = 11,
                            .columns = 11,
                            .row = {0.3, 0, -1},
                            .column = {1, 0, 0},
                            .mass = 0.3,
                            .k_structural = 300,
                            .k_shear = 200,
                            .npinned = 2,
                            .pinned = corners};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_cloth(scene, &cloth, err));
  assert_ok(msim_scene_add_faces(scene, 2, faces, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

enum { FRAMES = 5 };

static void check_calls(int32_t n) {
  const int calls[PIECES] = {1, n - 1, FRAMES, FRAMES * n, FRAMES, n};
  assert_int_equal(file.committed, FRAMES);
  for (int k = 0; k < PIECES; k++) assert_int_equal(file.calls[k], calls[k]);
  assert_true(file.calls[PIECES] > 0);
  assert_int_equal(file.rows, FRAMES * file.n);
  assert_int_equal(file.cells, FRAMES * file.ncells);
  for (int i = 0; i < FRAMES; i++)
    assert_true(file.hash[i] == 0 - (uint64_t)n - (uint64_t)file.n && file.t[i] == 5e-4 * i);
}

static void *copy_bytes(const void *from, size_t bytes) {
  void *to = malloc(bytes);
  assert_non_null(to);
  return memcpy(to, from, bytes);
}

static void check_rows(const msim_scene *scene, int pins) {
  set_failure(-1, -1);
  record(scene, 1, (recorded_run){.path = "one.memory", .steps = 20, .pins = pins});
  const size_t n = FRAMES * 3 * (size_t)file.n, cells = FRAMES * (size_t)file.ncells;
  double *x = copy_bytes(file.x, n * sizeof *x), *v = copy_bytes(file.v, n * sizeof *v);
  float *strain = copy_bytes(file.strain, cells * sizeof *strain),
        *tension = copy_bytes(file.tension, cells * sizeof *tension),
        *reaction = copy_bytes(file.reaction, n * sizeof *reaction);
  const uint64_t text_hash = file.text_hash;
  assert_int_equal(file.committed, FRAMES);
  assert_int_equal(file.calls[PIECES], 0);
  const float *let_go = reaction + 3 * (size_t)(3 * file.n + 61), *held = let_go - 3 * file.n;
  if (pins) assert_true(held[2] != 0 && let_go[0] == 0 && let_go[1] == 0 && let_go[2] == 0);
  for (int32_t ranks = 2; ranks <= MOST_RANKS; ranks++) {
    set_failure(-1, -1);
    record(scene, ranks,
           (recorded_run){.path = "several.memory", .steps = 20, .asks = ranks % 2, .pins = pins});
    check_calls(ranks);
    assert_true(file.text_hash == text_hash && file.text_length > 1000);
    assert_memory_equal(file.x, x, n * sizeof *x);
    assert_memory_equal(file.v, v, n * sizeof *v);
    assert_memory_equal(file.strain, strain, cells * sizeof *strain);
    assert_memory_equal(file.tension, tension, cells * sizeof *tension);
    assert_memory_equal(file.reaction, reaction, n * sizeof *reaction);
  }
  free(x), free(v), free(strain), free(tension), free(reaction);
}

static void rows_are_those_of_one_process(void **state) {
  (void)state;
  msim_scene *scenes[2] = {cloth_with_faces(), upright_cloth()};
  for (int i = 0; i < 2; i++) {
    for (int pins = 0; pins < 2; pins++) check_rows(scenes[i], pins);
    msim_scene_destroy(scenes[i]);
  }
}

/* Faces at the first springs, which the last ones join again */
static void repeat_springs(msim_scene *scene) {
  for (int i = 0; i < 40; i++) {
    msim_scene_view view = {.size = sizeof view};
    msim_scene_get(scene, &view);
    const int32_t ij[2] = {view.ij[2 * i + 1], view.ij[2 * i]}, face[3] = {ij[0], ij[1], 149};
    const double k = 1, rest = 0.01 * (i + 1);
    assert_ok(msim_scene_add_springs(scene, 1, ij, &k, &rest, NULL, err));
    if (ij[0] != 149 && ij[1] != 149) assert_ok(msim_scene_add_faces(scene, 1, face, err));
  }
}

/* Springs, faces and pins anywhere, several springs between the same particles */
static void rows_of_random_meshes(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 6; seed++) {
    msim_scene *scene = random_mesh(150, seed, seed % 2 * 0.01);
    unsigned next = seed;
    repeat_springs(scene);
    for (int i = 0; i < 90; i++) {
      const int32_t a = (int32_t)(uniform(&next) * 147), face[3] = {a, a + 1 + i % 2, 149 - a % 2};
      assert_ok(msim_scene_add_faces(scene, 1, face, err));
    }
    check_rows(scene, 0);
    msim_scene_destroy(scene);
  }
}

static void one_rank_that_fails(void **state) {
  (void)state;
  msim_scene *scene = cloth_with_faces();
  const struct {
    int32_t rank;
    int call, commits;
  } cases[] = {{0, OPENS, 0},   {2, JOINS, 0},  {0, BEGINS, 0}, {0, PARTS, 0}, {1, PARTS, 0},
               {0, COMMITS, 1}, {0, CLOSES, 5}, {2, CLOSES, 5}, {0, PIECES, 0}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    set_failure(cases[i].rank, cases[i].call);
    record(scene, 3, (recorded_run){.path = "failed.memory", .steps = 20, .expected = MSIM_ERR_IO});
    assert_int_equal(file.calls[COMMITS], cases[i].commits);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- memory ---------------------------------------------------*/

enum { PIECE = 1 << 17, PASSING = 1 << 18 }; /* most bytes of text, ends of springs at a time */
enum { ROPE = 20000, SCENE = 57 + 32 };      /* bytes of a particle and a spring in a scene */

/* Particles and springs in the same order: a rank writes n / N of both, with one more particle. */
static msim_scene *make_rope(const msim_allocator *alloc) {
  static double x[3 * ROPE], v[3 * ROPE], mass[ROPE], k[ROPE], rest[ROPE];
  static int32_t ij[2 * ROPE];
  msim_scene *scene = NULL;
  msim_error why;
  for (int32_t i = 0; i < ROPE; i++) {
    x[3 * i] = 0.01 * i, mass[i] = 0.1, k[i] = 10, rest[i] = 0.009;
    ij[2 * i] = i, ij[2 * i + 1] = i + 1;
  }
  if (msim_scene_create(alloc, &scene, &why) ||
      msim_scene_add_particles(scene, ROPE, x, v, mass, &why) ||
      msim_scene_add_springs(scene, ROPE - 1, ij, k, rest, NULL, &why))
    return NULL;
  return scene;
}

/* The bytes of a sim in one process */
static size_t measure_alone(void) {
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  const msim_options opt = options("velocity-verlet", 1e-4);
  msim_scene *scene = make_rope(&alloc);
  assert_non_null(scene);
  const size_t loaded = m.live;
  msim_sim *sim = make_sim(scene, &opt);
  const size_t created = m.live;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  return created - loaded;
}

/* Ranks have neither the whole scene nor its state before they are asked for that: each has two
 * parts of the scene, one of its own particles and one for output, with the numbers of the former.
 * They also keep their part of `alone`, what one process keeps, and of each row its owner, its
 * place in the order, a number to gather it, and 32 bytes to send and receive it in a checkpoint.
 * While a sim is created each particle of the whole scene takes its owner, 8 bytes to gather a
 * number and 4 for its number in the part, as each spring.
 *
 * A frame takes of each x, v, what is sent and received, with the numbers of these: 48 + 2 x 12
 * bytes a row, and 8 bytes a spring; while these are looked for the ends of all springs, the pins
 * and one more array, 8 + 1 + 24. Rank 0 also has the whole scene, and a piece of its text, while
 * it makes the file. */
static const char *measure_rank(msim_comm *comm, void *data) {
  static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* of the arrays of make_rope */
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  const size_t rows = ROPE / (size_t)comm->nranks + 2, rest = 4096;
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_sim *sim;
  msim_recorder *recorder;
  msim_state whole = {.size = sizeof whole};
  msim_error why = {0};
  const size_t *alone = data;
  opt.steps = 2, opt.every = 1, opt.comm = comm, opt.recorders = recorders, opt.threads = 1;
  pthread_mutex_lock(&lock);
  msim_scene *scene = make_rope(&alloc);
  pthread_mutex_unlock(&lock);
  const size_t loaded = m.peak = m.live;
  EXPECT(scene && msim_sim_create(scene, &opt, &sim, &why) == MSIM_OK);
  msim_scene_destroy(scene);
  const size_t created = m.live;
  const size_t share = *alone / (size_t)comm->nranks + (2 * (SCENE + 4) + 48) * rows;
  EXPECT(created <= share + rest);
  if (comm->nranks == 8) EXPECT(m.peak - loaded <= share + 20 * (size_t)ROPE + 2 * rest);
  m.peak = m.live;
  EXPECT(msim_recorder_open(sim, "rope.memory", &recorder, &why) == MSIM_OK);
  const size_t opened = m.live;
  for (int i = 0; i < 2; i++) {
    EXPECT(msim_recorder_write(recorder, &why) == MSIM_OK);
    EXPECT(msim_sim_step(sim, 1, &why) == MSIM_OK);
  }
  EXPECT(m.live == opened && opened - created <= 80 * rows + rest);
  /* one after the other: the whole scene on rank 0, and what the section needs */
  const size_t section = 200 * rows + ROPE + PASSING,
               scene_on_root = comm->rank == 0 ? SCENE * ROPE + 2 * PIECE : 0;
  EXPECT(m.peak - created <= (section > scene_on_root ? section : scene_on_root) + rest);
  EXPECT(comm->rank > 0 || (file.calls[PIECES] > 5 && file.text_length > 5 * PIECE / 2));
  EXPECT(msim_sim_state(sim, &whole) == MSIM_OK);
  EXPECT(m.live - opened <= (48 + SCENE) * (size_t)ROPE + rest);
  EXPECT(msim_recorder_close(recorder, &why) == MSIM_OK);
  msim_sim_destroy(sim);
  EXPECT(m.live == 0);
  return NULL;
}

static void no_rank_has_the_whole_state(void **state) {
  (void)state;
  size_t alone = measure_alone();
  for (int32_t n = 2; n <= MOST_RANKS; n *= 2) {
    set_failure(-1, -1);
    const char *wrong = run_ranks(n, measure_rank, &alone);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
}

/*------------------------------------- .vtkhdf files --------------------------------------------*/

/* The bytes of a file, *length of them */
static char *read_file(const char *name, size_t *length) {
  FILE *f = fopen(name, "rb");
  assert_non_null(f);
  assert_int_equal(fseek(f, 0, SEEK_END), 0);
  *length = (size_t)ftell(f);
  rewind(f);
  char *bytes = malloc(*length);
  assert_non_null(bytes);
  assert_int_equal(fread(bytes, 1, *length, f), *length);
  fclose(f);
  return bytes;
}

static void check_same_files(const char *a, const char *b) {
  size_t lengths[2];
  char *bytes[2] = {read_file(a, &lengths[0]), read_file(b, &lengths[1])};
  assert_int_equal(lengths[0], lengths[1]);
  assert_memory_equal(bytes[0], bytes[1], lengths[0]);
  free(bytes[0]), free(bytes[1]);
}

/* Ranks are threads of one process, which all have the file open, and have read the scene as a
 * whole or in parts. */
static void files_are_resumed(void **state) {
  (void)state;
  msim_scene *drawn = cloth_with_faces(), *scene;
  save(drawn);
  assert_ok(msim_scene_load(NULL, path, &scene, err));
  for (int32_t n = 2; n <= 3; n++)
    for (int in_parts = 0; in_parts < 2; in_parts++) {
      recorded_run r = {.path = "parts.vtkhdf", .steps = 10, .in_parts = in_parts};
      record(scene, n, (recorded_run){.path = "whole.vtkhdf", .steps = 20});
      record(scene, n, r);
      r.steps = 20, r.resumes = 1;
      record(scene, n, r);
      check_same_files("whole.vtkhdf", "parts.vtkhdf");
    }
  msim_scene_destroy(drawn);
  msim_scene_destroy(scene);
}

int main(void) {
  char folder[] = "/tmp/msim_rank_recorders_XXXXXX";
  if (!mkdtemp(folder) || chdir(folder)) return 1;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(rows_are_those_of_one_process),
      cmocka_unit_test(rows_of_random_meshes),
      cmocka_unit_test(one_rank_that_fails),
      cmocka_unit_test(no_rank_has_the_whole_state),
      cmocka_unit_test(files_are_resumed),
  };
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (const char *const *name =
           (const char *[]){"one.memory", "several.memory", "failed.memory", "rope.memory",
                            "whole.vtkhdf", "parts.vtkhdf", path, NULL};
       *name; name++)
    remove(*name);
  return chdir("/") || rmdir(folder) || failed;
}
