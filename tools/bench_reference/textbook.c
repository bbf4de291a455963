#include "textbook.h"

#include <stdlib.h>
#include <string.h>

MS_TABLES(textbook_kernels);

int textbook_make(const msim_scene_view *s, const double *x, const double *v, textbook *t) {
  const size_t n = (size_t)s->nparticles;
  *t = (textbook){.kernels = textbook_kernels_of[ms_isa_choose()],
                  .nparticles = s->nparticles,
                  .nsprings = s->nsprings,
                  .ij = s->ij,
                  .k = s->k,
                  .rest = s->rest,
                  .mass = s->mass,
                  .x = malloc(3 * n * sizeof(double)),
                  .v = malloc(3 * n * sizeof(double)),
                  .f = malloc(3 * n * sizeof(double)),
                  .inverse_mass = malloc(n * sizeof(double))};
  if (!t->x || !t->v || !t->f || !t->inverse_mass) return 0;
  memcpy(t->gravity, s->gravity, sizeof t->gravity);
  memcpy(t->x, x, 3 * n * sizeof(double));
  memcpy(t->v, v, 3 * n * sizeof(double));
  for (size_t i = 0; i < n; i++) t->inverse_mass[i] = s->pinned[i] ? 0 : 1 / s->mass[i];
  return 1;
}

void textbook_free(textbook *t) {
  void *arrays[] = {t->x, t->v, t->f, t->inverse_mass};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
  *t = (textbook){0};
}
