#include "integrate/rigid_guess.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/external_force.h"
#include "physics/rank_model.h"

/* Of all unknowns. X, V: of their centre of mass; X_next, V_next: by the momentum of the stage */
typedef struct rigid_motion {
  double mass, n, X[3], V[3], V_next[3], X_next[3];
} rigid_motion;

/* Sums over particles; x: from the centre of mass */
typedef struct moments {
  double S[3][3]; /* m x x^T */
  double K[3][3]; /* x y^T, y: m times the velocity, or the residual */
  double energy;  /* m |v - V|^2 */
} moments;

static int has_pins(const ms_model *model) {
  const ms_unknowns *rows = &model->unknowns;
  int found = 0;
  for (int32_t r = rows->first_fixed; r < rows->stride && !found; r++)
    found = rows->particle[r] >= 0;
  return ms_rank_model_any(model, found);
}

/* The momentum of a stage is (M + ah n b) V' = M W + ah F, with the means W of w and X0 of x0. */
static void find_means(const ms_stepper *s, const ms_newton_stage *g, rigid_motion *motion) {
  const ms_model *model = s->model;
  const ms_unknowns *rows = &model->unknowns;
  double sum[17] = {0};
  for (int32_t r = 0; r < rows->nfree; r++) {
    const double m = model->mass[r], *vec[] = {s->x, g->v, g->x0, g->w};
    double y[3];
    sum[0] += m, sum[1]++;
    for (int i = 0; i < 4; i++) {
      ms_unknowns_get(rows, vec[i], r, y);
      ms_vec3_axpy(m, y, sum + 2 + 3 * i);
    }
    if (model->force) {
      ms_unknowns_get(rows, model->force, r, y);
      ms_vec3_axpy(1, y, sum + 14);
    }
  }
  ms_ranks_sum(ms_rank_model_ranks(model), 17, sum);
  motion->mass = sum[0], motion->n = sum[1];
  const double drag = ms_external_matrix(&model->external, g->ah);
  for (int c = 0; c < 3; c++) {
    const double force = sum[14 + c] + sum[0] * model->external.gravity[c];
    motion->X[c] = sum[2 + c] / sum[0];
    motion->V[c] = sum[5 + c] / sum[0];
    motion->V_next[c] = (sum[11 + c] + g->ah * force) / (sum[0] + sum[1] * drag);
    motion->X_next[c] = sum[8 + c] / sum[0] + g->ah * motion->V_next[c];
  }
}

static void add_product(double a, const double y[3], const double z[3], double sum[3][3]) {
  for (int i = 0; i < 3; i++) ms_vec3_axpy(a * y[i], z, sum[i]);
}

/* A w = b; returns 0 where A is nearly singular, as the inertia of straight bodies. */
static int solve(double A[3][3], const double b[3], double w[3]) {
  const double FLAT = 1e-9, trace = A[0][0] + A[1][1] + A[2][2];
  double column[3][3];
  for (int c = 0; c < 3; c++) ms_vec3_cross(A[(c + 1) % 3], A[(c + 2) % 3], column[c]);
  const double det = ms_vec3_dot(A[0], column[0]);
  if (!(det > FLAT * trace * trace * trace)) return 0;
  for (int c = 0; c < 3; c++) w[c] = 0;
  for (int c = 0; c < 3; c++) ms_vec3_axpy(b[c] / det, column[c], w);
  return 1;
}

/* u = R u, R the rotation about a by the angle whose sine is |a| < 1 */
static void rotate(const double a[3], double u[3]) {
  double first[3], second[3];
  ms_vec3_cross(a, u, first);
  ms_vec3_cross(a, first, second);
  ms_vec3_axpy(1, first, u);
  ms_vec3_axpy(1 / (1 + sqrt(1 - ms_vec3_dot(a, a))), second, u);
}

