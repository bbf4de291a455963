/* Tests of sims whose scene ranks have read in parts: runs have the bits of one process, and
 * what a rank keeps is the same as of the whole scene. */
#define _GNU_SOURCE /* mkdtemp */
#include <stdio.h>
#include <unistd.h>

#include "contact/contact_set.h"
#include "drawn_scenes.h"
#include "moving_colliders.h"
#include "rank_runs.h"
#include "scene_part_file.h"
#include "sim/rank_scene.h"

/*------------------------------------- runs -----------------------------------------------------*/

/* As run_rank of rank_runs.h, from parts of the file */
static const char *run_part(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_error why = {0};
  msim_energy e = {.size = sizeof e};
  msim_sim *sim;
  msim_scene *part;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  EXPECT(comm->nranks == 1 || part->part);
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_OK);
  msim_scene_destroy(part);
  EXPECT(msim_sim_step(sim, r->steps, &why) == MSIM_OK);
  EXPECT(msim_sim_energy(sim, &e) == MSIM_OK && e.total == r->energy.total); /* of sections */
  const char *wrong = compare_with_run(sim, r);
  msim_sim_destroy(sim);
  return wrong;
}

static void check_steps_of_parts(const msim_scene *scene, msim_options opt, int32_t steps) {
  save(scene);
  run r = run_alone(scene, opt, steps);
  for (int32_t n = 1; n <= MOST_RANKS; n += is_long() || n < 3 ? 1 : 2) {
    const char *wrong = run_ranks(n, run_part, &r);
    if (wrong) fail_msg("%s, %d ranks, %d steps: %s", opt.integrator, n, steps, wrong);
  }
  free_run(&r);
}

static void check_run_of_parts(const msim_scene *scene, const char *method, double h) {
  check_steps_of_parts(scene, options(method, h), 20);
}

static void runs_have_the_bits_of_one_process(void **state) {
  (void)state;
  const msim_plane plane = {.normal = {0, 0, 1}, .offset = -0.2, .restitution = 0.5};
  msim_scene *mesh = random_mesh(300, 3, 0.01), *undamped = random_mesh(300, 4, 0),
             *cloth = hanging_cloth(9, 300, 0.02);
  const char *method;
  for (int32_t i = 0; (method = method_at(i)) != NULL; i++)
    if (is_tested(method))
      check_run_of_parts(takes_positions_only(method) ? undamped : mesh, method, 1e-3);
  check_run_of_parts(cloth, "velocity-verlet", 1e-3);
  assert_ok(msim_scene_add_plane(cloth, &plane, err));
  check_run_of_parts(cloth, "velocity-verlet", 1e-3);
  msim_scene_destroy(cloth);
  msim_scene_destroy(undamped);
  msim_scene_destroy(mesh);
  for (unsigned seed = 1; seed <= (is_long() ? 40 : 12); seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    check_run_of_parts(scene, seed % 3 ? "velocity-verlet" : "rk4", 1e-3);
    msim_scene_destroy(scene);
  }
}

static const double moving_at[3] = {0.5, 0.5, -0.3}, moving_by[3] = {0.2, 0, 3},
                    turning_by[3] = {0, 2, 0};

static msim_scene *moving_box(void) {
  msim_scene *scene = random_mesh(200, 9, 0);
  msim_collider below = box(0.5, 0.5, -0.3, 2, 0.3, 0.2);
  below.extent[2] = 0.6;
  add(scene, below, 0);
  return scene;
}

static void colliders_that_move(void **state) {
  (void)state;
  msim_scene *scene = moving_box();
  set_uniform(scene, moving_at, moving_by, turning_by);
  check_steps_of_parts(scene, options("velocity-verlet", 5e-4), 60);
  check_steps_of_parts(scene, options("rk4", 5e-4), 60);
  msim_scene_destroy(scene);
}

/* A motion that the file does not have, also once the scene has been gathered */
static const char *run_late_motion(msim_comm *comm, void *data) {
  const run *r = data;
  msim_options opt = r->opt;
  msim_error why = {0};
  msim_state now = {.size = sizeof now};
  msim_sim *sim;
  msim_scene *part;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  set_uniform(part, moving_at, moving_by, turning_by);
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_OK);
  msim_scene_destroy(part);
  EXPECT(msim_sim_step(sim, 5, &why) == MSIM_OK && msim_sim_state(sim, &now) == MSIM_OK);
  EXPECT(msim_sim_step(sim, r->steps - 5, &why) == MSIM_OK);
  const char *wrong = compare_with_run(sim, r);
  msim_sim_destroy(sim);
  return wrong;
}

