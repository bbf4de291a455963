#define _POSIX_C_SOURCE 200809L /* readlink, kill */
#include "reference_program.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../common/clock.h"

extern char **environ;

/*------------------------------------- starting -------------------------------------------------*/

/* REFERENCE_FOLDER is relative to this program's folder, so that an installation can be moved.
 * mode: as for access(). Returns 0 if there is no such file. */
static int reference_program_path(const char *name, int mode, char *path, size_t size) {
  char own[2048];
  const ssize_t length = readlink("/proc/self/exe", own, sizeof own - 1);
  if (length <= 0) return 0;
  own[length] = '\0';
  *strrchr(own, '/') = '\0';
  const int written = snprintf(path, size, "%s/" REFERENCE_FOLDER "/%s", own, name);
  return written > 0 && (size_t)written < size && access(path, mode) == 0;
}

static int configures_libraries(const char *variable) {
  static const char *const beginnings[] = {"OPENBLAS_", "GOTO_", "OMP_", "GOMP_",
                                           "KMP_",      "MKL_",  "BLIS_"};
  for (size_t i = 0; i < sizeof beginnings / sizeof *beginnings; i++)
    if (strncmp(variable, beginnings[i], strlen(beginnings[i])) == 0) return 1;
  return 0;
}

/* Returns the environment without such variables: an array to be freed, with shared strings. */
static char **filtered_environment(void) {
  size_t n = 0, kept = 0;
  while (environ[n]) n++;
  char **plain = calloc(n + 1, sizeof *plain);
  for (size_t i = 0; plain && i < n; i++)
    if (!configures_libraries(environ[i])) plain[kept++] = environ[i];
  return plain;
}

/* Makes two pipes that other child processes do not inherit: [0] to the child, [1] from it. */
static int make_pipes(int ends[2][2]) {
  if (pipe(ends[0]) != 0) return 0;
  if (pipe(ends[1]) != 0) {
    close(ends[0][0]);
    close(ends[0][1]);
    return 0;
  }
  for (int i = 0; i < 4; i++) fcntl(ends[i / 2][i % 2], F_SETFD, FD_CLOEXEC);
  return 1;
}

static int spawn(reference_program *r, char *path) {
  posix_spawn_file_actions_t actions;
  char *argv[] = {path, NULL}, **plain = filtered_environment();
  int ends[2][2];
  if (!plain || !make_pipes(ends)) {
    free(plain);
    return errno;
  }
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[0][0], STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1][1], STDOUT_FILENO);
  const int failed = posix_spawn(&r->pid, path, &actions, NULL, argv, plain);
  posix_spawn_file_actions_destroy(&actions);
  free(plain);
  close(ends[0][0]);
  close(ends[1][1]);
  r->to = ends[0][1];
  r->from = ends[1][0];
  if (!failed) return 0;
  close(r->to);
  close(r->from);
  r->pid = 0;
  return failed;
}

void reference_program_start(reference_program *r, const char *name) {
  char program[64], path[4096];
  *r = (reference_program){0};
  snprintf(program, sizeof program, "msim_bench_reference_%s", name);
  if (!reference_program_path(program, X_OK, path, sizeof path)) {
    snprintf(r->reason, sizeof r->reason,
             "msim_bench_reference_%s was not found; build with its library installed", name);
    return;
  }
  const int failed = spawn(r, path);
  if (failed) {
    snprintf(r->reason, sizeof r->reason, "msim_bench_reference_%s: %s", name, strerror(failed));
  } else if (!pipe_read(r->from, &r->hello, sizeof r->hello)) {
    reference_program_stop(r);
    snprintf(r->reason, sizeof r->reason, "msim_bench_reference_%s ended without an answer", name);
  }
}

void reference_program_stop(reference_program *r) {
  if (r->pid == 0) return;
  close(r->to);
  close(r->from);
  kill(r->pid, SIGKILL);
  waitpid(r->pid, NULL, 0);
  r->pid = 0;
}

/*------------------------------------- asking ---------------------------------------------------*/

/* Stops a program that does not answer. */
static int stop_unresponsive(reference_program *r) {
  reference_program_stop(r);
  snprintf(r->reason, sizeof r->reason, "the reference program ended unexpectedly");
  return 0;
}

int reference_program_send_system(reference_program *r, const msim_csr *A, const double *b,
                                  double rtol, int32_t max_iterations) {
  const size_t n = (size_t)A->n, entries = (size_t)A->rowptr[n];
  const reference_request request = {
      .what = REFERENCE_SYSTEM, .n = A->n, .max_iterations = max_iterations, .rtol = rtol};
  reference_reply reply;
  if (r->pid == 0) return 0;
  if (!pipe_write(r->to, &request, sizeof request) ||
      !pipe_write(r->to, A->rowptr, (n + 1) * sizeof(int32_t)) ||
      !pipe_write(r->to, A->colind, entries * sizeof(int32_t)) ||
      !pipe_write(r->to, A->val, entries * sizeof(double)) ||
      !pipe_write(r->to, b, n * sizeof(double)) || !pipe_read(r->from, &reply, sizeof reply))
    return stop_unresponsive(r);
  if (reply.failed) snprintf(r->reason, sizeof r->reason, "%.*s", 127, reply.reason);
  return !reply.failed;
}

int reference_program_solve(reference_program *r, int variant, reference_reply *reply) {
  const reference_request request = {.what = REFERENCE_SOLVE, .variant = variant};
  *reply = (reference_reply){.failed = 1};
  if (r->pid != 0 && pipe_write(r->to, &request, sizeof request) &&
      pipe_read(r->from, reply, sizeof *reply)) {
    clock_sleep(r->hello.rest_s);
    return !reply->failed;
  }
  if (r->pid != 0) stop_unresponsive(r);
  snprintf(reply->reason, sizeof reply->reason, "%.*s", 127, r->reason);
  return 0;
}

/*------------------------------------- the module -----------------------------------------------*/

const ode_methods *ode_load(char reason[static 256]) {
  static const char name[] = "msim_bench_ode_sundials.so";
  char path[4096];
  if (!reference_program_path(name, R_OK, path, sizeof path)) {
    snprintf(reason, 256,
             "%s was not found beside the reference programs; build with SUNDIALS "
             "(libsundials-dev)",
             name);
    return NULL;
  }
  void *module = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  const ode_methods *methods = module ? dlsym(module, ODE_SYMBOL) : NULL;
  if (!methods) snprintf(reason, 256, "%s", dlerror());
  return methods;
}
