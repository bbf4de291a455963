#define _POSIX_C_SOURCE 200809L /* popen, readlink, mkstemp */
#include "watch_overhead.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char cloth[] =
    "{\"msim\": 1, \"gravity\": [0, 0, -9.81], \"objects\": [{\"type\": \"cloth\", \"n\": [100, "
    "100], \"origin\": [0, 0, 0], \"row\": [1, 0, 0], \"column\": [0, 1, 0], \"mass\": 1, \"k\": "
    "1000, \"pinned\": \"first_corners\"}]}\n";

/* Instructions of a run by the msim_cli in the folder of this program. */
static double count_instructions(const char *folder, const char *scene, const char *watch) {
  char command[4096], line[256];
  double found = NAN;
  snprintf(command, sizeof command,
           "MSIM_ISA=avx2 valgrind --tool=callgrind --callgrind-out-file=/dev/null '%s/msim_cli' "
           "run '%s' --quiet --threads 1 --integrator velocity-verlet --h 1e-4 --steps 1600 "
           "--watch %s 2>&1",
           folder, scene, watch);
  FILE *pipe = popen(command, "r");
  while (pipe && fgets(line, sizeof line, pipe)) {
    const char *at = strstr(line, "Collected : ");
    if (at) found = strtod(at + 12, NULL);
  }
  return pipe && pclose(pipe) == 0 ? found : NAN;
}

double watch_overhead(void) {
  char folder[1024], scene[] = "/tmp/msim_bench_XXXXXX";
  const ssize_t length = readlink("/proc/self/exe", folder, sizeof folder - 1);
  double share = NAN;
  if (length <= 0) return NAN;
  folder[length] = 0;
  *strrchr(folder, '/') = 0;
  const int file = mkstemp(scene);
  if (file < 0) return NAN;
  if (write(file, cloth, sizeof cloth - 1) == (ssize_t)sizeof cloth - 1) {
    const double off = count_instructions(folder, scene, "off");
    share = isfinite(off) ? count_instructions(folder, scene, "on") / off - 1 : NAN;
  }
  close(file);
  remove(scene);
  return share;
}
