/* spinner - processes that keep the other cores busy when they are told to */
#ifndef BENCH_SPINNER_H
#define BENCH_SPINNER_H

#include <sys/types.h>

/* Cores that this process may use. */
int usable_cores(void);

typedef struct spinner {
  int count; /* processes; 0: nothing can be measured */
  struct spinner_process {
    pid_t pid;
    int control; /* a byte in this pipe turns it from idle to busy or back, its end ends it */
  } * processes;
} spinner;

/* Fork one less than there are cores, idle at first. To be called before a library brings threads
 * along. */
void spinner_start(spinner *s);
void spinner_stop(spinner *s);

/* Turn from idle to busy or back, and give the scheduler time to move them. */
void spinner_turn(const spinner *s);

#endif
