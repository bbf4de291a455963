#include "contact/contact_projection.h"

#include <string.h>

#include "base/vec3.h"

msim_status ms_contact_projection_create(const ms_model *model, const ms_contact_surface *surface,
                                         ms_contact_projection *j, msim_error *err) {
  msim_status status = ms_coefficients_create(model, &j->a, err);
  if (!status) status = ms_jacobi_create(model, &j->a, &j->jacobi, err);
  if (status) return status;
  if (MS_NEW_VECTORS(model->scene, &model->unknowns, &j->d, &j->r, &j->z, &j->p, &j->q) &&
      MS_NEW(&model->scene->alloc, j->direction, 3 * (size_t)surface->nnodes) &&
      MS_NEW(&model->scene->alloc, j->held, surface->nnodes))
    return MSIM_OK;
  return ms_error_set_memory(err, "the contact of surfaces");
}

void ms_contact_projection_destroy(const ms_model *model, ms_contact_projection *j) {
  ms_coefficients_destroy(model, &j->a);
  ms_jacobi_destroy(model, &j->jacobi);
  MS_FREE(&model->scene->alloc, j->d, j->r, j->z, j->p, j->q, j->direction, j->held);
}

void ms_contact_projection_start(ms_contact_projection *j, const ms_model *model,
                                 ms_surface_pairs *pairs) {
  ms_vector_clear_all(model->shape, j->d);
  j->is_clamped = 0;
  j->size = 0;
  for (int32_t k = 0; k < pairs->surface.nnodes; k++) j->held[k].is_active = 0;
  for (ms_surface_pair *p = pairs->pair; p < pairs->pair + pairs->n; p++) {
    memset(p->friction, 0, sizeof p->friction);
    p->reaction = 0;
  }
}

void ms_contact_projection_hold(ms_contact_projection *j, int32_t node,
                                const double displacement[3], const double x[3], double unit) {
  const double size = ms_vec3_norm(displacement),
               reaction = j->held[node].is_active ? j->held[node].reaction : 0;
  ms_surface_pair held = {.node = {node, node, node, node},
                          .is_active = 1,
                          .weight = {1},
                          .unit = unit,
                          .reaction = reaction};
  ms_vec3_axpy(1 / size, displacement, held.normal);
  held.target = ms_vec3_dot(held.normal, x);
  j->held[node] = held;
}

/* The next plane of pairs and of obstacles, from *i = 0 on; NULL: there are no more */
static ms_surface_pair *next_plane(const ms_contact_projection *j, const ms_projected_step *to,
                                   int64_t *i) {
  const int64_t n = to->pairs->n, all = n + to->pairs->surface.nnodes;
  while (*i < all) {
    ms_surface_pair *p = *i < n ? &to->pairs->pair[*i] : &j->held[*i - n];
    ++*i;
    if (p->is_active) return p;
  }
  return NULL;
}

/*------------------------------------- forces of pairs ------------------------------------------*/

/* The forces of a pair, and their slopes: B = push_slope n n^T + friction_slope (I - n n^T) */
typedef struct pair_force {
  double missing, push, friction[3];
  double push_slope, friction_slope;
} pair_force;

/* At x1 + by direction */
static pair_force find_force(const ms_projected_step *to, const ms_surface_pair *p, double by,
                             const double *direction) {
  double r[3] = {0}, u[3];
  ms_surface_pair_combine(p, 1, to->x1, r);
  if (by != 0) ms_surface_pair_combine(p, by, direction, r);
  memcpy(u, r, sizeof u);
  ms_surface_pair_combine(p, -1, to->x0, u);
  ms_vec3_axpy(-ms_vec3_dot(p->normal, u), p->normal, u);
  pair_force f = {.missing = p->target - ms_vec3_dot(p->normal, r)};
  f.push = fmax(0, p->reaction + p->stiffness * f.missing);
  f.push_slope = f.push > 0 ? p->stiffness : 0;
  memcpy(f.friction, p->friction, sizeof f.friction);
  ms_vec3_axpy(-p->stiffness, u, f.friction);
  const double size = ms_vec3_norm(f.friction), most = to->friction * p->reaction;
  const double share = size > most ? most / size : most > 0;
  for (int c = 0; c < 3; c++) f.friction[c] *= share;
  f.friction_slope = share * p->stiffness;
  return f;
}

