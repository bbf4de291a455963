#include "contact/implicit_impulses.h"

#include "base/vec3.h"
#include "contact/contact_impulses.h"

void ms_implicit_impulses_find_reaction(const ms_stepper *s, int32_t i, int is_linear,
                                        double a[3]) {
  const ms_contact *c = &s->events->contact[i];
  const ms_constraint *g = &s->events->constraint[i];
  double dv[3];
  for (int k = 0; k < 3; k++) a[k] = -c->push[k];
  ms_unknowns_get(&s->model->unknowns, s->work[0], c->row, dv);
  const double by = g->weight / (s->model->mass[c->row] * s->h);
  for (int32_t k = 0; k < g->n && is_linear; k++)
    ms_vec3_axpy(by * ms_vec3_dot(g->direction[k], dv), g->direction[k], a);
}

/* -r/h of a linear step */
static void find_linear_reaction(const ms_stepper *s, int32_t i, const double v[3], double a[3]) {
  const ms_constraint *g = &s->events->constraint[i];
  const double by = g->friction / (s->model->mass[g->row] * s->h);
  ms_implicit_impulses_find_reaction(s, i, 1, a);
  ms_vec3_axpy(by, v, a);
  for (int32_t k = 0; k < g->n; k++)
    ms_vec3_axpy(-by * ms_vec3_dot(g->direction[k], v), g->direction[k], a);
}

void ms_implicit_impulses_keep(ms_stepper *s, const double *v_start, int is_linear) {
  const ms_unknowns *rows = &s->model->unknowns;
  ms_contact_set *e = s->events;
  if (!s->contact_log && !(is_linear && e->near.moves)) return;
  ms_vector_copy(s->model->shape, s->v_next, e->begin[0]);
  if (!is_linear) ms_contact_set_free_acceleration(s, 1, s->x_next, s->v_next, e->a_end);
  for (int32_t i = 0; i < e->ncontacts; i++) {
    double *J = e->contact[i].impulse, v[3], before[3], a[3];
    const int32_t row = e->contact[i].row;
    ms_unknowns_get(rows, s->v_next, row, v);
    ms_unknowns_get(rows, v_start, row, before);
    if (is_linear) ms_unknowns_get(rows, s->v, row, J), find_linear_reaction(s, i, v, a);
    else ms_unknowns_get(rows, s->v_next, row, J), ms_unknowns_get(rows, e->a_end, row, a);
    ms_vec3_axpy(-1, before, J), ms_vec3_axpy(-s->h, a, J);
  }
}

void ms_implicit_impulses_add(const ms_stepper *s) {
  const ms_unknowns *rows = &s->model->unknowns;
  const ms_contact_set *e = s->events;
  for (int32_t i = 0; i < e->ncontacts && s->contact_log; i++) {
    const ms_contact *c = &e->contact[i];
    double x[3], v[3], solved[3];
    ms_unknowns_get(rows, s->x_next, c->row, x);
    ms_unknowns_get(rows, s->v_next, c->row, v);
    ms_unknowns_get(rows, e->begin[0], c->row, solved);
    ms_vec3_axpy(1, c->impulse, v);
    ms_contact_impulses_add(s, c->row, &c->on, x, solved, v);
  }
}

double ms_implicit_impulses_find_work(const ms_stepper *s) {
  const ms_unknowns *rows = &s->model->unknowns;
  const ms_contact_set *e = s->events;
  double sum = 0;
  for (int32_t i = 0; i < e->ncontacts && e->near.moves; i++) {
    const ms_contact *c = &e->contact[i];
    double v[3], solved[3];
    ms_unknowns_get(rows, s->v_next, c->row, v);
    ms_unknowns_get(rows, e->begin[0], c->row, solved);
    for (int k = 0; k < 3; k++)
      sum += s->model->mass[c->row] * (c->impulse[k] + v[k] - solved[k]) *
             c->frame.displacement[k] / s->h;
  }
  return sum;
}