static void motions_that_the_file_does_not_have(void **state) {
  (void)state;
  msim_scene *scene = moving_box();
  save(scene);
  set_uniform(scene, moving_at, moving_by, turning_by);
  run r = run_alone(scene, options("velocity-verlet", 5e-4), 60);
  const char *wrong = run_ranks(3, run_late_motion, &r);
  if (wrong) fail_msg("%s", wrong);
  free_run(&r);
  msim_scene_destroy(scene);
}

/* Methods that carry other variables than x and v have the state of the scene before they begin. */
static void runs_start_in_the_state_of_the_scene(void **state) {
  (void)state;
  msim_scene *mesh = random_mesh(200, 6, 0);
  msim_options opt = options("takahashi-imada", 1e-3);
  check_steps_of_parts(mesh, opt, 0);
  opt.integrator = "verlet";
  check_steps_of_parts(mesh, opt, 0);
  opt.verlet_start = MSIM_VERLET_PLAIN;
  check_steps_of_parts(mesh, opt, 0);
  check_steps_of_parts(mesh, opt, 1);
  msim_scene_destroy(mesh);
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
  EXPECT(is_same(k->owner, l->owner, k->in_whole.n, 4) &&
         memcmp(&k->in_whole, &l->in_whole, sizeof k->in_whole) == 0);
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

typedef struct sim_case {
  const char *method;
  double h;
  int lacks_rest;
} sim_case;

static const char *compare_sims(msim_comm *comm, void *data) {
  const sim_case *k = data;
  msim_options opt = options(k->method, k->h);
  msim_error why = {0};
  char notes[2][300] = {"", ""};
  msim_scene *scenes[2];
  msim_sim *sims[2];
  opt.comm = comm, opt.threads = 1, opt.warn = comm->rank ? keep_note : NULL;
  EXPECT(msim_scene_load(NULL, path, &scenes[0], &why) == MSIM_OK);
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &scenes[1], &why) == MSIM_OK);
  if (k->lacks_rest) forget_rest(scenes[1]);
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

static void compare_all_sims(const msim_scene *scene, sim_case k, unsigned seed) {
  save(scene);
  for (int32_t n = 2; n <= MOST_RANKS; n += 1 + (int32_t)seed % 3) {
    const char *wrong = run_ranks(n, compare_sims, &k);
    if (wrong) fail_msg("seed %u, %d ranks: %s", seed, n, wrong);
  }
}

/* Every third one in a plane that nothing leaves, the others above planes or behind them */
static void sims_of_parts_are_those_of_the_whole(void **state) {
  (void)state;
  const double zero[3] = {0};
  for (unsigned seed = 1; seed <= (is_long() ? 60 : 20); seed++) {
    msim_scene *scene = draw_scene(NULL, seed);
    const msim_plane plane = {.normal = {0, 0, 1}, .offset = -3 + (double)(seed % 5)};
    ms_scene *s = scene->data;
    for (int32_t p = 0; p < s->nparticles && seed % 3 == 0; p++)
      s->x[3 * p + 1] = 0.5, s->v[3 * p + 1] = 0;
    for (int32_t p = 0; p < s->nparticles && seed % 3 == 0 && s->force; p++)
      s->force[3 * p + 1] = 0;
    if (seed % 3 == 0) assert_ok(msim_scene_set_gravity(scene, zero, err));
    else assert_ok(msim_scene_add_plane(scene, &plane, err));
    for (int32_t e = 0; e < s->nsprings && seed % 2; e++)
      s->rest[e] = ms_scene_distance(s->x + 3 * s->ij[2 * e], s->x + 3 * s->ij[2 * e + 1]);
    const char *const methods[] = {"rkc", "velocity-verlet", "linearly-implicit-euler"};
    const sim_case k = {.method = methods[seed % 7 < 2 ? seed % 7 : 1 + seed / 7 % 2],
                        .h = seed % 4 ? 1e-4 : 10,
                        .lacks_rest = seed % 2};
    compare_all_sims(scene, k, seed);
    msim_scene_destroy(scene);
  }
}

