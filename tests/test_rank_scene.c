/* Tests of what ranks keep of a scene: the whole one is gathered as it was, bit by bit, energies
 * and checkpoints of parts are those of one process, errors name particles and springs by their
 * numbers in the whole scene, and a failure of memory or communication is one of all ranks. */
#include "angle_scenes.h"
#include "drawn_scenes.h"
#include "rank_failures.h"
#include "physics/reference.h"
#include "sim/rank_section.h"
#include "sim/rank_scene.h"

/*------------------------------------- gathering ------------------------------------------------*/

/* Rank 0 has the text that the scene was read from. */
static int has_text(const msim_comm *comm, const ms_scene *s, const ms_scene *from) {
  if (comm->rank > 0 || !from->source) return !s->source;
  return s->source && strcmp(s->source, from->source) == 0;
}

/* Rank 0 borrows the whole scene. */
static const char *check_borrowed(const msim_comm *comm, const msim_sim *sim,
                                  const ms_scene *whole) {
  msim_error why = {0};
  ms_scene *borrowed;
  EXPECT(ms_rank_scene_borrow(sim, &borrowed, &why) == MSIM_OK);
  EXPECT(has_text(comm, borrowed, whole) && borrowed->nsprings == whole->nsprings);
  EXPECT(comm->rank > 0 || are_same_scenes(borrowed, whole));
  EXPECT(comm->rank == 0 || (!borrowed->x && !borrowed->ij && !borrowed->faces));
  ms_rank_scene_return(sim, borrowed);
  return NULL;
}

/* What a model of the whole scene has in a part: the same particles and springs */
static const char *check_part(const msim_comm *comm, const msim_sim *sim, const ms_scene *whole) {
  const msim_error why = {0};
  const ms_scene *s = sim->scene;
  EXPECT(sim->kept && s->nparticles <= whole->nparticles && s->nfaces == 0);
  for (int32_t p = 0; p < s->nparticles; p++) {
    const int32_t at = ms_rank_scene_get_particle(sim, p);
    EXPECT(is_same(s->x + 3 * p, whole->x + 3 * at, 3, 8) && s->mass[p] == whole->mass[at]);
    EXPECT(s->pinned[p] == whole->pinned[at]);
  }
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t at = ms_rank_scene_get_spring(sim, e);
    EXPECT(s->k[e] == whole->k[at] && s->damping[e] == whole->damping[at]);
    for (int c = 0; c < 2; c++)
      EXPECT(ms_rank_scene_get_particle(sim, s->ij[2 * e + c]) == whole->ij[2 * at + c]);
  }
  return NULL;
}

static const char *gather_scene(msim_comm *comm, void *data) {
  const msim_scene *scene = data;
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_sim *sim;
  msim_energy e = {.size = sizeof e};
  msim_state time = {.size = MSIM_STATE_TIME};
  opt.comm = comm, opt.threads = 1;
  EXPECT(msim_sim_create(scene, &opt, &sim, &why) == MSIM_OK);
  for (int round = 0; round < 3; round++) { /* without and with a section for output */
    const char *wrong = check_part(comm, sim, scene->data);
    if (!wrong) wrong = check_borrowed(comm, sim, scene->data);
    if (wrong) return wrong;
    EXPECT(ms_rank_scene_gather(sim, &why) == MSIM_OK && !sim->kept);
    EXPECT(are_same_scenes(sim->scene, scene->data) && sim->scene != scene->data);
    EXPECT(has_text(comm, sim->scene, scene->data));
    EXPECT(ms_rank_scene_gather(sim, &why) == MSIM_OK);
    EXPECT(ms_rank_scene_divide(sim, &why) == MSIM_OK && sim->kept);
    EXPECT(ms_rank_scene_divide(sim, &why) == MSIM_OK);
    EXPECT(msim_sim_energy(sim, &e) == MSIM_OK && sim->section && sim->kept);
    EXPECT(msim_sim_state(sim, &time) == MSIM_OK && sim->kept && msim_sim_step(sim, 1, &why) == 0);
  }
  EXPECT(ms_rank_scene_count_springs(sim) == scene->data->nsprings);
  msim_sim_destroy(sim);
  return NULL;
}

