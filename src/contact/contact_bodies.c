#include "contact/contact_bodies.h"

#include <string.h>

msim_status ms_contact_bodies_create(const ms_model *model, ms_contact_bodies *b, msim_error *err) {
  const msim_status status = ms_momentum_create_components(model, &b->body, err);
  const msim_allocator *alloc = &model->scene->alloc;
  if (status) return status;
  const size_t n = (size_t)b->body.n + 1;
  if (MS_NEW(alloc, b->parent, n) && MS_NEW(alloc, b->touches, n) && MS_NEW(alloc, b->sum, 4 * n))
    return MSIM_OK;
  return ms_error_set_memory(err, "the contact of surfaces");
}

void ms_contact_bodies_destroy(const ms_model *model, ms_contact_bodies *b) {
  ms_momentum_destroy_components(model, &b->body);
  MS_FREE(&model->scene->alloc, b->parent, b->touches, b->sum);
}

void ms_contact_bodies_separate(ms_contact_bodies *b) {
  for (int32_t i = 0; i <= b->body.n; i++) b->parent[i] = i, b->touches[i] = 0;
}

/* The group of a body: the root of its tree, whose paths are halved by the search. */
static int32_t find_group(ms_contact_bodies *b, int32_t row) {
  const int32_t body = row >= 0 ? ms_momentum_find_component(&b->body, row) : -1;
  int32_t i = body >= 0 ? body : b->body.n;
  while (b->parent[i] != i) i = b->parent[i] = b->parent[b->parent[i]];
  return i;
}

void ms_contact_bodies_join(ms_contact_bodies *b, int32_t row, int32_t other) {
  const int32_t group = find_group(b, other);
  b->parent[find_group(b, row)] = group;
  b->touches[group] = 1;
}

/* The sums of W and W d over groups; those over the one that is held are set to 0. */
static void sum_groups(ms_contact_bodies *b, const ms_model *model, double drag, const double *d) {
  memset(b->sum, 0, 4 * (size_t)(b->body.n + 1) * sizeof *b->sum);
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    double *sum = b->sum + 4 * (size_t)find_group(b, r), at[3];
    const double inertia = model->mass[r] + drag;
    ms_unknowns_get(&model->unknowns, d, r, at);
    sum[0] += inertia;
    for (int c = 0; c < 3; c++) sum[1 + c] += inertia * at[c];
  }
  memset(b->sum + 4 * (size_t)find_group(b, -1) + 1, 0, 3 * sizeof *b->sum);
}

void ms_contact_bodies_balance(ms_contact_bodies *b, const ms_model *model, double drag,
                               double *d) {
  sum_groups(b, model, drag, d);
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const double *sum = b->sum + 4 * (size_t)find_group(b, r);
    double at[3];
    ms_unknowns_get(&model->unknowns, d, r, at);
    for (int c = 0; c < 3; c++) at[c] -= sum[1 + c] / sum[0];
    ms_unknowns_set(&model->unknowns, at, r, d);
  }
}

/* What of the sums of d over groups is along planes: one after the other, as several may not be
 * perpendicular */
static void project_sums(ms_contact_bodies *b, const ms_contact_surface *surface,
                         const ms_surface_pair *plane) {
  enum { SWEEPS = 8 };
  for (int sweep = 0; sweep < SWEEPS; sweep++)
    for (int32_t k = 0; k < surface->nnodes; k++) {
      if (!plane[k].is_active) continue;
      double *sum = b->sum + 4 * (size_t)find_group(b, surface->row[k]) + 1;
      ms_vec3_axpy(-ms_vec3_dot(sum, plane[k].normal), plane[k].normal, sum);
    }
}

void ms_contact_bodies_halve(ms_contact_bodies *b, const ms_model *model,
                             const ms_contact_surface *surface, const ms_surface_pair *plane,
                             double *d) {
  sum_groups(b, model, 0, d);
  if (plane) project_sums(b, surface, plane);
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const int32_t group = find_group(b, r);
    const double *sum = b->sum + 4 * (size_t)group;
    double at[3];
    if (!b->touches[group]) continue;
    ms_unknowns_get(&model->unknowns, d, r, at);
    for (int c = 0; c < 3; c++) at[c] = 0.5 * (at[c] + sum[1 + c] / sum[0]);
    ms_unknowns_set(&model->unknowns, at, r, d);
  }
}
