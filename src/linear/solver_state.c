#include <math.h>
#include <string.h>

#include "linear/pcg.h"
#include "linear/solver_choice.h"
#include "linear/solver_state.h"

static ms_pcg *pcg_of(const ms_solver *s) {
  return strcmp(s->linear->name, "pcg") == 0 ? (ms_pcg *)s->linear : NULL;
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
                     .saves = s->amortization.allowed,
                     .has_cholmod = s->amortization.cholmod != NULL};
}

static void archive_decisions(ms_archive *b, decisions *d) {
  int32_t *flags[] = {&d->pcg, &d->may_switch, &d->aggregates, &d->saves, &d->has_cholmod};
  for (size_t i = 0; i < sizeof flags / sizeof *flags; i++) MS_ARCHIVE_TRANSFER(b, *flags[i]);
}

/* Apply stored decisions to a solver just created. */
static msim_status apply_decisions(ms_solver *s, const decisions *d, msim_error *err) {
  msim_status status = MSIM_OK;
  if (pcg_of(s) && !d->pcg && s->may_switch) status = ms_solver_switch_to_cholmod(s, err);
  if (status) return status;
  if (!pcg_of(s) != !d->pcg || d->aggregates != s->linear->aggregates)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the linear solver of the checkpoint cannot be restored: here it is "
                        "another one (pcg or cholmod) or has another coarse space; resume with the "
                        "msim, plugins and options of the original run");
  s->may_switch = s->may_switch && d->may_switch;
  if (!d->saves && s->amortization.allowed) ms_solver_drop_lagged_factor(s);
  if (s->amortization.allowed && d->has_cholmod) status = ms_solver_add_cholmod(s, err);
  return status;
}

/* Constrained unknowns, ascending */
static void archive_constraints(ms_archive *b, const ms_unknowns *rows,
                                ms_linearization_point *origin) {
  MS_ARCHIVE_TRANSFER(b, origin->nconstraints);
  ms_archive_check(b, origin->nconstraints >= 0 && origin->nconstraints <= rows->nfree,
                   "the number of constrained particles");
  if (ms_archive_failed(b)) return;
  const int32_t most = b->rows ? b->rows->n : rows->nfree;
  const int32_t n = b->direction == MS_ARCHIVE_COUNT ? most : origin->nconstraints;
  ms_archive_transfer(b, origin->constraint, (size_t)n * sizeof *origin->constraint);
  for (int32_t i = 0, next = 0; i < n && b->direction == MS_ARCHIVE_READ; i++) {
    const ms_constraint *g = &origin->constraint[i];
    ms_archive_check(b, g->row >= next && g->row < rows->nfree, "a constrained particle");
    ms_archive_check(b, g->n >= 0 && g->n <= 3, "a constrained particle");
    for (int k = 0; k < 9; k++)
      ms_archive_check(b, isfinite(g->direction[k / 3][k % 3]), "a constrained particle");
    next = g->row + 1;
  }
}

static void archive_linearization_point(ms_archive *b, const ms_solver *s,
                                        ms_linearization_point *origin) {
  const ms_model *model = s->system.model;
  MS_ARCHIVE_TRANSFER(b, origin->h);
  MS_ARCHIVE_TRANSFER(b, origin->clamped);
  MS_ARCHIVE_TRANSFER(b, origin->kind);
  ms_archive_check(b, isfinite(origin->h) && origin->h > 0, "the step size of a factored matrix");
  ms_archive_check(b, (origin->kind | 1) == 1, "the kind of a factorization");
  if (s->system.a.block == 1) return;
  if (b->direction == MS_ARCHIVE_READ)
    ms_unknowns_gather(&model->unknowns, model->scene->x, origin->x);
  ms_archive_transfer_vector(b, model->shape, origin->x); /* pinned particles: from the scene */
  if (ms_solver_may_have_constraints(s)) archive_constraints(b, &model->unknowns, origin);
}

static void archive_counts(ms_archive *b, ms_lagged_factor *kept, ms_amortization *amortization) {
  int64_t *counts[] = {&kept->age, &kept->iterations, &kept->skip_length, &amortization->solves};
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
    ms_archive_transfer_count(b, counts[i]);
  MS_ARCHIVE_TRANSFER(b, kept->skips_left); /* may be negative */
  ms_archive_check(b, kept->skips_left > INT64_MIN / 2, "a counter of the linear solver");
  MS_ARCHIVE_TRANSFER(b, kept->limit);
  MS_ARCHIVE_TRANSFER(b, kept->rtol);
  MS_ARCHIVE_TRANSFER(b, amortization->flops);
  ms_archive_check(b, kept->limit >= 0 && kept->rtol >= 0 && amortization->flops >= 0,
                   "a limit of the linear solver");
  ms_archive_check(b, kept->factorizer || kept->age == 0, "the age of the lagged factorization");
}

/* The age of the coarse factor, if there is one that may be lagged; else -1 */
static int32_t coarse_age(const ms_solver *s) {
  const ms_pcg *pcg = pcg_of(s);
  const int serves = pcg && pcg->base.aggregates && pcg->coarse_is_ready && pcg->may_reuse_coarse;
  return serves ? pcg->coarse_age : -1;
}

/* Recompute all factors. As that resets their counts, these are restored. */
static msim_status recompute_factors(ms_solver *s, int32_t age,
                                     const ms_linearization_point *constant, msim_error *err) {
  const ms_lagged_factor kept = s->lagged_factor;
  msim_status status = MSIM_OK;
  if (s->linear->ops->restart) s->linear->ops->restart(s->linear);
  if (age >= 0) status = ms_solver_factor_at(s, s->linear, &s->coarse_point, err);
  if (!status && kept.age > 0)
    status = ms_solver_factor_at(s, kept.factorizer, &s->lagged_point, err);
  if (!status && constant->h > 0) status = ms_solver_factor_at(s, s->linear, constant, err);
  s->lagged_factor = kept;
  if (age >= 0) pcg_of(s)->coarse_age = age;
  s->constant_h = constant->h;
  return status;
}

