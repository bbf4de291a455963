#include "system.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *copy(const void *from, size_t bytes) {
  void *to = malloc(bytes);
  if (to) memcpy(to, from, bytes);
  return to;
}

/* The sim's matrix dies with it. */
static int copy_matrix(const msim_csr *from, msim_csr *to) {
  const size_t n = (size_t)from->n, entries = (size_t)from->rowptr[n];
  *to = (msim_csr){.size = sizeof *to,
                   .n = from->n,
                   .rowptr = copy(from->rowptr, (n + 1) * sizeof(int32_t)),
                   .colind = copy(from->colind, entries * sizeof(int32_t)),
                   .val = copy(from->val, entries * sizeof(double)),
                   .particle = copy(from->particle, n / 3 * sizeof(int32_t))};
  return to->rowptr && to->colind && to->val && to->particle;
}

/* b = M v + h F(x, 0) */
static void fill_vectors(const moving *m, const double *force, linear_system *s) {
  double sum = 0;
  for (int32_t i = 0; i < s->n; i++) {
    const int32_t particle = s->A.particle[i / 3], at = 3 * particle + i % 3;
    s->guess[i] = m->v[at];
    s->b[i] = m->view.mass[particle] * m->v[at] + s->h * force[at];
    sum += s->b[i] * s->b[i];
  }
  s->size = sqrt(sum);
}

static int take(const moving *m, msim_sim *sim, linear_system *s, msim_error *err) {
  msim_csr A = {.size = sizeof A};
  if (msim_sim_set_state(sim, &m->state, err) != MSIM_OK) return 0;
  if (msim_sim_matrix(sim, &A, err) != MSIM_OK) return 0;
  s->n = A.n;
  s->b = malloc((size_t)A.n * sizeof *s->b);
  s->guess = malloc((size_t)A.n * sizeof *s->guess);
  double *force = malloc(3 * (size_t)m->view.nparticles * sizeof *force);
  const int made = copy_matrix(&A, &s->A) && s->b && s->guess && force;
  if (made) {
    msim_sim_force(sim, m->x, m->none, force);
    fill_vectors(m, force, s);
  } else {
    snprintf(err->text, sizeof err->text, "out of memory for the matrix");
  }
  free(force);
  return made;
}

int system_make(const moving *m, double h, double rtol, linear_system *s, msim_error *err) {
  const msim_options options = implicit_options(h, rtol, "pcg", m->threads);
  msim_sim *sim = NULL;
  *s = (linear_system){.h = h, .rtol = rtol};
  const int made =
      msim_sim_create(m->scene, &options, &sim, err) == MSIM_OK && take(m, sim, s, err);
  msim_sim_destroy(sim);
  return made;
}

void system_free(linear_system *s) {
  free((void *)s->A.rowptr);
  free((void *)s->A.colind);
  free((void *)s->A.val);
  free((void *)s->A.particle);
  free(s->b);
  free(s->guess);
  *s = (linear_system){0};
}

double system_residual(const linear_system *s, const double *v) {
  const msim_csr *A = &s->A;
  double sum = 0;
  for (int32_t i = 0; i < s->n; i++) {
    double r = s->b[i];
    for (int32_t e = A->rowptr[i]; e < A->rowptr[i + 1]; e++) {
      const int32_t column = A->colind[e];
      r -= A->val[e] * v[3 * A->particle[column / 3] + column % 3];
    }
    sum += r * r;
  }
  return sqrt(sum) / s->size;
}
