#include "linear/coarse.h"

#include <stdlib.h>
#include <string.h>

#include "linear/coarse_kernels.h"

MS_TABLES(ms_coarse_kernels);

/*------------------------------------- pattern --------------------------------------------------*/

static int ascending(const void *a, const void *b) {
  const int32_t *p = a, *q = b;
  if (p[0] != q[0]) return p[0] < q[0] ? -1 : 1;
  return (p[1] > q[1]) - (p[1] < q[1]);
}

/* List the pairs of aggregates that springs connect, both ways, sorted, without duplicates. */
static int32_t list_links(const ms_model *model, const int32_t *of, int32_t (*link)[2]) {
  const ms_springs *s = &model->springs;
  int32_t n = 0, kept = 0;
  for (int32_t e = 0; e < s->n; e++) {
    if (s->i[e] >= model->rows.nfree || s->j[e] >= model->rows.nfree) continue;
    const int32_t a = of[s->i[e]], b = of[s->j[e]];
    if (a < 0 || b < 0 || a == b) continue;
    link[n][0] = a, link[n++][1] = b;
    link[n][0] = b, link[n++][1] = a;
  }
  qsort(link, (size_t)n, sizeof *link, ascending);
  for (int32_t i = 0; i < n; i++) {
    if (kept && ascending(link[kept - 1], link[i]) == 0) continue;
    link[kept][0] = link[i][0], link[kept++][1] = link[i][1];
  }
  return kept;
}

/* Where there are planes, prepare constraints: copy the modes, and allocate `held`. */
static msim_status keep_modes(const ms_model *model, ms_coarse *coarse, msim_error *err) {
  const size_t n = MS_MODES * (size_t)model->rows.first_pinned;
  if (!(model->passes & MSIM_SKIP_PLANES)) return MSIM_OK;
  coarse->modes = ms_new(&model->scene->alloc, n, sizeof *coarse->modes);
  coarse->held = ms_new(&model->scene->alloc, (size_t)model->rows.nfree, sizeof *coarse->held);
  if (!coarse->modes || !coarse->held) return ms_fail_memory(err, "the coarse matrix");
  memcpy(coarse->modes, coarse->aggregates.weight, n * sizeof *coarse->modes);
  return MSIM_OK;
}

static msim_status analyse(const ms_model *model, ms_coarse *coarse, msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  const int32_t n = coarse->aggregates.n;
  int32_t(*link)[2] = ms_new(alloc, 2 * (size_t)model->springs.n, sizeof *link);
  int32_t *ptr = ms_new(alloc, (size_t)n + 1, sizeof *ptr), *ind = NULL;
  int32_t links = 0;
  if (link && ptr) {
    links = list_links(model, coarse->aggregates.of, link);
    ind = ms_new(alloc, (size_t)links, sizeof *ind);
  }
  msim_status status = ind ? MSIM_OK : ms_fail_memory(err, "the coarse matrix");
  if (!status) {
    for (int32_t i = 0; i < links; i++) ptr[link[i][0] + 1]++, ind[i] = link[i][1];
    for (int32_t a = 0; a < n; a++) ptr[a + 1] += ptr[a];
    status = ms_block_cholesky_create(alloc, n, MS_MODES * model->rows.dims, ptr, ind, model->isa,
                                      &coarse->chol, err);
  }
  ms_delete(alloc, link);
  ms_delete(alloc, ptr);
  ms_delete(alloc, ind);
  return status;
}

/* Of the two half-edges of a spring, that of the aggregate eliminated later contributes to the
 * off-diagonal block. */
static void find_blocks(const ms_model *model, ms_coarse *coarse) {
  const ms_halves *halves = &model->halves;
  const int32_t *of = coarse->aggregates.of, *position = coarse->chol.position;
  for (int32_t at = 0; at < MS_GROUP * halves->nslots; at++) coarse->block[at] = -1;
  for (int32_t r = 0; r < model->rows.nfree; r++) {
    const ms_span span = ms_halves_of(halves, r);
    for (int32_t at = span.begin; at < span.end; at += span.step) {
      const int32_t j = halves->neighbour[at];
      if (halves->spring[at] < 0 || j >= model->rows.nfree) continue;
      if (of[r] < 0 || of[j] < 0 || position[of[r]] <= position[of[j]]) continue;
      coarse->block[at] = ms_block_cholesky_find(&coarse->chol, of[r], of[j]);
    }
  }
  for (int32_t a = 0; a < coarse->aggregates.n; a++)
    coarse->diagonal[a] = ms_block_cholesky_find(&coarse->chol, a, a);
}

