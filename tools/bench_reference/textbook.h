/* textbook - symplectic Euler as in a textbook, which explicit steps are compared with: arrays of
 * 3n numbers, a loop over the springs, a loop over the particles */
#ifndef BENCH_TEXTBOOK_H
#define BENCH_TEXTBOOK_H

#include "base/isa.h"
#include "msim/msim.h"

typedef struct textbook textbook;

typedef struct textbook_kernels {
  const char *isa; /* instruction set that it is compiled for */
  void (*step)(textbook *t, double h);
} textbook_kernels;

struct textbook {
  const textbook_kernels *kernels; /* for the instruction set that msim selects */
  int32_t nparticles, nsprings;
  const int32_t *ij;
  const double *k, *rest, *mass; /* arrays of the scene */
  double gravity[3];
  double *x, *v, *f, *inverse_mass; /* 1/m, 0 for pinned particles */
};

/* Copies x and v; the arrays of s must outlive t. Returns 0 if out of memory. */
int textbook_make(const msim_scene_view *s, const double *x, const double *v, textbook *t);
void textbook_free(textbook *t);

#endif
