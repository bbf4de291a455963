#include "physics/particle_blocks.h"

#include <float.h>
#include <math.h>

/* A B <- R^T B R and V <- V R, with the rotation R in the plane (p, q) that makes B_pq = 0 (Jacobi
 * 1846; Golub and Van Loan, Matrix Computations, 8.5) */
static void rotate(double B[3][3], double V[3][3], int p, int q) {
  if (B[p][q] == 0) return;
  const double theta = (B[q][q] - B[p][p]) / (2 * B[p][q]);
  const double t = copysign(1, theta) / (fabs(theta) + hypot(theta, 1)), c = 1 / hypot(t, 1);
  const double s = t * c;
  for (int k = 0; k < 3; k++) {
    const double kp = B[k][p], kq = B[k][q], vp = V[k][p], vq = V[k][q];
    B[k][p] = c * kp - s * kq, B[k][q] = s * kp + c * kq;
    V[k][p] = c * vp - s * vq, V[k][q] = s * vp + c * vq;
  }
  for (int k = 0; k < 3; k++) {
    const double pk = B[p][k], qk = B[q][k];
    B[p][k] = c * pk - s * qk, B[q][k] = s * pk + c * qk;
  }
}

/* Gershgorin's discs show that no eigenvalue is below `least`. */
static int is_above(double B[3][3], double least) {
  for (int a = 0; a < 3; a++)
    if (!(B[a][a] - fabs(B[a][(a + 1) % 3]) - fabs(B[a][(a + 2) % 3]) >= least)) return 0;
  return 1;
}

/* Raise the eigenvalues below `least` to that. A few sweeps reach rounding level. */
static void raise_eigenvalues(double B[3][3], double least) {
  enum { SWEEPS = 8 };
  double D[3][3], V[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  if (is_above(B, least)) return;
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) D[a][b] = B[a][b];
  for (int sweep = 0; sweep < SWEEPS; sweep++)
    rotate(D, V, 0, 1), rotate(D, V, 0, 2), rotate(D, V, 1, 2);
  for (int k = 0; k < 3; k++) {
    const double more = fmax(0, least - D[k][k]);
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++) B[a][b] += more * V[a][k] * V[b][k];
  }
}

void ms_particle_blocks_compute(const ms_model *model, double h, int clamp, double *blocks) {
  const ms_force_function *f = model->function;
  const size_t stride = (size_t)model->unknowns.first_pinned;
  for (int32_t i = 0; i < f->n; i++) {
    const double *x = f->dfdx + 9 * (size_t)i, *v = f->dfdv + 9 * (size_t)i;
    const size_t row = (size_t)f->row[i];
    double B[3][3];
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++)
        B[a][b] = -0.5 * h * (v[3 * a + b] + v[3 * b + a] + h * (x[3 * a + b] + x[3 * b + a]));
    raise_eigenvalues(B, clamp ? 0 : -0.5 * model->mass[row]);
    for (size_t a = 0; a < 3; a++)
      for (size_t b = a; b < 3; b++)
        blocks[ms_coefficients_diagonal_element(3, a, b) * stride + row] = B[a][b];
  }
}

double ms_particle_blocks_apply(const ms_model *model, const double *blocks, int without_mean,
                                double by, ms_operands o) {
  const size_t sd = (size_t)model->unknowns.first_pinned, stride = (size_t)model->unknowns.stride;
  const double *xx = blocks, *yy = xx + sd, *zz = yy + sd, *xy = zz + sd, *xz = xy + sd,
               *yz = xz + sd;
  double sum = 0;
  for (size_t r = 0; r < (size_t)model->unknowns.nfree; r++) { /* of 3 components */
    const double mean = without_mean ? ms_particle_blocks_mean(model, blocks, (int32_t)r) : 0;
    const double x = ms_operands_get(&o, r), y = ms_operands_get(&o, stride + r),
                 z = ms_operands_get(&o, 2 * stride + r);
    const double a = -mean * x + xx[r] * x + xy[r] * y + xz[r] * z,
                 b = -mean * y + xy[r] * x + yy[r] * y + yz[r] * z,
                 c = -mean * z + xz[r] * x + yz[r] * y + zz[r] * z;
    ms_operands_add(&o, r, by * a), ms_operands_add(&o, stride + r, by * b);
    ms_operands_add(&o, 2 * stride + r, by * c);
    sum += by * a * x, sum += by * b * y, sum += by * c * z;
  }
  return sum;
}