msim_status ms_coarse_create(const ms_model *model, int32_t aggregate_size, ms_coarse *coarse,
                             msim_error *err) {
  const msim_allocator *alloc = &model->scene->alloc;
  *coarse = (ms_coarse){.model = model, .kernels = ms_coarse_kernels_of[model->isa]};
  msim_status status = ms_aggregates_create(model, aggregate_size, &coarse->aggregates, err);
  if (!status) status = keep_modes(model, coarse, err);
  if (!status) status = analyse(model, coarse, err);
  if (status) return status;
  const size_t n = (size_t)coarse->aggregates.n * MS_MODES * (size_t)model->rows.dims;
  coarse->block = ms_new(alloc, MS_GROUP * (size_t)model->halves.nslots, sizeof *coarse->block);
  coarse->diagonal = ms_new(alloc, (size_t)coarse->aggregates.n, sizeof *coarse->diagonal);
  coarse->r = ms_new(alloc, n, sizeof *coarse->r);
  coarse->z = ms_new(alloc, n, sizeof *coarse->z);
  if (!coarse->block || !coarse->diagonal || !coarse->r || !coarse->z)
    return ms_fail_memory(err, "the coarse matrix");
  find_blocks(model, coarse);
  return MSIM_OK;
}

void ms_coarse_destroy(ms_coarse *coarse) {
  if (!coarse->model) return;
  const msim_allocator *alloc = &coarse->model->scene->alloc;
  ms_aggregates_destroy(coarse->model, &coarse->aggregates);
  ms_block_cholesky_destroy(alloc, &coarse->chol);
  void *arrays[] = {coarse->block, coarse->diagonal, coarse->r,
                    coarse->z,     coarse->modes,    coarse->held};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) ms_delete(alloc, arrays[i]);
  *coarse = (ms_coarse){0};
}

/*------------------------------------- values ---------------------------------------------------*/

enum { CHUNK = 8 }; /* aggregates per work item */

/* One loop over all aggregates, by all threads; no two write to the same place. */
typedef struct job {
  ms_coarse *coarse;
  const float *coefficients;
  const double *inertia;
  const double *r;
} job;

static void run(ms_item *work, job *j) {
  const int32_t n = j->coarse->aggregates.n;
  ms_pool_run(j->coarse->model->pool, work, j, (n + CHUNK - 1) / CHUNK);
}

#define EACH_OF(item) \
  for (int32_t k = CHUNK * (item); k < CHUNK * (item + 1) && k < j->coarse->aggregates.n; k++)

static void assemble_chunk(void *data, int32_t item) {
  const job *j = data;
  EACH_OF(item) j->coarse->kernels->assemble(j->coarse, j->coefficients, j->inertia, k);
}

static void restrict_chunk(void *data, int32_t item) {
  const job *j = data;
  EACH_OF(item) j->coarse->kernels->restrict_to(j->coarse, j->r, k);
}

void ms_coarse_hold(ms_coarse *coarse, const ms_hold *hold, int32_t n) {
  float *weight = coarse->aggregates.weight;
  const size_t size = MS_MODES * sizeof *weight;
  if (coarse->nheld) memcpy(weight, coarse->modes, size * (size_t)coarse->model->rows.first_pinned);
  coarse->nheld = n;
  for (int32_t i = 0; i < n; i++) {
    coarse->held[i] = hold[i].row;
    memset(weight + MS_MODES * hold[i].row, 0, size);
  }
}

int ms_coarse_holds(const ms_coarse *coarse, const ms_hold *hold, int32_t n) {
  if (n != coarse->nheld) return 0;
  for (int32_t i = 0; i < n; i++)
    if (hold[i].row != coarse->held[i]) return 0;
  return 1;
}

/* Modes of constrained unknowns alone need some inertia, or the coarse matrix would be singular. */
static void add_held(ms_coarse *coarse, const double *inertia) {
  const size_t n = (size_t)coarse->chol.block, area = n * n;
  for (const int32_t *row = coarse->held; row < coarse->held + coarse->nheld; row++) {
    const float *w = coarse->modes + MS_MODES * *row;
    const int32_t of = coarse->aggregates.of[*row];
    if (of < 0) continue;
    double *block = coarse->chol.value + area * (size_t)coarse->diagonal[of];
    for (size_t c = 0; c < n; c += MS_MODES)
      for (size_t i = 0; i < MS_MODES; i++)
        for (size_t j = 0; j < MS_MODES; j++)
          block[(c + j) * n + c + i] += inertia[*row] * (double)w[i] * (double)w[j];
  }
}

msim_status ms_coarse_factor(ms_coarse *coarse, const float *coefficients, const double *inertia,
                             int braced) {
  ms_block_cholesky *chol = &coarse->chol;
  const size_t area = (size_t)chol->block * (size_t)chol->block;
  coarse->braced = braced;
  memset(chol->value, 0, area * (size_t)chol->first[chol->n] * sizeof *chol->value);
  run(assemble_chunk, &(job){.coarse = coarse, .coefficients = coefficients, .inertia = inertia});
  add_held(coarse, inertia);
  return ms_block_cholesky_factor(chol);
}

double ms_coarse_solve(ms_coarse *coarse, const double *r) {
  const int32_t n = coarse->aggregates.n * coarse->chol.block;
  run(restrict_chunk, &(job){.coarse = coarse, .r = r});
  memcpy(coarse->z, coarse->r, (size_t)n * sizeof *coarse->z);
  ms_block_cholesky_solve(&coarse->chol, coarse->z);
  double sum = 0;
  for (int32_t i = 0; i < n; i++) sum += coarse->r[i] * coarse->z[i];
  return sum;
}
