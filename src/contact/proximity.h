/* proximity - distances between points and triangles and between edges, and whether they come too
 * close while their corners move along straight lines */
#ifndef MS_PROXIMITY_H
#define MS_PROXIMITY_H

typedef enum ms_feature_kind {
  MS_POINT_TRIANGLE = 1, /* corner 0; corners 1, 2 and 3 */
  MS_EDGE_EDGE = 2       /* corners 0 and 1; corners 2 and 3: the enumerators are the first of B */
} ms_feature_kind;

/* The closest points of two features A and B: sum_c w_c x_c = a - b = distance * normal, where the
 * weights of A have the sum 1 and those of B the sum -1 */
typedef struct ms_proximity {
  double distance;  /* m */
  double normal[3]; /* unit length; 0 where the distance is 0 */
  double weight[4];
} ms_proximity;

ms_proximity ms_proximity_find(ms_feature_kind kind, double x[4][3]);

/* A bound on the change of the distance while the corners move from x0 to x1 on straight lines */
double ms_proximity_bound_change(ms_feature_kind kind, double x0[4][3], double x1[4][3]);

/* The gap between A and B along n: positive if a plane normal to it separates them. If it exceeds a
 * number at the start and at the end of straight paths, it does so throughout, as the distances of
 * corners from a plane are linear in time. */
double ms_proximity_find_gap(ms_feature_kind kind, double x[4][3], const double n[3]);

/* The distance below which ms_proximity_collides() takes features for colliding */
double ms_proximity_stop(double distance, double least);

/* 0: on the straight paths of the corners from x0 to x1 the distance exceeds `least` everywhere,
 * which is below that at x0. 1: the distance becomes smaller than that of ms_proximity_stop(). *at:
 * the closest points where the method ends.
 * Additive conservative advancement (Li, Kaufman and Jiang, ACM Trans. Graph. 40 (2021) 170,
 * algorithm 1): with the mean motion removed, the distance changes at most as fast as the farthest
 * corners of A and B move, which bounds a step that is safe. It computes distances only, no roots
 * of polynomials, so that errors of rounding are those of distances. */
int ms_proximity_collides(ms_feature_kind kind, double x0[4][3], double x1[4][3], double least,
                          ms_proximity *at);

#endif
