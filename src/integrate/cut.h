/* cut - which springs are so much stiffer than the others that they are worth steps of their own */
#ifndef MS_CUT_H
#define MS_CUT_H

#include "physics/bounds.h"

/* Springs are told apart by the octave of k (1/m_i + 1/m_j), the square of the frequency that each
 * has alone. Those of `octave` and above are stiff. */
typedef struct ms_cut {
  int octave;
  int32_t nstiff; /* 0: no cut pays */
  int32_t inner;  /* steps of the stiff springs in one of the others */
} ms_cut;

/* The cut for which a step of h evaluates fewest springs, soft + (inner + 1) stiff, among those
 * where the soft springs alone are stable with h and the stiff ones with h/inner, at half the
 * limit of Verlet: both by the bounds of bounds.h. None where all are stable with h, or where
 * velocity Verlet at its limit costs less. octave: springs.n, out. */
msim_status ms_cut_choose(const ms_model *model, double h, int *octave, ms_cut *cut,
                          msim_error *err);

#endif
