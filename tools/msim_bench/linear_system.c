#include "linear_system.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

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
    s->b[i] = m->view.mass[particle] * m->v[at] + s->h * force[at] - row_product(s, i, m->v);
  }
  s->size = block_jacobi_norm(&s->A, s->b);
}

static int build_system(const moving_scene *m, linear_system *s, msim_error *err) {
  if (msim_sim_set_state(s->sim, &m->state, err) != MSIM_OK) return 0;
  if (msim_sim_matrix(s->sim, &s->A, err) != MSIM_OK) return 0;
  s->n = s->A.n, s->particles = m->view.nparticles;
  s->b = malloc((size_t)s->n * sizeof *s->b);
  s->v = malloc((size_t)s->n * sizeof *s->v);
  double *force = malloc(3 * (size_t)s->particles * sizeof *force);
  const int made = s->b && s->v && force;
  if (made) {
    msim_sim_force(s->sim, m->x, m->zeros, force);
    fill_vectors(m, force, s);
  } else {
    snprintf(err->text, sizeof err->text, "out of memory for the right-hand side");
  }
  free(force);
  return made;
}

int linear_system_create(const moving_scene *m, double h, double rtol, linear_system *s,
                         msim_error *err) {
  const msim_options options = implicit_options(h, rtol, "pcg", m->threads);
  *s = (linear_system){.h = h, .rtol = rtol, .A = {.size = sizeof s->A}};
  return msim_sim_create(m->scene, &options, &s->sim, err) == MSIM_OK && build_system(m, s, err);
}

void linear_system_free(linear_system *s) {
  msim_sim_destroy(s->sim);
  free(s->b);
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
