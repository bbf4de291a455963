/* Fuzz target: checkpoints with a correct hash and forged bytes. Each is refused, and the sim goes
 * on unchanged, or it is accepted, and the run goes on. */
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "input.h"
#include "checkpoint_layout.h"

/* At least one variant for each kind of method state and solver state in a checkpoint:
 * integrate/method_state.c, linear/solver_state.c, method_choice.c. */
static const struct {
  const char *integrator;
  double tol;
  int32_t collision;
} variants[] = {{"velocity-verlet", 0, MSIM_COLLISION_REFLECT},
                {"verlet", 0, MSIM_COLLISION_REFLECT},
                {"rk4", 0, MSIM_COLLISION_EVENT},
                {"dop853", 1e-3, MSIM_COLLISION_REFLECT},
                {"rkc", 0, MSIM_COLLISION_REFLECT},
                {"implicit-midpoint", 0, MSIM_COLLISION_REFLECT},
                {"bdf2", 0, MSIM_COLLISION_EVENT},
                {"newmark", 1e-2, MSIM_COLLISION_REFLECT},
                {"linearly-implicit-euler", 0, MSIM_COLLISION_REFLECT},
                {"auto", 1e-3, MSIM_COLLISION_REFLECT},
                {"respa", 0, MSIM_COLLISION_REFLECT},
                {"tr-bdf2", 0, MSIM_COLLISION_EVENT}};
enum { NVARIANTS = sizeof variants / sizeof *variants, NPARTICLES = 7, NX = 3 * NPARTICLES };

/* The scene and the options of a variant, and the run that was saved. */
typedef struct origin {
  msim_scene *scene;
  msim_options options;
  uint8_t *saved; /* after some steps */
  size_t length;
  double x[NX]; /* positions of a sim that loads nothing, after those and AFTER more steps */
} origin;

/* A cloth of four particles over a floor, a pair in the air and a single particle; or a planar
 * scene without gravity and floor. */
static msim_scene *make_scene(int is_flat) {
  static const double x[] = {0, 0, .3, 1, 0, .2, 0, 1, .1, 1, 1, .2, 3, 0, 4, 4, 0, 4, 6, 0, 0.1};
  static const double mass[] = {1, 2, 1, 1, 1, 1, 1}, k[] = {500, 100, 50, 70, 80, 900};
  static const double damping[] = {1, 0, 0.1, 0, 0, 0}, gravity[] = {0, 0, -9.81};
  static const int32_t ij[] = {0, 1, 1, 3, 3, 2, 2, 0, 0, 3, 4, 5}, pinned = 4;
  const msim_plane floor = {.normal = {0, 0, 1}, .restitution = 0.5, .friction = 0.1};
  double flat[NX], v[NX] = {[3] = 1, [16] = -2};
  msim_scene *scene;
  for (size_t i = 0; i < NX; i++) flat[i] = i % 3 == 2 ? 0 : x[i];
  int failed = msim_scene_create(NULL, &scene, NULL) ||
               msim_scene_add_particles(scene, NPARTICLES, is_flat ? flat : x, v, mass, NULL) ||
               msim_scene_add_springs(scene, 6, ij, k, NULL, damping, NULL) ||
               msim_scene_pin(scene, 1, &pinned, NULL);
  if (!is_flat)
    failed = failed || msim_scene_set_gravity(scene, gravity, NULL) ||
             msim_scene_add_plane(scene, &floor, NULL);
  fuzz_check(!failed, "the scene is good");
  return scene;
}

static msim_sim *make_sim(const origin *o) {
  msim_error err;
  msim_sim *sim;
  fuzz_check(msim_sim_create(o->scene, &o->options, &sim, &err) == MSIM_OK, err.text);
  return sim;
}

static void make_steps(msim_sim *sim, int64_t n) {
  msim_error err;
  fuzz_check(msim_sim_step(sim, n, &err) == MSIM_OK, err.text);
}

static const double *x_of(msim_sim *sim) {
  msim_state state = {.size = sizeof state};
  msim_sim_state(sim, &state);
  return state.x;
}

static uint8_t *save(msim_sim *sim, size_t *length) {
  msim_error err;
  const size_t most = msim_sim_save_size(sim);
  uint8_t *bytes = malloc(most);
  fuzz_check(bytes != NULL, "memory");
  fuzz_check(msim_sim_save(sim, bytes, most, length, &err) == MSIM_OK, err.text);
  return bytes;
}

