#include "integrate/replay.h"

#include <string.h>

#include "physics/path.h"

/* Of a row, with the acceleration a at the start of the step and b1 at its end */
static ms_path path_of(const ms_stepper *s, int32_t row, const double *a, const double *b1) {
  const ms_rows *rows = &s->model->rows;
  ms_path p = {.walls = ms_walls_of(s), .h = s->h};
  ms_row_get(rows, s->x, row, p.x);
  ms_row_get(rows, s->v, row, p.v);
  ms_row_get(rows, a, row, p.a);
  ms_row_get(rows, b1, row, p.b1);
  memcpy(p.w, p.v, sizeof p.w);
  memcpy(p.b0, p.a, sizeof p.b0);
  return p;
}

void ms_replay_positions(ms_stepper *s, const double *a, double *v_predicted) {
  ms_events *e = s->events;
  if (!e || !e->replays) return;
  e->nfollowed = 0;
  for (int32_t r = 0; r < s->model->rows.nfree; r++) {
    ms_path p = path_of(s, r, a, a);
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
    ms_path p = path_of(s, e->followed[i], a, a_next);
    ms_path_follow(&p);
    ms_row_put(&s->model->rows, p.w, e->followed[i], s->v_next);
  }
  if (e->nfollowed) s->finite = 0;
}
