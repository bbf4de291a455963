#include "sim/start_check.h"

#include <stdio.h>

#include "base/vec3.h"
#include "physics/signed_distance.h"
#include "sim/rank_scene.h"

static const double ROUNDING = 1e-9; /* relative, of coordinates in scene files */

/* The obstacle that x is deepest in: a plane, or a collider, outside or inside of which it is */
typedef enum relation { BEHIND_PLANE, OUTSIDE, INSIDE } relation;
typedef struct obstacle {
  relation relation;
  int32_t index;
  double depth; /* m; 0: none */
} obstacle;

static obstacle find_obstacle(const ms_scene *s, const double x[3]) {
  const double size = ms_vec3_norm(x);
  obstacle found = {0};
  double normal[3];
  for (int32_t i = 0; i < s->nplanes; i++) {
    const msim_plane *p = &s->planes[i];
    const double depth = p->offset - ms_vec3_dot(p->normal, x);
    if (depth > fmax(found.depth, ROUNDING * (size + fabs(p->offset))))
      found = (obstacle){BEHIND_PLANE, i, depth};
  }
  for (int32_t i = 0; i < s->ncolliders; i++) {
    ms_solid room;
    const ms_solid *solid = ms_collider_motion_place(s, i, (ms_instant){0}, &room);
    const double depth = -ms_signed_distance(solid, x, normal);
    if (depth > fmax(found.depth, ROUNDING * (size + solid->reach)))
      found = (obstacle){solid->inside ? OUTSIDE : INSIDE, i, depth};
  }
  return found;
}

/* What is wrong: the first particle, and how many there are */
typedef struct finding {
  obstacle first;
  int32_t particle, count;
} finding;

static finding check_scene(const ms_scene *s) {
  finding f = {.particle = -1};
  for (int32_t p = 0; p < s->nparticles; p++) {
    const obstacle found = s->pinned[p] ? (obstacle){0} : find_obstacle(s, s->x + 3 * (size_t)p);
    if (!(found.depth > 0)) continue;
    if (f.count++ == 0) f.first = found, f.particle = p;
  }
  return f;
}

/* That of all slices */
static finding check_slices(const msim_sim *sim) {
  const finding own = check_scene(sim->kept->slice);
  finding all = {.particle = -1};
  for (int32_t r = 0; r < sim->ranks->n; r++) {
    finding f = own;
    f.particle += sim->kept->in_whole.first;
    ms_ranks_broadcast(sim->ranks, r, sizeof f, &f);
    if (all.count == 0) all.first = f.first, all.particle = f.particle;
    all.count += f.count;
  }
  return all;
}

void ms_start_check_warn(const msim_sim *sim) {
  static const char *const relations[] = {"behind", "outside", "inside"};
  if (!ms_scene_has_obstacles(sim->scene)) return;
  const finding f = sim->kept ? check_slices(sim) : check_scene(sim->scene);
  char others[48] = "";
  if (f.count == 0 || (sim->ranks && sim->ranks->failed)) return;
  const char *name = f.first.relation == BEHIND_PLANE ? "planes" : "colliders";
  if (f.count > 1) snprintf(others, sizeof others, " (%d such particles in all)", f.count);
  ms_sim_warn(sim,
              "particle %d starts %.3g m %s %s[%d], which will move it at the first step%s; change "
              "its position or the %s",
              f.particle, f.first.depth, relations[f.first.relation], name, f.first.index, others,
              name);
}
