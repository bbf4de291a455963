#include "physics/moving_pins.h"

#include <math.h>

#include "physics/angle_springs.h"
#include "physics/external_force.h"
#include "physics/law.h"
#include "physics/reference.h"
#include "physics/spring_law.h"

/*------------------------------------- creation -------------------------------------------------*/

/* The rows of the model that move. to: stride, the index of each row among these, or -1 */
static void list_rows(const ms_model *model, ms_moving_pins *p, int32_t *row_of, int32_t *to) {
  const ms_scene *s = model->scene;
  const ms_unknowns *rows = &model->unknowns;
  for (int32_t i = 0; i < s->nparticles; i++) row_of[i] = -1;
  for (int32_t r = 0; r < rows->stride; r++) to[r] = -1;
  ms_unknowns_find_rows(rows, row_of);
  for (int32_t m = 0; m < s->nmotions; m++)
    for (int32_t i = 0; i < s->motions[m].n; i++) {
      const int32_t r = row_of[s->motions[m].particles[i]];
      if (r < 0) continue;
      to[r] = p->n;
      p->row[p->n++] = (ms_moving_row){r, m, i};
      p->speed = fmax(p->speed, ms_motion_find_speed(&s->motions[m]));
    }
}

static void list_springs(const ms_model *model, ms_moving_pins *p, const int32_t *to) {
  const ms_springs *s = &model->springs;
  for (int32_t e = 0; e < s->n; e++) {
    const int32_t i = to[s->i[e]], j = to[s->j[e]];
    if (i >= 0) p->spring[p->nsprings++] = (ms_moving_spring){e, s->j[e], p->row[i]};
    if (j >= 0) p->spring[p->nsprings++] = (ms_moving_spring){e, s->i[e], p->row[j]};
  }
}

static void list_corners(const ms_model *model, ms_moving_pins *p, const int32_t *to) {
  for (int32_t c = 0; c < 3 * model->angles.n; c++) {
    const int32_t at = to[model->angles.row[c]];
    if (at >= 0) p->corner[p->ncorners++] = (ms_moving_corner){c, p->row[at]};
  }
}

static msim_status fill_pins(const ms_model *model, ms_moving_pins *p, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const ms_unknowns *rows = &model->unknowns;
  int32_t *row_of = NULL, *to = NULL;
  const int fits =
      MS_NEW(alloc, row_of, model->scene->nparticles) && MS_NEW(alloc, to, rows->stride) &&
      MS_NEW(alloc, p->row, rows->n - rows->nfree) && MS_NEW(alloc, p->spring, model->springs.n) &&
      MS_NEW(alloc, p->corner, 3 * (size_t)model->angles.n);
  if (fits) {
    list_rows(model, p, row_of, to);
    list_springs(model, p, to);
    list_corners(model, p, to);
  }
  MS_FREE(alloc, row_of, to);
  return fits ? MSIM_OK : ms_error_set_memory(err, "the motions");
}

msim_status ms_moving_pins_create(const ms_model *model, ms_moving_pins **pins, msim_error *err) {
  const ms_scene *s = model->scene;
  *pins = NULL;
  if (s->nmotions == 0) return MSIM_OK;
  if (!MS_NEW(&s->alloc, *pins, 1)) return ms_error_set_memory(err, "the motions");
  const msim_status status = fill_pins(model, *pins, err);
  if (!status && (*pins)->n) return MSIM_OK;
  ms_moving_pins_destroy(s, *pins);
  *pins = NULL;
  return status;
}

void ms_moving_pins_destroy(const ms_scene *scene, ms_moving_pins *pins) {
  if (!pins) return;
  MS_FREE(&scene->alloc, pins->row, pins->spring, pins->corner, pins);
}

static void renumber_row(const ms_model *model, const ms_moving_row *mover, ms_moving_row *row) {
  const ms_moving_row *now = &mover[model->unknowns.particle[row->row]];
  row->motion = now->motion, row->i = now->i;
}

void ms_moving_pins_renumber(const ms_model *model, const ms_moving_row *mover) {
  ms_moving_pins *p = model->pins;
  p->speed = 0;
  for (int32_t k = 0; k < p->n; k++) {
    renumber_row(model, mover, &p->row[k]);
    p->speed = fmax(p->speed, ms_motion_find_speed(&model->scene->motions[p->row[k].motion]));
  }
  for (int32_t k = 0; k < p->nsprings; k++) renumber_row(model, mover, &p->spring[k].end);
  for (int32_t k = 0; k < p->ncorners; k++) renumber_row(model, mover, &p->corner[k].end);
}

/*------------------------------------- one model ------------------------------------------------*/

