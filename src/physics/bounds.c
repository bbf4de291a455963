#include "physics/bounds.h"

#include <math.h>

#include "physics/external_force.h"
#include "physics/lanczos.h"
#include "physics/rank_model.h"
#include "scene/angles.h"
#include "scene/laws.h"

static void add_to_discs(const ms_scene *s, double weight, int32_t i, int32_t j, double *disc) {
  disc[i] += s->pinned[j] ? weight : 2 * weight;
  disc[j] += s->pinned[i] ? weight : 2 * weight;
}

/* Disc of particle i: (1/m_i) (sum w + sum of w to free neighbours + b), 0 if pinned; the largest
 * one bounds all eigenvalues (Gershgorin 1931). disc: nparticles, in: zeros. */
static double compute_gershgorin_discs(const ms_laplacian *l, double *disc) {
  const ms_scene *s = l->scene;
  double largest = 0;
  for (size_t e = 0; e < (size_t)s->nsprings; e++)
    add_to_discs(s, l->weight[e], s->ij[2 * e], s->ij[2 * e + 1], disc);
  for (size_t e = 0; e < 2 * (size_t)s->angles.n && l->angle_weight; e++) {
    const int32_t *ijk = s->angles.ijk + 3 * (e / 2);
    add_to_discs(s, l->angle_weight[e], ijk[2 * (e % 2)], ijk[1], disc);
  }
  for (int32_t p = 0; p < s->nparticles; p++) {
    disc[p] = s->pinned[p] ? 0 : (disc[p] + l->ground) / s->mass[p];
    largest = fmax(largest, disc[p]);
  }
  return largest;
}