/* trace(A) - A, of A = sum m y y^T the inertia */
static void form_inertia(double A[3][3], double I[3][3]) {
  const double trace = A[0][0] + A[1][1] + A[2][2];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) I[i][j] = (i == j ? trace : 0) - A[i][j];
}

/* The vector sum y x z of A = sum y z^T */
static void form_torque(double A[3][3], double torque[3]) {
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    torque[i] = A[j][k] - A[k][j];
  }
}

/* The rotation R of less than a quarter of a turn with which R C is symmetric, as its columns: with
 * C = sum m y z^T the one that turns the y nearest to the z. By Newton's method; returns 0 where
 * there is none. */
static int find_rotation(double C[3][3], double R[3][3]) {
  enum { MOST = 20 };
  const double FAR = 0.5, NEAR = 1e-8;
  for (int i = 0; i < MOST; i++) {
    double RC[3][3] = {{0}}, A[3][3], torque[3], turn[3];
    if (i == 0) memset(R, 0, 9 * sizeof **R), R[0][0] = R[1][1] = R[2][2] = 1;
    for (int c = 0; c < 3; c++) add_product(1, R[c], C[c], RC);
    form_inertia(RC, A), form_torque(RC, torque);
    if (!solve(A, torque, turn)) return 0;
    const double size = ms_vec3_norm(turn);
    for (int c = 0; c < 3 && size > FAR; c++) turn[c] *= FAR / size;
    for (int c = 0; c < 3; c++) rotate(turn, R[c]);
    if (size < NEAR) return 1;
  }
  return 0;
}

static void apply_rotation(double R[3][3], double u[3]) {
  const double from[3] = {u[0], u[1], u[2]};
  u[0] = u[1] = u[2] = 0;
  for (int c = 0; c < 3; c++) ms_vec3_axpy(from[c], R[c], u);
}

/* u of a particle at x becomes the velocity of the next step of length dt: from y = x - dt u it
 * came to x, in the frame of the body by x - R y, and so goes on to R (x + (x - R y)). */
static void extrapolate(double R[3][3], double dt, const double x[3], double u[3]) {
  double before[3] = {x[0], x[1], x[2]}, next[3] = {2 * x[0], 2 * x[1], 2 * x[2]};
  ms_vec3_axpy(-dt, u, before);
  apply_rotation(R, before);
  ms_vec3_axpy(-1, before, next);
  apply_rotation(R, next);
  for (int c = 0; c < 3; c++) u[c] = (next[c] - x[c]) / dt;
}

/* 1: the motion relative to V is mostly a rotation, by R in the time dt before. */
static int find_past_rotation(const ms_stepper *s, double dt, const double *v,
                              const rigid_motion *motion, double R[3][3]) {
  const double MOSTLY = 0.5;
  const ms_unknowns *rows = &s->model->unknowns;
  double I[3][3], L[3], w[3];
  moments sum = {0};
  for (int32_t r = 0; r < rows->nfree; r++) {
    const double m = s->model->mass[r];
    double x[3], u[3];
    ms_unknowns_get(rows, s->x, r, x);
    ms_unknowns_get(rows, v, r, u);
    ms_vec3_axpy(-1, motion->X, x), ms_vec3_axpy(-1, motion->V, u);
    add_product(m, x, x, sum.S), add_product(m, x, u, sum.K);
    sum.energy += m * ms_vec3_dot(u, u);
  }
  ms_ranks_sum(ms_rank_model_ranks(s->model), sizeof sum / sizeof(double), &sum.S[0][0]);
  form_inertia(sum.S, I), form_torque(sum.K, L);
  if (!(sum.energy > 0 && solve(I, L, w) && ms_vec3_dot(w, L) > MOSTLY * sum.energy)) return 0;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) sum.S[i][j] -= dt * sum.K[j][i];
  return find_rotation(sum.S, R);
}

/* x, from the centre of mass, and minus the residual of unknown r at the guess, without gravity,
 * which has no moment about that centre */
