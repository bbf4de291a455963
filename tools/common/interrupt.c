#define _POSIX_C_SOURCE 200809L /* sigaction */
#include "interrupt.h"

#include <signal.h>
#include <stddef.h>

static volatile sig_atomic_t interrupted;

static void note_interrupt(int number) {
  (void)number;
  signal(SIGINT, SIG_DFL);
  signal(SIGTERM, SIG_DFL);
  interrupted = 1;
}

/* Signals that are ignored at the start, as under `nohup` or `&`, stay ignored. */
void catch_interrupts(void) {
  static const int numbers[] = {SIGINT, SIGTERM};
  struct sigaction action = {.sa_handler = note_interrupt}, before;
  sigemptyset(&action.sa_mask);
  for (int i = 0; i < 2; i++)
    if (sigaction(numbers[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN)
      sigaction(numbers[i], &action, NULL);
}

int is_interrupted(void) { return interrupted; }