/* beta = BY/(sum_c w_c^2/a_c), a_c the mean of the diagonal of A at corner c; 0: the
 * corners that are free cannot move the pair apart. */
static double find_stiffness(const ms_contact_projection *j, const ms_projected_step *to,
                             const ms_surface_pair *p) {
  const double BY = 10;
  const size_t stride = (size_t)to->s->model->unknowns.first_pinned;
  double sum = 0;
  if (!ms_surface_pair_is_mobile(&to->pairs->surface, p)) return 0;
  for (int k = 0; k < 4; k++) {
    const int32_t row = to->pairs->surface.row[p->node[k]];
    if (row < 0) continue;
    const double *own = j->a.diagonal + row;
    sum += 3 * p->weight[k] * p->weight[k] / (own[0] + own[stride] + own[2 * stride]);
  }
  return sum > 0 ? BY / sum : 0;
}

/* y += W^T f */
static void add_force(const ms_projected_step *to, const ms_surface_pair *p, const double f[3],
                      double *y) {
  const ms_unknowns *rows = &to->s->model->unknowns;
  for (int k = 0; k < 4; k++) {
    const int32_t row = to->pairs->surface.row[p->node[k]];
    double at[3];
    if (row < 0) continue;
    ms_unknowns_get(rows, y, row, at);
    ms_vec3_axpy(p->weight[k], f, at);
    ms_unknowns_set(rows, at, row, y);
  }
}

/*------------------------------------- linear system --------------------------------------------*/

/* Set A and beta. */
static void set_matrix(ms_contact_projection *j, const ms_projected_step *to) {
  ms_stepper *s = to->s;
  const int clamp = !to->is_linear || j->is_clamped || s->solver->system.clamped;
  ms_surface_pair *p;
  ms_coefficients_compute(s->model, to->is_linear ? s->x : s->x_next, s->h, clamp, &j->a);
  for (int64_t i = 0; (p = next_plane(j, to, &i)) != NULL;) p->stiffness = find_stiffness(j, to, p);
}

/* Add W^T B W to the diagonal blocks. */
static void add_diagonal(const ms_projected_step *to, const ms_surface_pair *p,
                         ms_coefficients *a) {
  const size_t stride = (size_t)to->s->model->unknowns.first_pinned;
  for (int k = 0; k < 4; k++) {
    const int32_t row = to->pairs->surface.row[p->node[k]];
    const double by = p->weight[k] * p->weight[k];
    if (row < 0) continue;
    for (size_t b = 0; b < 3; b++)
      for (size_t c = b; c < 3; c++)
        a->diagonal[ms_coefficients_diagonal_element(3, b, c) * stride + (size_t)row] +=
            by * ((b == c) * p->friction_slope +
                  (p->push_slope - p->friction_slope) * p->normal[b] * p->normal[c]);
  }
}

/* y = (A + sum_p W^T B W) x */
static void apply(const ms_contact_projection *j, const ms_projected_step *to, const double *x,
                  double *y) {
  const ms_unknowns *rows = &to->s->model->unknowns;
  const ms_surface_pair *p;
  ms_coefficients_apply(to->s->model, &j->a, x, y);
  for (int64_t i = 0; (p = next_plane(j, to, &i)) != NULL;) {
    double u[3] = {0}, f[3];
    if (!(p->push_slope + p->friction_slope > 0)) continue;
    for (int k = 0; k < 4; k++) {
      const int32_t row = to->pairs->surface.row[p->node[k]];
      double at[3];
      if (row < 0) continue;
      ms_unknowns_get(rows, x, row, at);
      ms_vec3_axpy(p->weight[k], at, u);
    }
    const double along = (p->push_slope - p->friction_slope) * ms_vec3_dot(p->normal, u);
    for (int c = 0; c < 3; c++) f[c] = p->friction_slope * u[c] + along * p->normal[c];
    add_force(to, p, f, y);
  }
}

/* Conjugate gradients from 0 for the right-hand side j->r, roughly. Returns 0 if the matrix is not
 * positive definite. */