static void find_residual(const ms_stepper *s, const ms_newton_stage *g, const rigid_motion *motion,
                          int32_t r, double x[3], double residual[3]) {
  const ms_model *model = s->model;
  const ms_unknowns *rows = &model->unknowns;
  const double m = model->mass[r];
  double v[3], w[3], f[3] = {0};
  ms_unknowns_get(rows, g->x0, r, x);
  ms_unknowns_get(rows, g->v, r, v);
  ms_unknowns_get(rows, g->w, r, w);
  if (model->force) ms_unknowns_get(rows, model->force, r, f);
  ms_vec3_axpy(g->ah, v, x), ms_vec3_axpy(-1, motion->X_next, x);
  const double inertia = m + ms_external_matrix(&model->external, g->ah);
  for (int c = 0; c < 3; c++) residual[c] = inertia * v[c] - m * w[c] - g->ah * f[c];
}

/* Turns the positions x' of the guess by the R that makes sum x' x residual 0: springs have no
 * moment. From v' on, R x' moves v by (R x' - x')/ah, so that R (ah K - S) is to be symmetric, with
 * S = sum (m + ah b) x' x'^T and K = sum x' residual^T. */
static void balance_moments(const ms_stepper *s, const ms_newton_stage *g,
                            const rigid_motion *motion) {
  const ms_unknowns *rows = &s->model->unknowns;
  const double drag = ms_external_matrix(&s->model->external, g->ah);
  moments sum = {0};
  double R[3][3];
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3], residual[3];
    find_residual(s, g, motion, r, x, residual);
    add_product(s->model->mass[r] + drag, x, x, sum.S), add_product(1, x, residual, sum.K);
  }
  ms_ranks_sum(ms_rank_model_ranks(s->model), sizeof sum / sizeof(double), &sum.S[0][0]);
  for (int i = 0; i < 3; i++) ms_vec3_axpy(-g->ah, sum.K[i], sum.S[i]);
  if (!find_rotation(sum.S, R)) return;
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3], turned[3], v[3];
    ms_unknowns_get(rows, g->x0, r, x);
    ms_unknowns_get(rows, g->v, r, v);
    ms_vec3_axpy(g->ah, v, x), ms_vec3_axpy(-1, motion->X_next, x);
    memcpy(turned, x, sizeof turned);
    apply_rotation(R, turned);
    ms_vec3_axpy(-1, x, turned), ms_vec3_axpy(1 / g->ah, turned, v);
    ms_unknowns_set(rows, v, r, g->v);
  }
}

void ms_rigid_guess_advance(ms_stepper *s, double dt, const ms_newton_stage *g) {
  const ms_model *model = s->model;
  const ms_unknowns *rows = &model->unknowns;
  rigid_motion motion;
  double R[3][3];
  if (!(model->features & MS_HAS_SPRINGS) || has_pins(model)) return;
  const int is_free = !ms_stepper_has_contacts(s) && !model->function;
  find_means(s, g, &motion);
  const int rotates = find_past_rotation(s, dt, g->v, &motion, R);
  if (!is_free) memcpy(motion.V_next, motion.V, sizeof motion.V);
  ms_vector_copy(model->shape, g->v, s->scratch);
  for (int32_t r = 0; r < rows->nfree; r++) {
    double x[3], u[3];
    ms_unknowns_get(rows, s->x, r, x);
    ms_unknowns_get(rows, g->v, r, u);
    ms_vec3_axpy(-1, motion.X, x), ms_vec3_axpy(-1, motion.V, u);
    if (rotates && is_free) extrapolate(R, dt, x, u);
    else if (rotates) apply_rotation(R, u);
    ms_vec3_axpy(1, motion.V_next, u);
    ms_unknowns_set(rows, u, r, g->v);
  }
  if (is_free && rotates) balance_moments(s, g, &motion);
  ms_stepper_copy_contacts(s, s->scratch, g->v);
}
