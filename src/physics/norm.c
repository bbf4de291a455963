#include "physics/norm.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "layout/components.h"
#include "physics/angle_springs.h"
#include "physics/bounds.h"
#include "physics/external_force.h"
#include "physics/law.h"
#include "physics/moving_pins.h"
#include "physics/rank_bodies.h"
#include "physics/rank_model.h"
#include "physics/scales.h"

static const char MEMORY[] = "the error norm of step-size control";

/* Sums and extremes over a body: nothing but doubles, so that ranks can share them */
typedef struct ms_norm_sums {
  double speed2;        /* sum of |v_i|^2 */
  double force2;        /* sum of |F_i/m_i|^2, of constant forces */
  double omega2;        /* by Gershgorin's discs, as in bounds.h */
  double x[3], back[3]; /* the bounding box: the largest coordinates and their largest negatives */
} ms_norm_sums;

/*------------------------------------- bodies ---------------------------------------------------*/

static int allocate_bodies(const ms_model *model, ms_norm *norm) {
  const msim_allocator *alloc = &model->scene->alloc;
  return MS_NEW(alloc, norm->body, norm->n + 1) && MS_NEW(alloc, norm->sums, norm->n + 1) &&
         (!model->rank_model || MS_NEW(alloc, norm->most, norm->n + 1));
}

static void count_particles(const ms_model *model, const ms_norm *norm) {
  for (int32_t r = 0; r < model->unknowns.nfree; r++) norm->body[norm->body_of[r]].n++;
}

msim_status ms_norm_create(const ms_model *model, ms_norm *norm, msim_error *err) {
  *norm = (ms_norm){0};
  int fits = MS_NEW(&model->scene->alloc, norm->body_of, model->unknowns.nfree + 1) != NULL;
  if (fits && !model->rank_model) {
    norm->n =
        ms_components_number(&model->unknowns, &model->springs, &model->angles, norm->body_of);
    fits = allocate_bodies(model, norm);
    if (fits) count_particles(model, norm);
  }
  return fits ? MSIM_OK : ms_error_set_memory(err, MEMORY);
}

/* Sizes of bodies are sums over ranks. */
msim_status ms_norm_connect(const ms_model *model, ms_norm *norm, msim_error *err) {
  ms_ranks *ranks = ms_rank_model_ranks(model);
  msim_status status = ms_rank_bodies_number(model, norm->body_of, &norm->n, err);
  if (status) return status;
  status = ms_ranks_agree_on_memory(ranks, allocate_bodies(model, norm), MEMORY, err);
  if (status) return status;
  double *sum = &norm->most->speed2; /* scratch */
  count_particles(model, norm);
  for (int32_t p = 0; p < norm->n; p++) sum[p] = norm->body[p].n;
  ms_ranks_sum(ranks, norm->n, sum);
  for (int32_t p = 0; p < norm->n && !ranks->failed; p++) norm->body[p].n = (int32_t)sum[p];
  return ms_ranks_agree(ranks, MSIM_OK, err);
}

void ms_norm_destroy(const ms_model *model, ms_norm *norm) {
  if (!model->scene) return;
  MS_FREE(&model->scene->alloc, norm->body_of, norm->body, norm->sums, norm->most);
}

/*------------------------------------- scales ---------------------------------------------------*/

static void extend_box(const double x[3], ms_norm_sums *g) {
  for (int c = 0; c < 3; c++) g->x[c] = fmax(g->x[c], x[c]), g->back[c] = fmax(g->back[c], -x[c]);
}

/* 1/m of a row; 0 where pinned */
static double inverse_mass(const ms_model *model, int32_t q) {
  if (q < model->unknowns.nfree) return model->inv_mass[q];
  const int is_ghost = q < model->unknowns.first_fixed;
  return is_ghost ? 1 / model->scene->mass[model->unknowns.particle[q]] : 0;
}

