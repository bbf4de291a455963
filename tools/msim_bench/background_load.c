#define _GNU_SOURCE /* sched_getaffinity */
#include "background_load.h"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../common/clock.h"

int usable_cores(void) {
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) return CPU_COUNT(&set);
  long online = sysconf(_SC_NPROCESSORS_ONLN);
  return online > 0 ? (int)online : 1;
}

/* Computes until the pipe has data. */
static void compute_until_signal(int control) {
  struct pollfd wait = {.fd = control, .events = POLLIN};
  do {
    const double end = clock_seconds() + 1e-3;
    while (clock_seconds() < end) continue;
  } while (poll(&wait, 1, 0) == 0);
}

static void run_load_process(int control) {
  char turn;
  for (int busy = 0; read(control, &turn, 1) == 1;) {
    busy = !busy;
    if (busy) compute_until_signal(control);
  }
  _exit(0);
}

static int start_one(struct load_process *process) {
  int ends[2];
  if (pipe(ends) != 0) return 0;
  process->pid = fork();
  if (process->pid == 0) {
    close(ends[1]);
    run_load_process(ends[0]);
  }
  close(ends[0]);
  fcntl(ends[1], F_SETFD, FD_CLOEXEC);
  process->control = ends[1];
  if (process->pid > 0) return 1;
  close(ends[1]);
  return 0;
}

void background_load_start(background_load *s) {
  const int wanted = usable_cores() - 1;
  *s = (background_load){.processes =
                             wanted > 0 ? calloc((size_t)wanted, sizeof *s->processes) : NULL};
  while (s->processes && s->count < wanted && start_one(&s->processes[s->count])) s->count++;
  if (s->count < wanted) background_load_stop(s);
}

void background_load_stop(background_load *s) {
  for (int i = 0; i < s->count; i++) {
    close(s->processes[i].control);
    kill(s->processes[i].pid, SIGKILL);
    waitpid(s->processes[i].pid, NULL, 0);
  }
  free(s->processes);
  *s = (background_load){0};
}

void background_load_toggle(const background_load *s) {
  for (int i = 0; i < s->count; i++)
    if (write(s->processes[i].control, "", 1) != 1) return; /* it was killed: no load */
  clock_sleep(0.03);
}
