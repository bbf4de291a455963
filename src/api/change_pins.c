/* change_pins - pin particles, let them go, or move them in a running sim: a new run starts from
 * the present state */
#include <math.h>
#include <string.h>

#include "api/change_scene.h"
#include "sim/rank_scene.h"

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

static msim_status change_scene(msim_scene *copy, const void *data, double *x, double *v,
                                msim_error *err) {
  const pin_change *c = data;
  for (int32_t i = 0; i < c->n; i++) ms_scene_remove_motion(copy->data, c->particles[i]);
  set_pins(copy->data, c, x, v);
  return c->to ? add_motion(copy, c, x, err) : MSIM_OK;
}

static msim_status change_pins(msim_sim *sim, const pin_change *c, msim_error *err) {
  return ms_change_scene(sim, change_scene, c, c->to != NULL, err);
}

static msim_status check_pin_move(const msim_sim *sim, const pin_change *c, msim_error *err) {
  if (!(c->duration > 0) || !isfinite(c->duration))
    return ms_error_set(err, MSIM_ERR_ARG, "duration is %g; it must be a finite number > 0",
                        c->duration);
  const msim_status status = check_pins(sim, c->n, c->particles, 1, err);
  return status || c->n == 0 ? status
                             : ms_scene_check_finite("x", 3 * (int64_t)c->n, 3, c->to, err);
}

msim_status msim_sim_move_pinned(msim_sim *sim, int32_t n, const int32_t *particles,
                                 const double *x, double duration, msim_error *err) {
  if (!sim || (n > 0 && (!particles || !x)))
    return ms_error_set(err, MSIM_ERR_ARG, "sim, particles or x is NULL");
  const msim_status gathered = ms_rank_scene_gather(sim, err);
  if (gathered) return gathered;
  const pin_change c = {.n = n,
                        .particles = particles,
                        .pinned = 1,
                        .to = x,
                        .t = ms_sim_time(sim),
                        .duration = duration};
  const msim_status status = ms_ranks_agree(sim->ranks, check_pin_move(sim, &c, err), err);
  if (status || n == 0) return status ? status : ms_error_clear(err);
  return change_pins(sim, &c, err);
}

msim_status msim_sim_set_pinned(msim_sim *sim, int32_t n, const int32_t *particles, int32_t pinned,
                                msim_error *err) {
  if (!sim || (n > 0 && !particles))
    return ms_error_set(err, MSIM_ERR_ARG, "sim or particles is NULL");
  msim_status status = ms_rank_scene_gather(sim, err);
  if (status) return status;
  status = check_pins(sim, n, particles, 0, err);
  if ((pinned | 1) != 1)
    status = ms_error_set(err, MSIM_ERR_ARG, "pinned is %d; it must be 1, or 0 to let go", pinned);
  status = ms_ranks_agree(sim->ranks, status, err);
  if (status || n == 0) return status ? status : ms_error_clear(err);
  return change_pins(sim, &(pin_change){.n = n, .particles = particles, .pinned = pinned}, err);
}
