/* spinner - background load: processes that keep the other cores busy on demand */
#ifndef BENCH_SPINNER_H
#define BENCH_SPINNER_H

#include <sys/types.h>

/* Number of cores that this process may use. */
int usable_cores(void);

typedef struct spinner {
  int count; /* processes; 0: no load is available */
  struct spinner_process {
    pid_t pid;
    int control; /* a byte in this pipe switches between idle and busy; closing it ends the
                    process */
  } * processes;
} spinner;

/* Forks one less than there are cores, idle at first. To be called before a library starts
 * threads. */
void spinner_start(spinner *s);
void spinner_stop(spinner *s);

/* Switches between idle and busy; gives the scheduler time to move the processes. */
void spinner_turn(const spinner *s);

#endif
