/* vectors - N_Vector_Serial with optimized loops for several vector widths (Debian's SUNDIALS is
 * not optimized) */
#ifndef ODE_VECTORS_H
#define ODE_VECTORS_H

#include <sundials/sundials_nvector.h>

/* Returns a vector of n zeros, whose clones have the same operations. NULL: out of memory. */
N_Vector fast_vector(size_t n, SUNContext context);

double *value_of(N_Vector v);

/* z *= w */
void multiply(size_t n, const double *w, double *z);

#endif