static void scenes_are_gathered_as_they_were(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 100; seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    assert_non_null(scene);
    if (seed % 2) scene->data->source = ms_memory_copy_string(&scene->data->alloc, "the text");
    const char *wrong = run_ranks(2 + (int32_t)(seed % 4), gather_scene, scene);
    if (wrong) fail_msg("seed %u: %s", seed, wrong);
    msim_scene_destroy(scene);
  }
}

/* Forces on all particles, from parts */
static const char *compute_force(msim_comm *comm, void *data) {
  const msim_scene *scene = data;
  const int64_t n = scene->data->nparticles;
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_sim *sim;
  double *force = malloc(3 * (size_t)n * sizeof *force),
         *expected = malloc(3 * (size_t)n * sizeof *expected);
  opt.comm = comm;
  EXPECT(force && expected && msim_sim_create(scene, &opt, &sim, &why) == MSIM_OK);
  msim_sim_force(sim, scene->data->x, scene->data->v, force);
  ms_reference_compute_force(scene->data, scene->data->x, scene->data->v, expected);
  EXPECT(is_same(force, expected, 3 * n, sizeof *force));
  free(force), free(expected);
  msim_sim_destroy(sim);
  return NULL;
}

static void forces_are_those_of_the_whole_scene(void **state) {
  (void)state;
  msim_scene *scene = draw_scene(NULL, 7);
  const char *wrong = run_ranks(3, compute_force, scene);
  if (wrong) fail_msg("%s", wrong);
  msim_scene_destroy(scene);
}

/*------------------------------------- runs of parts --------------------------------------------*/

typedef struct saved_run {
  const msim_scene *scene;
  const char *bytes;
  size_t length, size;
  msim_energy energy;
  int loads;
} saved_run;

/* Saves and loads without the whole scene before or after */
static const char *save_parts(msim_comm *comm, void *data) {
  const saved_run *r = data;
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_sim *sim;
  msim_energy e = {.size = sizeof e};
  size_t length;
  char *bytes = malloc(r->size);
  opt.comm = comm, opt.threads = 1, opt.watch = MSIM_WATCH_OFF;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK && bytes);
  EXPECT(msim_sim_save_size(sim) == r->size);
  const msim_status made =
      r->loads ? msim_sim_load(sim, r->bytes, r->length, &why) : msim_sim_step(sim, 20, &why);
  EXPECT(made == MSIM_OK);
  EXPECT(sim->kept && !sim->state_x);
  EXPECT(msim_sim_save(sim, bytes, r->size, &length, &why) == MSIM_OK && length == r->length);
  EXPECT(r->loads || msim_sim_load(sim, bytes, length, &why) == MSIM_OK);
  EXPECT(msim_sim_energy(sim, &e) == MSIM_OK && sim->kept && e.total == r->energy.total);
  free(bytes);
  msim_sim_destroy(sim);
  return NULL;
}

static void parts_have_checkpoints_and_energies_of_one_process(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 40; seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    msim_options opt = options("velocity-verlet", 1e-4);
    opt.watch = MSIM_WATCH_OFF;
    msim_sim *sim = make_sim(scene, &opt);
    saved_run r = {.scene = scene, .size = msim_sim_save_size(sim), .energy.size = sizeof r.energy};
    char *bytes = malloc(r.size);
    assert_ok(msim_sim_step(sim, 20, err));
    assert_ok(msim_sim_save(sim, bytes, r.size, &r.length, err));
    assert_int_equal(msim_sim_energy(sim, &r.energy), MSIM_OK);
    msim_sim_destroy(sim);
    r.bytes = bytes;
    for (r.loads = 0; r.loads < 2; r.loads++) {
      const char *wrong = run_ranks(2 + (int32_t)(seed % 3), save_parts, &r);
      if (wrong) fail_msg("seed %u: %s", seed, wrong);
    }
    free(bytes);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- rows of other sections -----------------------------------*/

static int is_in(const int32_t *list, int32_t n, int32_t number) {
  for (int32_t k = 0; k < n; k++)
    if (list[k] == number) return 1;
  return 0;
}

/* Which particles and springs a section needs, by the words of rank_others.h */
static void find_needed(const ms_scene *s, const ms_section *is, int with_pins, char *particle,
                        char *spring) {
  const int32_t *corner = s->faces + 3 * is->first_face, *angle = s->angles.ijk;
  const int32_t ncorners = 3 * is->nfaces;
  for (int32_t p = 0; p < s->nparticles; p++)
    particle[p] = (with_pins && s->pinned[p]) || is_in(corner, ncorners, p);
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    const int is_own = e >= is->first_spring && e < is->first_spring + is->nsprings,
              is_edge = is_in(corner, ncorners, i) && is_in(corner, ncorners, j);
    spring[e] = !is_own && (is_edge || (with_pins && (s->pinned[i] || s->pinned[j])));
    if (is_own || spring[e]) particle[i] = particle[j] = 1;
  }
  for (int32_t e = 0; e < s->angles.n; e++, angle += 3) {
    const int is_own = e >= is->first_angle && e < is->first_angle + is->nangles,
              pins = s->pinned[angle[0]] || s->pinned[angle[1]] || s->pinned[angle[2]];
    for (int c = 0; c < 3 && (is_own || (with_pins && pins)); c++) particle[angle[c]] = 1;
  }
  for (int32_t p = is->first; p < is->first + is->n; p++) particle[p] = 0;
}

