#include "physics/single.h"

#include <math.h>

#include "scene/laws.h"

/*------------------------------------- creation -------------------------------------------------*/

/* The squares and products of numbers up to here, and their reciprocals, are floats. */
#define LARGEST 1e18
#define LEAST   1e-18

/* Nullable: values */
static msim_status check_range(const char *what, int32_t n, const double *values, double least,
                               msim_error *err) {
  for (int32_t i = 0; i < n && values; i++)
    if (!(values[i] >= least && values[i] <= LARGEST))
      return ms_error_set(err, MSIM_ERR_ARG,
                          "%s[%d] is %g, which is outside the range of precision = single, %g to "
                          "%g; use precision = double",
                          what, i, values[i], least, LARGEST);
  return MSIM_OK;
}

msim_status ms_single_check_springs(int32_t n, const double *k, const double *rest,
                                    const double *damping, msim_error *err) {
  msim_status status = check_range("k", n, k, 0, err);
  if (!status) status = check_range("rest", n, rest, 0, err);
  return status ? status : check_range("damping", n, damping, 0, err);
}

msim_status ms_single_check_scene(const ms_scene *s, msim_error *err) {
  const msim_status status = check_range("mass", s->nparticles, s->mass, LEAST, err);
  return status ? status : ms_single_check_springs(s->nsprings, s->k, s->rest, s->damping, err);
}

static void narrow(size_t n, const double *from, float *to) {
  for (size_t i = 0; i < n; i++) to[i] = (float)from[i];
}

void ms_single_update_springs(ms_model *model) {
  const ms_half_edges *h = &model->half_edges;
  const size_t lanes = MS_SLICE * (size_t)h->nentries;
  if (!model->single) return;
  narrow(lanes, h->k, model->single->k);
  narrow(lanes, h->rest, model->single->rest);
  narrow(lanes, h->damping, model->single->damping);
}

msim_status ms_single_create(ms_model *model, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t lanes = MS_SLICE * (size_t)model->half_edges.nentries,
               rows = (size_t)model->unknowns.first_pinned;
  ms_single *s;
  if (!MS_NEW(alloc, model->single, 1)) return ms_error_set_memory(err, "the springs as floats");
  s = model->single;
  if (!MS_NEW(alloc, s->k, lanes) || !MS_NEW(alloc, s->rest, lanes) ||
      !MS_NEW(alloc, s->damping, lanes) || !MS_NEW(alloc, s->mass, rows) ||
      !MS_NEW(alloc, s->inv_mass, rows) ||
      !MS_NEW_VECTORS(model->scene, &model->unknowns, &s->x, &s->v))
    return ms_error_set_memory(err, "the springs as floats");
  s->stiffness = s->k;
  narrow(rows, model->mass, s->mass);
  narrow(rows, model->inv_mass, s->inv_mass);
  ms_single_update_springs(model);
  model->shape.single = 1;
  return MSIM_OK;
}

void ms_single_destroy(const ms_scene *scene, ms_single *s) {
  if (!s) return;
  MS_FREE(&scene->alloc, s->k, s->rest, s->damping, s->mass, s->inv_mass, s->x, s->v, s);
}

/*------------------------------------- states ---------------------------------------------------*/

void ms_single_set_origin(const ms_model *model, const double *x) {
  const ms_unknowns *rows = &model->unknowns;
  if (!model->single) return;
  for (int c = 0; c < 3; c++) {
    double low = INFINITY, high = -INFINITY;
    for (int32_t r = 0; r < rows->stride; r++) {
      if (rows->particle[r] < 0) continue;
      const double at = x[3 * (size_t)rows->particle[r] + (size_t)c];
      low = fmin(low, at), high = fmax(high, at);
    }
    model->single->origin[c] = low / 2 + high / 2;
  }
}

void ms_single_archive(ms_archive *b, ms_single *s) {
  for (int c = 0; c < 3; c++) {
    MS_ARCHIVE_TRANSFER(b, s->origin[c]);
    ms_archive_check(b, isfinite(s->origin[c]), "the origin of positions");
  }
}

/* The vector minus `origin` in all rows of particles, rounded to floats */
static void gather(const ms_model *model, const double *array, const double origin[3], double *room,
                   float *to) {
  const ms_unknowns *rows = &model->unknowns;
  ms_unknowns_gather(rows, array, room);
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->stride; r++) {
      const size_t at = (size_t)c * (size_t)rows->stride + (size_t)r;
      to[at] = rows->particle[r] < 0 ? 0 : (float)(room[at] - origin[rows->axis[c]]);
    }
}

static const double *widen(const ms_model *model, const float *vec, const double origin[3],
                           double *to) {
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->stride; r++) {
      const size_t at = (size_t)c * (size_t)rows->stride + (size_t)r;
      to[at] = origin[rows->axis[c]] + (double)vec[at];
    }
  return to;
}

static const double zero[3];

void ms_single_gather_x(const ms_model *model, const double *array, void *vec) {
  const ms_single *s = model->single;
  if (s) gather(model, array, s->origin, s->x, vec);
  else ms_unknowns_gather(&model->unknowns, array, vec);
}

void ms_single_gather_v(const ms_model *model, const double *array, void *vec) {
  const ms_single *s = model->single;
  if (s) gather(model, array, zero, s->v, vec);
  else ms_unknowns_gather(&model->unknowns, array, vec);
}

const double *ms_single_get_x(const ms_model *model, const void *vec) {
  const ms_single *s = model->single;
  return s ? widen(model, vec, s->origin, s->x) : vec;
}

const double *ms_single_get_v(const ms_model *model, const void *vec) {
  const ms_single *s = model->single;
  return s ? widen(model, vec, zero, s->v) : vec;
}
