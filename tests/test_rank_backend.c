/* Tests of backends of systems that several ranks share: rows, columns and numbers of ghosts, and
 * products and preconditioners without a matrix (matrix_free_backend.c). The backend here gathers
 * the whole matrix on every rank and solves with it by elimination, which fails or gives other
 * velocities than one process if any of them is wrong. */
#include <stdatomic.h>

#include "angle_scenes.h"
#include "counting_allocator.h"
#include "laws.h"
#include "msim/backend.h"
#include "rank_runs.h"

enum { MOST = 700 }; /* scalar rows of all ranks */

typedef struct gathering_backend {
  int32_t n; /* scalar rows of all ranks */
  double *a; /* n^2, by rows */
} gathering_backend;

static msim_status gather_create(const msim_host *host, void **self) {
  (void)host;
  *self = calloc(1, sizeof(gathering_backend));
  return *self ? MSIM_OK : MSIM_ERR_MEMORY;
}

static void gather_destroy(void *self) {
  if (self) free(((gathering_backend *)self)->a);
  free(self);
}

static msim_status gather_analyze(void *self, const msim_system *A, msim_solve_info *info) {
  (void)info;
  gathering_backend *g = self;
  double n = A->n * A->block;
  if (A->comm) A->comm->sum(A->comm->self, 1, &n);
  g->n = (int32_t)n;
  if (g->n > MOST) return MSIM_ERR_ARG;
  g->a = calloc((size_t)g->n * (size_t)g->n, sizeof *g->a);
  for (int32_t k = 0; k < A->nghosts; k++) /* owned by others, ascending from each */
    if (A->ghost[k] < 0 || A->ghost[k] >= g->n / A->block ||
        (A->ghost[k] >= A->first && A->ghost[k] < A->first + A->n))
      return MSIM_ERR_BACKEND;
  return g->a ? MSIM_OK : MSIM_ERR_MEMORY;
}

static int64_t number_of(const msim_system *A, int32_t scalar) {
  const int32_t k = scalar / A->block;
  return A->block * (k < A->n ? A->first + k : A->ghost[k - A->n]) + scalar % A->block;
}

/* Each number belongs to one rank, so that sums gather them. */
static void gather_numbers(const msim_system *A, int32_t n, double *numbers) {
  if (A->comm) A->comm->sum(A->comm->self, n, numbers);
}

static msim_status gather_factor(void *self, const msim_system *A, int32_t kind,
                                 msim_solve_info *info) {
  (void)kind, (void)info;
  gathering_backend *g = self;
  const int32_t columns = A->block * (A->n + A->nghosts);
  memset(g->a, 0, (size_t)g->n * (size_t)g->n * sizeof *g->a);
  for (int32_t r = 0; r < A->block * A->n; r++)
    for (int32_t e = A->rowptr[r]; e < A->rowptr[r + 1]; e++) {
      if (A->colind[e] >= columns) return MSIM_ERR_BACKEND;
      g->a[g->n * number_of(A, r) + number_of(A, A->colind[e])] = A->val[e];
    }
  for (int32_t r = 0; r < g->n; r++) gather_numbers(A, g->n, g->a + (size_t)g->n * (size_t)r);
  for (int32_t i = 0; i < g->n; i++)
    for (int32_t j = 0; j < i; j++) {
      const double one = g->a[g->n * i + j], other = g->a[g->n * j + i];
      if (fabs(one - other) > 1e-12 * (fabs(g->a[g->n * i + i]) + fabs(one)))
        return MSIM_ERR_BACKEND;
    }
  return MSIM_OK;
}

/* Gaussian elimination, which a positive definite matrix needs no pivoting for */
static void eliminate(int32_t n, double *a, double *b) {
  for (int32_t k = 0; k < n; k++)
    for (int32_t i = k + 1; i < n; i++) {
      const double factor = a[n * i + k] / a[n * k + k];
      for (int32_t j = k; j < n && factor != 0; j++) a[n * i + j] -= factor * a[n * k + j];
      b[i] -= factor * b[k];
    }
  for (int32_t i = n; i-- > 0;) {
    for (int32_t j = i + 1; j < n; j++) b[i] -= a[n * i + j] * b[j];
    b[i] /= a[n * i + i];
  }
}