static int is_list_of(const char *needed, int32_t n, const int32_t *list, int32_t count) {
  int32_t k = 0;
  for (int32_t i = 0; i < n; i++)
    if (needed[i] && (k == count || list[k++] != i)) return 0;
  return k == count;
}

static const char *check_others(msim_comm *comm, void *data) {
  const msim_scene *scene = data;
  const ms_scene *s = scene->data;
  msim_options opt = options("velocity-verlet", 1e-4);
  msim_error why = {0};
  msim_sim *sim;
  msim_energy e = {.size = sizeof e};
  msim_state now = {.size = sizeof now};
  char *particle = calloc((size_t)s->nparticles, 1), *spring = calloc((size_t)s->nsprings + 1, 1);
  opt.comm = comm, opt.threads = 1;
  EXPECT(particle && spring && msim_sim_create(scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(!sim->kept == (s->angles.n > 0) && msim_sim_energy(sim, &e) == MSIM_OK);
  const ms_section *is = &sim->section->in_whole;
  find_needed(s, is, comm->rank == 0, particle, spring);
  EXPECT(is_list_of(particle, s->nparticles, is->other, is->nothers));
  EXPECT(is_list_of(spring, s->nsprings, is->other_spring, is->nother_springs));
  EXPECT(msim_sim_step(sim, 3, &why) == MSIM_OK && msim_sim_energy(sim, &e) == MSIM_OK);
  EXPECT(msim_sim_state(sim, &now) == MSIM_OK);
  for (int32_t i = 0; i < is->n + is->nothers; i++)
    EXPECT(is_same(sim->section->x + 3 * i, now.x + 3 * ms_section_particle(is, (size_t)i), 3, 8));
  msim_sim_destroy(sim);
  free(particle), free(spring);
  return NULL;
}

/* They have its present state, too. The last ones have angular springs, one of them at a pin far
 * from the section of rank 0, and no spring between its ends. */
static void sections_have_what_they_refer_to(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 40; seed++) {
    msim_scene *scene =
        seed > 38 ? bending_cloth(5 + (int32_t)seed % 3, 400, 0, 0.001) : draw_scene(NULL, seed);
    const int32_t last = scene->data->nparticles - 1;
    const int32_t far[3] = {last, last - 3, last - 7};
    const double bend = 0.1;
    if (seed > 38) {
      assert_ok(msim_scene_pin(scene, 1, &last, err));
      assert_ok(msim_scene_add_angles(scene, 1, far, &bend, NULL, NULL, err));
    }
    const char *wrong =
        run_ranks(seed > 38 ? MOST_RANKS : 2 + (int32_t)(seed % 4), check_others, scene);
    if (wrong) fail_msg("seed %u: %s", seed, wrong);
    msim_scene_destroy(scene);
  }
}

/*------------------------------------- errors ---------------------------------------------------*/

/* A run that fails, without the whole scene before its end */
typedef struct unstable_run {
  const msim_scene *scene;
  msim_options opt;
  int32_t steps;
  const char *text, *advice;
} unstable_run;

static const char *run_unstable(msim_comm *comm, void *data) {
  const unstable_run *r = data;
  msim_options opt = r->opt;
  msim_error why = {0};
  msim_sim *sim;
  opt.comm = comm;
  EXPECT(msim_sim_create(r->scene, &opt, &sim, &why) == MSIM_OK);
  const msim_status status = msim_sim_step(sim, r->steps, &why);
  EXPECT(status == MSIM_UNSTABLE || status == MSIM_NOT_FINITE);
  EXPECT(sim->kept && strcmp(why.text, r->text) == 0);
  char advice[1024];
  EXPECT(msim_sim_advice(sim, advice, sizeof advice) == MSIM_OK);
  EXPECT(strcmp(advice, r->advice) == 0);
  msim_sim_destroy(sim);
  return NULL;
}

/* The error names `what`, too. */
static void check_error(const msim_scene *scene, double h, int32_t watch, const char *what) {
  msim_error why;
  unstable_run r = {.scene = scene, .opt = options("velocity-verlet", h), .steps = 2000};
  r.opt.watch = watch;
  msim_sim *sim = make_sim(scene, &r.opt);
  assert_true(msim_sim_step(sim, r.steps, &why) > 0);
  if (!strstr(why.text, "particle") || !strstr(why.text, what)) fail_msg("%s", why.text);
  char advice[1024];
  assert_int_equal(msim_sim_advice(sim, advice, sizeof advice), MSIM_OK);
  assert_true(*advice);
  msim_sim_destroy(sim);
  r.text = why.text, r.advice = advice;
  for (int32_t n = 2; n <= 4; n++) {
    const char *wrong = run_ranks(n, run_unstable, &r);
    if (wrong) fail_msg("%d ranks: %s, not %s", n, wrong, why.text);
  }
}

static void errors_have_numbers_of_the_whole_scene(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 300, 0);
  const double x[9] = {0, 0, 0, 2, 0, 0, 0, 0, 1}, mass[3] = {1, 1, 1}, k[2] = {1e300, 1};
  const int32_t ij[4] = {81, 82, 0, 83};
  check_error(cloth, 0.003, MSIM_WATCH_ON, "unstable");
  assert_ok(msim_scene_add_particles(cloth, 3, x, NULL, mass, err));
  assert_ok(msim_scene_add_springs(cloth, 2, ij, k, (double[]){1, 1}, NULL, err));
  check_error(cloth, 1e-3, MSIM_WATCH_OFF, "spring");
  msim_scene_destroy(cloth);
}

