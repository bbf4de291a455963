/* contacts - what particles touched in the last step (msim_sim_contacts) */
#include <stdlib.h>
#include <string.h>

#include "contact/contact_log.h"
#include "sim/sim.h"

static int compare_contacts(const void *a, const void *b) {
  const msim_contact *p = a, *q = b;
  if (p->particle != q->particle) return (p->particle > q->particle) - (p->particle < q->particle);
  if (p->collider != q->collider) return (p->collider > q->collider) - (p->collider < q->collider);
  return (p->plane > q->plane) - (p->plane < q->plane);
}

/* by: the factor of impulses */
static msim_contact make_contact(const ms_model *model, const ms_touch *touch, double by) {
  const int32_t nplanes = model->scene->nplanes, obstacle = touch->obstacle;
  const int is_plane = obstacle < nplanes;
  msim_contact c = {.particle = model->unknowns.particle[touch->row],
                    .plane = is_plane ? obstacle : -1,
                    .collider = is_plane ? -1 : obstacle - nplanes};
  memcpy(c.point, touch->point, sizeof c.point);
  memcpy(c.normal, touch->normal, sizeof c.normal);
  const int32_t axis = model->unknowns.dropped_axis;
  if (axis >= 0) c.point[axis] = model->scene->x[3 * (size_t)c.particle + (size_t)axis];
  for (int i = 0; i < 3; i++) c.impulse[i] = by * model->mass[touch->row] * touch->dv[i];
  return c;
}

/* The number of touches in all logs; -1: some are missing */
static int64_t count_touches(const msim_sim *sim) {
  int64_t n = 0;
  for (int32_t i = 0; i < sim->nislands && sim->contacts_known; i++) {
    const ms_contact_log *log = sim->islands[i].stepper.contact_log;
    if (log && log->lost) return -1;
    n += log ? log->n : 0;
  }
  return n;
}

msim_status msim_sim_contacts(msim_sim *sim, int32_t *n, const msim_contact **contacts) {
  if (!sim || !n || !contacts || sim->config.opt.contacts == MSIM_CONTACTS_OFF) return MSIM_ERR_ARG;
  const int64_t count = count_touches(sim);
  if (count < 0 || count > INT32_MAX) return MSIM_ERR_MEMORY;
  msim_contact *all;
  if (!MS_NEW(&sim->alloc, all, count)) return MSIM_ERR_MEMORY;
  int32_t at = 0;
  for (int32_t i = 0; i < sim->nislands && count; i++) {
    const ms_island_sim *m = &sim->islands[i];
    const ms_contact_log *log = m->stepper.contact_log;
    const double by =
        log && m->at_rest ? m->stepper.h / log->h : 1; /* reactions of an earlier step */
    for (int32_t k = 0; log && k < log->n; k++)
      all[at++] = make_contact(&m->model, &log->touch[k], by);
  }
  qsort(all, (size_t)at, sizeof *all, compare_contacts);
  ms_memory_free(&sim->alloc, sim->contacts);
  *contacts = sim->contacts = all, *n = at;
  return MSIM_OK;
}
