/* textbook - symplectic Euler as one writes it down: flat arrays of 3n numbers, a loop over the
 * springs, a loop over the particles. What the explicit step is compared with. */
#ifndef BENCH_TEXTBOOK_H
#define BENCH_TEXTBOOK_H

#include "scenes.h"

typedef struct textbook {
  int32_t nparticles, nsprings;
  const int32_t *ij;
  const double *k, *rest, *mass; /* of the scene */
  double gravity[3];
  double *x, *v, *f, *inverse_mass; /* pinned: 0 */
} textbook;

/* From the state of m, which outlives it. 0 where there is no memory. */
int textbook_make(const moving *m, textbook *t);
void textbook_free(textbook *t);
void textbook_step(textbook *t, double h);

#endif
