#include "physics/bounds.h"

#include <math.h>

#include "physics/external_force.h"
#include "physics/lanczos.h"
#include "scene/laws.h"

/* Disc of particle i: (1/m_i) (sum w + sum of w to free neighbours + b), 0 if pinned; the largest
 * one bounds all eigenvalues (Gershgorin 1931). disc: nparticles, in: zeros. */
static double compute_gershgorin_discs(const ms_laplacian *l, double *disc) {
  const ms_scene *s = l->scene;
  double largest = 0;
  for (size_t e = 0; e < (size_t)s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    disc[i] += s->pinned[j] ? l->weight[e] : 2 * l->weight[e];
    disc[j] += s->pinned[i] ? l->weight[e] : 2 * l->weight[e];
  }
  for (int32_t p = 0; p < s->nparticles; p++) {
    disc[p] = s->pinned[p] ? 0 : (disc[p] + l->ground) / s->mass[p];
    largest = fmax(largest, disc[p]);
  }
  return largest;
}

static int any_above_zero(int32_t n, const double *values) {
  for (int32_t e = 0; e < n; e++)
    if (values[e] > 0) return 1;
  return 0;
}

/* The discs are exact if all weights are 0. */
static msim_status bound_largest(const ms_laplacian *l, int tight, double *bound, msim_error *err) {
  const ms_scene *s = l->scene;
  double *disc, tighter;
  if (!MS_NEW(&s->alloc, disc, s->nparticles))
    return ms_error_set_memory(err, "the stability bounds");
  msim_status status = MSIM_OK;
  *bound = compute_gershgorin_discs(l, disc);
  if (tight && *bound > 0 && any_above_zero(s->nsprings, l->weight)) {
    status = ms_lanczos_bound(l, disc, &tighter, err);
    if (!status) *bound = fmin(*bound, tighter);
  }
  ms_memory_free(&s->alloc, disc);
  return status;
}

static double find_largest_mass(const ms_scene *s) {
  double most = 0;
  for (int32_t p = 0; p < s->nparticles; p++)
    if (!s->pinned[p]) most = fmax(most, s->mass[p]);
  return most;
}

/* Sums over the springs of a particle with k > r c */
typedef struct uncovered {
  double ratio;      /* r */
  double k, damping; /* of e k and e c */
} uncovered;

static void add_uncovered(const ms_scene *s, size_t e, int32_t from, int32_t to, uncovered *u) {
  const double ends = s->pinned[to] ? 1 : 2;
  const double k = ms_scene_stiffness(s, (int32_t)e);
  if (s->pinned[from] || !(k > u[from].ratio * s->damping[e])) return;
  u[from].k += ends * k, u[from].damping += ends * s->damping[e];
}

/* One step of Newton's method on sum e (k - r c)^+ = r b for each particle, from below, as the
 * left-hand side is convex. Returns 1 if any r has grown. */
static int raise_ratios(const ms_scene *s, uncovered *u) {
  int grown = 0;
  for (int32_t p = 0; p < s->nparticles; p++)
    u[p].k = s->pinned[p] ? 0 : s->force_function.largest_stiffness, u[p].damping = 0;
  for (size_t e = 0; e < (size_t)s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    add_uncovered(s, e, i, j, u);
    add_uncovered(s, e, j, i, u);
  }
  for (int32_t p = 0; p < s->nparticles; p++) {
    if (u[p].k == 0) continue;
    const double ratio = u[p].k / (u[p].damping + ms_external_damping(&s->external));
    if (!(ratio > u[p].ratio)) continue;
    u[p].ratio = ratio;
    grown = 1;
  }
  return grown;
}

/* Each step removes springs from some sum, so that few steps suffice. Before convergence r is no
 * bound. */
static msim_status bound_ratio(const ms_scene *s, double *bound, msim_error *err) {
  enum { MOST_STEPS = 100 };
  uncovered *u;
  if (!MS_NEW(&s->alloc, u, s->nparticles)) return ms_error_set_memory(err, "the stability bounds");
  int step = 0;
  while (step < MOST_STEPS && raise_ratios(s, u)) step++;
  *bound = step < MOST_STEPS ? 0 : INFINITY;
  for (int32_t p = 0; p < s->nparticles; p++) *bound = fmax(*bound, u[p].ratio);
  ms_memory_free(&s->alloc, u);
  return MSIM_OK;
}

static double *list_stiffnesses(const ms_scene *s) {
  double *k = ms_memory_allocate(&s->alloc, (size_t)s->nsprings, sizeof *k);
  for (int32_t e = 0; k && e < s->nsprings; e++) k[e] = ms_scene_stiffness(s, e);
  return k;
}

msim_status ms_bounds_compute(const ms_scene *scene, int tight, ms_bounds *bounds,
                              msim_error *err) {
  double *stiffness = NULL; /* of springs with laws */
  if (scene->law && !(stiffness = list_stiffnesses(scene)))
    return ms_error_set_memory(err, "the stability bounds");
  const double b = ms_external_damping(&scene->external);
  const ms_laplacian elastic = {scene, stiffness ? stiffness : scene->k,
                                scene->force_function.largest_stiffness};
  const ms_laplacian damped = {scene, scene->damping, b + scene->force_function.largest_damping};
  double omega2;
  msim_status status = bound_largest(&elastic, tight, &omega2, err);
  if (!status) status = bound_largest(&damped, tight, &bounds->rate, err);
  if (!status) status = bound_ratio(scene, &bounds->ratio, err);
  ms_memory_free(&scene->alloc, stiffness);
  if (status) return status;
  bounds->omega = sqrt(omega2);
  bounds->least_rate = b > 0 ? b / find_largest_mass(scene) : 0;
  return MSIM_OK;
}

double ms_bounds_sum_row(const ms_model *model, const double *weight, int32_t row) {
  const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, row);
  double sum = 0;
  for (int32_t at = span.begin; at < span.end; at += span.step)
    sum += (model->half_edges.neighbour[at] < model->unknowns.nfree ? 2 : 1) * weight[at];
  return sum;
}

ms_bounds ms_bounds_compute_island(const ms_model *model) {
  const msim_force_function *function = &model->scene->force_function;
  const double b = ms_external_damping(&model->external);
  double omega2 = 0, rate = 0, heaviest = 0;
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const double k = ms_bounds_sum_row(model, model->half_edges.stiffness, r) +
                     function->largest_stiffness,
                 c = ms_bounds_sum_row(model, model->half_edges.damping, r) +
                     function->largest_damping;
    omega2 = fmax(omega2, k * model->inv_mass[r]);
    rate = fmax(rate, (c + b) * model->inv_mass[r]);
    heaviest = fmax(heaviest, model->mass[r]);
  }
  return (ms_bounds){.omega = sqrt(omega2), .rate = rate, .least_rate = b > 0 ? b / heaviest : 0};
}

double ms_bounds_verlet_limit(const ms_bounds *b) {
  return 4 / (b->rate + hypot(b->rate, 2 * b->omega));
}
