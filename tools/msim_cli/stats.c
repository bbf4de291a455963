#include "stats.h"

#include <inttypes.h>
#include <stdio.h>

/* Tables of --stats */
typedef enum group { STEPS, FORCES, SYSTEMS, SOLUTIONS, CONTACT, NGROUPS } group;

typedef struct field {
  const char *name;
  size_t member; /* offset in msim_stats */
  group group;
  const char *doc; /* what one is */
} field;

#define COUNTER(name, group, doc) \
  { #name, offsetof(msim_stats, name), group, doc }
#define PHASE(name, doc) \
  { #name, offsetof(msim_stats, name##_s), 0, doc }

/* In the order of final states */
static const field counters[] = {
    COUNTER(steps, STEPS, "steps made"),
    COUNTER(force_evaluations, FORCES, "evaluations of all forces"),
    COUNTER(assemblies, SYSTEMS, "matrices computed"),
    COUNTER(analyses, SYSTEMS, "symbolic analyses of a matrix"),
    COUNTER(factorizations, SYSTEMS, "factorizations of a matrix"),
    COUNTER(solves, SOLUTIONS, "linear systems solved"),
    COUNTER(iterations, SOLUTIONS, "iterations of linear solvers"),
    COUNTER(newton_iterations, SOLUTIONS, "iterations of Newton's method"),
    COUNTER(contacts, CONTACT, "impacts or reflections of particles"),
    COUNTER(indefinite_steps, SYSTEMS, "steps with an indefinite matrix"),
    COUNTER(coarse_factors, SYSTEMS, "factorizations of pcg's coarse matrix"),
    COUNTER(kept_factors, SOLUTIONS, "solves with an earlier factorization"),
    COUNTER(refinements, SOLUTIONS, "corrections to reach solver.rtol"),
    COUNTER(fallbacks, SOLUTIONS, "changes of solver by solver = auto"),
    COUNTER(steps_at_rest, STEPS, "of them skipped: the scene was at rest"),
    COUNTER(islands_at_rest, STEPS, "steps of single islands skipped at rest"),
    COUNTER(spring_evaluations, FORCES, "evaluations of single springs"),
    COUNTER(rejected_steps, STEPS, "steps repeated in shorter ones"),
    COUNTER(incomplete_steps, STEPS, "steps made at a limit of iterations"),
    COUNTER(broken, FORCES, "springs that have broken"),
};
static const field phases[] = {
    PHASE(total, "all of these, and what is between them"),
    PHASE(force, "forces and updates of the state"),
    PHASE(assemble, "computing matrices"),
    PHASE(factor, "factoring matrices"),
    PHASE(solve, "solving linear systems"),
    PHASE(collide, "contact with planes"),
    PHASE(output, "conversion to particle order"),
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

static void print_counters(const msim_stats *stats, group which) {
  int64_t count;
  for (int i = 0; i < NCOUNTERS; i++) {
    if (counters[i].group != which) continue;
    stats_counter(stats, i, &count);
    printf("    %-20s %14" PRId64 "  %s\n", counters[i].name, count, counters[i].doc);
  }
}

static void print_phases(const msim_stats *stats) {
  double seconds;
  puts("\n  seconds");
  for (int i = 0; i < NPHASES; i++) {
    stats_phase(stats, i, &seconds);
    printf("    %-20s %14.6f  %s\n", phases[i].name, seconds, phases[i].doc);
  }
}

void stats_print(const msim_stats *stats) {
  static const char *const titles[NGROUPS] = {[STEPS] = "steps",
                                              [FORCES] = "forces",
                                              [SYSTEMS] = "matrices",
                                              [SOLUTIONS] = "solutions",
                                              [CONTACT] = "contact"};
  for (int g = 0; g < NGROUPS; g++) {
    printf("\n  %s\n", titles[g]);
    print_counters(stats, (group)g);
  }
  print_phases(stats);
}
