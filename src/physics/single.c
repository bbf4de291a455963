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
  ms_single *s = model->single;
  for (size_t i = 0; s && i < h->nvalues; i++) {
    s->k[i] = (float)h->k[i];
    s->half_k_rest[i] = (float)(h->k[i] * h->rest[i] / 2);
    s->quarter_damping[i] = (float)(h->damping[i] / 4);
  }
}

static void free_springs(const msim_allocator *alloc, const ms_single *s) {
  MS_FREE(alloc, s->k, s->half_k_rest, s->quarter_damping);
}

msim_status ms_single_reserve_springs(ms_model *model, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t room = model->half_edges.room;
  ms_single *s = model->single;
  if (!s || s->room == room) return MSIM_OK;
  ms_single to = *s;
  to.k = to.half_k_rest = to.quarter_damping = NULL, to.room = room;
  if (!MS_NEW(alloc, to.k, room) || !MS_NEW(alloc, to.half_k_rest, room) ||
      !MS_NEW(alloc, to.quarter_damping, room)) {
    free_springs(alloc, &to);
    return ms_error_set_memory(err, "the springs as floats");
  }
  free_springs(alloc, s);
  *s = to;
  ms_single_update_springs(model);
  return MSIM_OK;
}

msim_status ms_single_create(ms_model *model, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t rows = (size_t)model->unknowns.first_pinned;
  if (!MS_NEW(alloc, model->single, 1)) return ms_error_set_memory(err, "the springs as floats");
  ms_single *s = model->single;
  if (!MS_NEW(alloc, s->mass, rows) || !MS_NEW(alloc, s->inv_mass, rows) ||
      !MS_NEW_VECTORS(model->scene, &model->unknowns, &s->x, &s->v) ||
      (model->features & MS_HAS_PLANES &&
       !MS_NEW_VECTORS(model->scene, &model->unknowns, &s->x_before)))
    return ms_error_set_memory(err, "the springs as floats");
  narrow(rows, model->mass, s->mass);
  narrow(rows, model->inv_mass, s->inv_mass);
  model->state_shape.single = 1;
  return ms_single_reserve_springs(model, err);
}

void ms_single_destroy(const ms_scene *scene, ms_single *s) {
  if (!s) return;
  free_springs(&scene->alloc, s);
  MS_FREE(&scene->alloc, s->mass, s->inv_mass, s->x, s->v, s->x_before, s);
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

/* The index of the error of the float at 0 (vector.h) */
static size_t error_offset(const ms_unknowns *rows) {
  return (size_t)rows->dims * (size_t)rows->stride;
}

static double value(const ms_unknowns *rows, const float *vec, double origin) {
  return origin + ((double)vec[0] + (double)vec[error_offset(rows)]);
}

static void set_value(const ms_unknowns *rows, double to, double origin, float *vec) {
  vec[0] = (float)(to - origin);
  vec[error_offset(rows)] = (float)((to - origin) - (double)vec[0]);
}

/* The vector minus `origin` in all rows of particles, rounded to pairs of floats */
static void gather(const ms_model *model, const double *array, const double origin[3], double *room,
                   float *to) {
  const ms_unknowns *rows = &model->unknowns;
  ms_unknowns_gather(rows, array, room);
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->stride; r++) {
      const size_t at = (size_t)c * (size_t)rows->stride + (size_t)r;
      const double o = origin[rows->axis[c]];
      set_value(rows, rows->particle[r] < 0 ? o : room[at], o, to + at);
    }
}

/* Of the unknowns: pinned particles keep what gather() has left in the room of positions, as their
 * pairs may have lost digits. */
static void widen(const ms_model *model, const float *vec, const double origin[3], double *to) {
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->nfree; r++) {
      const size_t at = (size_t)c * (size_t)rows->stride + (size_t)r;
      to[at] = value(rows, vec + at, origin[rows->axis[c]]);
    }
}

/* A number that is what widen() made of floats leaves these as they are. */
static void take_changes(const ms_model *model, const double *from, const double origin[3],
                         float *vec) {
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->nfree; r++) {
      const size_t at = (size_t)c * (size_t)rows->stride + (size_t)r;
      const double o = origin[rows->axis[c]];
      if (from[at] != value(rows, vec + at, o)) set_value(rows, from[at], o, vec + at);
    }
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

void ms_single_widen_x(const ms_model *model, const void *vec, double *to) {
  widen(model, vec, model->single->origin, to);
}

void ms_single_widen_v(const ms_model *model, const void *vec, double *to) {
  widen(model, vec, zero, to);
}

const double *ms_single_get_x(const ms_model *model, const void *vec) {
  if (!model->single) return vec;
  ms_single_widen_x(model, vec, model->single->x);
  return model->single->x;
}

const double *ms_single_get_v(const ms_model *model, const void *vec) {
  if (!model->single) return vec;
  ms_single_widen_v(model, vec, model->single->v);
  return model->single->v;
}

static const double *subtract(const ms_model *model, const void *a, const void *b, double *room,
                              double *to) {
  const ms_unknowns *rows = &model->unknowns;
  const float *of_a = a, *of_b = b;
  if (!model->single) {
    ms_vector_add_scaled(model->shape, a, -1, b, to);
    return to;
  }
  for (int32_t c = 0; c < rows->dims; c++)
    for (int32_t r = 0; r < rows->nfree; r++) {
      const size_t at = (size_t)c * (size_t)rows->stride + (size_t)r;
      room[at] = value(rows, of_a + at, 0) - value(rows, of_b + at, 0);
    }
  return room;
}

const double *ms_single_subtract_x(const ms_model *model, const void *a, const void *b,
                                   double *to) {
  return subtract(model, a, b, model->single ? model->single->x : NULL, to);
}

const double *ms_single_subtract_v(const ms_model *model, const void *a, const void *b,
                                   double *to) {
  return subtract(model, a, b, model->single ? model->single->v : NULL, to);
}

void ms_single_weigh(const ms_model *model, double s, const void *a, double *f) {
  const ms_unknowns *rows = &model->unknowns;
  if (!model->single) {
    ms_vector_scale_rows(model->shape, model->mass, a, f);
    ms_vector_scale(model->shape, s, f);
    return;
  }
  for (int32_t c = 0; c < rows->dims; c++) {
    const size_t at = (size_t)c * (size_t)rows->stride;
    const float *of = (const float *)a + at;
    for (int32_t r = 0; r < rows->nfree; r++) f[at + (size_t)r] = s * (model->mass[r] * of[r]);
  }
}

const void *ms_single_round(const ms_model *model, const double *vec, void *to) {
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t c = 0; c < rows->dims && model->single; c++) {
    const size_t at = (size_t)c * (size_t)rows->stride;
    narrow((size_t)rows->nfree, vec + at, (float *)to + at);
  }
  return model->single ? to : vec;
}

void ms_single_take_changes(const ms_model *model, void *x, void *v) {
  const ms_single *s = model->single;
  take_changes(model, s->x, s->origin, x);
  take_changes(model, s->v, zero, v);
}
