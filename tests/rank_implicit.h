/* rank_implicit - run a scene by an implicit method on 2 to 4 ranks: the velocities of one process
 * to the tolerance of the method, and on 3 ranks the same bits in each run */
#ifndef TEST_RANK_IMPLICIT_H
#define TEST_RANK_IMPLICIT_H

#include "rank_runs.h"

static const double RTOL = 1e-8;

static inline double largest_of(const double *x, int32_t n) {
  double most = 0;
  for (int32_t i = 0; i < 3 * n; i++) most = fmax(most, fabs(x[i]));
  return most;
}

/* The runs on a number of ranks, two on three ranks */
typedef struct implicit_case {
  run r;
  double *v; /* of the first run on that many ranks; NULL: this is the first */
  double worst;
  int64_t iterations; /* of the linear solver on ranks */
  msim_stats alone;   /* of one process */
} implicit_case;

static inline const char *check_implicit_rank(msim_comm *comm, void *data) {
  implicit_case *c = data;
  msim_options opt = c->r.opt;
  msim_sim *sim = NULL;
  msim_error why = {0};
  msim_state s = {.size = sizeof s};
  msim_stats stats = {.size = sizeof stats};
  msim_energy e = {.size = sizeof e};
  opt.comm = comm;
  EXPECT(msim_sim_create(c->r.scene, &opt, &sim, &why) == MSIM_OK);
  EXPECT(msim_sim_step(sim, c->r.steps, &why) == MSIM_OK);
  EXPECT(msim_sim_state(sim, &s) == MSIM_OK && msim_sim_stats(sim, &stats) == MSIM_OK);
  EXPECT(stats.rejected_steps == c->alone.rejected_steps);
  EXPECT(stats.newton_iterations == c->alone.newton_iterations);
  EXPECT(stats.broken == c->alone.broken);
  EXPECT(msim_sim_energy(sim, &e) == MSIM_OK);
  EXPECT(fabs(e.work - c->r.energy.work) <= 1e-6 * (fabs(e.work) + fabs(e.total)));
  const double most = fmax(largest_of(c->r.expected.v, s.n), 9.81 * c->r.opt.h);
  double off = 0;
  for (int32_t i = 0; i < 3 * s.n; i++) off = fmax(off, fabs(s.v[i] - c->r.expected.v[i]));
  const char *wrong = NULL;
  if (!(off <= 10 * RTOL * c->r.steps * most)) wrong = "other velocities";
  if (c->v && !has_same_bits(s.v, c->v, s.n)) wrong = "other bits in the second run";
  double *v = comm->rank == 0 && !c->v ? copy_numbers(s.v, s.n) : NULL;
  double unused = 0;
  comm->sum(comm->self, 1, &unused); /* all have read c->v */
  if (v) c->v = v;
  if (comm->rank == 0) c->worst = off / most, c->iterations = stats.iterations;
  msim_sim_destroy(sim);
  return wrong;
}

/* most: the largest ratio of iterations on ranks to those of one process */
static inline void check_implicit(const char *name, const msim_scene *scene, msim_options opt,
                                  int32_t steps, double most) {
  opt.solver = "pcg", opt.solver_rtol = opt.newton_rtol = RTOL;
  implicit_case c = {.r = run_alone(scene, opt, steps)};
  msim_sim *sim = make_sim(scene, &opt);
  assert_ok(msim_sim_step(sim, steps, err));
  c.alone = stats_of(sim);
  msim_sim_destroy(sim);
  print_message("%s, %s: %d iterations alone;", name, opt.integrator, (int)c.alone.iterations);
  for (int32_t n = 2; n <= 4; n++) {
    for (int again = 0; again < (n == 3 ? 2 : 1); again++) {
      const char *wrong = run_ranks(n, check_implicit_rank, &c);
      if (wrong) fail_msg("%s, %s, %d ranks: %s, %.1e", name, opt.integrator, n, wrong, c.worst);
    }
    print_message(" %d: %d, dv %.1e;", n, (int)c.iterations, c.worst);
    assert_true((double)c.iterations <= most * (double)c.alone.iterations);
    free(c.v);
    c.v = NULL;
  }
  print_message("\n");
  free_run(&c.r);
}

#endif