static int solve(ms_contact_projection *j, const ms_projected_step *to, double *change) {
  enum { MOST = 400 };
  const double RTOL = 0.1;
  const ms_model *model = to->s->model;
  const ms_shape shape = model->shape;
  double rho = 0, goal = 0;
  ms_vector_clear_all(shape, j->p);
  ms_vector_clear_all(shape, change);
  for (int i = 0; i < MOST; i++) {
    ms_jacobi_apply(model, &j->jacobi, 3, j->r, j->z);
    const double rho_new = ms_vector_dot(shape, j->r, j->z);
    if (i == 0) goal = RTOL * RTOL * rho_new;
    if (!(rho_new > goal)) break;
    ms_vector_add_scaled(shape, j->z, i > 0 ? rho_new / rho : 0, j->p, j->p);
    apply(j, to, j->p, j->q);
    const double curvature = ms_vector_dot(shape, j->p, j->q);
    if (!(curvature > 0)) return 0;
    rho = rho_new;
    ms_vector_axpy(shape, rho / curvature, j->p, change);
    ms_vector_axpy(shape, -rho / curvature, j->q, j->r);
    to->s->stats->iterations++;
  }
  return 1;
}

/*------------------------------------- Newton's method ------------------------------------------*/

/* The forces at d without those of contact balance, j->r = sum_p W^T f - A d, and their slopes on
 * the diagonal of A; returns the largest part of a target that is missing. */
static double find_imbalance(ms_contact_projection *j, const ms_projected_step *to) {
  double most = 0;
  ms_surface_pair *p;
  set_matrix(j, to);
  ms_coefficients_apply(to->s->model, &j->a, j->d, j->r);
  ms_vector_scale(to->s->model->shape, -1, j->r);
  for (int64_t i = 0; (p = next_plane(j, to, &i)) != NULL;) {
    pair_force f = find_force(to, p, 0, NULL);
    most = fmax(most, f.missing / p->unit);
    p->is_pushed |= f.push > 0;
    p->push_slope = f.push_slope, p->friction_slope = f.friction_slope;
    ms_vec3_axpy(f.push, p->normal, f.friction);
    add_force(to, p, f.friction, j->r);
    add_diagonal(to, p, &j->a);
  }
  return most;
}

/* The derivative along j->direction of the function that d minimizes, at d + by j->direction, from
 * that of its quadratic part, linear + by square */
static double find_slope(const ms_contact_projection *j, const ms_projected_step *to, double by,
                         double linear, double square) {
  double sum = linear + by * square;
  const ms_surface_pair *p;
  for (int64_t i = 0; (p = next_plane(j, to, &i)) != NULL;) {
    double displacement[3] = {0};
    pair_force f = find_force(to, p, by, j->direction);
    ms_surface_pair_combine(p, 1, j->direction, displacement);
    ms_vec3_axpy(f.push, p->normal, f.friction);
    sum -= ms_vec3_dot(f.friction, displacement);
  }
  return sum;
}

/* The share of `change` that minimizes the function, at most 1, by the Illinois method */
static double find_share(ms_contact_projection *j, const ms_projected_step *to,
                         const double *change) {
  enum { MOST = 8 };
  const double ENOUGH = 0.1;
  const ms_shape shape = to->s->model->shape;
  ms_coefficients_apply(to->s->model, &j->a, j->d, j->q);
  const double linear = ms_vector_dot(shape, change, j->q);
  ms_coefficients_apply(to->s->model, &j->a, change, j->q);
  const double square = ms_vector_dot(shape, change, j->q);
  double low = 0, high = 1, at_low = find_slope(j, to, 0, linear, square),
         at_high = find_slope(j, to, 1, linear, square), middle = 1;
  const double enough = ENOUGH * fabs(at_low);
  for (int i = 0; i < MOST && at_high > enough; i++) {
    middle = low + (high - low) * at_low / (at_low - at_high);
    const double at = find_slope(j, to, middle, linear, square);
    if (fabs(at) <= enough) return middle;
    if (at > 0) high = middle, at_high = at, at_low /= 2;
    else low = middle, at_low = at, at_high /= 2;
  }
  return middle;
}

