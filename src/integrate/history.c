#include "integrate/history.h"

#include <math.h>

#include "integrate/contacts.h"

/* 1 if `note` is a cached-stage tag of the method */
static int is_note(const ms_integrator *method, int note) {
  if (note < 1 || note > 2) return note == 0;
  return method->carried && method->carried_at + note * method->carried <= method->nwork;
}

void ms_carried_history(ms_bytes *b, const ms_integrator *method, const ms_stepper *s, int note) {
  ms_bytes_check(b, is_note(method, note), "what the method carries");
  if (ms_bytes_failed(b)) return;
  const int first = method->carried_at + (note - 1) * method->carried;
  for (int i = 0; i < method->carried && MS_BYTES_IF(b, note > 0); i++)
    ms_bytes_pass_rows(b, s->model->shape, s->work[note > 0 ? first + i : 0]);
}

static void pass_contacts(ms_bytes *b, ms_stepper *s) {
  ms_bytes_check(b, s->events || !(s->warm & MS_NOTED), "a contact");
  if (!s->events || !MS_BYTES_IF(b, s->warm & MS_NOTED)) return;
  ms_bytes_pass_rows(b, s->model->shape, s->events->a);
  MS_BYTES_PASS(b, s->events->held);
}

/* A method with its own dense output needs its stages, others the a of both ends. */
static void pass_last_step(ms_bytes *b, const ms_integrator *method, ms_stepper *s) {
  const ms_shape shape = s->model->shape;
  ms_bytes_pass_rows(b, shape, s->x_next);
  ms_bytes_pass_rows(b, shape, s->v_next);
  MS_BYTES_PASS(b, s->looked);
  ms_bytes_check(b, s->looked >= 0 && s->looked <= (method->interpolate ? 3 : 1), "a look inside");
  if (MS_BYTES_IF(b, s->looked == 1)) {
    ms_bytes_pass_rows(b, shape, s->x_spare[1]);
    ms_bytes_pass_rows(b, shape, s->v_spare[1]);
  }
  for (int i = 0; i < method->nwork && method->interpolate; i++)
    ms_bytes_pass_rows(b, shape, s->work[i]);
}

void ms_stepper_history(ms_bytes *b, const ms_integrator *method, ms_stepper *s, int inside) {
  const ms_shape shape = s->model->shape;
  ms_bytes_pass_rows(b, shape, s->x);
  ms_bytes_pass_rows(b, shape, s->v);
  MS_BYTES_PASS(b, s->h);
  MS_BYTES_PASS(b, s->h_before);
  MS_BYTES_PASS(b, s->warm);
  ms_bytes_check(b, isfinite(s->h) && s->h > 0 && isfinite(s->h_before), "the last step");
  if (ms_bytes_failed(b)) return;
  ms_carried_history(b, method, s, s->warm & ~MS_NOTED);
  pass_contacts(b, s);
  if (inside) pass_last_step(b, method, s);
}