static void evaluate_row(const ms_model *model, const ms_moving_row *row, ms_instant at,
                         double x[3], double v[3]) {
  ms_motion_evaluate(&model->scene->motions[row->motion], row->i, at, x, v);
}

void ms_moving_pins_set(const ms_model *model, ms_instant at, double *x, double *v) {
  const ms_moving_pins *p = model->pins;
  for (int32_t i = 0; i < p->n; i++) {
    double where[3], speed[3];
    evaluate_row(model, &p->row[i], at, where, speed);
    ms_unknowns_set(&model->unknowns, where, p->row[i].row, x);
    if (v) ms_unknowns_set(&model->unknowns, speed, p->row[i].row, v);
  }
}

/* The power of the force of a spring on its moving end */
static double compute_spring_power(const ms_model *model, const ms_moving_spring *e, ms_instant at,
                                   const double *x, const double *v) {
  const int32_t spring = ms_springs_number(&model->springs, e->spring);
  double here[3], w[3], d[3], dv[3] = {0};
  evaluate_row(model, &e->end, at, here, w);
  ms_unknowns_get(&model->unknowns, x, e->other, d);
  if (v) ms_unknowns_get(&model->unknowns, v, e->other, dv);
  for (int c = 0; c < 3; c++) d[c] -= here[c], dv[c] = v ? dv[c] - w[c] : 0;
  const double l = ms_vec3_norm(d);
  if (l * l <= MS_MIN_LENGTH2) return 0;
  const double damping = ms_scene_damping(model->scene, spring);
  const double pull = ms_law_value_of(model->scene, spring, l).force +
                      MS_DASHPOT_FORCE(damping, ms_vec3_dot(d, dv)) / l;
  return pull / l * ms_vec3_dot(d, w);
}

/* This rank's share of the power of the force of an angular spring on its moving corner */
static double compute_corner_power(const ms_model *model, const ms_moving_corner *e, ms_instant at,
                                   const double *x, const double *v) {
  double here[3], w[3], f[3];
  evaluate_row(model, &e->end, at, here, w);
  ms_angle_springs_force_at(model, e->corner, x, v, f);
  return ms_unknowns_own_share(&model->unknowns, 3, model->angles.row + e->corner / 3 * 3) *
         ms_vec3_dot(f, w);
}

double ms_moving_pins_compute_power(const ms_model *model, ms_instant at, const double *x,
                                    const double *v) {
  const ms_moving_pins *p = model->pins;
  double sum = 0;
  for (int32_t k = 0; k < p->nsprings; k++)
    sum -= compute_spring_power(model, &p->spring[k], at, x, v);
  for (int32_t k = 0; k < p->ncorners; k++)
    sum -= compute_corner_power(model, &p->corner[k], at, x, v);
  return sum;
}

/*------------------------------------- the scene ------------------------------------------------*/

double ms_moving_pins_next_time(const ms_scene *scene, double t) {
  double next = ms_collider_motion_next_time(scene, t);
  for (int32_t m = 0; m < scene->nmotions; m++)
    next = fmin(next, ms_motion_next_time(&scene->motions[m], t));
  return next;
}

void ms_moving_pins_set_arrays(const ms_scene *scene, ms_instant at, double *x, double *v) {
  for (int32_t k = 0; k < scene->nmotions; k++) {
    const ms_motion *m = &scene->motions[k];
    for (int32_t i = 0; i < m->n; i++) {
      const size_t p = 3 * (size_t)m->particles[i];
      ms_motion_evaluate(m, i, at, x + p, v + p);
    }
  }
}

static int are_pinned(const ms_scene *s, int n, const int32_t *particles) {
  for (int i = 0; i < n; i++)
    if (!s->pinned[particles[i]]) return 0;
  return 1;
}

double ms_moving_pins_compute_energy(const ms_scene *s, const double *x, const double *v) {
  const ms_section all = ms_section_whole(s);
  double sum = 0;
  for (size_t p = 0; p < (size_t)s->nparticles; p++) {
    if (!s->pinned[p]) continue;
    sum += s->mass[p] * ms_vec3_dot(v + 3 * p, v + 3 * p) / 2 +
           ms_external_energy(&s->external, s->mass[p], x + 3 * p);
    if (s->force) sum -= ms_vec3_dot(s->force + 3 * p, x + 3 * p);
  }
  for (int32_t e = 0; e < s->nsprings; e++)
    if (are_pinned(s, 2, s->ij + 2 * (size_t)e))
      sum += ms_reference_compute_spring_energy(s, &all, e, x);
  for (int32_t e = 0; e < s->angles.n; e++)
    if (are_pinned(s, 3, s->angles.ijk + 3 * (size_t)e))
      sum += ms_reference_compute_angle_energy(s, &all, e, x);
  return sum;
}