/* A step just above the limit, which is that of the heaviest particle, at a corner */
static void notes_follow_from_all_parts(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(9, 300, 0);
  const msim_options opt = options("explicit-euler", MSIM_H_AUTO);
  assert_ok(msim_scene_set_drag(cloth, 0.05, err));
  cloth->data->mass[80] *= 3;
  msim_sim *sim = make_sim(cloth, &opt);
  compare_all_sims(cloth, (sim_case){"explicit-euler", 1.001 * state_of(sim).h / 0.9, 0}, 1);
  msim_sim_destroy(sim);
  msim_scene_destroy(cloth);
}

/* A method or option */
typedef struct step_case {
  const char *method;
  double h;
  int has_end; /* 1: t_end and tol in place of h and steps */
} step_case;

/* Sims of parts and of the whole have the same bits; the part of the file is the first one, the
 * other one gathers its scene in the middle of the run. */
static const char *compare_steps(msim_comm *comm, void *data) {
  const step_case *k = data;
  msim_options opt = k->has_end ? controlled(k->method, 1e-6, 0.002) : options(k->method, k->h);
  msim_error why = {0};
  msim_scene *scenes[2];
  msim_sim *sims[2];
  msim_state at[2];
  msim_stats made[2];
  int is_divided[2];
  opt.comm = comm, opt.threads = 1;
  if (!k->has_end) opt.steps = 5;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &scenes[0], &why) == MSIM_OK);
  EXPECT(msim_scene_load(NULL, path, &scenes[1], &why) == MSIM_OK);
  for (int i = 0; i < 2; i++) {
    EXPECT(msim_sim_create(scenes[i], &opt, &sims[i], &why) == MSIM_OK);
    msim_scene_destroy(scenes[i]);
    is_divided[i] = sims[i]->kept != NULL;
    const ms_contact_set *contacts = sims[i]->islands->stepper.events;
    EXPECT(!contacts || is_common(comm, contacts->reach));
    at[i].size = sizeof at[i], made[i].size = sizeof made[i];
    EXPECT(k->has_end || msim_sim_step(sims[i], 2, &why) == MSIM_OK);
    EXPECT(i == 0 || (msim_sim_state(sims[i], &at[i]) == MSIM_OK && !sims[i]->kept));
    EXPECT(msim_sim_run(sims[i], NULL, NULL, &why) == MSIM_OK);
    EXPECT(!msim_sim_state(sims[i], &at[i]) && !msim_sim_stats(sims[i], &made[i]));
  }
  EXPECT(at[0].n == at[1].n && at[0].t == at[1].t && has_same_bits(at[0].x, at[1].x, at[0].n));
  EXPECT(has_same_bits(at[0].v, at[1].v, at[0].n));
  EXPECT(is_divided[0] == is_divided[1] && at[0].h == at[1].h && made[0].steps == made[1].steps);
  EXPECT(made[0].iterations == made[1].iterations && made[0].contacts == made[1].contacts);
  EXPECT(made[0].newton_iterations == made[1].newton_iterations);
  for (int i = 0; i < 2; i++) msim_sim_destroy(sims[i]);
  return NULL;
}

static void check_steps(const msim_scene *scene, step_case k) {
  save(scene);
  for (int32_t n = 2; n <= 4; n++) {
    const char *wrong = run_ranks(n, compare_steps, &k);
    if (wrong) fail_msg("%s, %d ranks: %s", k.method, n, wrong);
  }
}

static void steps_follow_from_all_parts(void **state) {
  (void)state;
  msim_scene *const scenes[] = {random_mesh(300, 5, 0.02), hanging_cloth(9, 300, 0),
                                hanging_cloth(9, 300, 0.1)};
  const char *const methods[] = {"velocity-verlet", "rk4", "verlet"};
  for (int i = 0; i < 3; i++) {
    for (int m = 0; m < 3; m++) check_steps(scenes[i], (step_case){methods[m], MSIM_H_AUTO, 0});
    msim_scene_destroy(scenes[i]);
  }
}

/* One sentence on all ranks where no step follows */
static const char *check_no_step(msim_comm *comm, void *data) {
  msim_options opt = options(data, MSIM_H_AUTO);
  msim_error why = {0};
  msim_scene *part;
  msim_sim *sim;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_ERR_ARG &&
         strstr(why.text, "h is 'auto'"));
  EXPECT(has_same_text(comm, why.text));
  msim_scene_destroy(part);
  return NULL;
}

