/* bernstein - finds where a polynomial first falls below 0, by its Bernstein coefficients
 *
 *   s(q) = sum_i c_i B_i(q) over q in [0, 1],  B_i(q) = binomial(n, i) q^i (1 - q)^(n - i)
 *
 * The values of s lie within the range of its coefficients, and s has at most as many roots in
 * (0, 1) as these have sign changes (Farouki, Computer Aided Geometric Design 29 (2012) 379): if no
 * coefficient is negative, s falls below 0 nowhere, so that no dip is missed, however short. */
#ifndef MS_BERNSTEIN_H
#define MS_BERNSTEIN_H

enum { MS_BERNSTEIN_MAX_DEGREE = 7 };

typedef struct ms_bernstein {
  int degree;
  double c[MS_BERNSTEIN_MAX_DEGREE + 1];
} ms_bernstein;

/* The cubic Hermite interpolant of values and slopes ds/dq at both ends. */
ms_bernstein ms_bernstein_cubic(double s0, double slope0, double s1, double slope1);

/* The quintic one, with second derivatives `bend` also. */
ms_bernstein ms_bernstein_quintic(double s0, double slope0, double bend0, double s1, double slope1,
                                  double bend1);

/* Degree elevation: the same polynomial with one coefficient more, MS_BERNSTEIN_MAX_DEGREE at most.
 * */
void ms_bernstein_elevate(ms_bernstein *s);

double ms_bernstein_evaluate(const ms_bernstein *s, double q);

double ms_bernstein_evaluate_slope(const ms_bernstein *s, double q);

/* The least coefficient, a lower bound of the values in [0, 1]. */
double ms_bernstein_lower_bound(const ms_bernstein *s);

/* The first q where s falls below 0 and goes on below -tolerance (smaller values may be rounding
 * errors); MS_NOWHERE: none. If s(0) <= tolerance, the first q where s falls below s(0) again. */
#define MS_NOWHERE 2.0
double ms_bernstein_find_crossing(const ms_bernstein *s, double tolerance);

#endif
