/* change_pins - pin particles, let them go, or move them in a running sim: a new run starts from
 * the present state */
#include <math.h>
#include <string.h>

#include "physics/energy.h"
#include "physics/law_springs.h"
#include "physics/moving_pins.h"
#include "sim/sim.h"

/*------------------------------------- arguments ------------------------------------------------*/

static msim_status check_pins(const msim_sim *sim, int32_t n, const int32_t *particles,
                              int must_be_pinned, msim_error *err) {
  const ms_scene *s = sim->scene;
  msim_status status = ms_scene_check_count(n, "particles", err);
  for (int32_t i = 0; i < n && !status; i++) {
    const int32_t p = particles[i];
    if (p < 0 || p >= s->nparticles)
      status = ms_error_set(err, MSIM_ERR_ARG,
                            "particles[%d] is %d; there are %d particles, counted from 0", i, p,
                            s->nparticles);
    else if (must_be_pinned && !s->pinned[p])
      status = ms_error_set(err, MSIM_ERR_ARG,
                            "particles[%d] is particle %d, which is not pinned; pin it to move it",
                            i, p);
  }
  return status;
}

/*------------------------------------- restart --------------------------------------------------*/

static double total_energy(const ms_scene *scene, const msim_state *state) {
  msim_energy e = {.size = sizeof e};
  ms_energy_compute(scene, state->x, state->v, &e);
  return e.total;
}

/* A copy of the sim's scene, in which these particles have no motion */
static msim_status copy_scene(const msim_sim *sim, int32_t n, const int32_t *particles,
                              msim_scene *copy, msim_error *err) {
  copy->data = ms_scene_retain(sim->scene);
  if (ms_scene_make_writable(copy, err)) {
    for (int32_t i = 0; i < n; i++) ms_scene_remove_motion(copy->data, particles[i]);
    return MSIM_OK;
  }
  ms_scene_release(copy->data);
  return MSIM_ERR_MEMORY;
}

/* pins: for each island those of the motions of `scene` */
static msim_status create_pins(const msim_sim *sim, const ms_scene *scene, ms_moving_pins **pins,
                               msim_error *err) {
  msim_status status = MSIM_OK;
  for (int32_t i = 0; i < sim->nislands && !status; i++) {
    ms_model model = sim->islands[i].model;
    model.scene = scene;
    status = ms_moving_pins_create(&model, &pins[i], err);
  }
  return status;
}

/* Exchange the pins of all islands, and let them refer to this scene. */
static void exchange_pins(msim_sim *sim, const ms_scene *scene, ms_moving_pins **pins) {
  for (int32_t i = 0; i < sim->nislands; i++) {
    ms_model *model = &sim->islands[i].model;
    ms_moving_pins *old = model->pins;
    model->pins = pins[i], pins[i] = old;
    model->scene = scene;
    if (model->laws) ms_law_springs_update(model);
  }
}

/* Start a run in a state with motions of the same pins: no unknown changes, and so the islands
 * stay, with their analyses. */
static msim_status start_with_motions(msim_sim *sim, const ms_scene *before, const msim_state *to,
                                      msim_error *err) {
  const int32_t n = sim->nislands;
  ms_moving_pins **pins;
  if (!MS_NEW(&sim->alloc, pins, n)) return ms_error_set_memory(err, "the motions");
  msim_status status = create_pins(sim, sim->scene, pins, err);
  if (!status) {
    exchange_pins(sim, sim->scene, pins);
    status = msim_sim_set_state(sim, to, err);
    if (status) exchange_pins(sim, before, pins);
  }
  for (int32_t i = 0; i < n; i++) ms_moving_pins_destroy(before, pins[i]);
  ms_memory_free(&sim->alloc, pins);
  return status;
}

/* Start a run with this scene in the state of x and v, which get the velocities of motions, and
 * release the scene or the one before. The change of energy is work. moves: only motions differ. */
static msim_status restart(msim_sim *sim, ms_scene *scene, int moves, double *x, double *v,
                           msim_error *err) {
  msim_state to = {.size = sizeof to};
  msim_sim_state(sim, &to);
  const double energy = total_energy(sim->scene, &to);
  ms_moving_pins_set_arrays(scene, (ms_instant){.t = to.t}, x, v);
  to.x = x, to.v = v, to.v_half = NULL;
  const ms_config config = sim->config;
  const ms_run_state run = sim->run;
  ms_scene *before = sim->scene;
  ms_sim_free_matrix(sim); /* its model refers to the old scene */
  sim->scene = scene;
  to.work += total_energy(scene, &to) - energy;
  msim_status status = ms_sim_check_motions(sim, err);
  if (!status) {
    ms_sim_subtract_steps_made(sim);
    if (!moves) sim->config.choice.out_of_date = 1; /* other unknowns */
    status = moves ? start_with_motions(sim, before, &to, err) : msim_sim_set_state(sim, &to, err);
  }
  if (status) {
    sim->scene = before, sim->config = config, sim->run = run;
    ms_scene_release(scene);
    return status;
  }
  ms_sim_set_created_scene(sim, before);
  ms_scene_release(before);
  return ms_error_clear(err);
}