static void gather_displacements(const ms_projected_step *to, const double *vec,
                                 double *displacement) {
  const ms_contact_surface *surface = &to->pairs->surface;
  for (int32_t k = 0; k < surface->nnodes; k++)
    if (surface->row[k] >= 0)
      ms_unknowns_get(&to->s->model->unknowns, vec, surface->row[k], displacement + 3 * (size_t)k);
}

/* Join the bodies of pairs that push, and those that obstacles hold. */
static void join_bodies(const ms_contact_projection *j, const ms_projected_step *to) {
  const ms_contact_surface *surface = &to->pairs->surface;
  ms_contact_bodies_separate(to->bodies);
  const ms_surface_pair *p;
  for (int64_t i = 0; (p = next_plane(j, to, &i)) != NULL;) {
    if (!(p->push_slope > 0)) continue;
    const int is_obstacle = i > to->pairs->n;
    for (int k = 1; k < 4; k++)
      ms_contact_bodies_join(to->bodies, surface->row[p->node[0]],
                             is_obstacle ? -1 : surface->row[p->node[k]]);
  }
}

/* One iteration of Newton's method, to the right-hand side j->r */
static void improve_balance(ms_contact_projection *j, const ms_projected_step *to) {
  double *change = to->s->scratch;
  if (!solve(j, to, change)) {
    j->is_clamped = 1;
    return;
  }
  ms_contact_bodies_balance(to->bodies, to->s->model, j->a.drag, change);
  gather_displacements(to, change, j->direction);
  const double share = find_share(j, to, change);
  ms_vector_axpy(to->s->model->shape, share, change, j->d);
  for (size_t i = 0; i < 3 * (size_t)to->pairs->surface.nnodes; i++)
    to->x1[i] += share * j->direction[i];
}

static void update_reactions(const ms_contact_projection *j, const ms_projected_step *to) {
  ms_surface_pair *p;
  for (int64_t i = 0; (p = next_plane(j, to, &i)) != NULL;) {
    const pair_force f = find_force(to, p, 0, NULL);
    p->reaction = f.push;

    memcpy(p->friction, f.friction, sizeof p->friction);
  }
}

void ms_contact_projection_improve(ms_contact_projection *j, const ms_projected_step *to) {
  enum { MOST = 40 };
  const double MISSING = 0.02;   /* of targets */
  const double IMBALANCE = 3e-3; /* of the forces at d = 0 */
  for (int i = 0, updates = 0; i < MOST; i++) {
    const double missing = find_imbalance(j, to);
    if (ms_jacobi_invert(to->s->model, &j->a, MSIM_FACTOR_SPD, &j->jacobi)) {
      j->is_clamped = 1;
      continue;
    }
    ms_jacobi_apply(to->s->model, &j->jacobi, 3, j->r, j->z);
    const double size = sqrt(ms_vector_dot(to->s->model->shape, j->r, j->z));
    if (j->size == 0) j->size = size;
    if (size > IMBALANCE * j->size) join_bodies(j, to), improve_balance(j, to);
    else if (updates++ > 0 && missing <= MISSING) break;
    else update_reactions(j, to);
  }
  update_reactions(j, to);
}

double ms_contact_projection_find_work(const ms_projected_step *to) {
  const ms_contact_surface *surface = &to->pairs->surface;
  double sum = 0;
  for (const ms_surface_pair *p = to->pairs->pair; p < to->pairs->pair + to->pairs->n; p++) {
    double force[3] = {p->friction[0], p->friction[1], p->friction[2]};
    if (!p->is_active || !(p->reaction > 0)) continue;
    ms_vec3_axpy(p->reaction, p->normal, force);
    for (int k = 0; k < 4; k++) {
      const size_t at = 3 * (size_t)p->node[k];
      double displacement[3] = {to->x1[at], to->x1[at + 1], to->x1[at + 2]};
      ms_vec3_axpy(-1, to->x0 + at, displacement);
      if (surface->row[p->node[k]] < 0) sum -= p->weight[k] * ms_vec3_dot(force, displacement);
    }
  }
  return sum / (to->s->h * to->s->h);
}
