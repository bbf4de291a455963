/* pause - a thread that polls before it sleeps */
#ifndef MS_PAUSE_H
#define MS_PAUSE_H

#include <stdatomic.h>

/* Number of polls before a waiting thread sleeps: about 20 us, longer than the time between two
 * steps of a run, but too short to keep a core busy. */
enum { MS_POLLS_BEFORE_SLEEP = 1000 };

/* Between two polls */
static inline void ms_pause(void) {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#else
  atomic_signal_fence(memory_order_seq_cst);
#endif
}

#endif
