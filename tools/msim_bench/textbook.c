#include "textbook.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int textbook_make(const moving *m, textbook *t) {
  const msim_scene_view *s = &m->view;
  const size_t n = (size_t)s->nparticles;
  *t = (textbook){.nparticles = s->nparticles,
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
  memcpy(t->x, m->x, 3 * n * sizeof(double));
  memcpy(t->v, m->v, 3 * n * sizeof(double));
  for (size_t i = 0; i < n; i++) t->inverse_mass[i] = s->pinned[i] ? 0 : 1 / s->mass[i];
  return 1;
}

void textbook_free(textbook *t) {
  void *arrays[] = {t->x, t->v, t->f, t->inverse_mass};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
  *t = (textbook){0};
}

/* F = m g + sum of k (l - L) d/l */
static void forces(const textbook *t) {
  const double *restrict x = t->x;
  double *restrict f = t->f;
  for (int32_t i = 0; i < t->nparticles; i++)
    for (int c = 0; c < 3; c++) f[3 * i + c] = t->mass[i] * t->gravity[c];
  for (int32_t e = 0; e < t->nsprings; e++) {
    const int32_t i = 3 * t->ij[2 * e], j = 3 * t->ij[2 * e + 1];
    const double dx = x[j] - x[i], dy = x[j + 1] - x[i + 1], dz = x[j + 2] - x[i + 2];
    const double l = sqrt(dx * dx + dy * dy + dz * dz);
    const double scale = l > 0 ? t->k[e] * (l - t->rest[e]) / l : 0;
    f[i] += scale * dx, f[i + 1] += scale * dy, f[i + 2] += scale * dz;
    f[j] -= scale * dx, f[j + 1] -= scale * dy, f[j + 2] -= scale * dz;
  }
}

/* v' = v + h F/m, x' = x + h v' */
void textbook_step(textbook *t, double h) {
  forces(t);
  double *restrict x = t->x, *restrict v = t->v;
  const double *restrict f = t->f;
  for (int32_t i = 0; i < t->nparticles; i++)
    for (int c = 0; c < 3; c++) {
      v[3 * i + c] += h * t->inverse_mass[i] * f[3 * i + c];
      x[3 * i + c] += h * v[3 * i + c];
    }
}
