#include "physics/norm.h"

#include <float.h>
#include <math.h>

#include "base/vec3.h"
#include "layout/components.h"
#include "physics/angle_springs.h"
#include "physics/bounds.h"
#include "physics/external_force.h"
#include "physics/law.h"
#include "physics/moving_pins.h"
#include "physics/scales.h"

/* Sums and extremes over a body */
typedef struct ms_norm_sums {
  double low[3], high[3]; /* the bounding box */
  double speed2;          /* sum of |v_i|^2 */
  double force2;          /* sum of |F_i/m_i|^2, of constant forces */
  double omega2;          /* by Gershgorin's discs, as in bounds.h */
} ms_norm_sums;

/*------------------------------------- bodies ---------------------------------------------------*/

msim_status ms_norm_create(const ms_model *model, ms_norm *norm, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const int32_t nfree = model->unknowns.nfree;
  *norm = (ms_norm){0};
  if (!MS_NEW(alloc, norm->body_of, nfree + 1))
    return ms_error_set_memory(err, "the error norm of step-size control");
  norm->n = ms_components_number(&model->unknowns, &model->springs, &model->angles, norm->body_of);
  if (!MS_NEW(alloc, norm->body, norm->n + 1) || !MS_NEW(alloc, norm->sums, norm->n + 1))
    return ms_error_set_memory(err, "the error norm of step-size control");
  for (int32_t r = 0; r < nfree; r++) norm->body[norm->body_of[r]].n++;
  return MSIM_OK;
}

void ms_norm_destroy(const ms_model *model, ms_norm *norm) {
  if (!model->scene) return;
  MS_FREE(&model->scene->alloc, norm->body_of, norm->body, norm->sums);
}

/*------------------------------------- scales ---------------------------------------------------*/

static void extend_box(const double x[3], ms_norm_sums *g) {
  for (int c = 0; c < 3; c++)
    g->low[c] = fmin(g->low[c], x[c]), g->high[c] = fmax(g->high[c], x[c]);
}

/* |v|^2 of row r if the energy e of a spring to row q becomes kinetic: both ends have momentum of
 * magnitude p, p^2 = 2 e mu, mu the reduced mass (q pinned: m_r). */
static double speed2_from_spring(const ms_model *model, int32_t r, int32_t q, double energy) {
  const double there = q < model->unknowns.nfree ? model->inv_mass[q] : 0,
               here = model->inv_mass[r];
  return 2 * energy * here * here / (here + there);
}

/* |E| of a half-edge's spring at length l; of linear ones without a call */
static double elastic_energy(const ms_model *model, int32_t at, double l) {
  const ms_half_edges *h = &model->half_edges;
  const int32_t e = h->spring[at];
  if (model->springs.has_law && model->springs.has_law[e])
    return fabs(ms_law_value_of(model->scene, model->springs.spring[e], l).energy);
  const double stretch = l - h->rest[at];
  return h->k[at] * stretch * stretch / 2;
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
    const int32_t q = half_edges->neighbour[at];
    if (half_edges->spring[at] < 0) continue;
    ms_unknowns_get(rows, x, q, xq);
    if (q >= rows->nfree) extend_box(xq, g);
    for (int i = 0; i < 3; i++) xq[i] -= xr[i];
    g->speed2 += speed2_from_spring(model, r, q, elastic_energy(model, at, ms_vec3_norm(xq)));
  }
  g->speed2 += speed2_from_angles(model, x, r);
  g->omega2 = fmax(g->omega2, ms_bounds_sum_stiffness(model, r) * model->inv_mass[r]);
}

static void set_body_scales(const ms_model *model, const ms_norm_sums *sum, double gravity,
                            double span, ms_norm_body *p) {
  const double pins = model->pins ? model->pins->speed : 0;
  ms_scale_sources from = {.speed2 = sum->speed2 / p->n + pins * pins,
                           .gravity = gravity + sqrt(sum->force2 / p->n),
                           .omega = sqrt(sum->omega2),
                           .span = span};
  for (int c = 0; c < 3; c++) {
    from.extent = fmax(from.extent, sum->high[c] - sum->low[c]);
    from.farthest = fmax(from.farthest, fmax(fabs(sum->low[c]), fabs(sum->high[c])));
  }
  ms_scales scales;
  ms_scales_set(&from, &scales);
  p->extent = scales.extent, p->speed = scales.speed;
  p->rounding = fmin(scales.rounding, DBL_MAX);
}

void ms_norm_measure_scales(const ms_model *model, const double *x, const double *v, double span,
                            ms_norm *norm) {
  for (int32_t p = 0; p < norm->n; p++)
    norm->sums[p] = (ms_norm_sums){.low = {INFINITY, INFINITY, INFINITY},
                                   .high = {-INFINITY, -INFINITY, -INFINITY}};
  for (int32_t r = 0; r < model->unknowns.nfree; r++)
    add_row_sums(model, x, v, r, &norm->sums[norm->body_of[r]]);
  for (int32_t p = 0; p < norm->n; p++)
    set_body_scales(model, &norm->sums[p], ms_external_acceleration(&model->external), span,
                    &norm->body[p]);
}

/*------------------------------------- norms ----------------------------------------------------*/

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
