#include "stats.h"

typedef struct field {
  const char *name;
  size_t member; /* offset in msim_stats */
} field;

#define COUNTER(name) \
  { #name, offsetof(msim_stats, name) }
#define PHASE(name) \
  { #name, offsetof(msim_stats, name##_s) }

static const field counters[] = {
    COUNTER(steps),
    COUNTER(force_evaluations),
    COUNTER(assemblies),
    COUNTER(analyses),
    COUNTER(factorizations),
    COUNTER(solves),
    COUNTER(iterations),
    COUNTER(newton_iterations),
    COUNTER(contacts),
    COUNTER(indefinite_steps),
    COUNTER(coarse_factors),
    COUNTER(kept_factors),
    COUNTER(refinements),
    COUNTER(fallbacks),
    COUNTER(steps_at_rest),
    COUNTER(islands_at_rest),
    COUNTER(spring_evaluations),
    COUNTER(rejected_steps),
};
static const field phases[] = {
    PHASE(total), PHASE(force),   PHASE(assemble), PHASE(factor),
    PHASE(solve), PHASE(collide), PHASE(output),
};
enum { NCOUNTERS = sizeof counters / sizeof *counters, NPHASES = sizeof phases / sizeof *phases };

const char *stats_counter(const msim_stats *stats, int i, int64_t *count) {
  if (i >= NCOUNTERS) return NULL;
  *count = *(const int64_t *)((const char *)stats + counters[i].member);
  return counters[i].name;
}

const char *stats_phase(const msim_stats *stats, int i, double *seconds) {
  if (i >= NPHASES) return NULL;
  *seconds = *(const double *)((const char *)stats + phases[i].member);
  return phases[i].name;
}