/*------------------------------------- failures -------------------------------------------------*/

/* A sim that is gathered and divided in each way; first failure */
static msim_status use_parts(const msim_scene *scene, const msim_options *opt, msim_sim **sim,
                             msim_error *why) {
  msim_energy e = {.size = sizeof e};
  msim_state now = {.size = sizeof now};
  msim_status status = msim_sim_create(scene, opt, sim, why);
  const double g[3] = {0, 0, -1};
  char bytes[16384];
  size_t length;
  if (!status) status = msim_sim_energy(*sim, &e);
  if (!status) status = msim_sim_save(*sim, bytes, sizeof bytes, &length, why);
  if (!status) status = msim_sim_load(*sim, bytes, length, why);
  if (!status) status = msim_sim_state(*sim, &now);
  return status ? status : msim_sim_set_gravity(*sim, g, why);
}

static msim_scene *draw_on_rank(const msim_comm *comm, const msim_allocator *alloc,
                                const void *seed) {
  (void)comm;
  return draw_scene(alloc, *(const unsigned *)seed);
}

static void failures_of_one_rank_are_those_of_all(void **state) {
  (void)state;
  for (unsigned seed = 5; seed < 7; seed++)
    check_rank_failures(&(rank_failures){.load = draw_on_rank,
                                         .from = &seed,
                                         .use = use_parts,
                                         .opt = options("velocity-verlet", 1e-4),
                                         .least = {150, 60}});
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(scenes_are_gathered_as_they_were),
      cmocka_unit_test(forces_are_those_of_the_whole_scene),
      cmocka_unit_test(parts_have_checkpoints_and_energies_of_one_process),
      cmocka_unit_test(sections_have_what_they_refer_to),
      cmocka_unit_test(errors_have_numbers_of_the_whole_scene),
      cmocka_unit_test(failures_of_one_rank_are_those_of_all),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