static msim_status gather_solve(void *self, const msim_system *A, const msim_solve_params *params,
                                int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  (void)params;
  const gathering_backend *g = self;
  const size_t n = (size_t)g->n, own = (size_t)(A->n * A->block);
  double *a = calloc(n * n, sizeof *a), *x = calloc(n, sizeof *x);
  for (size_t k = 0; k < (size_t)nrhs && a && x; k++) {
    memcpy(a, g->a, n * n * sizeof *a);
    memset(x, 0, n * sizeof *x);
    for (size_t r = 0; r < own; r++) x[number_of(A, (int32_t)r)] = b[own * k + r];
    gather_numbers(A, g->n, x);
    eliminate(g->n, a, x);
    for (size_t r = 0; r < own; r++) y[own * k + r] = x[number_of(A, (int32_t)r)];
  }
  info->iterations = 1;
  free(a), free(x);
  return a && x ? MSIM_OK : MSIM_ERR_MEMORY;
}

static const msim_backend gathering = {.abi = MSIM_BACKEND_ABI,
                                       .size = sizeof gathering,
                                       .name = "gathering",
                                       .library = "none",
                                       .license = "none",
                                       .flags = MSIM_BACKEND_ITERATIVE | MSIM_BACKEND_RANKS,
                                       .format = MSIM_FORMAT_FULL,
                                       .create = gather_create,
                                       .analyze = gather_analyze,
                                       .factor = gather_factor,
                                       .solve = gather_solve,
                                       .destroy = gather_destroy};

/*------------------------------------- runs -----------------------------------------------------*/

const msim_backend *msim_backend_matrix_free(void);

static const msim_backend *backends[] = {&gathering, NULL /* matrix_free */, NULL};

static const char *check_shared_run(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_state s = {.size = sizeof s};
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, r->steps, &why) == MSIM_OK);
  EXPECT(msim_sim_state(sim, &s) == MSIM_OK);
  double off = 0, most = 0;
  for (int32_t i = 0; i < 3 * s.n; i++) {
    off = fmax(off, fabs(s.v[i] - r->expected.v[i]));
    most = fmax(most, fabs(r->expected.v[i]));
  }
  msim_sim_destroy(sim);
  snprintf(why.text, sizeof why.text, "off by %g of %g", off, most);
  EXPECT(off <= 1e-9 * most);
  return NULL;
}

static void check_shared(const char *name, msim_scene *scene, double h) {
  msim_options opt = options("linearly-implicit-euler", h);
  opt.solver = "pcg", opt.solver_rtol = 1e-13, opt.solver_max_iterations = 10000;
  run r = run_alone(scene, opt, 3);
  r.opt.solver_rtol = 1e-12, r.opt.backends = backends;
  for (int i = 0; i < 2; i++)
    for (int32_t n = 1; n <= 4; n++) {
      r.opt.solver = backends[i]->name;
      const char *wrong = run_ranks(n, check_shared_run, &r);
      if (wrong) fail_msg("%s, %s, %d ranks: %s", name, r.opt.solver, n, wrong);
    }
  free_run(&r);
  msim_scene_destroy(scene);
}

static void velocities_are_those_of_one_process(void **state) {
  (void)state;
  check_shared("cloth", hanging_cloth(12, 800, 0.01), 5e-3);
  check_shared("jelly", pinned_block(5, 1, 3000, 0), 5e-3);
  check_shared("mesh", random_mesh(150, 1, 0.02), 2e-3);
  check_shared("laws", law_net(60, 300, 0, 0.1, 3), 1e-3);
  check_shared("planar laws", law_net(60, 300, 1, 0.1, 3), 1e-3);
  check_shared("bending cloth", bending_cloth(10, 400, 0.01, 0.001), 5e-3);
}

/* The iterations of three steps of stiff cloth, of which block Jacobi takes five times as many */
static const char *count_iterations(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_stats stats = {.size = sizeof stats};
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, 3, &why) == MSIM_OK);
  EXPECT(msim_sim_stats(sim, &stats) == MSIM_OK);
  msim_sim_destroy(sim);
  snprintf(why.text, sizeof why.text, "%lld iterations", (long long)stats.iterations);
  EXPECT(stats.iterations > 0.8 * r->steps && stats.iterations < 1.25 * r->steps);
  return NULL;
}

