/* Tests of scenes that ranks read in parts: the parts one behind the other are the file, runs have
 * the bits of one process, memory falls with the number of ranks, and a failure of memory or
 * communication is one of all ranks. */
#define _GNU_SOURCE /* mkdtemp */
#include <stdatomic.h>
#include <stdio.h>
#include <unistd.h>

#include "counting_allocator.h"
#include "drawn_scenes.h"
#include "failing_comm.h"
#include "peak_allocator.h"
#include "rank_runs.h"
#include "scene_part_file.h"
#include "scene/section.h"
#include "sim/rank_scene.h"

/*------------------------------------- parts ----------------------------------------------------*/

/* Rows of a part behind those of the parts of lower ranks */
typedef struct rows_so_far {
  int64_t particles, springs, faces;
} rows_so_far;

static void check_rows(const ms_scene *part, const ms_scene *whole, rows_so_far *at) {
  const int64_t n = part->nparticles, m = part->nsprings, p = at->particles, e = at->springs;
  const size_t real = sizeof(double);
  assert_true(is_same(part->x, whole->x + 3 * p, 3 * n, real));
  assert_true(is_same(part->v, whole->v + 3 * p, 3 * n, real));
  assert_true(is_same(part->mass, whole->mass + p, n, real));
  assert_true(is_same(part->pinned, whole->pinned + p, n, 1));
  assert_int_equal(!part->force, !whole->force);
  if (part->force) assert_true(is_same(part->force, whole->force + 3 * p, 3 * n, real));
  assert_true(is_same(part->ij, whole->ij + 2 * e, 2 * m, sizeof *part->ij));
  assert_true(is_same(part->k, whole->k + e, m, real));
  assert_true(is_same(part->rest, whole->rest + e, m, real));
  assert_true(is_same(part->damping, whole->damping + e, m, real));
  assert_true(is_same(part->faces, whole->faces + 3 * at->faces, 3 * (int64_t)part->nfaces,
                      sizeof *part->faces));
  at->particles += n, at->springs += m, at->faces += part->nfaces;
}

static void check_parts(const msim_scene *whole, int32_t nranks) {
  rows_so_far at = {0};
  for (int32_t r = 0; r < nranks; r++) {
    msim_scene *part;
    assert_ok(msim_scene_load_part(NULL, path, r, nranks, &part, err));
    assert_non_null(part->part);
    assert_int_equal(part->data->nparticles, 0);
    assert_string_equal(part->data->name, whole->data->name);
    assert_memory_equal(&part->data->external, &whole->data->external,
                        sizeof whole->data->external);
    check_rows(part->part->rows, whole->data, &at);
    msim_scene_destroy(part);
  }
  assert_int_equal(at.particles, whole->data->nparticles);
  assert_int_equal(at.springs, whole->data->nsprings);
  assert_int_equal(at.faces, whole->data->nfaces);
}

/* Arrays that are longer than what is read at a time, 2^17 numbers */
static msim_scene *draw_large_scene(const msim_allocator *alloc) {
  enum { N = 60000, M = 140000, F = 50000 };
  double *x = malloc(3 * N * sizeof *x), *v = malloc(3 * N * sizeof *v),
         *mass = malloc(N * sizeof *mass), *k = malloc(M * sizeof *k);
  int32_t *ij = malloc(2 * M * sizeof *ij), *faces = malloc(3 * F * sizeof *faces);
  unsigned seed = 4;
  msim_scene *scene;
  for (int32_t i = 0; i < 3 * N; i++) x[i] = draw(&seed), v[i] = draw(&seed);
  for (int32_t i = 0; i < N; i++) mass[i] = 1.5 + draw(&seed);
  for (int32_t e = 0; e < M; e++) {
    ij[2 * e] = draw_index(&seed, N), ij[2 * e + 1] = (ij[2 * e] + 1 + e % 7) % N;
    k[e] = 2 + draw(&seed);
  }
  for (int32_t i = 0; i < F; i++)
    for (int32_t c = 0; c < 3; c++) faces[3 * i + c] = (i + c * (1 + i % 5)) % N;
  assert_ok(msim_scene_create(alloc, &scene, err));
  assert_ok(msim_scene_add_particles(scene, N, x, v, mass, err));
  assert_ok(msim_scene_add_springs(scene, M, ij, k, k, NULL, err));
  assert_ok(msim_scene_add_faces(scene, F, faces, err));
  free(x), free(v), free(mass), free(k), free(ij), free(faces);
  return scene;
}

