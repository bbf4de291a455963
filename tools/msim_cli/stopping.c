#define _POSIX_C_SOURCE 200809L /* sigaction */
#include "stopping.h"

#include <signal.h>

static msim_sim *volatile running;
static volatile sig_atomic_t stop_asked;

/* SIGUSR1 is what batch systems send before the time limit, and what mpirun forwards. */
static const int ending_signals[] = {SIGINT, SIGTERM, SIGUSR1};
enum { ENDING_SIGNALS = sizeof ending_signals / sizeof *ending_signals };

/* The first signal ends the run after the present step, the second one ends the program. */
static void on_signal(int number) {
  (void)number;
  for (int i = 0; i < ENDING_SIGNALS; i++) signal(ending_signals[i], SIG_DFL);
  stop_asked = 1;
  if (running) msim_sim_stop(running);
}

void stopping_catch_signals(msim_sim *sim) {
  struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESTART}, before;
  sigemptyset(&action.sa_mask);
  running = sim;
  for (int i = 0; i < ENDING_SIGNALS; i++)
    if (sigaction(ending_signals[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN)
      sigaction(ending_signals[i], &action, NULL);
}

int stopping_is_asked(void) { return stop_asked; }

void stopping_forget_sim(void) { running = NULL; }
