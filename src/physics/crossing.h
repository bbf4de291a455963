/* crossing - where the distance of a particle from a plane, a cubic over a step, falls below 0 */
#ifndef MS_CROSSING_H
#define MS_CROSSING_H

/* s(q) = c[0] + c[1] q + c[2] q^2 + c[3] q^3, q from 0 to 1 over the step */
typedef struct ms_cubic {
  double c[4];
} ms_cubic;

/* Hermite's: the values and slopes ds/dq at both ends. */
ms_cubic ms_cubic_between(double s0, double slope0, double s1, double slope1);

double ms_cubic_at(const ms_cubic *s, double q);
double ms_cubic_slope(const ms_cubic *s, double q);

/* The first q in [from, 1] where s falls through 0 on its way below -depth; MS_NOWHERE: there is
 * none. A minimum between the ends counts, which no look at the ends would find. `from` itself,
 * where s is not above 0 there and falls at once. */
#define MS_NOWHERE 2.0
double ms_first_crossing(const ms_cubic *s, double from, double depth);

#endif
