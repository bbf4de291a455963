/* vector - arithmetic on vectors of `dims` components, `stride` apart, n rows each.
 *
 * Sums run over fixed chunks in 8 fixed lanes, so that their bits depend on neither threads nor
 * instruction set. Rows past n are left alone. */
#ifndef MS_VECTOR_H
#define MS_VECTOR_H

#include <stddef.h>
#include <stdint.h>

typedef struct ms_shape {
  int32_t n;      /* rows to work on */
  int32_t stride; /* doubles from one component to the next */
  int32_t dims;   /* components */
  int32_t isa;    /* of the kernels (isa.h) */
} ms_shape;

void ms_copy(ms_shape s, const double *x, double *y);
void ms_scale(ms_shape s, double a, double *x);                 /* x = a x */
void ms_axpy(ms_shape s, double a, const double *x, double *y); /* y += a x */
void ms_combine(ms_shape s, const double *x, double a, const double *y,
                double *z); /* z = x + a y */
void ms_add2(ms_shape s, const double *x, double a, const double *y, double b, const double *z,
             double *w); /* w = x + a y + b z */
/* y = y0 + a (y1 - y0) + b (y2 - y0) + c f; y may be y1 or y2 */
void ms_three_term(ms_shape s, const double *y0, double a, const double *y1, double b,
                   const double *y2, double c, const double *f, double *y);

/* z = x + sum of w_k y_k, added up in their order. Nullable: x, for 0. */
void ms_add_all(ms_shape s, const double *x, int n, const double *w /* n */,
                const double *const *y /* n */, double *z);
double ms_dot(ms_shape s, const double *x, const double *y);

/* a = D f, D diagonal with one entry a row. */
void ms_scale_rows(ms_shape s, const double *d /* n */, const double *f, double *a);

int ms_is_zero(ms_shape s, const double *x);
int ms_is_same(ms_shape s, const double *x, const double *y); /* bit for bit */

/* The first row that holds NaN or a number beyond MS_HUGE; -1 if all are fine. */
int32_t ms_find_bad(ms_shape s, const double *x);

/* The first row that holds the largest magnitude. */
int32_t ms_find_largest(ms_shape s, const double *x);

/* The i-th entry of a vector that has a part of every other, and is the same on every machine: some
 * number in [-1/2, 1/2). */
double ms_arbitrary(uint32_t i);

/* Beyond this a square leaves the range of doubles, and so do forces and energies. */
#define MS_HUGE 1e140

#endif