static int any_above_zero(const ms_laplacian *l) {
  for (int32_t e = 0; e < l->scene->nsprings; e++)
    if (l->weight[e] > 0) return 1;
  for (int32_t e = 0; e < 2 * l->scene->angles.n && l->angle_weight; e++)
    if (l->angle_weight[e] > 0) return 1;
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
  if (tight && *bound > 0 && sqrt(*bound) <= MS_LARGEST_VALID && any_above_zero(l)) {
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

/* A spring i-j, or one of two that bound an angular spring */
typedef struct bounding_spring {
  int32_t i, j;
  double k, damping;
} bounding_spring;

/* Sums over the springs of a particle with k > r c */
typedef struct uncovered {
  double ratio;      /* r */
  double k, damping; /* of e k and e c */
} uncovered;

static void add_uncovered_end(const ms_scene *s, const bounding_spring *e, int32_t from, int32_t to,
                              uncovered *u) {
  const double ends = s->pinned[to] ? 1 : 2;
  if (s->pinned[from] || !(e->k > u[from].ratio * e->damping)) return;
  u[from].k += ends * e->k, u[from].damping += ends * e->damping;
}

static void add_uncovered(const ms_scene *s, bounding_spring e, uncovered *u) {
  add_uncovered_end(s, &e, e.i, e.j, u);
  add_uncovered_end(s, &e, e.j, e.i, u);
}

/* weight: 2 for each angular spring, or NULL */
static void add_all_uncovered(const ms_scene *s, const double *weight, uncovered *u) {
  for (int32_t e = 0; e < s->nsprings; e++)
    add_uncovered(s,
                  (bounding_spring){s->ij[2 * (size_t)e], s->ij[2 * (size_t)e + 1],
                                    ms_scene_stiffness(s, e), s->damping[e]},
                  u);
  for (size_t e = 0; e < 2 * (size_t)s->angles.n; e++) {
    const int32_t *ijk = s->angles.ijk + 3 * (e / 2);
    add_uncovered(s,
                  (bounding_spring){ijk[2 * (e % 2)], ijk[1], weight[e] * s->angles.k[e / 2],
                                    weight[e] * s->angles.damping[e / 2]},
                  u);
  }
}

/* One step of Newton's method on sum e (k - r c)^+ = r b for each particle, from below, as the
 * left-hand side is convex. Returns 1 if any r has grown. */
static int raise_ratios(const ms_scene *s, const double *weight, uncovered *u) {
  int grown = 0;
  for (int32_t p = 0; p < s->nparticles; p++)
    u[p].k = s->pinned[p] ? 0 : s->force_function.largest_stiffness, u[p].damping = 0;
  add_all_uncovered(s, weight, u);
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
static msim_status bound_ratio(const ms_scene *s, const double *weight, double *bound,
                               msim_error *err) {
  enum { MOST_STEPS = 100 };
  uncovered *u;
  if (!MS_NEW(&s->alloc, u, s->nparticles)) return ms_error_set_memory(err, "the stability bounds");
  int step = 0;
  while (step < MOST_STEPS && raise_ratios(s, weight, u)) step++;
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

/* Arrays of one computation; NULL: not needed */
typedef struct bound_arrays {
  double *stiffness;   /* of springs with laws */
  double *weight;      /* 2 for each angular spring */
  double *k, *damping; /* weight times k and damping of each */
} bound_arrays;

static msim_status create_arrays(const ms_scene *s, bound_arrays *r, msim_error *err) {
  const size_t n = (size_t)s->angles.n;
  *r = (bound_arrays){0};
  int fits = !s->law || (r->stiffness = list_stiffnesses(s));
  if (n)
    fits = fits && MS_NEW(&s->alloc, r->weight, 2 * n) && MS_NEW(&s->alloc, r->k, 2 * n) &&
           MS_NEW(&s->alloc, r->damping, 2 * n);
  for (size_t e = 0; e < n && fits; e++) {
    ms_scene_angles_weigh(s, (int32_t)e, r->weight + 2 * e);
    for (size_t end = 2 * e; end < 2 * e + 2; end++) {
      r->k[end] = r->weight[end] * s->angles.k[e];
      r->damping[end] = r->weight[end] * s->angles.damping[e];
    }
  }
  return fits ? MSIM_OK : ms_error_set_memory(err, "the stability bounds");
}

msim_status ms_bounds_compute(const ms_scene *scene, int tight, ms_bounds *bounds,
                              msim_error *err) {
  const msim_force_function *function = &scene->force_function;
  const double b = ms_external_damping(&scene->external);
  bound_arrays r;
  msim_status status = create_arrays(scene, &r, err);
  const ms_laplacian elastic = {scene, r.stiffness ? r.stiffness : scene->k, r.k,
                                function->largest_stiffness};
  const ms_laplacian damped = {scene, scene->damping, r.damping, b + function->largest_damping};
  double omega2 = 0;
  if (!status) status = bound_largest(&elastic, tight, &omega2, err);
  if (!status) status = bound_largest(&damped, tight, &bounds->rate, err);
  if (!status) status = bound_ratio(scene, r.weight, &bounds->ratio, err);
  MS_FREE(&scene->alloc, r.stiffness, r.weight, r.k, r.damping);
  if (status) return status;
  bounds->omega = sqrt(omega2);
  bounds->least_rate = b > 0 ? b / find_largest_mass(scene) : 0;
  return MSIM_OK;
}

/* The sum over a row's half-edges of e w, w one of their values */
static double sum_row(const ms_model *model, const double *weight, int32_t row) {
  const ms_half_edge_span span = ms_half_edges_of_row(&model->half_edges, row);
  double sum = 0;
  for (int32_t at = span.begin; at < span.end; at += span.step)
    sum += (ms_half_edges_neighbour(&model->half_edges, at) < model->unknowns.first_fixed ? 2 : 1) *
           weight[ms_half_edges_value(&model->half_edges, at)];
  return sum;
}

double ms_bounds_sum_stiffness(const ms_model *model, int32_t row) {
  return sum_row(model, model->half_edges.stiffness, row) +
         ms_angles_sum_row(&model->angles, model->unknowns.first_fixed, model->angles.k, row);
}

ms_bounds ms_bounds_compute_island(const ms_model *model) {
  const msim_force_function *function = &model->scene->force_function;
  const double b = ms_external_damping(&model->external);
  double omega2 = 0, rate = 0, heaviest = 0; /* largest of all ranks */
  for (int32_t r = 0; r < model->unknowns.nfree; r++) {
    const double k = ms_bounds_sum_stiffness(model, r) + function->largest_stiffness,
                 c = sum_row(model, model->half_edges.damping, r) +
                     ms_angles_sum_row(&model->angles, model->unknowns.first_fixed,
                                       model->angles.damping, r) +
                     function->largest_damping;
    omega2 = fmax(omega2, k * model->inv_mass[r]);
    rate = fmax(rate, (c + b) * model->inv_mass[r]);
    heaviest = fmax(heaviest, model->mass[r]);
  }
  double most[3] = {omega2, rate, heaviest};
  ms_ranks_maximum(ms_rank_model_ranks(model), 3, most);
  omega2 = most[0], rate = most[1], heaviest = most[2];
  return (ms_bounds){.omega = sqrt(omega2), .rate = rate, .least_rate = b > 0 ? b / heaviest : 0};
}

double ms_bounds_verlet_limit(const ms_bounds *b) {
  return 4 / (b->rate + hypot(b->rate, 2 * b->omega));
}
