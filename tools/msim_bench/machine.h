/* machine - describes the machine on which a benchmark runs */
#ifndef BENCH_MACHINE_H
#define BENCH_MACHINE_H

#include <jansson.h>

/* Returns a new object: cpu, cores, isa, os, kernel, compiler, msim; unknown entries are absent. */
json_t *machine_describe(void);

/* Adds the configuration that OpenBLAS reports, if a solver has loaded it. */
void machine_add_blas(json_t *machine);

#endif