static void two_levels_take_the_iterations_of_pcg(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(40, 20000, 0.01);
  msim_options opt = options("linearly-implicit-euler", 0.01);
  opt.solver = "pcg";
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, 3, err));
  opt.solver = "matrix_free", opt.backends = backends;
  run r = {.scene = scene, .opt = opt, .steps = (int32_t)stats_of(sim).iterations};
  for (int32_t n = 1; n <= 4; n++) {
    const char *wrong = run_ranks(n, count_iterations, &r);
    if (wrong) fail_msg("%d ranks, %d iterations of pcg: %s", n, r.steps, wrong);
  }
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

/* A backend that does not know of ranks is refused. */
static const char *check_unshared(msim_comm *comm, void *data) {
  msim_options opt = *(const msim_options *)data;
  msim_scene *scene = hanging_cloth(6, 100, 0);
  msim_sim *sim = NULL;
  msim_error why = {0};
  opt.comm = comm;
  EXPECT(msim_sim_create(scene, &opt, &sim, &why) == MSIM_ERR_UNSUPPORTED);
  EXPECT(strstr(why.text, "that solver; use solver = pcg or petsc"));
  msim_scene_destroy(scene);
  return NULL;
}

static void other_backends_are_refused(void **state) {
  (void)state;
  msim_backend alone = gathering;
  const msim_backend *tables[] = {&alone, NULL};
  msim_options opt = options("linearly-implicit-euler", 1e-3);
  alone.flags = MSIM_BACKEND_ITERATIVE;
  opt.solver = "gathering", opt.backends = tables;
  const char *wrong = run_ranks(2, check_unshared, &opt);
  if (wrong) fail_msg("%s", wrong);
}

/* Rank 1 has a scene of its own, whose allocation `fail_at` fails. */
typedef struct memory_case {
  const char *solver;
  int64_t fail_at;
  atomic_int succeeded;
} memory_case;

static const char *check_memory(msim_comm *comm, void *data) {
  memory_case *c = data;
  counting_allocator count = {.fail_at = -1};
  msim_allocator alloc = {sizeof alloc, counting_allocator_alloc, counting_allocator_free, &count};
  const double x[12] = {0, 0, 0, 1, 0, 0, 2, 0, 1, 3, 0, 0}, mass[4] = {1, 1, 1, 1},
               k[3] = {9, 9, 9};
  const int32_t ij[6] = {0, 1, 1, 2, 2, 3};
  msim_options opt = options("linearly-implicit-euler", 1e-3);
  msim_scene *scene = NULL;
  msim_sim *sim = NULL;
  msim_error why = {0};
  EXPECT(!msim_scene_create(&alloc, &scene, NULL) &&
         !msim_scene_add_particles(scene, 4, x, NULL, mass, NULL) &&
         !msim_scene_add_springs(scene, 3, ij, k, NULL, NULL, NULL));
  opt.comm = comm, opt.threads = 1, opt.solver = c->solver, opt.backends = backends;
  if (comm->rank == 1) count.fail_at = count.calls + c->fail_at;
  const msim_status status = msim_sim_create(scene, &opt, &sim, &why);
  count.fail_at = -1;
  EXPECT(status == MSIM_OK || (status == MSIM_ERR_MEMORY && !sim));
  if (!status) EXPECT(msim_sim_step(sim, 2, &why) == MSIM_OK);
  if (!status && comm->rank == 0) c->succeeded = 1;
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
  EXPECT(count.live == 0);
  return NULL;
}

static void each_allocation_that_fails_is_a_failure_on_all_ranks(void **state) {
  (void)state;
  for (int i = 0; i < 2; i++) {
    memory_case c = {.solver = backends[i]->name};
    for (; !c.succeeded; c.fail_at++) {
      const char *wrong = run_ranks(2, check_memory, &c);
      if (wrong) fail_msg("%s, allocation %d: %s", c.solver, (int)c.fail_at, wrong);
    }
    assert_true(c.fail_at > 60);
  }
}

int main(void) {
  backends[1] = msim_backend_matrix_free();
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(velocities_are_those_of_one_process),
      cmocka_unit_test(two_levels_take_the_iterations_of_pcg),
      cmocka_unit_test(other_backends_are_refused),
      cmocka_unit_test(each_allocation_that_fails_is_a_failure_on_all_ranks),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
