#include "physics/force_function.h"

#include <math.h>
#include <string.h>

/*------------------------------------- creation -------------------------------------------------*/

/* The rows of free particles in ascending order of particles. row_of: scratch, one per particle */
static void list_particles(const ms_model *model, ms_force_function *f, int32_t *row_of) {
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t p = 0; p < model->scene->nparticles; p++) row_of[p] = -1;
  for (int32_t r = 0; r < rows->nfree; r++) row_of[rows->particle[r]] = r;
  for (int32_t p = 0; p < model->scene->nparticles; p++)
    if (row_of[p] >= 0) f->particle[f->n] = p, f->row[f->n++] = row_of[p];
}

static int allocate(const ms_model *model, ms_force_function *f) {
  const msim_allocator *alloc = &model->scene->alloc;
  const size_t n = (size_t)model->unknowns.nfree;
  const int has_jacobian = ms_scene_function_has(model->scene, MSIM_FORCE_JACOBIAN);
  return MS_NEW(alloc, f->particle, n) && MS_NEW(alloc, f->row, n) && MS_NEW(alloc, f->x, 3 * n) &&
         MS_NEW(alloc, f->v, 3 * n) && MS_NEW(alloc, f->f, 3 * n) &&
         (!has_jacobian || (MS_NEW(alloc, f->dfdx, 9 * n) && MS_NEW(alloc, f->dfdv, 9 * n))) &&
         MS_NEW_VECTORS(model->scene, &model->unknowns, &f->force);
}

msim_status ms_force_function_create(const ms_model *model, ms_force_function **function,
                                     msim_error *err) {
  const ms_scene *s = model->scene;
  int32_t *row_of = NULL;
  *function = NULL;
  if (!ms_scene_has_function(s) || model->unknowns.nfree == 0) return MSIM_OK;
  ms_force_function *f = ms_memory_allocate(&s->alloc, 1, sizeof *f);
  const int fits = f && allocate(model, f) && MS_NEW(&s->alloc, row_of, s->nparticles);
  if (fits) list_particles(model, f, row_of);
  ms_memory_free(&s->alloc, row_of);
  if (!fits) {
    ms_force_function_destroy(s, f);
    return ms_error_set_memory(err, "the force function");
  }
  *function = f;
  return MSIM_OK;
}

void ms_force_function_destroy(const ms_scene *scene, ms_force_function *f) {
  if (!f) return;
  MS_FREE(&scene->alloc, f->particle, f->row, f->x, f->v, f->f, f->dfdx, f->dfdv, f->force, f);
}

/*------------------------------------- calls ----------------------------------------------------*/

static void gather(const ms_model *model, const double *vector, double *array) {
  const ms_force_function *f = model->function;
  for (int32_t i = 0; i < f->n; i++)
    ms_unknowns_get(&model->unknowns, vector, f->row[i], array + 3 * (size_t)i);
}

/* The first particle with a number that is NaN or infinite among `width` ones of each; -1: none */
static int32_t find_not_finite(const ms_force_function *f, size_t width, const double *numbers) {
  for (size_t i = 0; i < width * (size_t)f->n; i++)
    if (!isfinite(numbers[i])) return (int32_t)(i / width);
  return -1;
}

static void check_results(ms_force_function *f, int has_jacobian) {
  f->offender = find_not_finite(f, 3, f->f);
  if (f->offender < 0 && has_jacobian) f->offender = find_not_finite(f, 9, f->dfdx);
  if (f->offender < 0 && has_jacobian) f->offender = find_not_finite(f, 9, f->dfdv);
  f->status = f->code ? MSIM_FORCE_FAILED : f->offender >= 0 ? MSIM_NOT_FINITE : MSIM_OK;
}

static void clear_derivatives(ms_force_function *f) {
  memset(f->dfdx, 0, 9 * (size_t)f->n * sizeof *f->dfdx);
  memset(f->dfdv, 0, 9 * (size_t)f->n * sizeof *f->dfdv);
}