static void parts_are_the_file(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 50; seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    save(scene);
    for (int32_t n = 2; n <= 8; n += 1 + (int32_t)seed % 3) check_parts(scene, n);
    msim_scene_destroy(scene);
  }
  msim_scene *scene = draw_large_scene(NULL);
  save(scene);
  for (int32_t n = 2; n <= 5; n++) check_parts(scene, n);
  msim_scene_destroy(scene);
}

/* Files that ranks read as a whole */
static void check_whole(const char *name, int32_t nranks) {
  msim_scene *whole, *scene;
  assert_ok(msim_scene_load(NULL, name, &whole, err));
  for (int32_t r = 0; r < nranks; r++) {
    assert_ok(msim_scene_load_part(NULL, name, r, nranks, &scene, err));
    assert_null(scene->part);
    assert_true(are_same_scenes(scene->data, whole->data));
    msim_scene_destroy(scene);
  }
  msim_scene_destroy(whole);
}

static void other_scenes_are_whole(void **state) {
  (void)state;
  const msim_law law = {.size = sizeof law, .kind = MSIM_LAW_DEAD_BAND, .half_width = 0.1};
  const int32_t end = 0, ijk[3] = {0, 1, 2};
  const double t[2] = {0, 1}, x[6] = {0}, k = 1;
  const msim_motion motion = {
      .size = sizeof motion, .n = 1, .particles = &end, .nt = 2, .t = t, .x = x};
  msim_scene *scene = hanging_cloth(5, 100, 0);
  save(scene);
  check_whole(path, 1);
  check_whole(path, 26);
  assert_ok(msim_scene_save(scene, "scene.json", err));
  check_whole("scene.json", 2);
  assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, NULL, NULL, err));
  save(scene);
  check_whole(path, 2);
  msim_scene_destroy(scene);
  scene = hanging_cloth(5, 100, 0);
  assert_ok(msim_scene_add_motion(scene, &motion, err));
  save(scene);
  check_whole(path, 2);
  msim_scene_destroy(scene);
  scene = hanging_cloth(5, 100, 0);
  assert_ok(msim_scene_add_law(scene, &law, NULL, err));
  save(scene);
  check_whole(path, 2);
  msim_scene_destroy(scene);
}

/*------------------------------------- runs -----------------------------------------------------*/

/* As run_rank of rank_runs.h, from parts of the file */
static const char *run_part(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_error why = {0};
  msim_sim *sim;
  msim_scene *part;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  EXPECT(comm->nranks == 1 || part->part);
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_OK);
  msim_scene_destroy(part);
  EXPECT(msim_sim_step(sim, r->steps, &why) == MSIM_OK);
  const char *wrong = compare_with_run(sim, r);
  msim_sim_destroy(sim);
  return wrong;
}

static void check_run_of_parts(const msim_scene *scene, const char *method, double h) {
  save(scene);
  run r = run_alone(scene, options(method, h), 20);
  for (int32_t n = 1; n <= MOST_RANKS; n++) {
    const char *wrong = run_ranks(n, run_part, &r);
    if (wrong) fail_msg("%s, %d ranks: %s", method, n, wrong);
  }
  free_run(&r);
}

