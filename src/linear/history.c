/* history - serializes the state of a solver that affects later solves, for checkpoints:
 *
 *   linear solver         auto may have replaced pcg by cholmod for good
 *   lagged factor         its linearization point; its age and cost, which decide on its use
 *   coarse factor         of pcg, likewise
 *   constant matrix       its h, as a scalar matrix is factored once for a whole run
 *   amortization          flops of pcg so far; whether cholmod was opened for a factor, or given up
 *
 * All else is computed anew in each solve. The caller creates the solver for the same h and springs
 * before its state is read. Instead of factors their linearization points are stored, which are
 * hundreds of times smaller and reproduce the factors to the bit. */
#include <math.h>
#include <string.h>

#include "linear/pcg.h"
#include "linear/solver.h"

static ms_pcg *pcg_of(const ms_solver *s) {
  return strcmp(s->linear->name, "pcg") == 0 ? (ms_pcg *)s->linear : NULL;
}

static int is_auto(const ms_solver *s) { return strcmp(s->opt->solver, "auto") == 0; }

int ms_solver_is_chosen(const ms_solver *s) {
  return is_auto(s) || strcmp(s->opt->solver, "pcg") == 0;
}

/* Decisions that are stored as flags */
typedef struct decisions {
  int32_t pcg, may_switch, aggregates;
  int32_t saves, has_cholmod; /* beside pcg */
} decisions;

static decisions decisions_of(const ms_solver *s) {
  return (decisions){.pcg = pcg_of(s) != NULL,
                     .may_switch = s->may_switch,
                     .aggregates = s->linear->aggregates,
                     .saves = s->savings.allowed,
                     .has_cholmod = s->savings.cholmod != NULL};
}

static void pass_decisions(ms_bytes *b, decisions *d) {
  int32_t *flags[] = {&d->pcg, &d->may_switch, &d->aggregates, &d->saves, &d->has_cholmod};
  for (size_t i = 0; i < sizeof flags / sizeof *flags; i++) MS_BYTES_PASS(b, *flags[i]);
}

/* Apply stored decisions to a solver just created. */
static msim_status decide(ms_solver *s, const decisions *d, msim_error *err) {
  msim_status status = MSIM_OK;
  if (pcg_of(s) && !d->pcg && s->may_switch) status = ms_solver_switch(s, err);
  if (status) return status;
  if (!pcg_of(s) != !d->pcg || d->aggregates != s->linear->aggregates)
    return ms_fail(
        err, MSIM_ERR_ARG,
        "the linear solver cannot be as it was: it is pcg here and cholmod there, or has "
        "another coarse space");
  s->may_switch = s->may_switch && d->may_switch;
  if (!d->saves && s->savings.allowed) ms_solver_drop_kept(s);
  if (s->savings.allowed && d->has_cholmod) status = ms_solver_add_cholmod(s, err);
  return status;
}

/* Constrained unknowns, ascending */
static void pass_holds(ms_bytes *b, const ms_rows *rows, ms_origin *origin) {
  MS_BYTES_PASS(b, origin->nholds);
  ms_bytes_check(b, origin->nholds >= 0 && origin->nholds <= rows->nfree, "rows that are held");
  if (ms_bytes_failed(b)) return;
  const int32_t n = b->direction == MS_COUNT ? rows->nfree : origin->nholds;
  ms_bytes_pass(b, origin->hold, (size_t)n * sizeof *origin->hold);
  for (int32_t i = 0, next = 0; i < n && b->direction == MS_TAKE; i++) {
    const ms_hold *g = &origin->hold[i];
    ms_bytes_check(b, g->row >= next && g->row < rows->nfree, "a row that is held");
    ms_bytes_check(b, g->n >= 0 && g->n <= 3, "a row that is held");
    for (int k = 0; k < 9; k++)
      ms_bytes_check(b, isfinite(g->along[k / 3][k % 3]), "a row that is held");
    next = g->row + 1;
  }
}

