#include "integrate/damper_strength.h"

#include <math.h>

#include "physics/rank_model.h"
#include "scene/laws.h"

/* 1: a damper c of any rank exceeds share ah k, k the stiffness of its spring, and ah c exceeds the
 * mass of a free end. From share = 0.1 on its non-symmetric term is more than a small part of the
 * matrix. */
static int has_damper_above(const ms_model *model, double ah, double share) {
  const ms_springs *s = &model->springs;
  double found = 0;
  for (int32_t e = 0; e < s->n && found == 0; e++) {
    double mass = INFINITY;
    if (s->i[e] < model->unknowns.nfree) mass = fmin(mass, model->mass[s->i[e]]);
    if (s->j[e] < model->unknowns.nfree) mass = fmin(mass, model->mass[s->j[e]]);
    const double c = ms_scene_damping(model->scene, ms_springs_number(s, e));
    found =
        c > share * ah * ms_scene_stiffness(model->scene, ms_springs_number(s, e)) && ah * c > mass;
  }
  ms_ranks_maximum(model->shape.ranks, 1, &found);
  return found > 0;
}

ms_damper_strength ms_damper_strength_find(const ms_model *model, double ah) {
  if (!(model->features & MS_HAS_DAMPING) || !has_damper_above(model, ah, 0.1))
    return MS_DAMPERS_WEAK;
  return has_damper_above(model, ah, 1) ? MS_DAMPERS_DOMINANT : MS_DAMPERS_STRONG;
}
