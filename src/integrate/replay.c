#include "integrate/replay.h"

void ms_replay_positions(ms_stepper *s, const double *a, double *v_predicted) {
  ms_events *e = s->events;
  if (!e || !e->replays) return;
  e->nfollowed = 0;
  for (int32_t r = 0; r < s->model->rows.nfree; r++) {
    ms_path p = ms_contacts_path(s, r, a, a);
    if (!ms_path_is_near(&p)) continue;
    e->followed[e->nfollowed++] = r;
    ms_path_follow(&p);
    ms_row_put(&s->model->rows, p.x, r, s->x_next);
    ms_row_put(&s->model->rows, p.v, r, v_predicted);
    s->stats->contacts += p.impacts;
  }
}

void ms_replay_velocities(ms_stepper *s, const double *a, const double *a_next) {
  const ms_events *e = s->events;
  if (!e || !e->replays) return;
  for (int32_t i = 0; i < e->nfollowed; i++) {
    ms_path p = ms_contacts_path(s, e->followed[i], a, a_next);
    ms_path_follow(&p);
    ms_row_put(&s->model->rows, p.w, e->followed[i], s->v_next);
  }
  if (e->nfollowed) s->finite = 0;
}
