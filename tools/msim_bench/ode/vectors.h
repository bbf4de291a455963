/* vectors - N_Vector_Serial with loops of ours, compiled as we like and for every width of register
 * (Debian's SUNDIALS is not optimised) */
#ifndef ODE_VECTORS_H
#define ODE_VECTORS_H

#include <sundials/sundials_nvector.h>

/* Of n zeros; its clones are like it. NULL: no memory. */
N_Vector fast_vector(size_t n, SUNContext context);

double *value_of(N_Vector v);

/* z *= w */
void multiply(size_t n, const double *w, double *z);

#endif
