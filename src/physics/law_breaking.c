#include "physics/law_breaking.h"

#include <float.h>
#include <math.h>
#include <stdatomic.h>

#include "physics/law_kernels.h"

MS_TABLES(ms_law_kernels);

/*------------------------------------- limits of lengths ----------------------------------------*/

/* Relative room for the rounding errors of lengths, stretches and forces, some units each */
#define MARGIN (32 * DBL_EPSILON)

/* F/k; 0 where the quotient has fewer digits than a normal number. */
static double divide_by_stiffness(double force, double k) {
  const double e = force / k;
  return e < DBL_MIN ? 0 : e;
}

/* With the coefficients a > 0 alone f/k <= B(e) = sum a_i e^(i+1), also beyond the limit of the
 * law, where f continues along its tangent, as B is convex. Rounding errors of Horner's rule, below
 * 2 n units of the sum of all |a_i| e^(i+1), are added to B. */
static double bound_polynomial(const ms_law *law, double e) {
  const double rounding = 16 * DBL_EPSILON * law->given.n;
  double sum = 0;
  for (int32_t i = law->given.n - 1; i >= 0; i--) {
    const double a = law->given.coefficients[i];
    sum = sum * e + fmax(a, 0) + rounding * fabs(a);
  }
  return sum * e;
}

/* B(e) <= q, by chords of the convex B from 0, below which B lies. A law that pulls at compression
 * has no such bound. */
static double find_polynomial_stretch(const ms_law *law, double q) {
  enum { CHORDS = 24 };
  double high = INFINITY, low = 0;
  for (int32_t i = 0; i < law->given.n; i++) {
    const double a = law->given.coefficients[i];
    if (i % 2 ? a > 0 : a < 0) return -INFINITY;
    if (a > 0) high = fmin(high, pow(q / a, 1. / (i + 1)));
  }
  if (!(high < INFINITY)) return high;
  double above = bound_polynomial(law, high);
  for (int i = 0; i < CHORDS && above > q && low < high; i++) {
    const double below = bound_polynomial(law, low);
    low += (high - low) * fmax(0, q - below) / (above - below) * (1 - MARGIN);
  }
  return low;
}

/* Between two points of a table the force is monotone: where it rises beyond F, by bisection. */
static double find_piece_stretch(const ms_law *law, int32_t i, double most) {
  enum { HALVINGS = 40 };
  const ms_law_piece *p = &law->piece[i];
  double low = law->given.stretch[i - 1], high = law->given.stretch[i];
  for (int k = 0; k < HALVINGS; k++) {
    const double middle = low + (high - low) / 2, s = middle - p->start;
    if (p->a + s * (p->b + s * (p->c + s * p->d)) <= most) low = middle;
    else high = middle;
  }
  return low;
}

/* F less the rounding errors of a piece, whose terms are some times its largest force */
static double find_table_stretch(const ms_law *law) {
  const msim_law *t = &law->given;
  const ms_law_piece *low = law->piece, *high = law->piece + t->n;
  double size = 0;
  for (int32_t i = 0; i < t->n; i++) size = fmax(size, fabs(t->force[i]));
  const double most = t->break_force - 1e-9 * fmax(size, t->break_force);
  if (low->b < 0 || t->force[0] > most) return -INFINITY;
  for (int32_t i = 1; i < t->n; i++)
    if (t->force[i] > most) return find_piece_stretch(law, i, most);
  return high->b > 0 ? high->start + (most - high->a) / high->b * (1 - 1e-9) : INFINITY;
}

/* The force does not exceed break_force up to this stretch; -INFINITY: unknown. */
static double find_force_stretch(const ms_law *law, double k) {
  const double force = law->given.break_force;
  switch (law->given.kind) {
    case MSIM_LAW_LINEAR:
    case MSIM_LAW_TENSION:
      return divide_by_stiffness(force, k);
    case MSIM_LAW_DEAD_BAND:
      return law->given.half_width + divide_by_stiffness(force, k);
    case MSIM_LAW_COMPRESSION:
      return INFINITY;
    case MSIM_LAW_POLYNOMIAL:
      return find_polynomial_stretch(law, divide_by_stiffness(force, k));
    case MSIM_LAW_TABLE:
      return find_table_stretch(law);
    default:
      return -INFINITY;
  }
}

static double find_stretch(const ms_law *law, double k) {
  return law->given.break_force > 0 ? find_force_stretch(law, k) : INFINITY;
}

/* At most DBL_MAX, as the test decides about infinite lengths */
static double limit_length(const ms_law *law, double rest, double stretch) {
  const double strain = law->given.break_strain;
  const double e = strain > 0 && rest > 0 ? fmin(stretch, strain * rest) : stretch;
  return fmin(DBL_MAX, rest + e - MARGIN * (rest + fabs(e)));
}

double ms_law_breaking_limit(const ms_law *law, double k, double rest) {
  return limit_length(law, rest, find_stretch(law, k));
}

