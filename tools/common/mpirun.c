#include "mpirun.h"

#include <stdio.h>
#include <stdlib.h>

static int number_of(const char *variable, int otherwise) {
  const char *text = getenv(variable);
  return text && *text ? (int)strtol(text, NULL, 10) : otherwise;
}

/* Open MPI and others by PMI tell the number of ranks; PMIX_RANK only that there may be several. */
int mpirun_size(void) { return number_of("OMPI_COMM_WORLD_SIZE", number_of("PMI_SIZE", 0)); }

int mpirun_may_be_several(void) {
  const int n = mpirun_size();
  return n > 1 || (n == 0 && getenv("PMIX_RANK") != NULL);
}

int mpirun_rank(void) {
  if (!mpirun_may_be_several()) return 0;
  return number_of("PMIX_RANK", number_of("OMPI_COMM_WORLD_RANK", number_of("PMI_RANK", 0)));
}

void mpirun_mute(void) {
  if (mpirun_rank() > 0 && !freopen("/dev/null", "w", stdout)) fclose(stdout);
}
