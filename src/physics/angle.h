/* angle - the formulas of one angular spring
 *
 * With the edges p = x_i - x_j, q = x_k - x_j of lengths a, b, the deviation from straight edges is
 *   phi = pi - theta = atan2(|p x q|, -p.q) in [0, pi],
 * and E = k/2 (phi - bend)^2 with bend = pi - rest. With n the unit normal of p x q and
 * t_p = n x p/a, t_q = n x q/b:
 *   grad phi = (t_p/a, -t_q/b) by (p, q),
 * of x_j minus their sum, so that momentum and angular momentum are conserved; the force is
 * -(k (phi - bend) + c dphi/dt) grad phi. The Hessian of phi has, in the plane of the edges,
 *   -(p t_p^T + t_p p^T)/a^3 by p,  (q t_q^T + t_q q^T)/b^3 by q,
 * and, across it, for alpha = n.dp/a, beta = n.dq/b, the quadratic form
 *   cot(phi/2) (alpha + beta)^2/2 - tan(phi/2) (alpha - beta)^2/2.
 * (Second differences of spherical trigonometry; for harmonic angles see Allen and Tildesley 1987,
 * appendix C.) phi^2 is an analytic function of p and q at phi = 0, with the Hessian 2 (alpha +
 * beta)^2 in every plane through the edges. For bend = 0 it is a smooth minimum; the same holds for
 * bend = pi at phi = pi, with alpha - beta. For any other bend the direction of grad phi is not
 * defined there: no elastic force. Damping and matrix are there those of the limit along the
 * motion, equal in all planes. An edge without length exerts nothing.
 *
 * Damping must not resist rotations of the three particles, and so acts on dphi/dt alone: where the
 * motion passes near phi = 0 in space, its direction turns as fast as the plane of the edges does,
 * and methods lose their order there; in a plane it is smooth. */
#ifndef MS_ANGLE_H
#define MS_ANGLE_H

typedef enum ms_angle_kind {
  MS_ANGLE_NONE,     /* an edge has no length */
  MS_ANGLE_PLANE,    /* the edges define a plane */
  MS_ANGLE_STRAIGHT, /* phi = 0, up to rounding */
  MS_ANGLE_FOLDED    /* phi = pi, likewise */
} ms_angle_kind;

typedef struct ms_angle {
  ms_angle_kind kind;
  double p[3], q[3]; /* m */
  double a2, b2;     /* m^2 */
  double phi;        /* rad; NONE: 0 */
  double n[3];       /* PLANE: the unit normal */
  double grad[2][3]; /* PLANE: of phi by p and by q, 1/m */
} ms_angle;

/* k (N m/rad^2), pi - rest (rad), damping (N m s/rad) */
typedef struct ms_angle_spring {
  double k, bend, damping;
} ms_angle_spring;

/* Below this sine, a few times the rounding of unit vectors, the plane of the edges is undefined */
#define MS_ANGLE_SMALLEST_SINE 1e-15

void ms_angle_measure(const double p[3], const double q[3], ms_angle *to);

double ms_angle_energy(const ms_angle *at, const ms_angle_spring *s);

/* The forces on i and k; that on j is minus their sum. vp = v_i - v_j, vq = v_k - v_j; both NULL:
 * without damping. */
void ms_angle_force(const ms_angle *at, const ms_angle_spring *s, const double vp[3],
                    const double vq[3], double fi[3], double fk[3]);

/* A symmetric matrix of (p, q), [P R; R^T Q]: P and Q by rows, upper triangles; R by rows */
enum { MS_ANGLE_P = 0, MS_ANGLE_Q = 6, MS_ANGLE_R = 12, MS_ANGLE_ELEMENT = 21 };

/* element = h^2 Hess E + h damping grad phi grad phi^T. clamp: without what makes it indefinite:
 * the part of Hess phi in the plane, and the negative one of both terms across it, which is the
 * exact projection of that part. */
void ms_angle_matrix(const ms_angle *at, const ms_angle_spring *s, double h, int clamp,
                     double element[MS_ANGLE_ELEMENT]);

/* yp = P p + R q, yq = R^T p + Q q */
static inline void ms_angle_multiply(const double element[MS_ANGLE_ELEMENT], const double p[3],
                                     const double q[3], double yp[3], double yq[3]) {
  const double *P = element + MS_ANGLE_P, *Q = element + MS_ANGLE_Q, *R = element + MS_ANGLE_R;
  yp[0] = P[0] * p[0] + P[1] * p[1] + P[2] * p[2];
  yp[1] = P[1] * p[0] + P[3] * p[1] + P[4] * p[2];
  yp[2] = P[2] * p[0] + P[4] * p[1] + P[5] * p[2];
  yq[0] = Q[0] * q[0] + Q[1] * q[1] + Q[2] * q[2];
  yq[1] = Q[1] * q[0] + Q[3] * q[1] + Q[4] * q[2];
  yq[2] = Q[2] * q[0] + Q[4] * q[1] + Q[5] * q[2];
  for (int c = 0; c < 3; c++) {
    yp[c] += R[3 * c] * q[0] + R[3 * c + 1] * q[1] + R[3 * c + 2] * q[2];
    yq[c] += R[c] * p[0] + R[3 + c] * p[1] + R[6 + c] * p[2];
  }
}

/* The block of corners r and c (0: i, 1: j, 2: k) of the matrix of x_i, x_j and x_k */
void ms_angle_block(const double element[MS_ANGLE_ELEMENT], int r, int c, double block[3][3]);

#endif
