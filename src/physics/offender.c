#include "physics/offender.h"

#include <math.h>

#include "base/vec3.h"
#include "physics/law.h"
#include "physics/spring_law.h"

/* |f(l)| + c |v_j - v_i| >= the magnitude of the force */
static double bound_force(const ms_model *m, int32_t e, const double *x, const double *v) {
  const ms_springs *s = &m->springs;
  double xi[3], xj[3], vi[3], vj[3], d[3], dv[3];
  ms_unknowns_get(&m->unknowns, x, s->i[e], xi), ms_unknowns_get(&m->unknowns, x, s->j[e], xj);
  ms_unknowns_get(&m->unknowns, v, s->i[e], vi), ms_unknowns_get(&m->unknowns, v, s->j[e], vj);
  for (int c = 0; c < 3; c++) d[c] = xj[c] - xi[c], dv[c] = vj[c] - vi[c];
  const double elastic =
      fabs(ms_law_value_of(m->scene, ms_springs_number(s, e), ms_vec3_norm(d)).force);
  const double c = ms_scene_damping(m->scene, ms_springs_number(s, e));
  return c > 0 ? elastic + MS_DASHPOT_FORCE(c, ms_vec3_norm(dv)) : elastic;
}

int32_t ms_offender_find_spring(const ms_model *model, const double *x, const double *v,
                                int32_t row) {
  const ms_springs *s = &model->springs;
  for (int32_t e = 0; e < s->n; e++)
    if ((s->i[e] == row || s->j[e] == row) && !(bound_force(model, e, x, v) <= MS_LARGEST_VALID))
      return ms_springs_number(s, e);
  return -1;
}

int32_t ms_offender_find_compressed(const ms_model *model, const ms_coefficients *a) {
  int32_t worst = 0;
  double largest = -1;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, r);
    double push = 0;
    for (int32_t at = span.begin; at < span.end; at += span.step) push += fmax(0, -a->t[at]);
    push *= model->inv_mass[r];
    if (push > largest) largest = push, worst = r;
  }
  return worst;
}
