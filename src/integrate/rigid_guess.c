#include "integrate/rigid_guess.h"

#include <math.h>
#include <string.h>

#include "physics/external_force.h"
#include "physics/rank_model.h"

/* Of all unknowns; X, V: of their centre of mass */
typedef struct rigid_motion {
  double mass, n, X[3], V[3], F[3]; /* F, over mass: gravity and constant forces */
  double L[3], I[3][3];             /* angular momentum and moments of inertia about X */
  double w[3];                      /* angular velocity */
} rigid_motion;

static void cross(const double a[3], const double b[3], double c[3]) {
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    c[i] = a[j] * b[k] - a[k] * b[j];
  }
}

static int has_pins(const ms_model *model) {
  const ms_unknowns *rows = &model->unknowns;
  int found = 0;
  for (int32_t r = rows->first_fixed; r < rows->stride && !found; r++)
    found = rows->particle[r] >= 0;
  return ms_rank_model_any(model, found);
}

static void find_means(const ms_stepper *s, const double *v, rigid_motion *motion) {
  const ms_model *model = s->model;
  const ms_unknowns *rows = &model->unknowns;
  double sum[11] = {0};
  for (int32_t r = 0; r < rows->nfree; r++) {
    const double m = model->mass[r];
    double x[3], u[3], f[3] = {0};
    ms_unknowns_get(rows, s->x, r, x);
    ms_unknowns_get(rows, v, r, u);
    if (model->force) ms_unknowns_get(rows, model->force, r, f);
    ms_vec3_axpy(m, model->external.gravity, f);
    sum[0] += m, sum[1]++;
    ms_vec3_axpy(m, x, sum + 2), ms_vec3_axpy(m, u, sum + 5), ms_vec3_axpy(1, f, sum + 8);
  }
  ms_ranks_sum(ms_rank_model_ranks(model), 11, sum);
  motion->mass = sum[0], motion->n = sum[1];
  for (int c = 0; c < 3; c++) {
    motion->X[c] = sum[2 + c] / sum[0];
    motion->V[c] = sum[5 + c] / sum[0];
    motion->F[c] = sum[8 + c] / sum[0];
  }
}

/* Solves I w = L; returns 0 where it is nearly singular, as of straight bodies. */
static int solve_inertia(rigid_motion *motion) {
  const double FLAT = 1e-9;
  double(*I)[3] = motion->I, column[3][3];
  const double trace = I[0][0] + I[1][1] + I[2][2];
  for (int c = 0; c < 3; c++) cross(I[(c + 1) % 3], I[(c + 2) % 3], column[c]);
  const double det = ms_vec3_dot(I[0], column[0]);
  if (!(det > FLAT * trace * trace * trace)) return 0;
  for (int c = 0; c < 3; c++) motion->w[c] = 0;
  for (int c = 0; c < 3; c++) ms_vec3_axpy(motion->L[c] / det, column[c], motion->w);
  return 1;
}

/* 1: the motion relative to V is mostly a rotation, by w. */
static int find_rotation(const ms_stepper *s, const double *v, rigid_motion *motion) {
  const double MOSTLY = 0.5;
  const ms_unknowns *rows = &s->model->unknowns;
  double sum[13] = {0}, *L = sum, *I = sum + 3, *energy = sum + 12;
  for (int32_t r = 0; r < rows->nfree; r++) {
    const double m = s->model->mass[r];
    double x[3], u[3], l[3];
    ms_unknowns_get(rows, s->x, r, x);
    ms_unknowns_get(rows, v, r, u);
    ms_vec3_axpy(-1, motion->X, x), ms_vec3_axpy(-1, motion->V, u);
    cross(x, u, l);
    ms_vec3_axpy(m, l, L);
    *energy += m * ms_vec3_dot(u, u);
    for (int c = 0; c < 3; c++) {
      I[4 * c] += m * ms_vec3_dot(x, x);
      ms_vec3_axpy(-m * x[c], x, I + 3 * c);
    }
  }
  ms_ranks_sum(ms_rank_model_ranks(s->model), 13, sum);
  memcpy(motion->L, L, sizeof motion->L);
  memcpy(motion->I, I, sizeof motion->I);
  return *energy > 0 && solve_inertia(motion) &&
         ms_vec3_dot(motion->w, motion->L) > MOSTLY * *energy;
}

/* u = R u; past a quarter of a turn u stays. */
static void rotate(const double w[3], double dt, double u[3]) {
  const double turn[3] = {dt * w[0], dt * w[1], dt * w[2]};
  const double left = 1 - ms_vec3_dot(turn, turn);
  double first[3], second[3];
  if (left < 0) return;
  cross(turn, u, first);
  cross(turn, first, second);
  ms_vec3_axpy(1, first, u);
  ms_vec3_axpy(1 / (1 + sqrt(left)), second, u);
}

/* The change of V, for drag b by (M + dt n b) V' = M V + dt F */
static void find_momentum_change(const ms_stepper *s, const rigid_motion *motion, double dt,
                                 double change[3]) {
  const double drag = motion->n / motion->mass * ms_external_matrix(&s->model->external, dt);
  for (int c = 0; c < 3; c++) change[c] = (dt * motion->F[c] - drag * motion->V[c]) / (1 + drag);
}

void ms_rigid_guess_advance(ms_stepper *s, double dt, double *v) {
  const ms_model *model = s->model;
  const ms_unknowns *rows = &model->unknowns;
  rigid_motion motion = {0};
  double change[3] = {0};
  if (!(model->features & MS_HAS_SPRINGS) || has_pins(model)) return;
  const int has_contacts = ms_stepper_has_contacts(s);
  find_means(s, v, &motion);
  const int rotates = find_rotation(s, v, &motion);
  if (!has_contacts && !model->function) find_momentum_change(s, &motion, dt, change);
  ms_vector_copy(model->shape, v, s->scratch);
  for (int32_t r = 0; r < rows->nfree; r++) {
    double u[3];
    ms_unknowns_get(rows, v, r, u);
    ms_vec3_axpy(-1, motion.V, u);
    if (rotates) rotate(motion.w, dt, u);
    ms_vec3_axpy(1, motion.V, u), ms_vec3_axpy(1, change, u);
    ms_unknowns_set(rows, u, r, v);
  }
  ms_stepper_copy_contacts(s, s->scratch, v);
}
