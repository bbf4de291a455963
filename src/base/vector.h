/* vector - arithmetic of vectors of `dims` components with n rows each, `stride` doubles apart.
 *
 * Sums run over fixed chunks in 8 fixed lanes, so that their bits depend on neither the number of
 * threads nor the instruction set. Rows from n to stride are neither read nor written, but for
 * ms_vector_..._all. */
#ifndef MS_VECTOR_H
#define MS_VECTOR_H

#include <stddef.h>
#include <stdint.h>

struct ms_ranks;

typedef struct ms_shape {
  int32_t n;              /* rows */
  int32_t stride;         /* numbers from one component to the next */
  int32_t dims;           /* components */
  int32_t isa;            /* instruction set of the kernels (isa.h) */
  int32_t single;         /* 1: vectors have pairs of floats in place of doubles, see below */
  struct ms_ranks *ranks; /* products are sums over all ranks (ranks.h); NULL: over these rows */
} ms_shape;

/* The functions with void * are for both precisions. In single precision a vector has `dims`
 * components of floats, and as many with what these lack of their sums: x + a y adds the errors of
 * earlier sums, and keeps its own (Kahan, Commun. ACM 8 (1965) 40), so that steps do not lose what
 * is below a float. Only x is a sum; of y, z, ... the floats count, as in dot products. Factors are
 * rounded to floats. */

size_t ms_vector_number_size(ms_shape s);       /* bytes */
int32_t ms_vector_count_components(ms_shape s); /* all of them */

void ms_vector_copy(ms_shape s, const void *x, void *y);

/* y = x and x = 0 in all rows up to `stride`: pinned particles and padding too */
void ms_vector_copy_all(ms_shape s, const void *x, void *y);
void ms_vector_clear_all(ms_shape s, void *x);

/* x and y of a product y += K x: vectors of doubles, or if `single` of floats, without errors of
 * sums */
typedef struct ms_operands {
  const void *x;
  void *y;
  int single;
} ms_operands;

static inline double ms_operands_get(const ms_operands *o, size_t i) {
  return o->single ? (double)((const float *)o->x)[i] : ((const double *)o->x)[i];
}

static inline void ms_operands_add(const ms_operands *o, size_t i, double to_y) {
  if (o->single) ((float *)o->y)[i] += (float)to_y;
  else ((double *)o->y)[i] += to_y;
}

void ms_vector_scale(ms_shape s, double a, void *x);               /* x = a x */
void ms_vector_axpy(ms_shape s, double a, const void *x, void *y); /* y += a x, without errors */
void ms_vector_add_scaled(ms_shape s, const void *x, double a, const void *y,
                          void *z); /* z = x + a y */
void ms_vector_add_two_scaled(ms_shape s, const void *x, double a, const void *y, double b,
                              const void *z, void *w); /* w = x + a y + b z */
/* y = y0 + a (y1 - y0) + b (y2 - y0) + c f; y may be y1 or y2 */
void ms_vector_three_term(ms_shape s, const void *y0, double a, const void *y1, double b,
                          const void *y2, double c, const void *f, void *y);

/* z = x + sum_k w_k y_k, summed in this order; z may be x or a term. Nullable: x (0). */
void ms_vector_linear_combination(ms_shape s, const double *x, int n, const double *w /* n */,
                                  const double *const *y /* n */, double *z);
/* One of two such sums of the same terms */
typedef struct ms_combination {
  const double *x, *w;
  double *z;
} ms_combination;
/* Both, which reads each term once. */
void ms_vector_two_combinations(ms_shape s, int n, const double *const *y /* n */,
                                const ms_combination of[2]);
double ms_vector_dot(ms_shape s, const void *x, const void *y); /* collective; sums are doubles */

/* The sum of 8 partial sums, as a binary tree: an order that SIMD registers of any width follow. */
static inline double ms_vector_sum_lanes(const double l[8]) {
  return ((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7]));
}

/* a = D f with the diagonal matrix D, one entry per row. */
void ms_vector_scale_rows(ms_shape s, const double *d /* n */, const double *f, double *a);

int ms_vector_is_zero(ms_shape s, const void *x);
int ms_vector_is_equal(ms_shape s, const void *x, const void *y); /* bit for bit */

/* Index of the first row that contains NaN or a number beyond MS_LARGEST_VALID, of floats beyond
 * MS_LARGEST_VALID_SINGLE; -1: none. */
int32_t ms_vector_find_invalid(ms_shape s, const void *x);

/* Index of the first row with the largest magnitude; -1: another rank has it. Collective */
int32_t ms_vector_find_largest(ms_shape s, const double *x);

/* The i-th entry of a fixed pseudo-random vector, in [-1/2, 1/2), the same on every machine. It has
 * a component along practically every other vector. */
double ms_vector_random_entry(uint32_t i);

/* v = the entries of that vector from `first` on, and 0 in the rows from n to stride */
void ms_vector_fill_random(ms_shape s, uint32_t first, double *v);

/* Limit of the numbers in a state. Squares overflow at 1.34e154; the margin is for the products in
 * forces and energies. */
#define MS_LARGEST_VALID 1e140

/* The same for floats, whose squares overflow at 1.84e19 */
#define MS_LARGEST_VALID_SINGLE 1e18f

#endif
