#include "linear/momentum.h"

#include <string.h>

#include "layout/components.h"

/* Number the components without pinned particles. number: scratch, nfree zeros */
static void number_components(const ms_model *model, int32_t *number, ms_momentum_components *f) {
  const ms_springs *s = &model->springs;
  const int32_t nfree = model->unknowns.nfree;
  const int32_t components = ms_components_number(&model->unknowns, s, &model->angles, f->of);
  for (int32_t e = 0; e < s->n; e++) {
    if (s->i[e] < nfree && s->j[e] >= nfree) number[f->of[s->i[e]]] = -1;
    if (s->j[e] < nfree && s->i[e] >= nfree) number[f->of[s->j[e]]] = -1;
  }
  for (int32_t c = 0; c < 3 * model->angles.n; c++) {
    const int32_t row = model->angles.row[c], vertex = model->angles.row[c - c % 3 + 1];
    const int32_t other = row == vertex ? -1 : vertex;
    if (row < nfree && other >= nfree) number[f->of[row]] = -1;
    if (other >= 0 && other < nfree && row >= nfree) number[f->of[other]] = -1;
  }
  for (int32_t k = 0; k < components; k++)
    if (number[k] == 0) number[k] = f->n++;
  for (int32_t row = 0; row < nfree; row++) f->of[row] = number[f->of[row]];
}

msim_status ms_momentum_create_components(const ms_model *model, ms_momentum_components *f,
                                          msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const int32_t nfree = model->unknowns.nfree;
  int32_t *number = NULL;
  *f = (ms_momentum_components){0};
  int fits = MS_NEW(alloc, number, nfree) && MS_NEW(alloc, f->of, nfree);
  if (fits) number_components(model, number, f);
  if (f->n == 0) ms_memory_free(alloc, f->of), f->of = NULL;
  fits = fits && MS_NEW(alloc, f->sums, 4 * (size_t)f->n);
  ms_memory_free(alloc, number);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the linear solver");
}

void ms_momentum_destroy_components(const ms_model *model, ms_momentum_components *f) {
  MS_FREE(&model->scene->alloc, f->of, f->sums);
  *f = (ms_momentum_components){0};
}

void ms_momentum_balance(const ms_model *model, const ms_coefficients *a,
                         const ms_momentum_components *f, const double *b, double *y) {
  const size_t stride = (size_t)model->unknowns.stride, dims = (size_t)model->unknowns.dims;
  if (f->n == 0 || a->own) return;
  memset(f->sums, 0, 4 * (size_t)f->n * sizeof *f->sums);
  for (int32_t row = 0; row < model->unknowns.nfree; row++) {
    if (f->of[row] < 0) continue;
    double *sum = f->sums + 4 * f->of[row];
    const double inertia = model->mass[row] + a->drag;
    sum[0] += inertia;
    for (size_t c = 0; c < dims; c++) {
      const size_t at = c * stride + (size_t)row;
      sum[c + 1] += b[at] - inertia * y[at];
    }
  }
  for (int32_t i = 0; i < a->nconstraints; i++)
    if (f->of[a->constraint[i].row] >= 0) f->sums[4 * f->of[a->constraint[i].row]] = 0;
  for (int32_t row = 0; row < model->unknowns.nfree; row++) {
    const double *sum = f->of[row] < 0 ? NULL : f->sums + 4 * f->of[row];
    for (size_t c = 0; c < dims && sum && sum[0] > 0; c++)
      y[c * stride + (size_t)row] += sum[c + 1] / sum[0];
  }
}