static void call_function(const ms_model *model, double t, const double *x, const double *v,
                          int linearize) {
  ms_force_function *f = model->function;
  const msim_force_function *is = &model->scene->force_function;
  const int has_velocity = (is->flags & MSIM_FORCE_VELOCITY) != 0;
  gather(model, x, f->x);
  if (has_velocity) gather(model, v, f->v);
  memset(f->f, 0, 3 * (size_t)f->n * sizeof *f->f);
  if (linearize) clear_derivatives(f);
  const msim_force_batch batch = {.size = sizeof batch,
                                  .n = f->n,
                                  .particles = f->particle,
                                  .t = t,
                                  .x = f->x,
                                  .v = has_velocity ? f->v : NULL,
                                  .f = f->f,
                                  .dfdx = linearize ? f->dfdx : NULL,
                                  .dfdv = linearize ? f->dfdv : NULL};
  f->code = is->evaluate(is->data, &batch);
  check_results(f, linearize);
  if (linearize && f->status) clear_derivatives(f);
}

/* After a failure the force is 0: the rest of the step computes finite numbers, and is dropped. */
void ms_force_function_evaluate(const ms_model *model, double t, const double *x, const double *v) {
  ms_force_function *f = model->function;
  if (!f->status) call_function(model, t, x, v, 0);
  for (int32_t i = 0; i < f->n; i++) {
    double constant[3] = {0}, sum[3];
    if (model->force) ms_unknowns_get(&model->unknowns, model->force, f->row[i], constant);
    for (size_t c = 0; c < 3; c++) sum[c] = constant[c] + (f->status ? 0 : f->f[3 * (size_t)i + c]);
    ms_unknowns_set(&model->unknowns, sum, f->row[i], f->force);
  }
}

void ms_force_function_linearize(const ms_model *model, double t, const double *x,
                                 const double *v) {
  const ms_force_function *f = model->function;
  if (f->dfdx && !f->status) call_function(model, t, x, v, 1);
}

/*------------------------------------- results --------------------------------------------------*/

void ms_force_function_add_gradient(const ms_model *model, double by, const double *v, double *b) {
  const ms_force_function *f = model->function;
  if (!f->dfdx) return;
  for (int32_t i = 0; i < f->n; i++) {
    const double *block = f->dfdx + 9 * (size_t)i;
    double along[3], to[3];
    ms_unknowns_get(&model->unknowns, v, f->row[i], along);
    ms_unknowns_get(&model->unknowns, b, f->row[i], to);
    for (size_t c = 0; c < 3; c++)
      to[c] += by * (block[3 * c] * along[0] + block[3 * c + 1] * along[1] +
                     block[3 * c + 2] * along[2]);
    ms_unknowns_set(&model->unknowns, to, f->row[i], b);
  }
}

double ms_force_function_compute_power(const ms_model *model, const double *v) {
  const ms_force_function *f = model->function;
  double sum = 0;
  for (int32_t i = 0; i < f->n; i++) {
    double along[3];
    ms_unknowns_get(&model->unknowns, v, f->row[i], along);
    for (size_t c = 0; c < 3; c++) sum += f->f[3 * (size_t)i + c] * along[c];
  }
  return sum;
}

double ms_force_function_compute_potential(const ms_model *model, const double *x) {
  const ms_force_function *f = model->function;
  const msim_force_function *is = &model->scene->force_function;
  if (!f || !is->potential) return 0;
  gather(model, x, f->x);
  return is->potential(is->data, f->n, f->particle, f->x);
}

msim_status ms_force_function_report(const ms_model *model, int32_t *row, msim_error *err) {
  const ms_force_function *f = model->function;
  const char *name = model->scene->force_function.name;
  *row = f->status == MSIM_NOT_FINITE ? f->row[f->offender] : -1;
  if (f->status == MSIM_NOT_FINITE)
    return ms_error_set(err, f->status,
                        "force function '%s' returned a number that is NaN or infinite for this "
                        "particle",
                        name);
  return ms_error_set(err, f->status, "force function '%s' failed: it returned %d", name, f->code);
}
