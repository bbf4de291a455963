/* Measures by how much the solutions of all solvers differ. */
#include <math.h>
#include <stdio.h>

#include "../common/interrupt.h"
#include "linear.h"

/* max |a_i - b_i| */
static double largest_difference(size_t n, const double *a, const double *b) {
  double largest = 0;
  for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(a[i] - b[i]));
  return largest;
}

static const double *velocity(const timing_candidate *c) {
  const struct timed_step *step = c->data;
  msim_state state = {.size = sizeof state};
  msim_sim_state(step->sim, &state);
  return state.v;
}

typedef struct disagreement {
  int solvers;
  double largest; /* m/s; NAN: fewer than two solvers have a result */
  const timing_candidate *pair[2];
} disagreement;

static disagreement find_disagreement(const solver_comparison *r) {
  const size_t n = 3 * (size_t)r->moving->view.nparticles;
  const timing_candidate *good[MOST_STEPS];
  disagreement d = {.largest = NAN};
  for (const timing_candidate *c = r->all; c < r->all + r->count; c++) {
    if (c->failed || c->nsamples == 0) continue;
    for (int i = 0; i < d.solvers; i++) {
      const double difference = largest_difference(n, velocity(good[i]), velocity(c));
      if (difference <= d.largest) continue;
      d.largest = difference;
      d.pair[0] = good[i], d.pair[1] = c;
    }
    good[d.solvers++] = c;
  }
  return d;
}

static void report_disagreement(report *out, const solver_comparison *r, const disagreement *d) {
  json_t *row =
      add_step_row(out, "disagreement", r->moving, r->system.h,
                   FIELDS(INTEGER("unknowns", r->moving->unknowns), REAL("rtol", r->system.rtol),
                          INTEGER("solvers", d->solvers), REAL("largest", d->largest)));
  if (!d->pair[0]) return;
  put_fields(row, FIELDS(TEXT("first", d->pair[0]->name), TEXT("second", d->pair[1]->name)));
  printf(" solver.rtol %g: velocities of %d solvers differ by at most %.2g m/s (%s, %s)\n",
         r->system.rtol, d->solvers, d->largest, d->pair[0]->name, d->pair[1]->name);
  fflush(stdout);
}

static int all_have_samples(const solver_comparison *r) {
  for (const timing_candidate *c = r->all; c < r->all + r->count; c++)
    if (!c->failed && c->nsamples == 0) return 0;
  return 1;
}

double compare_solvers(const linear_bench *b, const moving_scene *m, double h,
                       const cost_limits *t) {
  const timing_limits once = {.until = b->run->until};
  msim_error err;
  solver_comparison *r = solver_comparison_create(m, h, 1e-12, 0, &err);
  if (!r) {
    report_left_out(b->report, "disagreement", m, h, "all", err.text);
    return NAN;
  }
  printf(" all solvers again, with solver.rtol %g\n", r->system.rtol);
  add_solvers(b, r, t, "disagreement");
  time_in_turn(r->all, r->count, &once);
  disagreement d = {.largest = NAN};
  if (!is_interrupted()) {
    solver_comparison_report(b->report, r, "disagreement");
    d = find_disagreement(r);
    report_disagreement(b->report, r, &d);
    if (!all_have_samples(r)) d.largest = NAN;
  }
  solver_comparison_free(r);
  return d.largest;
}
