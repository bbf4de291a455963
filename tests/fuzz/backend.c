/* Fuzz target: the function table of a solver and all of its results come from the input; msim must
 * trust none of them. */
#include "fuzz.h"
#include "input.h"
#include "msim/backend.h"

/*------------------------------------- functions ------------------------------------------------*/

typedef struct hostile {
  const msim_host *host;
} hostile;

static msim_status hostile_create(const msim_host *host, void **self) {
  hostile *h = host->alloc(host, sizeof *h);
  *self = h;
  if (h) h->host = host;
  return h ? input_status(host) : MSIM_ERR_MEMORY;
}

static msim_status hostile_order(void *self, int32_t n, const int32_t *ptr, const int32_t *ind,
                                 int32_t *perm) {
  (void)ptr, (void)ind;
  const int honest = input_next() & 1;
  for (int32_t i = 0; i < n; i++) perm[i] = honest ? n - 1 - i : (int32_t)input_next() - 4;
  return input_status(((hostile *)self)->host);
}

static void fill_info(msim_solve_info *info) {
  const unsigned what = input_next();
  if (what & 1) info->iterations = (int64_t)input_next() - 9;
  if (what & 2) info->residual = input_number();
  if (what & 4) info->fill = input_number();
  if (what & 8) info->flops = input_number();
}

static msim_status hostile_analyze(void *self, const msim_system *A, msim_solve_info *info) {
  (void)A;
  fill_info(info);
  return input_status(((hostile *)self)->host);
}

static msim_status hostile_factor(void *self, const msim_system *A, int32_t kind,
                                  msim_solve_info *info) {
  (void)A, (void)kind;
  fill_info(info);
  return input_status(((hostile *)self)->host);
}

static msim_status hostile_solve(void *self, const msim_system *A, const msim_solve_params *params,
                                 int32_t nrhs, const double *b, double *y, msim_solve_info *info) {
  const size_t length =
      (size_t)A->block * (size_t)(A->format == MSIM_FORMAT_NONE ? A->stride : A->n);
  (void)params;
  for (size_t i = 0; i < (size_t)nrhs * length; i++)
    y[i] = input_next() & 1 ? input_number() : b[i];
  fill_info(info);
  return input_status(((hostile *)self)->host);
}

static void hostile_destroy(void *self) {
  hostile *h = self;
  if (h) h->host->free(h->host, h);
}

/*------------------------------------- the table ------------------------------------------------*/

static void make_table(msim_backend *table) {
  static const char *const names[] = {"hostile", NULL, "", "pcg", "hostile "};
  const unsigned spoilt = input_fault_bits();
  *table = (msim_backend){.abi = MSIM_BACKEND_ABI,
                          .size = sizeof *table,
                          .name = "hostile",
                          .library = spoilt & 1 ? NULL : "none",
                          .license = spoilt & 2 ? NULL : "MIT",
                          .flags = input_next(),
                          .format = (int32_t)(input_next() % 3),
                          .create = spoilt & 4 ? NULL : hostile_create,
                          .order = spoilt & 8 ? NULL : hostile_order,
                          .analyze = spoilt & 16 ? NULL : hostile_analyze,
                          .factor = spoilt & 32 ? NULL : hostile_factor,
                          .solve = spoilt & 64 ? NULL : hostile_solve,
                          .destroy = spoilt & 128 ? NULL : hostile_destroy};
  if (spoilt & 256) table->abi = input_next();
  if (spoilt & 512) table->size = input_next();
  if (spoilt & 1024) table->format = (int32_t)input_next() - 128;
  if (spoilt & 2048) table->name = names[input_next() % (sizeof names / sizeof *names)];
}

static msim_scene *make_scene(void) {
  static const double x[] = {0, 0, 2, 0.5, 0, 2, 1, 0.2, 0, 1, 1, 1}, mass[] = {1, 2, 1, 1};
  static const double k[] = {500, 100, 50}, gravity[] = {0, 0, -9.81};
  static const int32_t ij[] = {0, 1, 1, 2, 2, 3}, pinned = 0;
  const msim_plane floor = {.normal = {0, 0, 1}, .restitution = 1};
  msim_scene *scene;
  const int failed =
      msim_scene_create(NULL, &scene, NULL) || msim_scene_set_gravity(scene, gravity, NULL) ||
      msim_scene_add_particles(scene, 4, x, NULL, mass, NULL) ||
      msim_scene_add_springs(scene, 3, ij, k, NULL, NULL, NULL) ||
      msim_scene_pin(scene, 1, &pinned, NULL) || msim_scene_add_plane(scene, &floor, NULL);
  fuzz_check(!failed, "the scene is good");
  return scene;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static const char *const methods[] = {"linearly-implicit-euler",
                                        "implicit-euler",
                                        "implicit-midpoint",
                                        "bdf2",
                                        "tr-bdf2",
                                        "newmark"};
  msim_backend table;
  const msim_backend *const backends[] = {&table, NULL};
  msim_options options;
  input_begin(data, size);
  msim_scene *scene = make_scene();
  msim_options_init(&options, sizeof options);
  options.integrator = methods[input_next() % (sizeof methods / sizeof *methods)];
  options.indefinite = (int32_t)(input_next() % 3);
  options.newton_retries = (int32_t)(input_next() % 3);
  options.h = 0.01;
  options.steps = 10;
  options.solver = "hostile";
  options.backends = backends;
  make_table(&table);
  fuzz_run(scene, &options);
  msim_scene_destroy(scene);
  return 0;
}