static void no_step_follows(void **state) {
  (void)state;
  const char *const methods[] = {"linearly-implicit-euler", "explicit-euler"};
  msim_scene *scene = hanging_cloth(5, 300, 0);
  save(scene);
  for (int m = 0; m < 2; m++)
    for (int32_t n = 2; n <= 4; n++) {
      const char *wrong = run_ranks(n, check_no_step, (void *)(uintptr_t)methods[m]);
      if (wrong) fail_msg("%s, %d ranks: %s", methods[m], n, wrong);
    }
  msim_scene_destroy(scene);
}

/* Also of bodies of which each has its own norm */
static void errors_are_those_of_the_whole_scene(void **state) {
  (void)state;
  const step_case cases[] = {{"dop853", 0, 1},
                             {"rk4", 0, 1},
                             {"velocity-verlet", 0, 1},
                             {"bdf2", 0, 1},
                             {"tr-bdf2", 0, 1}};
  msim_scene *scene = random_mesh(300, 5, 0.02);
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i += is_long() ? 1 : 2)
    check_steps(scene, cases[i]);
  msim_scene_destroy(scene);
  for (unsigned seed = 1; seed <= (is_long() ? 40 : 5); seed++) {
    scene = draw_scene(NULL, seed);
    check_steps(scene, (step_case){seed % 2 ? "dop853" : "velocity-verlet", 0, 1});
    msim_scene_destroy(scene);
  }
}

/* Stiff springs in space and in a plane, for which the modes of ranks matter; a plane below, a
 * ball, and a box that moves. By default each method in two of the scenes */
static void implicit_methods_have_the_bits_of_the_whole_scene(void **state) {
  (void)state;
  msim_scene *const scenes[] = {random_mesh(300, 5, 0.02), hanging_cloth(24, 20000, 0.01),
                                hanging_cloth(12, 300, 0), hanging_cloth(12, 300, 0),
                                hanging_cloth(8, 300, 0),  moving_box()};
  const double zero[3] = {0};
  const msim_plane below = {.normal = {0, 0, 1}, .offset = -1e-4, .restitution = 0.5};
  const char *method;
  assert_ok(msim_scene_set_gravity(scenes[2], zero, err));
  assert_ok(msim_scene_add_plane(scenes[3], &below, err));
  add(scenes[4], sphere(0.5, 0.5, -0.2001, 0.2, 0.5, 0), 0);
  set_uniform(scenes[5], moving_at, moving_by, turning_by);
  for (int i = 0; i < 6; i++) {
    for (int32_t m = 0; (method = method_at(m)) != NULL; m++)
      if (is_implicit(method) && (is_long() || (i + m) % 3 == 0))
        check_steps(scenes[i], (step_case){method, 2e-3, 0});
    msim_scene_destroy(scenes[i]);
  }
}

/* Creation fails as in one process. */
static const char *check_refusal(msim_comm *comm, void *data) {
  const char *alone = data;
  msim_options opt = options("force-gradient", 1e-3);
  msim_error why = {0};
  msim_scene *part;
  msim_sim *sim;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &part, &why) == MSIM_OK);
  EXPECT(msim_sim_create(part, &opt, &sim, &why) == MSIM_ERR_ARG && strcmp(why.text, alone) == 0);
  msim_scene_destroy(part);
  return NULL;
}

static void the_first_damped_spring_is_refused(void **state) {
  (void)state;
  const msim_options opt = options("force-gradient", 1e-3);
  msim_scene *scene = random_mesh(200, 2, 0.01);
  msim_error alone;
  msim_sim *sim;
  save(scene);
  assert_int_equal(msim_sim_create(scene, &opt, &sim, &alone), MSIM_ERR_ARG);
  assert_non_null(strstr(alone.text, "is damped"));
  for (int32_t n = 2; n <= 5; n++) {
    const char *wrong = run_ranks(n, check_refusal, alone.text);
    if (wrong) fail_msg("%d ranks: %s", n, wrong);
  }
  msim_scene_destroy(scene);
}

