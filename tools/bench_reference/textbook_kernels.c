/* The textbook step, compiled once for each instruction set (MS_ISA), like the library's loops. */
#include <math.h>

#include "textbook.h"

/* F = m g + sum of k (l - L) d/l */
static void textbook_forces(const textbook *t) {
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
static void textbook_step(textbook *t, double h) {
  textbook_forces(t);
  double *restrict x = t->x, *restrict v = t->v;
  const double *restrict f = t->f;
  for (int32_t i = 0; i < t->nparticles; i++)
    for (int c = 0; c < 3; c++) {
      v[3 * i + c] += h * t->inverse_mass[i] * f[3 * i + c];
      x[3 * i + c] += h * v[3 * i + c];
    }
}

#define TEXT_(word) #word
#define TEXT(word)  TEXT_(word)
const textbook_kernels MS_TABLE(textbook_kernels) = {TEXT(MS_ISA), textbook_step};
