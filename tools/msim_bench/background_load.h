/* background_load - background load: processes that keep the other cores busy on demand */
#ifndef BENCH_BACKGROUND_LOAD_H
#define BENCH_BACKGROUND_LOAD_H

#include <sys/types.h>

/* Number of cores that this process may use. */
int usable_cores(void);

typedef struct background_load {
  int count; /* processes; 0: no load is available */
  struct load_process {
    pid_t pid;
    int control; /* a byte in this pipe switches between idle and busy; closing it ends the
                    process */
  } * processes;
} background_load;

/* Forks one less than there are cores, idle at first. To be called before a library starts
 * threads. */
void background_load_start(background_load *s);
void background_load_stop(background_load *s);

/* Switches between idle and busy; gives the scheduler time to move the processes. */
void background_load_toggle(const background_load *s);

#endif
