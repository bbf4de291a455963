/* change_colliders - move the colliders of a running sim: a new run starts from the present state
 * */
#include <math.h>

#include "api/change_scene.h"

/* From where it is to x and rotation within `duration` from time t on */
typedef struct collider_change {
  int32_t collider;
  const double *x, *rotation; /* 3; rotation NULL: it stays */
  double t, duration;         /* s */
} collider_change;

static msim_status change_scene(msim_scene *copy, const void *data, double *x, double *v,
                                msim_error *err) {
  const collider_change *change = data;
  const ms_scene *s = copy->data;
  const double t[2] = {change->t, change->t + change->duration};
  double at[2][3], w[2][3];
  (void)x, (void)v;
  ms_collider_motion_get_pose(s, change->collider, (ms_instant){.t = change->t}, at[0], w[0]);
  for (int c = 0; c < 3; c++) {
    at[1][c] = change->x[c];
    w[1][c] = change->rotation ? change->rotation[c] : w[0][c];
  }
  const int rotates = change->rotation || s->collider_motions[change->collider].rotation.nt;
  const msim_collider_motion motion = {.size = sizeof motion,
                                       .collider = change->collider,
                                       .nt = 2,
                                       .t = t,
                                       .x = at[0],
                                       .rotation = rotates ? w[0] : NULL};
  return msim_scene_set_collider_motion(copy, &motion, err);
}

static msim_status check_collider_move(const msim_sim *sim, const collider_change *c,
                                       msim_error *err) {
  if (c->collider < 0 || c->collider >= sim->scene->ncolliders)
    return ms_error_set(err, MSIM_ERR_ARG, "collider is %d; there are %d colliders, counted from 0",
                        c->collider, sim->scene->ncolliders);
  if (c->duration > 0 && isfinite(c->duration)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG, "duration is %g; it must be a finite number > 0",
                      c->duration);
}

msim_status msim_sim_move_collider(msim_sim *sim, int32_t collider, const double *x,
                                   const double *rotation, double duration, msim_error *err) {
  if (!sim || !x) return ms_error_set(err, MSIM_ERR_ARG, "sim or x is NULL");
  const collider_change c = {collider, x, rotation, ms_sim_time(sim), duration};
  const msim_status status = ms_ranks_agree(sim->ranks, check_collider_move(sim, &c, err), err);
  return status ? status : ms_change_scene(sim, change_scene, &c, 1, err);
}