/* Decisions of a solver that has made solves are not changed: they must be the stored ones. */
static msim_status read_decisions(ms_archive *b, ms_solver *s, int in_use, decisions *d,
                                  msim_error *err) {
  const decisions now = *d;
  archive_decisions(b, d);
  if (b->direction != MS_ARCHIVE_READ) return MSIM_OK;
  if (!in_use) return apply_decisions(s, d, err);
  return memcmp(&now, d, sizeof now) == 0
             ? MSIM_OK
             : ms_error_set(err, MSIM_ERR_ARG, "the linear solver is another one");
}

/* Which factors there are, apart from their linearization points */
typedef struct factor_list {
  int has_coarse, has_lagged;
  ms_linearization_point constant;
} factor_list;

static factor_list factors_of(const ms_solver *s, int32_t age) {
  return (factor_list){age >= 0,
                       s->lagged_factor.age > 0,
                       {.h = s->constant_h, .clamped = s->constant_h > 0 && s->system.clamped}};
}

static int factors_are_listed(const ms_solver *s, const factor_list *before, int32_t age,
                              const ms_linearization_point *constant) {
  return before->has_coarse == (age >= 0) && before->has_lagged == (s->lagged_factor.age > 0) &&
         before->constant.h == constant->h && before->constant.clamped == constant->clamped;
}

/* Transfer a point; *same becomes 0 if another one is read than the solver had. */
static void archive_factor(ms_archive *b, const ms_solver *s, ms_linearization_point *origin,
                           int *same) {
  ms_archive comparison = *b;
  comparison.direction = MS_ARCHIVE_COMPARE;
  if (*same) archive_linearization_point(&comparison, s, origin);
  *same &= !comparison.differs;
  archive_linearization_point(b, s, origin);
}

msim_status ms_solver_state_archive(ms_archive *b, ms_solver *s, int in_use, msim_error *err) {
  decisions d = decisions_of(s);
  int32_t age = coarse_age(s);
  const factor_list before = factors_of(s, age);
  ms_linearization_point constant = before.constant;
  msim_status status = read_decisions(b, s, in_use, &d, err);
  if (status) return status;
  archive_counts(b, &s->lagged_factor, &s->amortization);
  MS_ARCHIVE_TRANSFER(b, constant.h);
  MS_ARCHIVE_TRANSFER(b, constant.clamped);
  ms_archive_check(b, isfinite(constant.h) && (constant.h == 0 || s->system.a.block == 1),
                   "the step size of a factored matrix");
  MS_ARCHIVE_TRANSFER(b, age);
  ms_archive_check(b,
                   age == -1 || (age >= 0 && age < INT32_MAX / 2 && pcg_of(s) &&
                                 pcg_of(s)->may_reuse_coarse && d.aggregates),
                   "the age of the coarse factorization");
  if (ms_archive_failed(b)) return MSIM_OK;
  const int counts = b->direction == MS_ARCHIVE_COUNT; /* count what may exist later, too */
  int same =
      b->direction == MS_ARCHIVE_READ && in_use && factors_are_listed(s, &before, age, &constant);
  const int is_auto = ms_solver_choice_is_auto(s->opt) || s->system.model->shape.ranks;
  if (counts ? is_auto || pcg_of(s) : age >= 0) archive_factor(b, s, &s->coarse_point, &same);
  if (counts ? is_auto : s->lagged_factor.age > 0) archive_factor(b, s, &s->lagged_point, &same);
  if (b->direction != MS_ARCHIVE_READ || ms_archive_failed(b)) return MSIM_OK;
  if (!same) return recompute_factors(s, age, &constant, err);
  if (age >= 0) pcg_of(s)->coarse_age = age;
  return MSIM_OK;
}

/* As archive_linearization_point(), of n unknowns */
static void skip_linearization_point(ms_archive *b, const ms_solver *s, int32_t n) {
  ms_linearization_point point = {0};
  b->position += sizeof point.h + sizeof point.clamped + sizeof point.kind;
  if (s->system.a.block == 1) return;
  b->position += (size_t)s->system.model->shape.dims * (size_t)n * sizeof *point.x;
  if (!ms_solver_may_have_constraints(s)) return;
  MS_ARCHIVE_TRANSFER(b, point.nconstraints);
  ms_archive_check(b, point.nconstraints >= 0 && point.nconstraints <= n,
                   "the number of constrained particles");
  if (!ms_archive_failed(b)) b->position += (size_t)point.nconstraints * sizeof *point.constraint;
}

void ms_solver_state_skip(ms_archive *b, const ms_solver *s, int32_t n) {
  decisions d;
  ms_lagged_factor kept = {.factorizer = s->linear};
  ms_amortization amortization = {0};
  ms_linearization_point constant = {0};
  int32_t age;
  archive_decisions(b, &d);
  archive_counts(b, &kept, &amortization);
  MS_ARCHIVE_TRANSFER(b, constant.h);
  MS_ARCHIVE_TRANSFER(b, constant.clamped);
  MS_ARCHIVE_TRANSFER(b, age);
  if (ms_archive_failed(b)) return;
  if (age >= 0) skip_linearization_point(b, s, n);
  if (kept.age > 0) skip_linearization_point(b, s, n);
}
