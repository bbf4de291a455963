/* bernstein - where a polynomial first falls below 0
 *
 *   s(q) = sum_i c_i B_i(q) over q in [0, 1],  B_i(q) = binomial(n, i) q^i (1 - q)^(n - i)
 *
 * A polynomial lies within the range of its coefficients and has no more roots in (0, 1) than they
 * change their signs (Farouki, Computer Aided Geometric Design 29 (2012) 379): where no
 * coefficient is negative there is no root, however short a dip below 0 would be. */
#ifndef MS_BERNSTEIN_H
#define MS_BERNSTEIN_H

enum { MS_MAX_DEGREE = 7 };

typedef struct ms_bernstein {
  int degree;
  double c[MS_MAX_DEGREE + 1];
} ms_bernstein;

/* Hermite's cubic: the values and slopes ds/dq at both ends. */
ms_bernstein ms_bernstein_cubic(double s0, double slope0, double s1, double slope1);

/* The same with second derivatives. */
ms_bernstein ms_bernstein_quintic(double s0, double slope0, double bend0, double s1, double slope1,
                                  double bend1);

/* The same polynomial with one coefficient more. */
void ms_bernstein_elevate(ms_bernstein *s);

double ms_bernstein_at(const ms_bernstein *s, double q);

/* The least coefficient: no value in [0, 1] is less. */
double ms_bernstein_least(const ms_bernstein *s);

/* The first q where s falls below 0 on its way below -noise; MS_NOWHERE: there is none. Where s(0)
 * is not above `noise`, s starts at 0, and its first return there is looked for. */
#define MS_NOWHERE 2.0
double ms_bernstein_first_fall(const ms_bernstein *s, double noise);

#endif
