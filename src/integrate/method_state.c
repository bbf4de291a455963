#include "integrate/method_state.h"

#include <math.h>

#include "contact/contact_set.h"

/* 1 if `tag` is a cached-stage tag of the method */
static int is_cached_tag(const ms_integrator *method, int tag) {
  if (tag < 1 || tag > 2) return tag == 0;
  return method->carried && method->carried_at + tag * method->carried <= method->nwork;
}

void ms_method_state_archive_carried(ms_archive *b, const ms_integrator *method,
                                     const ms_stepper *s, int tag) {
  ms_archive_check(b, is_cached_tag(method, tag), "the tag of cached stages");
  if (ms_archive_failed(b)) return;
  const int first = method->carried_at + (tag - 1) * method->carried;
  for (int i = 0; i < method->carried && MS_ARCHIVE_OPTIONAL(b, tag > 0); i++)
    ms_archive_transfer_vector(b, s->model->state_shape, s->work[tag > 0 ? first + i : 0]);
}

static void archive_contacts(ms_archive *b, ms_stepper *s) {
  ms_archive_check(b, s->events || !(s->cached_stage & MS_CONTACTS_CACHED), "the contact set");
  if (!s->events || !MS_ARCHIVE_OPTIONAL(b, s->cached_stage & MS_CONTACTS_CACHED)) return;
  ms_archive_transfer_vector(b, s->model->state_shape, s->events->a);
  MS_ARCHIVE_TRANSFER(b, s->events->contact_hash);
}

/* A method with its own dense output needs its stages, others the a of both ends. */
static void archive_last_step(ms_archive *b, const ms_integrator *method, ms_stepper *s) {
  const ms_shape shape = s->model->state_shape;
  ms_archive_transfer_vector(b, shape, s->x_next);
  ms_archive_transfer_vector(b, shape, s->v_next);
  MS_ARCHIVE_TRANSFER(b, s->dense_output);
  ms_archive_check(b, s->dense_output >= 0 && s->dense_output <= (method->interpolate ? 3 : 1),
                   "the dense output of the last step");
  MS_ARCHIVE_TRANSFER(b, s->h_made);
  ms_archive_check(
      b, s->h_made == 0 || (s->dense_output > 1 && s->h_made >= s->h && isfinite(s->h_made)),
      "the dense output of the last step");
  if (MS_ARCHIVE_OPTIONAL(b, s->dense_output == 1 || s->h_made > 0)) {
    ms_archive_transfer_vector(b, shape, s->x_spare[1]);
    ms_archive_transfer_vector(b, shape, s->v_spare[1]);
  }
  for (int i = 0; i < method->nwork && method->interpolate; i++)
    ms_archive_transfer_vector(b, shape, s->work[i]);
}

/* As before the first step: nothing of the last one is known but what is read. */
static void forget_last_step(ms_stepper *s) {
  s->dense_output = s->cached_stage_next = 0, s->h_made = 0;
  ms_contact_set_forget(s->events);
}

void ms_method_state_archive(ms_archive *b, const ms_integrator *method, ms_stepper *s,
                             int inside) {
  const ms_shape shape = s->model->state_shape;
  if (b->direction == MS_ARCHIVE_READ) forget_last_step(s);
  ms_archive_transfer_vector(b, shape, s->x);
  ms_archive_transfer_vector(b, shape, s->v);
  MS_ARCHIVE_TRANSFER(b, s->h);
  MS_ARCHIVE_TRANSFER(b, s->h_before);
  MS_ARCHIVE_TRANSFER(b, s->t);
  MS_ARCHIVE_TRANSFER(b, s->cached_stage);
  ms_archive_check(b, isfinite(s->h) && s->h > 0 && isfinite(s->h_before) && isfinite(s->t),
                   "the length of the last step");
  if (ms_archive_failed(b)) return;
  ms_method_state_archive_carried(b, method, s, s->cached_stage & ~MS_CONTACTS_CACHED);
  archive_contacts(b, s);
  if (inside) archive_last_step(b, method, s);
}
