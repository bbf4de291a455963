/* machine - where a bench ran */
#ifndef BENCH_MACHINE_H
#define BENCH_MACHINE_H

#include <jansson.h>

/* A new object: cpu, cores, isa, os, kernel, compiler, msim. What is not known is absent. */
json_t *machine_describe(void);

/* Add what OpenBLAS tells of itself, once a solver has loaded it. */
void machine_add_blas(json_t *machine);

#endif