/* Options that ranks refuse, and no method: creation says the same of parts and of the whole. */
static const char *compare_refusals(msim_comm *comm, void *data) {
  msim_options opt = *(const msim_options *)data;
  msim_error why = {0}, whys[2];
  msim_scene *scenes[2];
  msim_sim *sim;
  opt.comm = comm;
  EXPECT(msim_scene_load_part(NULL, path, comm->rank, comm->nranks, &scenes[0], &why) == MSIM_OK);
  EXPECT(msim_scene_load(NULL, path, &scenes[1], &why) == MSIM_OK);
  for (int i = 0; i < 2; i++) {
    EXPECT(msim_sim_create(scenes[i], &opt, &sim, &whys[i]) != MSIM_OK && !sim);
    msim_scene_destroy(scenes[i]);
  }
  EXPECT(strcmp(whys[0].text, whys[1].text) == 0);
  return NULL;
}

static void check_refusals(const msim_scene *scene, msim_options opt) {
  save(scene);
  const char *wrong = run_ranks(3, compare_refusals, &opt);
  if (wrong) fail_msg("%s", wrong);
}

static void refusals_are_those_of_the_whole_scene(void **state) {
  (void)state;
  const char *const methods[] = {NULL, "auto", "respa", "no method"};
  const msim_plane plane = {.normal = {0, 0, 1}, .offset = -0.2};
  msim_scene *scene = hanging_cloth(9, 300, 0.01);
  msim_options opt = options("velocity-verlet", 1e-3);
  opt.steps = -1, opt.t_end = 0.1;
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    opt.integrator = methods[i];
    check_refusals(scene, opt);
  }
  opt.integrator = "velocity-verlet", opt.precision = MSIM_PRECISION_SINGLE;
  check_refusals(scene, opt);
  opt = options("velocity-verlet", 1e-3);
  opt.collision = MSIM_COLLISION_EVENT;
  check_steps_of_parts(scene, opt, 20); /* without obstacles */
  assert_ok(msim_scene_add_plane(scene, &plane, err));
  check_refusals(scene, opt);
  check_refusals(scene, controlled("dop853", 1e-6, 0.1));
  opt.collision = options("rk4", 1).collision;
  assert_ok(msim_scene_set_self_contact(scene, 0.01, 0.1, err));
  check_refusals(scene, opt);
  msim_scene_destroy(scene);
}

/* One particle lies off the plane of the parts of the other ranks. */
static void parts_in_a_plane(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(9, 300, 0);
  assert_ok(msim_scene_set_gravity(scene, (double[3]){0}, err));
  scene->data->x[3 * 80 + 2] = 0.02;
  check_run_of_parts(scene, "velocity-verlet", 1e-3);
  msim_scene_destroy(scene);
}

/* More ranks than free particles: the scene is gathered. */
static void ranks_without_particles(void **state) {
  (void)state;
  msim_scene *scene = hanging_cloth(3, 100, 0);
  for (int32_t p = 0; p < 6; p++) assert_ok(msim_scene_pin(scene, 1, &p, err));
  check_run_of_parts(scene, "velocity-verlet", 1e-3);
  msim_scene_destroy(scene);
}

int main(void) {
  char folder[] = "/tmp/msim_rank_load_sims_XXXXXX";
  if (!mkdtemp(folder) || chdir(folder)) return 1;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(runs_have_the_bits_of_one_process),
      cmocka_unit_test(colliders_that_move),
      cmocka_unit_test(motions_that_the_file_does_not_have),
      cmocka_unit_test(runs_start_in_the_state_of_the_scene),
      cmocka_unit_test(sims_of_parts_are_those_of_the_whole),
      cmocka_unit_test(notes_follow_from_all_parts),
      cmocka_unit_test(steps_follow_from_all_parts),
      cmocka_unit_test(no_step_follows),
      cmocka_unit_test(errors_are_those_of_the_whole_scene),
      cmocka_unit_test(implicit_methods_have_the_bits_of_the_whole_scene),
      cmocka_unit_test(the_first_damped_spring_is_refused),
      cmocka_unit_test(refusals_are_those_of_the_whole_scene),
      cmocka_unit_test(parts_in_a_plane),
      cmocka_unit_test(ranks_without_particles),
  };
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (const char *const *name = (const char *[]){path, NULL}; *name; name++) remove(*name);
  return chdir("/") || rmdir(folder) || failed;
}