/* |v|^2 of row r if the energy e of a spring to row q becomes kinetic: both ends have momentum of
 * magnitude p, p^2 = 2 e mu, mu the reduced mass (q pinned: m_r). */
static double speed2_from_spring(const ms_model *model, int32_t r, int32_t q, double energy) {
  const double there = inverse_mass(model, q), here = model->inv_mass[r];
  return 2 * energy * here * here / (here + there);
}

/* |E| of a half-edge's spring at length l; of linear ones without a call */
static double elastic_energy(const ms_model *model, int32_t at, double l) {
  const ms_half_edges *h = &model->half_edges;
  const int32_t e = h->spring[at];
  if (ms_scene_law(model->scene, ms_springs_number(&model->springs, e)))
    return fabs(ms_law_value_of(model->scene, ms_springs_number(&model->springs, e), l).energy);
  const size_t value = ms_half_edges_value(h, at);
  const double stretch = l - h->rest[value];
  return h->k[value] * stretch * stretch / 2;
}

/* |v|^2 of row r if it gets a third of the energy of each of its angular springs */
static double speed2_from_angles(const ms_model *model, const double *x, int32_t r) {
  const ms_angles *g = &model->angles;
  double energy = 0;
  for (int32_t at = g->n ? g->of.first[r] : 0; g->n && at < g->of.first[r + 1]; at++)
    energy += ms_angle_springs_energy_of(model, g->of.item[at] / 3, x);
  return 2 * energy / 3 * model->inv_mass[r];
}

static void add_row_sums(const ms_model *model, const double *x, const double *v, int32_t r,
                         ms_norm_sums *g) {
  const ms_unknowns *rows = &model->unknowns;
  const ms_half_edges *half_edges = &model->half_edges;
  const ms_half_edge_span span = ms_half_edges_of_row(half_edges, r);
  double xr[3], vr[3], xq[3];
  ms_unknowns_get(rows, x, r, xr);
  ms_unknowns_get(rows, v, r, vr);
  extend_box(xr, g);
  g->speed2 += ms_vec3_dot(vr, vr);
  const double pull = ms_model_force_acceleration(model, r);
  g->force2 += pull * pull;
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const int32_t q = ms_half_edges_neighbour(half_edges, at);
    if (half_edges->spring[at] < 0) continue;
    ms_unknowns_get(rows, x, q, xq);
    if (q >= rows->nfree) extend_box(xq, g);
    for (int i = 0; i < 3; i++) xq[i] -= xr[i];
    g->speed2 += speed2_from_spring(model, r, q, elastic_energy(model, at, ms_vec3_norm(xq)));
  }
  g->speed2 += speed2_from_angles(model, x, r);
  g->omega2 = fmax(g->omega2, ms_bounds_sum_stiffness(model, r) * model->inv_mass[r]);
}

/* Those of all ranks; *pins: the speed of the fastest pinned particle */
static void share_sums(const ms_norm *norm, ms_ranks *ranks, double *pins) {
  const int32_t n = norm->n * (int32_t)(sizeof *norm->sums / sizeof(double));
  memcpy(norm->most, norm->sums, (size_t)norm->n * sizeof *norm->sums);
  ms_ranks_sum(ranks, n, &norm->sums->speed2);
  ms_ranks_maximum(ranks, n, &norm->most->speed2);
  ms_ranks_maximum(ranks, 1, pins);
  for (int32_t p = 0; p < norm->n; p++) {
    const ms_norm_sums sum = norm->sums[p];
    norm->sums[p] = norm->most[p];
    norm->sums[p].speed2 = sum.speed2, norm->sums[p].force2 = sum.force2;
  }
}

