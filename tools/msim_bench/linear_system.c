#include "linear_system.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *copy_bytes(const void *from, size_t bytes) {
  void *to = malloc(bytes);
  if (to) memcpy(to, from, bytes);
  return to;
}

/* Copies the matrix, which the sim owns and frees. */
static int copy_matrix(const msim_csr *from, msim_csr *to) {
  const size_t n = (size_t)from->n, entries = (size_t)from->rowptr[n];
  *to = (msim_csr){.size = sizeof *to,
                   .n = from->n,
                   .rowptr = copy_bytes(from->rowptr, (n + 1) * sizeof(int32_t)),
                   .colind = copy_bytes(from->colind, entries * sizeof(int32_t)),
                   .val = copy_bytes(from->val, entries * sizeof(double)),
                   .particle = copy_bytes(from->particle, n / 3 * sizeof(int32_t))};
  return to->rowptr && to->colind && to->val && to->particle;
}

/* Row i of A times the velocities y of all particles */
static double row_product(const linear_system *s, int32_t i, const double *y) {
  const msim_csr *A = &s->A;
  double sum = 0;
  for (int32_t e = A->rowptr[i]; e < A->rowptr[i + 1]; e++) {
    const int32_t column = A->colind[e];
    sum += A->val[e] * y[3 * A->particle[column / 3] + column % 3];
  }
  return sum;
}

static double csr_entry(const msim_csr *A, int32_t row, int32_t column) {
  for (int32_t e = A->rowptr[row]; e < A->rowptr[row + 1]; e++)
    if (A->colind[e] == column) return A->val[e];
  return 0;
}

/* sqrt(r.D^-1 r), where D is the block diagonal of A, by Cholesky factors: the norm of
 * solver.rtol */
static double block_jacobi_norm(const msim_csr *A, const double *r) {
  double sum = 0;
  for (int32_t first = 0; first < A->n; first += 3) {
    double l[3][3], y[3];
    for (int i = 0; i < 3; i++) {
      y[i] = r[first + i];
      for (int k = 0; k <= i; k++) {
        l[i][k] = csr_entry(A, first + i, first + k);
        for (int q = 0; q < k; q++) l[i][k] -= l[i][q] * l[k][q];
        l[i][k] = k < i ? l[i][k] / l[k][k] : sqrt(l[i][k]);
        if (k < i) y[i] -= l[i][k] * y[k];
      }
      y[i] /= l[i][i];
      sum += y[i] * y[i];
    }
  }
  return sqrt(sum);
}

/* b = M v + h F(x, 0) - A v */
static void fill_vectors(const moving_scene *m, const double *force, linear_system *s) {
  for (int32_t i = 0; i < s->n; i++) {
    const int32_t particle = s->A.particle[i / 3], at = 3 * particle + i % 3;
    s->v[i] = m->v[at];
    s->guess[i] = 0;
    s->b[i] = m->view.mass[particle] * m->v[at] + s->h * force[at] - row_product(s, i, m->v);
  }
  s->size = block_jacobi_norm(&s->A, s->b);
}

static int build_system(const moving_scene *m, msim_sim *sim, linear_system *s, msim_error *err) {
  msim_csr A = {.size = sizeof A};
  if (msim_sim_set_state(sim, &m->state, err) != MSIM_OK) return 0;
  if (msim_sim_matrix(sim, &A, err) != MSIM_OK) return 0;
  s->n = A.n, s->particles = m->view.nparticles;
  s->b = malloc((size_t)A.n * sizeof *s->b);
  s->guess = malloc((size_t)A.n * sizeof *s->guess);
  s->v = malloc((size_t)A.n * sizeof *s->v);
  double *force = malloc(3 * (size_t)m->view.nparticles * sizeof *force);
  const int made = copy_matrix(&A, &s->A) && s->b && s->guess && s->v && force;
  if (made) {
    msim_sim_force(sim, m->x, m->zeros, force);
    fill_vectors(m, force, s);
  } else {
    snprintf(err->text, sizeof err->text, "out of memory for the matrix");
  }
  free(force);
  return made;
}

int linear_system_create(const moving_scene *m, double h, double rtol, linear_system *s,
                         msim_error *err) {
  const msim_options options = implicit_options(h, rtol, "pcg", m->threads);
  msim_sim *sim = NULL;
  *s = (linear_system){.h = h, .rtol = rtol};
  const int made =
      msim_sim_create(m->scene, &options, &sim, err) == MSIM_OK && build_system(m, sim, s, err);
  msim_sim_destroy(sim);
  return made;
}

void linear_system_free(linear_system *s) {
  free((void *)s->A.rowptr);
  free((void *)s->A.colind);
  free((void *)s->A.val);
  free((void *)s->A.particle);
  free(s->b);
  free(s->guess);
  free(s->v);
  *s = (linear_system){0};
}

double linear_system_residual(const linear_system *s, const double *v) {
  double *r = malloc((size_t)s->n * sizeof *r), *dv = calloc((size_t)s->particles, 3 * sizeof *dv);
  double result = NAN;
  if (r && dv) {
    for (int32_t i = 0; i < s->n; i++) {
      const int32_t at = 3 * s->A.particle[i / 3] + i % 3;
      dv[at] = v[at] - s->v[i];
    }
    for (int32_t i = 0; i < s->n; i++) r[i] = s->b[i] - row_product(s, i, dv);
    result = block_jacobi_norm(&s->A, r) / s->size;
  }
  free(r), free(dv);
  return result;
}