enum { BEFORE = 2, AFTER = 3 };

/* Created on first use, and never freed. */
static const origin *find_origin(unsigned variant, int is_flat) {
  static origin all[NVARIANTS][2];
  origin *o = &all[variant][is_flat];
  if (o->scene) return o;
  o->scene = make_scene(is_flat);
  msim_options_init(&o->options, sizeof o->options);
  o->options.integrator = variants[variant].integrator;
  o->options.tol = variants[variant].tol;
  o->options.collision = variants[variant].collision;
  o->options.solver = is_flat ? "pcg" : "auto";
  o->options.h = 2e-3;
  o->options.t_end = 1;
  o->options.fps = 50;
  o->options.threads = 1;
  msim_sim *sim = make_sim(o);
  make_steps(sim, BEFORE + AFTER);
  memcpy(o->x, x_of(sim), sizeof o->x);
  make_steps(sim, 20);
  o->saved = save(sim, &o->length);
  msim_sim_destroy(sim);
  return o;
}

static int look(msim_sim *sim, void *user) {
  int *frames = user;
  fuzz_check_state(sim);
  return --*frames == 0;
}

/* Some frames, one step per call: a forged state may have steps so short, or a method and a
 * tolerance with so many of them, that the next frame is out of reach. */
static void run_some(msim_sim *sim) {
  const int most = 600;
  msim_error err;
  msim_status status = MSIM_STOPPED;
  int frames = 3;
  for (int i = 0; i < most && frames > 0 && status == MSIM_STOPPED; i++) {
    msim_sim_stop(sim);
    status = msim_sim_run(sim, look, &frames, &err);
    fuzz_check_error(status, &err);
  }
}

/* An accepted checkpoint is a run: some frames of it, and a checkpoint of its own. */
static void go_on(msim_sim *sim, const origin *o) {
  msim_error err;
  const char *text;
  size_t length;
  fuzz_check_error(msim_sim_explain(sim, &text, &err), &err);
  fuzz_check_error(msim_sim_step(sim, AFTER, &err), &err);
  run_some(sim);
  fuzz_check_state(sim);
  uint8_t *saved = save(sim, &length);
  msim_sim *again = make_sim(o);
  const int is_taken = msim_sim_load(again, saved, length, &err) == MSIM_OK;
  fuzz_check(is_taken || strstr(err.text, "a count"), err.text); /* a count may be at its limit */
  msim_sim_destroy(again);
  free(saved);
}

/* The first byte selects the variant, the second one what is forged. Bit 0: the input is the
 * checkpoint. Otherwise bytes of the saved run are changed; bit 1: the hash is not recomputed; bit
 * 2: the fingerprint is changed, too; bit 3: the checkpoint is truncated. */
static uint8_t *make_bytes(const origin *o, size_t *length) {
  const unsigned how = input_next();
  size_t size;
  const uint8_t *rest = input_rest(&size);
  *length = how & 1 ? size : o->length;
  uint8_t *bytes = malloc(*length + 1);
  fuzz_check(bytes != NULL, "memory");
  memcpy(bytes, how & 1 ? rest : o->saved, *length);
  if (how & 1) return bytes;
  if (how & 8) *length -= input_next() % *length;
  const size_t run = how & 4 ? 8 : checkpoint_layout_run(bytes);
  input_corrupt(bytes + run, run < *length ? *length - run : 0);
  if (!(how & 2)) checkpoint_layout_rehash(bytes, *length);
  return bytes;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  msim_error err;
  size_t length;
  input_begin(data, size);
  const unsigned variant = input_next();
  const origin *o = find_origin(variant / 2 % NVARIANTS, variant % 2);
  uint8_t *bytes = make_bytes(o, &length);
  msim_sim *sim = make_sim(o);
  make_steps(sim, BEFORE);
  const msim_status status = msim_sim_load(sim, bytes, length, &err);
  fuzz_check_error(status, &err);
  if (status) {
    make_steps(sim, AFTER);
    fuzz_check(memcmp(x_of(sim), o->x, sizeof o->x) == 0,
               "a refused checkpoint leaves the sim unchanged");
  } else go_on(sim, o);
  msim_sim_destroy(sim);
  free(bytes);
  return 0;
}