static void set_body_scales(const ms_norm_sums *sum, double pins, double gravity, double span,
                            ms_norm_body *p) {
  ms_scale_sources from = {.speed2 = sum->speed2 / p->n + pins * pins,
                           .gravity = gravity + sqrt(sum->force2 / p->n),
                           .omega = sqrt(sum->omega2),
                           .span = span};
  for (int c = 0; c < 3; c++) {
    from.extent = fmax(from.extent, sum->x[c] + sum->back[c]);
    from.farthest = fmax(from.farthest, fmax(fabs(sum->x[c]), fabs(sum->back[c])));
  }
  ms_scales scales;
  ms_scales_set(&from, &scales);
  p->extent = scales.extent, p->speed = scales.speed;
  p->rounding = fmin(scales.rounding, DBL_MAX);
}

void ms_norm_measure_scales(const ms_model *model, const double *x, const double *v, double span,
                            ms_norm *norm) {
  const double gravity = ms_external_acceleration(&model->external);
  double pins = model->pins ? model->pins->speed : 0;
  ms_rank_model_refresh(model, x, NULL);
  for (int32_t p = 0; p < norm->n; p++)
    norm->sums[p] = (ms_norm_sums){.x = {-INFINITY, -INFINITY, -INFINITY},
                                   .back = {-INFINITY, -INFINITY, -INFINITY}};
  for (int32_t r = 0; r < model->unknowns.nfree; r++)
    add_row_sums(model, x, v, r, &norm->sums[norm->body_of[r]]);
  if (model->rank_model) share_sums(norm, ms_rank_model_ranks(model), &pins);
  for (int32_t p = 0; p < norm->n; p++)
    set_body_scales(&norm->sums[p], pins, gravity, span, &norm->body[p]);
}

/*------------------------------------- norms ----------------------------------------------------*/

static void share_squares(const ms_norm *norm, ms_ranks *ranks, int which) {
  double *sum = &norm->most->speed2; /* scratch */
  for (int32_t p = 0; p < norm->n; p++) sum[p] = norm->body[p].square[which];
  ms_ranks_sum(ranks, norm->n, sum);
  for (int32_t p = 0; p < norm->n; p++) norm->body[p].square[which] = sum[p];
}

/* The rows of bodies are interleaved: sums are formed row by row. */
static void square_bodies(const ms_norm *norm, ms_shape shape, int which, const double *dx,
                          const double *dv) {
  for (int32_t p = 0; p < norm->n; p++) norm->body[p].square[which] = 0;
  for (int32_t r = 0; r < shape.n; r++) {
    ms_norm_body *p = &norm->body[norm->body_of[r]];
    for (int32_t c = 0; c < shape.dims; c++) {
      const size_t at = (size_t)c * (size_t)shape.stride + (size_t)r;
      const double x = dx[at] / p->extent, v = dv[at] / p->speed;
      p->square[which] += x * x + v * v;
    }
  }
  if (shape.ranks) share_squares(norm, shape.ranks, which);
  for (int32_t p = 0; p < norm->n; p++) norm->body[p].square[which] /= 2 * norm->body[p].n;
}

void ms_norm_square_errors(const ms_norm *norm, ms_shape shape, int which, const double *dx,
                           const double *dv) {
  if (norm->n != 1) {
    square_bodies(norm, shape, which, dx, dv);
    return;
  }
  ms_norm_body *p = norm->body;
  const double L2 = p->extent * p->extent, U2 = p->speed * p->speed;
  p->square[which] =
      (ms_vector_dot(shape, dx, dx) / L2 + ms_vector_dot(shape, dv, dv) / U2) / (2 * p->n);
}

ms_norm_body ms_norm_find_smallest(const ms_norm *norm) {
  if (!norm->n) return (ms_norm_body){0};
  ms_norm_body least = {.extent = INFINITY, .speed = INFINITY, .rounding = INFINITY};
  for (const ms_norm_body *p = norm->body; p < norm->body + norm->n; p++) {
    least.extent = fmin(least.extent, p->extent);
    least.speed = fmin(least.speed, p->speed);
    least.rounding = fmin(least.rounding, p->rounding);
  }
  return least;
}
