/* residual - the right-hand side of a system for a change, and how an answer is judged */
#ifndef MS_RESIDUAL_H
#define MS_RESIDUAL_H

#include "linear/linear.h"

/* to = b - (A - M) base: with it A dv = to is A (base + dv) = b + M base, and to is small where
 * nothing happens. */
void ms_change_right_hand_side(const ms_system *s, const double *b, const double *base, double *to);

/* r = b - A y; its norm (jacobi.h) */
double ms_true_residual(const ms_system *s, const double *b, const double *y, double *r);

/* No solver gets below a small multiple of eps (|A| |y| + |b|), with any signs: what that comes to
 * in the norm, one component after the other, as a block may nearly cancel what several make
 * together. */
double ms_rounding_level(const ms_system *s, const double *b, const double *y, double *work1,
                         double *work2);

#endif
