/* Tests that a solver backend keeps the contract of backend.h.
 * usage: test_conformance NAME [OPTIONS]
 *
 * NAME is found like the option `solver`, so that MSIM_PLUGIN_PATH adds plugins. This program is
 * the host: no sim is involved. */
#include <float.h>
#include <string.h>

#include "../checking_backend.h"
#include "conformance.h"

const msim_backend *backend, *bare;
int iterative, symmetric, unsymmetric;

int check_no_breach(void **state) {
  (void)state;
  const char *report = checking_report();
  if (report[0])
    print_error(
        "breaches of backend.h:\n"
        "%s",
        report);
  return report[0] != '\0';
}

void for_each(const kind *kinds, const int32_t *sizes, visitor *visit) {
  for (; kinds->name; kinds++)
    for (const int32_t *n = sizes; *n; n++)
      for (int32_t block = 1; block <= 3; block++) {
        char label[128];
        problem *p = scale_values(kinds->make(*n, block, 7), kinds->factor);
        snprintf(label, sizeof label, "%s, %d blocks of %d, times %g", kinds->name, *n, block,
                 kinds->factor);
        visit(label, p);
        problem_free(p);
      }
}

outcome solve_with(const msim_backend *table, const problem *p, int32_t ask, const double *b) {
  rig r;
  outcome o = {.call = "analyze", .y = calloc((size_t)unknowns(p) + 1, sizeof(double))};
  o.status = rig_open(&r, table, p);
  if (!o.status) {
    o.call = "factor";
    o.status = rig_factor(&r, ask);
    o.definite = r.info.definite;
  }
  if (!o.status) {
    o.call = "solve";
    o.status = rig_solve(&r, RTOL, LIMIT, 1, b, o.y);
    if (r.info.definite) o.definite = r.info.definite;
  }
  o.iterations = r.info.iterations, o.fill = r.fill, o.flops = r.flops;
  rig_close(&r);
  return o;
}

int is_solution(const problem *p, const double *b, const double *y, double rtol, double error) {
  if (!iterative) return backward_error(p, b, y) <= error;
  return residual(p, b, y) <= rtol * (1 + 1e-9) || backward_error(p, b, y) <= 8 * DBL_EPSILON;
}

int is_valid_outcome(const problem *p, const double *b, msim_status status, const double *y) {
  if (status == MSIM_OK) return is_solution(p, b, y, RTOL, 1e-9);
  return status == MSIM_NOT_SPD || (status == MSIM_NOT_CONVERGED && iterative);
}

void assert_same(const char *label, const double *y, const double *z, int32_t n) {
  for (int32_t i = 0; i < n; i++)
    if (memcmp(&y[i], &z[i], sizeof *y) != 0)
      fail_msg("%s: y[%d] = %.17g once and %.17g once", label, i, y[i], z[i]);
}

int main(int argc, char **argv) {
  msim_error err;
  if (argc != 2 && argc != 3) return fprintf(stderr, "usage: test_conformance NAME [OPTIONS]\n"), 2;
  rig_options = argv[2]; /* NULL behind the last */
  msim_status status = msim_solver_backend(argv[1], NULL, &bare, &err);
  if (status) {
    fprintf(stderr, "%s\n", err.text);
    return status == MSIM_ERR_NAME ? missing_status(argv[1]) : 1;
  }
  backend = checking_backend(bare);
  iterative = (bare->flags & MSIM_BACKEND_ITERATIVE) != 0;
  symmetric = (bare->flags & MSIM_BACKEND_SYMMETRIC) != 0;
  unsymmetric = (bare->flags & MSIM_BACKEND_UNSYMMETRIC) != 0;
  const int failed = run_solutions() + run_definiteness() + run_iterations() + run_refusals() +
                     run_side_effects() + run_out_of_memory();
  return failed != 0;
}
