#include "energies.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../common/message.h"

const char energies_beginning[] = "step,t,kinetic,elastic,gravitational,total\n";

int energies_open(energies *table, const char *path) {
  if (output_open(&table->start, path)) return EXIT_ERROR;
  fputs(energies_beginning, table->start.stream);
  return EXIT_OK;
}

/* Copy the lines before time t. A killed run may have left a part of one, which has no end. */
static void keep_rows(const energies *table, double t) {
  char line[256];
  FILE *old = fopen(table->start.path, "r");
  while (old && fgets(line, sizeof line, old)) {
    const char *comma = strchr(line, ',');
    if (!comma) continue;
    char *end;
    const double row_t = strtod(comma + 1, &end);
    if (end != comma + 1 && row_t < t && strchr(line, '\n')) fputs(line, table->start.stream);
  }
  if (old) fclose(old);
}

int energies_start(energies *table, msim_sim *sim, int resumed) {
  msim_error err;
  msim_state state = {.size = sizeof state};
  msim_sim_state(sim, &state);
  if (resumed) keep_rows(table, state.t);
  errno = 0;
  if (output_close(&table->start, !ferror(table->start.stream))) return EXIT_ERROR;
  table->stream = fopen(table->start.path, "a");
  if (!table->stream)
    return report_error("cannot write '%s': %s", table->start.path, strerror(errno));
  if (!resumed || energies_write(table, sim, &err) == MSIM_OK) return EXIT_OK;
  return report_error("%s", err.text);
}

msim_status energies_write(energies *table, msim_sim *sim, msim_error *err) {
  msim_state state = {.size = sizeof state};
  msim_energy energy = {.size = sizeof energy};
  msim_sim_state(sim, &state);
  msim_sim_energy(sim, &energy);
  if (!table->stream || !isfinite(energy.total)) return MSIM_OK;
  if (fprintf(table->stream, "%" PRId64 ",%.17g,%.17g,%.17g,%.17g,%.17g\n", state.step, state.t,
              energy.kinetic, energy.elastic, energy.gravitational, energy.total) > 0 &&
      fflush(table->stream) == 0)
    return MSIM_OK;
  err->status = MSIM_ERR_IO;
  snprintf(err->text, sizeof err->text, "cannot write '%s': %s", table->start.path,
           strerror(errno));
  return MSIM_ERR_IO;
}

void energies_close(energies *table) {
  if (table->stream) fclose(table->stream);
  output_discard(&table->start);
}
