/* contact_projection - moves surfaces apart at the end of an implicit step, with the springs in the
 * balance
 *
 * The end x* of an implicit step without contact is a minimum of the energy of the step, which
 * grows from there by d.A d/(2 h^2), d = x - x*, A = M - h D - h^2 J. With contact the step ends at
 *   min_d d.A d/2,  n_p.r_p >= target_p for each pair p,  r_p = sum_c w_c x_c,
 * that is at A d = sum_p W_p^T (lambda_p n_p + tau_p), W_p x = r_p, with the reaction lambda_p >= 0
 * and friction |tau_p| <= mu lambda_p. As the start of the step meets the conditions, energy does
 * not grow, whereas moving single particles stretches stiff springs.
 * It is solved by the augmented Lagrangian method (Nocedal and Wright, Numerical Optimization,
 * 2006, 17.3; with friction: Simo and Laursen, Comput. Struct. 42 (1992) 97), which repeats
 *   lambda = max(0, lambda + beta (target - n.r)),
 *   tau = tau - beta u, shortened to mu lambda,  u the tangential displacement of r in the step,
 * with d such that A d balances these forces, which Newton's method finds: d minimizes a convex
 * function, as the limit of friction is that of the last lambda. Its matrix is A + sum_p W_p^T B_p
 * W_p, B_p the derivative of the forces. beta is of the size of A, so that conjugate gradients take
 * about as many iterations as without contact. */
#ifndef MS_CONTACT_PROJECTION_H
#define MS_CONTACT_PROJECTION_H

#include "contact/contact_bodies.h"
#include "contact/surface_pairs.h"
#include "integrate/integrator.h"
#include "linear/jacobi.h"

typedef struct ms_contact_projection {
  ms_coefficients a;
  ms_jacobi jacobi;
  double *d;             /* a vector, m; kg: forces have the unit kg m, as they are times h^2 */
  double *r, *z, *p, *q; /* vectors of conjugate gradients */
  double *direction;     /* 3 nnodes: the last change of d, of nodes */
  int is_clamped;        /* 1: A is clamped, as that of a linear method is not positive definite */
  double size;           /* of the forces at d = 0, in the norm of the preconditioner */
  ms_surface_pair *held; /* nnodes: where is_active, a plane of an obstacle that holds the node */
} ms_contact_projection;

/* On failure the caller destroys what is there. */
msim_status ms_contact_projection_create(const ms_model *model, const ms_contact_surface *surface,
                                         ms_contact_projection *j, msim_error *err);
void ms_contact_projection_destroy(const ms_model *model, ms_contact_projection *j);

/* d = 0, without reactions and obstacles */
void ms_contact_projection_start(ms_contact_projection *j, const ms_model *model,
                                 ms_surface_pairs *pairs);

/* An obstacle has moved the node from x* + d by `displacement` to x: it is to stay in front of the
 * plane there from now on. unit: of distances, m */
void ms_contact_projection_hold(ms_contact_projection *j, int32_t node,
                                const double displacement[3], const double x[3], double unit);

/* A step of which A is the matrix, and the pairs that are kept apart */
typedef struct ms_projected_step {
  ms_stepper *s;
  int is_linear; /* 1: A is the matrix of the step, at its start; 0: that at x_next, clamped */
  ms_surface_pairs *pairs;
  ms_contact_bodies *bodies; /* overwritten */
  double friction;
  const double *x0; /* 3 nnodes: the positions of nodes at the start */
  double *x1;       /* 3 nnodes: those at x* + d, which are kept up to date */
} ms_projected_step;

/* Improve d from its last value. Uses s->scratch. */
void ms_contact_projection_improve(ms_contact_projection *j, const ms_projected_step *to);

/* The work of pinned corners that move, by the reactions of their pairs, J */
double ms_contact_projection_find_work(const ms_projected_step *to);

#endif
