/* warning - passes warnings to the callback of the options */
#include <stdarg.h>

#include "sim/sim.h"

void ms_sim_warn(const msim_sim *sim, const char *format, ...) {
  msim_error note;
  va_list args;
  va_start(args, format);
  ms_error_vset(&note, MSIM_OK, format, args);
  va_end(args);
  if (sim->config.opt.warn) sim->config.opt.warn(note.text, sim->config.opt.warn_user);
}

void msim_sim_set_warn(msim_sim *sim, void (*warn)(const char *text, void *user), void *user) {
  sim->config.opt.warn = warn;
  sim->config.opt.warn_user = user;
}