/*------------------------------------- changes --------------------------------------------------*/

/* A change of `copy`, the scene of a sim at time t whose state is x, v */
typedef struct pin_change {
  int32_t n;
  const int32_t *particles;
  int pinned;         /* 0: let them go */
  const double *to;   /* n x 3: where they move; NULL: they stay */
  double t, duration; /* s */
} pin_change;

static msim_status add_motion(msim_scene *copy, const pin_change *c, const double *x,
                              msim_error *err) {
  const msim_allocator *alloc = &copy->data->alloc;
  const double t[2] = {c->t, c->t + c->duration};
  const size_t n = (size_t)c->n;
  double *points;
  if (!MS_NEW(alloc, points, 6 * n)) return ms_error_set_memory(err, "a motion");
  for (size_t i = 0; i < n; i++)
    memcpy(points + 3 * i, x + 3 * (size_t)c->particles[i], 3 * sizeof *points);
  memcpy(points + 3 * n, c->to, 3 * n * sizeof *points);
  const msim_motion m = {
      .size = sizeof m, .n = c->n, .particles = c->particles, .nt = 2, .t = t, .x = points};
  const msim_status status = msim_scene_add_motion(copy, &m, err);
  ms_memory_free(alloc, points);
  return status;
}

/* Particles are pinned where they are, without velocity, and go with the one that they have. */
static void set_pins(ms_scene *s, const pin_change *c, const double *x, double *v) {
  for (int32_t i = 0; i < c->n; i++) {
    const size_t p = (size_t)c->particles[i];
    s->pinned[p] = (uint8_t)c->pinned;
    memcpy(s->x + 3 * p, x + 3 * p, 3 * sizeof *s->x);
    memset(s->v + 3 * p, 0, 3 * sizeof *s->v);
    if (c->pinned) memset(v + 3 * p, 0, 3 * sizeof *v);
  }
}

static msim_status change_pins(msim_sim *sim, const pin_change *c, msim_error *err) {
  msim_state now = {.size = sizeof now};
  msim_sim_state(sim, &now);
  const size_t count = 3 * (size_t)now.n;
  double *x = ms_memory_allocate(&sim->alloc, 2 * count, sizeof *x);
  if (!x) return ms_error_set_memory(err, "the state");
  double *v = x + count;
  memcpy(x, now.x, count * sizeof *x);
  memcpy(v, now.v, count * sizeof *v);
  msim_scene copy;
  msim_status status = copy_scene(sim, c->n, c->particles, &copy, err);
  if (!status) {
    set_pins(copy.data, c, x, v);
    if (c->to) status = add_motion(&copy, c, x, err);
    if (status) ms_scene_release(copy.data);
    else status = restart(sim, copy.data, c->to != NULL, x, v, err);
  }
  ms_memory_free(&sim->alloc, x);
  return status;
}

msim_status msim_sim_move_pinned(msim_sim *sim, int32_t n, const int32_t *particles,
                                 const double *x, double duration, msim_error *err) {
  if (!sim || (n > 0 && (!particles || !x)))
    return ms_error_set(err, MSIM_ERR_ARG, "sim, particles or x is NULL");
  if (!(duration > 0) || !isfinite(duration))
    return ms_error_set(err, MSIM_ERR_ARG, "duration is %g; it must be a finite number > 0",
                        duration);
  msim_status status = check_pins(sim, n, particles, 1, err);
  if (!status && n) status = ms_scene_check_finite("x", 3 * (int64_t)n, 3, x, err);
  if (status || n == 0) return status ? status : ms_error_clear(err);
  const pin_change c = {.n = n,
                        .particles = particles,
                        .pinned = 1,
                        .to = x,
                        .t = ms_sim_time(sim),
                        .duration = duration};
  return change_pins(sim, &c, err);
}

msim_status msim_sim_set_pinned(msim_sim *sim, int32_t n, const int32_t *particles, int32_t pinned,
                                msim_error *err) {
  if (!sim || (n > 0 && !particles))
    return ms_error_set(err, MSIM_ERR_ARG, "sim or particles is NULL");
  if ((pinned | 1) != 1)
    return ms_error_set(err, MSIM_ERR_ARG, "pinned is %d; it must be 1, or 0 to let go", pinned);
  const msim_status status = check_pins(sim, n, particles, 0, err);
  if (status || n == 0) return status ? status : ms_error_clear(err);
  return change_pins(sim, &(pin_change){.n = n, .particles = particles, .pinned = pinned}, err);
}
