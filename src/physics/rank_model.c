#include "physics/rank_model.h"

#include "base/vec3.h"
#include "physics/angle_springs.h"
#include "physics/law.h"

/*------------------------------------- springs of two ranks -------------------------------------*/

/* 1: the first free one of these particles belongs to another rank. */
static int counts_elsewhere(const ms_rank_part *part, int32_t n, const int32_t *particle) {
  int32_t c = 0;
  while (c + 1 < n && part->owner[particle[c]] < 0) c++;
  return part->owner[particle[c]] != part->ranks->rank;
}

static int list_foreign(const ms_model *model, const ms_rank_part *part, struct ms_rank_model *m) {
  const ms_scene *s = model->scene;
  if (!MS_NEW(&s->alloc, m->spring, model->springs.n) ||
      !MS_NEW(&s->alloc, m->angle, model->angles.n))
    return 0;
  for (int32_t e = 0; e < model->springs.n; e++)
    if (counts_elsewhere(part, 2, s->ij + 2 * (size_t)ms_springs_number(&model->springs, e)))
      m->spring[m->nsprings++] = e;
  for (int32_t e = 0; e < model->angles.n; e++)
    if (counts_elsewhere(part, 3, s->angles.ijk + 3 * (size_t)model->angles.angle[e]))
      m->angle[m->nangles++] = e;
  return 1;
}

double ms_rank_model_foreign_energy(const ms_model *model, const double *x) {
  const struct ms_rank_model *m = model->rank_model;
  double sum = 0;
  for (int32_t k = 0; m && k < m->nsprings; k++) {
    const int32_t e = m->spring[k];
    double a[3], b[3];
    ms_unknowns_get(&model->unknowns, x, model->springs.i[e], a);
    ms_unknowns_get(&model->unknowns, x, model->springs.j[e], b);
    const double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    sum += ms_law_value_of(model->scene, ms_springs_number(&model->springs, e), ms_vec3_norm(d))
               .energy;
  }
  for (int32_t k = 0; m && k < m->nangles; k++)
    sum += ms_angle_springs_energy_of(model, m->angle[k], x);
  return sum;
}

/*------------------------------------- connect --------------------------------------------------*/

/* Each loop of a sweep is the same on all ranks, as in one process. */
void ms_rank_model_share_features(ms_model *model) {
  enum { BITS = 10 };
  double bit[BITS];
  for (int i = 0; i < BITS; i++) bit[i] = model->features >> i & 1;
  ms_ranks_maximum(model->shape.ranks, BITS, bit);
  for (int i = 0; i < BITS; i++) model->features |= (bit[i] > 0 ? 1u : 0u) << i;
}

msim_status ms_rank_model_connect(ms_model *model, const ms_rank_part *part, msim_error *err) {
  const ms_scene *s = model->scene;
  struct ms_rank_model *m = model->rank_model = ms_memory_allocate(&s->alloc, 1, sizeof *m);
  if (m) m->part = part;
  const int fits = m && list_foreign(model, part, m);
  msim_status status = fits ? MSIM_OK : ms_error_set_memory(err, "the springs between ranks");
  status = ms_ranks_agree(part->ranks, status, err);
  if (!status) status = ms_halo_create(s, &model->unknowns, part, &m->halo, err);
  model->shape.ranks = model->state_shape.ranks = part->ranks;
  if (!status) ms_rank_model_share_features(model);
  return status;
}

void ms_rank_model_destroy(const ms_scene *scene, struct ms_rank_model *m) {
  if (!m) return;
  ms_halo_destroy(scene, m->halo);
  MS_FREE(&scene->alloc, m->spring, m->angle, m);
}
