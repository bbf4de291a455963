/* textbook - symplectic Euler as one writes it down: flat arrays of 3n numbers, a loop over the
 * springs, a loop over the particles. What the explicit step is compared with. */
#ifndef BENCH_TEXTBOOK_H
#define BENCH_TEXTBOOK_H

#include "base/isa.h"
#include "scenes.h"

typedef struct textbook textbook;

typedef struct textbook_kernels {
  const char *isa; /* the instruction set that it is compiled for */
  void (*step)(textbook *t, double h);
} textbook_kernels;

struct textbook {
  const textbook_kernels *kernels; /* by the library's own rule: of the set that msim uses */
  int32_t nparticles, nsprings;
  const int32_t *ij;
  const double *k, *rest, *mass; /* of the scene */
  double gravity[3];
  double *x, *v, *f, *inverse_mass; /* pinned: 0 */
};

/* From the state of m, which outlives it. 0 where there is no memory. */
int textbook_make(const moving *m, textbook *t);
void textbook_free(textbook *t);

#endif