static void runs_have_the_bits_of_one_process(void **state) {
  (void)state;
  const msim_plane plane = {.normal = {0, 0, 1}, .offset = -0.2, .restitution = 0.5};
  msim_scene *mesh = random_mesh(300, 3, 0.01), *cloth = hanging_cloth(9, 300, 0.02);
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++)
    if (is_tested(method) && takes_positions_only(method) == 0)
      check_run_of_parts(mesh, method, 1e-3);
  check_run_of_parts(cloth, "velocity-verlet", 1e-3);
  assert_ok(msim_scene_add_plane(cloth, &plane, err));
  check_run_of_parts(cloth, "velocity-verlet", 1e-3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(mesh);
  for (unsigned seed = 1; seed <= 40; seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    check_run_of_parts(scene, seed % 3 ? "velocity-verlet" : "rk4", 1e-3);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- parts of sims --------------------------------------------*/

/* What a sim keeps is the same, whether ranks have read the whole scene or parts. */
static const char *compare_kept(const msim_comm *comm, const msim_sim *a, const msim_sim *b) {
  const msim_error why = {0};
  const ms_rank_scene *k = a->kept, *l = b->kept;
  const ms_rank_part *p = a->part, *q = b->part;
  const ms_unknowns *u = &a->islands->model.unknowns, *w = &b->islands->model.unknowns;
  const int64_t own = ms_rank_part_count(p, comm->rank);
  EXPECT(k && l && k->nparticles == l->nparticles && k->nsprings == l->nsprings);
  EXPECT(are_same_scenes(a->scene, b->scene) && are_same_scenes(k->slice, l->slice));
  EXPECT(is_same(k->particle, l->particle, a->scene->nparticles, 4));
  EXPECT(is_same(k->spring, l->spring, a->scene->nsprings, 4));
  EXPECT(is_same(k->owner, l->owner, k->is.n, 4) && memcmp(&k->is, &l->is, sizeof k->is) == 0);
  EXPECT(is_same(p->place, q->place, own, 4) && is_same(p->bytes, q->bytes, comm->nranks, 8));
  EXPECT(p->whole.n == q->whole.n && is_same(p->whole.hash, q->whole.hash, p->whole.n, 8));
  EXPECT(!p->owner && !q->owner && !q->number && !l->order);
  EXPECT(u->dims == w->dims && u->stride == w->stride && u->nfree == w->nfree);
  EXPECT(is_same(u->particle, w->particle, u->stride, 4));
  EXPECT(a->monitor.start_bound == b->monitor.start_bound);
  EXPECT(a->monitor.extent == b->monitor.extent && a->monitor.least_mass == b->monitor.least_mass);
  EXPECT(is_same(a->scene_hashes, b->scene_hashes, MS_SCENE_HASHES, 8));
  return NULL;
}

/* The last note of a sim */
static void keep_note(const char *text, void *user) { snprintf(user, 300, "%s", text); }

/* data: the step */
static const char *compare_sims(msim_comm *comm, void *data) {
  msim_options opt = options("velocity-verlet", *(const double *)data);
  msim_error why = {0};
  char notes[2][300] = {"", ""};
  msim_scene *scenes[2];
  msim_sim *sims[2];
  opt.comm = comm, opt.threads = 1, opt.warn = keep_note;
  EXPECT(msim_scene_load(NULL, path, &scenes[0], &why) == MSIM_OK);
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &scenes[1], &why) == MSIM_OK);
  for (int i = 0; i < 2; i++) {
    opt.warn_user = notes[i];
    EXPECT(msim_sim_create(scenes[i], &opt, &sims[i], &why) == MSIM_OK);
    msim_scene_destroy(scenes[i]);
  }
  const char *wrong = compare_kept(comm, sims[0], sims[1]);
  EXPECT(strcmp(notes[0], notes[1]) == 0);
  for (int i = 0; i < 2; i++) msim_sim_destroy(sims[i]);
  return wrong;
}

static void compare_all_sims(const msim_scene *scene, double h, unsigned seed) {
  save(scene);
  for (int32_t n = 2; n <= MOST_RANKS; n += 1 + (int32_t)seed % 3) {
    const char *wrong = run_ranks(n, compare_sims, &h);
    if (wrong) fail_msg("seed %u, %d ranks: %s", seed, n, wrong);
  }
}