static void set_limits(struct ms_law_springs *s) {
  s->slack = -1, s->has_limits = 1;
  for (int32_t at = 0; at < s->nslots; at++) s->limit[at] = DBL_MAX;
  for (int32_t r = 0; r < s->nruns; r++) {
    const ms_law_run *run = &s->run[r];
    double stretch = 0;
    for (int32_t at = run->begin; at < run->end && ms_law_breaks(run->law); at++) {
      if (at == run->begin || s->k[at] != s->k[at - 1]) stretch = find_stretch(run->law, s->k[at]);
      if (!s->broken[at]) s->limit[at] = limit_length(run->law, s->rest[at], stretch);
    }
  }
}

/*------------------------------------- the test -------------------------------------------------*/

static int breaks(const struct ms_law_springs *s, const ms_law_run *run, const ms_law_batch *at,
                  int32_t e) {
  return !s->broken[run->begin + e] &&
         ms_law_exceeds_threshold(run->law, at->stretch[e], at->force[e], s->rest[run->begin + e]);
}

static void evaluate_springs(const ms_model *model, const ms_law_run *run, const double *x,
                             int only_force, ms_law_lengths *to) {
  to->at.only_force = only_force;
  ms_law_kernels_of[model->isa]->measure(model, run, x, to);
  ms_law_springs_evaluate(model, run, &to->at);
}

/*------------------------------------- all springs ----------------------------------------------*/

typedef struct breaking_job {
  const ms_model *model;
  const double *x;
  double most; /* m: a distance of particles */
  atomic_int moved;
} breaking_job;

/* Rows in a chunk of work: some 5 us. */
enum { ROWS = 4096 };

static void find_moved_rows(void *data, int32_t begin, int32_t end) {
  breaking_job *j = data;
  const struct ms_law_springs *s = j->model->laws;
  if (atomic_load_explicit(&j->moved, memory_order_relaxed)) return;
  if (ms_law_kernels_of[j->model->isa]->has_moved(j->model, begin, end, s->seen, j->x, j->most))
    atomic_store_explicit(&j->moved, 1, memory_order_relaxed);
}

/* 1: some particle has moved so far that springs may have reached their limits. */
static int may_have_reached_limits(breaking_job *j) {
  enum { FARTHEST = 500 };
  if (!(j->model->laws->slack > 0)) return 1;
  j->most = fmin(j->model->laws->slack / 2, pow(2, FARTHEST)) * (1 - MARGIN);
  ms_pool_run_chunks(j->model->pool, find_moved_rows, j, j->model->unknowns.stride, ROWS);
  return atomic_load(&j->moved);
}

static void measure_run_slack(void *data, int32_t item) {
  const breaking_job *j = data;
  const struct ms_law_springs *s = j->model->laws;
  const ms_law_run *run = &s->run[item];
  s->sum[item] = ms_law_breaks(run->law) && run->begin < run->end
                     ? ms_law_kernels_of[j->model->isa]->slack(j->model, run, j->x)
                     : DBL_MAX;
}

static void measure_slack(breaking_job *j) {
  struct ms_law_springs *s = j->model->laws;
  ms_pool_run(j->model->pool, measure_run_slack, j, s->nruns);
  s->slack = DBL_MAX;
  for (int32_t r = 0; r < s->nruns; r++) s->slack = fmin(s->slack, s->sum[r]);
  if (s->slack > 0) ms_vector_copy_all(j->model->shape, j->x, s->seen);
}

static void count_run_breaking(void *data, int32_t item) {
  const breaking_job *j = data;
  const struct ms_law_springs *s = j->model->laws;
  const ms_law_run *run = &s->run[item];
  const int may_break = s->sum[item] < 0;
  ms_law_lengths at;
  s->sum[item] = 0;
  if (!may_break) return;
  evaluate_springs(j->model, run, j->x, 1, &at);
  for (int32_t e = 0; e < run->end - run->begin; e++) s->sum[item] += breaks(s, run, &at.at, e);
}

int32_t ms_law_breaking_count(const ms_model *model, const double *x) {
  struct ms_law_springs *s = model->laws;
  breaking_job j = {.model = model, .x = x};
  double n = 0;
  if (!s->limit) return 0;
  if (!s->has_limits) set_limits(s);
  if (!may_have_reached_limits(&j)) return 0;
  measure_slack(&j);
  if (s->slack >= 0) return 0;
  ms_pool_run(model->pool, count_run_breaking, &j, s->nruns);
  for (int32_t r = 0; r < s->nruns; r++) n += s->sum[r];
  return (int32_t)n;
}

double ms_law_breaking_mark(const ms_model *model, const double *x, uint8_t *broken) {
  const struct ms_law_springs *s = model->laws;
  double below = 0;
  for (int32_t r = 0; r < s->nruns; r++) {
    const ms_law_run *run = &s->run[r];
    ms_law_lengths at;
    if (!ms_law_breaks(run->law)) continue;
    evaluate_springs(model, run, x, 0, &at);
    for (int32_t e = 0; e < run->end - run->begin; e++) {
      const int32_t ends[2] = {s->i[run->begin + e], s->j[run->begin + e]};
      if (!breaks(s, run, &at.at, e)) continue;
      broken[ms_springs_number(&model->springs, s->spring[run->begin + e])] = MS_BREAKING;
      below += ms_unknowns_own_share(&model->unknowns, 2, ends) * fmax(0, -at.at.energy[e]);
    }
  }
  return below;
}
