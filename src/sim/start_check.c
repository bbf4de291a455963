#include "sim/start_check.h"

#include <stdio.h>

#include "base/vec3.h"
#include "physics/signed_distance.h"

static const double ROUNDING = 1e-9; /* relative, of coordinates in scene files */

/* The obstacle that x is deepest in. */
typedef struct obstacle {
  const char *relation, *name; /* "behind", "planes" */
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
      found = (obstacle){"behind", "planes", i, depth};
  }
  for (int32_t i = 0; i < s->ncolliders; i++) {
    ms_solid room;
    const ms_solid *solid = ms_collider_motion_place(s, i, (ms_instant){0}, &room);
    const double depth = -ms_signed_distance(solid, x, normal);
    if (depth > fmax(found.depth, ROUNDING * (size + solid->reach)))
      found = (obstacle){solid->inside ? "outside" : "inside", "colliders", i, depth};
  }
  return found;
}

void ms_start_check_warn(const msim_sim *sim) {
  const ms_scene *s = sim->scene;
  obstacle first = {0};
  int32_t particle = -1, count = 0;
  char others[48] = "";
  for (int32_t p = 0; p < s->nparticles && s->nplanes + s->ncolliders > 0; p++) {
    const obstacle found = s->pinned[p] ? (obstacle){0} : find_obstacle(s, s->x + 3 * (size_t)p);
    if (!found.name) continue;
    if (count++ == 0) first = found, particle = p;
  }
  if (count == 0) return;
  if (count > 1) snprintf(others, sizeof others, " (%d such particles in all)", count);
  ms_sim_warn(sim,
              "particle %d starts %.3g m %s %s[%d], which will move it at the first step%s; change "
              "its position or the %s",
              particle, first.depth, first.relation, first.name, first.index, others, first.name);
}
