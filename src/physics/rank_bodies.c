#include "physics/rank_bodies.h"

#include "layout/components.h"
#include "physics/rank_model.h"

/* A body consists of components, each of the unknowns of one rank, that springs between ranks
 * connect. */
typedef struct bodies {
  const ms_model *model;
  int32_t n;      /* components of this rank */
  int32_t *of;    /* nfree: the component of each unknown */
  int32_t *first; /* n: the place (rank_part.h) of their first unknowns */
  int32_t *label; /* n */
  double *row;    /* stride: the label of each row, also of ghosts */
} bodies;

/* The component of row p, if that is an own one, takes the label of row q, if that is a ghost and
 * its label is lower. Returns 1 then. */
static int lower_label(const bodies *b, int32_t p, int32_t q) {
  const ms_unknowns *rows = &b->model->unknowns;
  if (p >= rows->nfree || q < rows->nfree || q >= rows->first_fixed) return 0;
  int32_t *label = &b->label[b->of[p]];
  if (!(b->row[q] < *label)) return 0;
  *label = (int32_t)b->row[q];
  return 1;
}

static int lower_labels(const bodies *b) {
  const ms_springs *s = &b->model->springs;
  const ms_angles *g = &b->model->angles;
  int changes = 0;
  for (int32_t e = 0; e < s->n; e++)
    changes |= lower_label(b, s->i[e], s->j[e]) | lower_label(b, s->j[e], s->i[e]);
  for (int32_t c = 0; c < 3 * g->n; c++)
    for (int32_t other = 0; other < 3; other++)
      changes |= lower_label(b, g->row[c], g->row[c / 3 * 3 + other]);
  return changes;
}

/* All components of a body get the lowest of their labels. */
static void share_lowest_labels(const bodies *b) {
  do {
    for (int32_t r = 0; r < b->model->unknowns.nfree; r++) b->row[r] = b->label[b->of[r]];
    ms_rank_model_refresh_components(b->model, 1, b->row);
  } while (ms_rank_model_any(b->model, lower_labels(b)));
}

/* The component that has the first unknown of its body numbers it; bodies of lower ranks come
 * first. Returns the number of bodies. */
static int32_t number_bodies(const bodies *b, ms_ranks *ranks, int64_t *counts) {
  int64_t own = 0, sum = 0, next = 0;
  for (int32_t k = 0; k < b->n; k++) own += b->label[k] == b->first[k];
  ms_ranks_gather(ranks, sizeof own, &own, counts);
  for (int32_t r = 0; r < ranks->n && !ranks->failed; sum += counts[r++])
    if (r == ranks->rank) next = sum;
  for (int32_t k = 0; k < b->n; k++)
    b->label[k] = b->label[k] == b->first[k] ? (int32_t)next++ : INT32_MAX;
  return (int32_t)sum;
}

msim_status ms_rank_bodies_number(const ms_model *model, int32_t *of, int32_t *n, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const ms_rank_part *part = model->rank_model->part;
  const int32_t nfree = model->unknowns.nfree;
  bodies b = {.model = model, .of = of};
  b.n = ms_components_number(&model->unknowns, &model->springs, &model->angles, of);
  const int fits = MS_NEW(alloc, b.first, b.n) && MS_NEW(alloc, b.label, b.n) &&
                   MS_NEW(alloc, b.row, model->unknowns.stride);
  msim_status status = ms_ranks_agree_on_memory(part->ranks, fits, "the bodies of the scene", err);
  if (!status) {
    for (int32_t r = nfree - 1; r >= 0; r--) b.label[of[r]] = b.first[of[r]] = part->place[r];
    share_lowest_labels(&b);
    *n = number_bodies(&b, part->ranks, part->next);
    share_lowest_labels(&b);
    for (int32_t r = 0; r < nfree; r++) of[r] = b.label[of[r]];
    status = ms_ranks_agree(part->ranks, MSIM_OK, err);
  }
  MS_FREE(alloc, b.first, b.label, b.row);
  return status;
}