/* Every third one in a plane that nothing leaves, the others above planes or behind them */
static void sims_of_parts_are_those_of_the_whole(void **state) {
  (void)state;
  const double zero[3] = {0};
  for (unsigned seed = 1; seed <= 60; seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    const msim_plane plane = {.normal = {0, 0, 1}, .offset = -3 + (double)(seed % 5)};
    ms_scene *s = scene->data;
    for (int32_t p = 0; p < s->nparticles && seed % 3 == 0; p++)
      s->x[3 * p + 1] = 0.5, s->v[3 * p + 1] = 0;
    for (int32_t p = 0; p < s->nparticles && seed % 3 == 0 && s->force; p++)
      s->force[3 * p + 1] = 0;
    if (seed % 3 == 0) assert_ok(msim_scene_set_gravity(scene, zero, err));
    else assert_ok(msim_scene_add_plane(scene, &plane, err));
    compare_all_sims(scene, seed % 4 ? 1e-4 : 10, seed);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- memory ---------------------------------------------------*/

/* A particle has 57 bytes and takes 80 while it is read, a spring 32, a face 12; a part of an array
 * 1 MiB. Shorter arrays, as that of masses, are read at once. */
static void memory_falls_with_ranks(void **state) {
  (void)state;
  msim_scene *scene = draw_large_scene(NULL);
  save(scene);
  for (int32_t n = 1; n <= 8; n *= 2)
    for (int32_t r = 0; r < n; r++) {
      const ms_section is = ms_section_of_rank(scene->data, r, n);
      const size_t rows = 57 * (size_t)is.n + 32 * (size_t)is.nsprings + 12 * (size_t)is.nfaces,
                   first = 137 * (size_t)is.n, rest = 1 << 14,
                   masses = 8 * (size_t)scene->data->nparticles;
      peak_allocator m = {0};
      const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
      msim_scene *part;
      assert_ok(msim_scene_load_part(&alloc, path, r, n, &part, err));
      assert_true(m.live <= rows + rest);
      assert_true(m.peak <= (rows > first ? rows : first) + masses + (1 << 20) + rest);
      msim_scene_destroy(part);
      assert_int_equal(m.live, 0);
    }
  msim_scene_destroy(scene);
}

typedef struct shared_memory {
  size_t alone; /* bytes of the sim of one process */
  const ms_scene *scene;
} shared_memory;

/* A rank has what it keeps, its share of a sim in one process and of the scene, twice, with at most
 * 60 bytes a row in messages; rank 0 the layout of the whole scene, too, 37 bytes a particle and 40
 * a spring, with owners, pins and ends, 5 and 8. */
static const char *measure_creation(msim_comm *comm, void *data) {
  const shared_memory *of = data;
  const size_t n = (size_t)comm->nranks, rows = (size_t)of->scene->nparticles,
               springs = (size_t)of->scene->nsprings, faces = (size_t)of->scene->nfaces,
               scene = 57 * rows + 32 * springs + 12 * faces, root = 42 * rows + 48 * springs;
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_sim *sim;
  msim_scene *part;
  opt.comm = comm, opt.threads = 1;
  EXPECT(msim_scene_load_part(&alloc, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  m.peak = m.live;
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_OK);
  const size_t share = (of->alone + 2 * scene + 60 * rows) / n + (1 << 16),
               most = comm->rank == 0 && share < root + scene / n ? root + scene / n : share;
  EXPECT(m.peak <= most + most / 10);
  msim_scene_destroy(part);
  msim_sim_destroy(sim);
  EXPECT(m.live == 0);
  return NULL;
}

static void creation_falls_with_ranks(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(150, 100, 0);
  const msim_options opt = options("velocity-verlet", 1e-4);
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  msim_scene *alone;
  save(scene);
  assert_ok(msim_scene_load(&alloc, path, &alone, err));
  const size_t loaded = m.live;
  msim_sim *sim = make_sim(alone, &opt);
  shared_memory of = {m.live - loaded, scene->data};
  msim_sim_destroy(sim);
  msim_scene_destroy(alone);
  for (int32_t n = 2; n <= 8; n *= 2) {
    const char *wrong = run_ranks(n, measure_creation, &of);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
  msim_scene_destroy(scene);
}

/*------------------------------------- failures -------------------------------------------------*/

static void each_allocation_of_a_load_fails(void **state) {
  (void)state;
  msim_scene *scene = draw_large_scene(NULL), *part;
  save(scene);
  counting_allocator count = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &count};
  int64_t fail_at = 0;
  for (msim_status status = MSIM_ERR_MEMORY; status; fail_at++) {
    msim_error why;
    count.calls = 0, count.fail_at = fail_at;
    status = msim_scene_load_part(&alloc, path, 1, 3, &part, &why);
    if (!status) msim_scene_destroy(part);
    else assert_int_equal(status, MSIM_ERR_MEMORY);
    if (status) assert_non_null(strstr(why.text, "out of memory"));
    assert_int_equal(count.live, 0);
  }
  assert_true(fail_at > 30);
  msim_scene_destroy(scene);
}

/* The allocation or call `fail_at` of one rank fails while the sim is created. */
typedef struct failure_case {
  int32_t rank;
  int64_t fail_at;
  int of_calls;
  atomic_int succeeded;
} failure_case;

static const char *check_failure(msim_comm *inner, void *data) {
  failure_case *k = data;
  const int fails = inner->rank == k->rank;
  failing_comm failing = failing_comm_of(inner, fails && k->of_calls ? k->fail_at : -1);
  const msim_comm *comm = &failing.table;
  counting_allocator count = {.fail_at = -1};
  const msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free,
                                &count};
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_energy e = {.size = sizeof e};
  msim_sim *sim;
  msim_scene *part;
  failing.table.self = &failing;
  opt.comm = comm, opt.threads = 1;
  EXPECT(msim_scene_load_part(&alloc, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  const int64_t before = count.live;
  if (fails && !k->of_calls) count.fail_at = count.calls + k->fail_at;
  const msim_status status = msim_sim_create(part, &opt, &sim, &why);
  const int64_t made = k->of_calls ? failing.calls : count.calls;
  const int has_failed = count.fail_at >= 0 ? made > count.fail_at : made > k->fail_at;
  count.fail_at = -1;
  EXPECT(!status || status == (k->of_calls ? MSIM_ERR_BACKEND : MSIM_ERR_MEMORY));
  EXPECT(!sim || k->of_calls || msim_sim_energy(sim, &e) == MSIM_OK);
  EXPECT(!sim || k->of_calls || msim_sim_step(sim, 2, &why) == MSIM_OK);
  if (fails && !has_failed) k->succeeded = 1;
  msim_sim_destroy(sim);
  EXPECT(count.live == before);
  msim_scene_destroy(part);
  return NULL;
}

static void failures_of_one_rank_are_those_of_all(void **state) {
  (void)state;
  for (unsigned seed = 5; seed < 7; seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    save(scene);
    for (int of_calls = 0; of_calls < 2; of_calls++)
      for (int32_t rank = 0; rank < 3; rank++) {
        failure_case k = {.rank = rank, .of_calls = of_calls};
        for (; !k.succeeded; k.fail_at++) {
          const char *wrong = run_ranks(3, check_failure, &k);
          if (wrong) fail_msg("rank %d, failure %d: %s", rank, (int)k.fail_at, wrong);
        }
        assert_true(k.fail_at > (of_calls ? 20 : 60));
      }
    msim_scene_destroy(scene);
  }
}

int main(void) {
  char folder[] = "/tmp/msim_rank_load_XXXXXX";
  if (!mkdtemp(folder) || chdir(folder)) return 1;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(parts_are_the_file),
      cmocka_unit_test(other_scenes_are_whole),
      cmocka_unit_test(runs_have_the_bits_of_one_process),
      cmocka_unit_test(sims_of_parts_are_those_of_the_whole),
      cmocka_unit_test(memory_falls_with_ranks),
      cmocka_unit_test(creation_falls_with_ranks),
      cmocka_unit_test(each_allocation_of_a_load_fails),
      cmocka_unit_test(failures_of_one_rank_are_those_of_all),
  };
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (const char *const *name = (const char *[]){path, "scene.json", NULL}; *name; name++)
    remove(*name);
  return chdir("/") || rmdir(folder) || failed;
}
