/* msim_bench_reference_NAME - solves the systems that msim_bench sends, by library NAME in default
 * settings
 *
 * A separate process, so that no setting of msim (threads, environment) affects the library. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "solver.h"

static void free_system(csr_system *s) {
  void *arrays[] = {s->rowptr, s->colind, s->val, s->b};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
  *s = (csr_system){0};
}

/* Returns a new array read from the pipe; NULL: out of memory, or no more data. */
static void *read_array(size_t count, size_t size) {
  void *array = malloc(count * size + 1);
  if (array && pipe_read(STDIN_FILENO, array, count * size)) return array;
  free(array);
  return NULL;
}

static int read_system(const reference_request *request, csr_system *s) {
  free_system(s);
  *s = (csr_system){
      .n = request->n, .max_iterations = request->max_iterations, .rtol = request->rtol};
  const size_t n = (size_t)s->n;
  s->rowptr = read_array(n + 1, sizeof(int32_t));
  if (!s->rowptr) return 0;
  const size_t entries = (size_t)s->rowptr[n];
  s->colind = read_array(entries, sizeof(int32_t));
  s->val = s->colind ? read_array(entries, sizeof(double)) : NULL;
  s->b = s->val ? read_array(n, sizeof(double)) : NULL;
  return s->b != NULL;
}

/* ||b - A x|| / ||b|| */
static double relative_residual(const csr_system *s, const double *x) {
  double rr = 0, bb = 0;
  for (int32_t i = 0; i < s->n; i++) {
    double r = s->b[i];
    for (int32_t e = s->rowptr[i]; e < s->rowptr[i + 1]; e++) r -= s->val[e] * x[s->colind[e]];
    rr += r * r, bb += s->b[i] * s->b[i];
  }
  return sqrt(rr / bb);
}

static void answer_solve(const csr_system *s, int variant, reference_reply *reply) {
  double *x = s->n > 0 ? malloc((size_t)s->n * sizeof *x) : NULL;
  reply->failed = !x || !solver.solve(variant, x, reply);
  if (!reply->failed) reply->residual = relative_residual(s, x);
  free(x);
}

int main(void) {
  csr_system system = {0};
  reference_request request;
  int alive = pipe_write(STDOUT_FILENO, &solver.hello, sizeof solver.hello);
  while (alive && pipe_read(STDIN_FILENO, &request, sizeof request)) {
    reference_reply reply = {0};
    if (request.what == REFERENCE_SYSTEM) {
      if (!read_system(&request, &system)) break;
      reply.failed = !solver.prepare(&system);
      if (reply.failed) snprintf(reply.reason, sizeof reply.reason, "the analysis failed");
    } else {
      answer_solve(&system, request.variant, &reply);
    }
    alive = pipe_write(STDOUT_FILENO, &reply, sizeof reply);
  }
  free_system(&system);
  return 0;
}