static void pass_origin(ms_bytes *b, const ms_solver *s, ms_origin *origin) {
  const ms_model *model = s->system.model;
  MS_BYTES_PASS(b, origin->h);
  MS_BYTES_PASS(b, origin->clamped);
  MS_BYTES_PASS(b, origin->kind);
  ms_bytes_check(b, isfinite(origin->h) && origin->h > 0, "the h of a matrix");
  ms_bytes_check(b, (origin->kind | 1) == 1, "the kind of a factor");
  if (s->system.a.block == 1) return;
  if (b->direction == MS_TAKE) ms_rows_gather(&model->rows, model->scene->x, origin->x);
  ms_bytes_pass_rows(b, model->shape, origin->x); /* pinned particles: from the scene */
  if (ms_solver_may_hold(s)) pass_holds(b, &model->rows, origin);
}

static void pass_counts(ms_bytes *b, ms_kept *kept, ms_savings *savings) {
  int64_t *counts[] = {&kept->age, &kept->iterations, &kept->wait, &savings->steps};
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) ms_bytes_pass_count(b, counts[i]);
  MS_BYTES_PASS(b, kept->rest); /* may be negative */
  ms_bytes_check(b, kept->rest > INT64_MIN / 2, "a count");
  MS_BYTES_PASS(b, kept->limit);
  MS_BYTES_PASS(b, kept->rtol);
  MS_BYTES_PASS(b, savings->flops);
  ms_bytes_check(b, kept->limit >= 0 && kept->rtol >= 0 && savings->flops >= 0, "the solver");
  ms_bytes_check(b, kept->by || kept->age == 0, "a kept factor");
}

/* The age of the coarse factor, if there is one that may be lagged; else -1 */
static int32_t coarse_age(const ms_solver *s) {
  const ms_pcg *pcg = pcg_of(s);
  const int serves = pcg && pcg->base.aggregates && pcg->coarse_is_ready && pcg->may_keep;
  return serves ? pcg->coarse_age : -1;
}

/* Recompute all factors. As that resets their counts, these are restored. */
static msim_status make_factors(ms_solver *s, int32_t age, const ms_origin *constant,
                                msim_error *err) {
  const ms_kept kept = s->kept;
  msim_status status = MSIM_OK;
  if (age >= 0) status = ms_solver_make(s, s->linear, &s->by_coarse, err);
  if (!status && kept.age > 0) status = ms_solver_make(s, kept.by, &s->by_kept, err);
  if (!status && constant->h > 0) status = ms_solver_make(s, s->linear, constant, err);
  s->kept = kept;
  if (age >= 0) pcg_of(s)->coarse_age = age;
  s->made_for = constant->h;
  return status;
}

msim_status ms_solver_history(ms_bytes *b, ms_solver *s, msim_error *err) {
  decisions d = decisions_of(s);
  int32_t age = coarse_age(s);
  ms_origin constant = {.h = s->made_for, .clamped = s->made_for > 0 && s->system.clamped};
  pass_decisions(b, &d);
  msim_status status = b->direction == MS_TAKE ? decide(s, &d, err) : MSIM_OK;
  if (status) return status;
  pass_counts(b, &s->kept, &s->savings);
  MS_BYTES_PASS(b, constant.h);
  MS_BYTES_PASS(b, constant.clamped);
  ms_bytes_check(b, isfinite(constant.h) && (constant.h == 0 || s->system.a.block == 1),
                 "the h of a matrix");
  MS_BYTES_PASS(b, age);
  ms_bytes_check(b,
                 age == -1 || (age >= 0 && age < INT32_MAX / 2 && pcg_of(s) &&
                               pcg_of(s)->may_keep && d.aggregates),
                 "a coarse factor");
  if (ms_bytes_failed(b)) return MSIM_OK;
  const int counts = b->direction == MS_COUNT; /* count what may exist later, too */
  if (counts ? is_auto(s) || pcg_of(s) : age >= 0) pass_origin(b, s, &s->by_coarse);
  if (counts ? is_auto(s) : s->kept.age > 0) pass_origin(b, s, &s->by_kept);
  if (b->direction != MS_TAKE || ms_bytes_failed(b)) return MSIM_OK;
  return make_factors(s, age, &constant, err);
}
