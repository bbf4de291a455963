/* rules - which solver is not worth measuring on which system */
#ifndef BENCH_RULES_H
#define BENCH_RULES_H

#include "scenes.h"

/* What a bench has time for. */
typedef struct thrift {
  double flops;     /* of a factorisation without dense kernels */
  double dense;     /* with them; 0: time for any */
  double products;  /* A x, of a short recurrence */
  double restarted; /* the same of a method that starts again and again */
} thrift;

/* Why a solver is left out; NULL: it is not. text: room for the sentence. */
const char *leave_out(const char *solver, const moving *m, double h, double rtol, const thrift *t,
                      char text[static 128]);

#endif
