/* Tests of the creation of sims whose scene ranks have read in parts: its memory falls with the
 * number of ranks, and a failure of memory or communication is one of all ranks. */
#define _GNU_SOURCE /* mkdtemp */
#include <stdio.h>
#include <unistd.h>

#include "drawn_scenes.h"
#include "moving_colliders.h"
#include "peak_allocator.h"
#include "rank_failures.h"
#include "scene_part_file.h"

/*------------------------------------- memory ---------------------------------------------------*/

typedef struct shared_memory {
  msim_options opt;
  int has_whole; /* 1: rank 0 has the whole scene for a moment */
  size_t alone;  /* bytes of the sim of one process */
  const ms_scene *scene;
} shared_memory;

/* A rank has what it keeps, its share of a sim in one process and of the scene, twice, with at most
 * 60 bytes a row in messages; rank 0 the layout of the whole scene, too, 37 bytes a particle and 40
 * a spring, with owners, pins and ends, 5 and 8, and, with h = auto, also under error control, the
 * whole scene and 40 bytes a particle, beside its part, section and order, 8 bytes a spring. */
static const char *measure_creation(msim_comm *comm, void *data) {
  const shared_memory *of = data;
  const size_t n = (size_t)comm->nranks, rows = (size_t)of->scene->nparticles,
               springs = (size_t)of->scene->nsprings, faces = (size_t)of->scene->nfaces,
               scene = 57 * rows + 32 * springs + 12 * faces, order = 42 * rows + 48 * springs;
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  msim_options opt = of->opt;
  msim_error why = {0};
  msim_energy e = {.size = sizeof e};
  msim_sim *sim;
  msim_scene *part;
  opt.comm = comm, opt.threads = 1;
  EXPECT(msim_scene_load_part(&alloc, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  m.peak = m.live;
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_OK);
  const size_t share = (of->alone + 2 * scene + 60 * rows) / n + (1 << 16),
               own = (2 * scene + 60 * rows + 8 * springs) / n,
               bounds = of->has_whole ? scene + 40 * rows + own : 0,
               root = order + scene / n > bounds ? order + scene / n : bounds,
               most = comm->rank == 0 && share < root ? root : share;
  EXPECT(m.peak <= most + most / 10);
  EXPECT(msim_sim_energy(sim, &e) == MSIM_OK); /* more springs pass by than at a time */
  msim_scene_destroy(part);
  msim_sim_destroy(sim);
  EXPECT(m.live == 0);
  return NULL;
}

static void check_memory(const msim_scene *scene, msim_options opt) {
  peak_allocator m = {0};
  const msim_allocator alloc = {sizeof alloc, peak_allocator_alloc, peak_allocator_free, &m};
  msim_scene *alone;
  opt.solver = "pcg";
  assert_ok(msim_scene_load(&alloc, path, &alone, err));
  const size_t loaded = m.live;
  msim_sim *sim = make_sim(alone, &opt);
  shared_memory of = {opt, opt.h == MSIM_H_AUTO, m.live - loaded, scene->data};
  msim_sim_destroy(sim);
  msim_scene_destroy(alone);
  for (int32_t n = 2; n <= 8; n *= 2) {
    const char *wrong = run_ranks(n, measure_creation, &of);
    if (wrong) fail_msg("%s, %d ranks: %s", opt.integrator, n, wrong);
  }
}

static void creation_falls_with_ranks(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(150, 100, 0);
  save(scene);
  const char *const methods[] = {"velocity-verlet", "rkc", "verlet", "takahashi-imada",
                                 "linearly-implicit-euler"};
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
    check_memory(scene, options(methods[i], 1e-4));
  check_memory(scene, options("velocity-verlet", MSIM_H_AUTO));
  check_memory(scene, controlled("dop853", 1e-6, 0.002));
  check_memory(scene, controlled("linearly-implicit-euler", 1e-6, 0.002));
  add(scene, sphere(0.5, 0.5, -0.3, 0.2, 0.5, 0), 0);
  set_uniform(scene, (double[3]){0.5, 0.5, -0.3}, (double[3]){0, 0, 1}, NULL);
  save(scene);
  check_memory(scene, options("velocity-verlet", 1e-4));
  check_memory(scene, options("linearly-implicit-euler", 1e-4));
  msim_scene_destroy(scene);
}

/*------------------------------------- failures -------------------------------------------------*/

static msim_scene *load_part(const msim_comm *comm, const msim_allocator *alloc, const void *from) {
  msim_scene *part = NULL;
  msim_scene_load_part(alloc, path, comm->rank, comm->nranks, &part, NULL);
  if (part && *(const int *)from) forget_rest(part);
  return part;
}

static void check_failures(msim_scene *scene, msim_options opt, int lacks_rest) {
  save(scene);
  check_rank_failures(&(rank_failures){.load = load_part,
                                       .from = &lacks_rest,
                                       .use = msim_sim_create,
                                       .opt = opt,
                                       .least = {60, 20}});
  msim_scene_destroy(scene);
}

static void failures_of_one_rank_are_those_of_all(void **state) {
  (void)state;
  check_failures(draw_scene(NULL, 5), options("velocity-verlet", 1e-4), 1);
  check_failures(draw_scene(NULL, 6), options("velocity-verlet", 1e-4), 0);
  check_failures(hanging_cloth(5, 300, 0), options("verlet", MSIM_H_AUTO), 0);
  check_failures(draw_scene(NULL, 7), controlled("dop853", 1e-6, 0.002), 0);
  msim_scene *above = hanging_cloth(5, 300, 0.01);
  add(above, sphere(0.5, 0.5, -0.2001, 0.2, 0.5, 0), 0);
  check_failures(above, options("linearly-implicit-euler", 1e-4), 0);
}

int main(void) {
  char folder[] = "/tmp/msim_rank_load_creation_XXXXXX";
  if (!mkdtemp(folder) || chdir(folder)) return 1;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(creation_falls_with_ranks),
      cmocka_unit_test(failures_of_one_rank_are_those_of_all),
  };
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (const char *const *name = (const char *[]){path, NULL}; *name; name++) remove(*name);
  return chdir("/") || rmdir(folder) || failed;
}
