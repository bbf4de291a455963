/* angle_springs - the angular springs of an island (model->angles): what they add to forces,
 * energies and matrix
 *
 * The loops over half-edges do not contain them. Each one is evaluated to places of its own, one a
 * corner; then each unknown adds those of its corners, in fixed order (angle_kernels.h). So bits do
 * not depend on the number of threads, nor on the instruction set, and scenes without angular
 * springs cost no instruction more. */
#ifndef MS_ANGLE_SPRINGS_H
#define MS_ANGLE_SPRINGS_H

#include "physics/angle.h"
#include "physics/force.h"

/* Each of these does nothing, or returns 0, if there are none. */

/* Set model->added_force of their unknowns to the constant forces: to be called before all others
 * that write to it. */
void ms_angle_springs_reset_forces(const ms_model *model);

/* Add their forces at x, v to model->added_force. v NULL: without damping. */
void ms_angle_springs_add_forces(const ms_model *model, const double *x, const double *v);

/* The force at x, v on a corner (layout/angles.h), also a pinned one, in space. v as above. */
void ms_angle_springs_force_at(const ms_model *model, int32_t corner, const double *x,
                               const double *v, double f[3]);

/* The sum of their elastic energies at x */
double ms_angle_springs_energy(const ms_model *model, const double *x);

/* That of one of them */
double ms_angle_springs_energy_of(const ms_model *model, int32_t angle, const double *x);

/* The sum of E(x + s d) - E(x) - s grad E.d: see nonlinearity.h */
double ms_angle_springs_nonlinearity(const ms_model *model, const double *x, const double *d,
                                     double s);

/* The element of angle e */
static inline void ms_angle_springs_get_element(const ms_coefficients *a, int32_t e,
                                                double element[MS_ANGLE_ELEMENT]) {
  const size_t slice = (size_t)e / MS_SLICE, lane = (size_t)e % MS_SLICE;
  const double *from = a->angles + MS_SLICE * MS_ANGLE_ELEMENT * slice + lane;
  for (size_t m = 0; m < MS_ANGLE_ELEMENT; m++) element[m] = from[MS_SLICE * m];
}

/* a->angles = their elements (angle.h) at a->x for a step h; add those of the corners of each
 * unknown to a->diagonal. */
void ms_angle_springs_add_matrix(const ms_model *model, double h, int clamp, ms_coefficients *a);

/* x.K x for the element of one of them */
double ms_angle_springs_product_of(const ms_model *model, const ms_coefficients *a, int32_t e,
                                   ms_operands o);

/* y += by K x on the unknowns, K the sum of their elements; past them x must be 0. It acts on
 * differences, as that of springs does. Returns by x.K x. */
double ms_angle_springs_apply(const ms_model *model, const ms_coefficients *a, double by,
                              ms_operands o);

/* y += |K'| |x| element by element, K' without the diagonal blocks */
void ms_angle_springs_apply_abs(const ms_model *model, const ms_coefficients *a, const double *x,
                                double *y);

/* >= minus the least eigenvalue of the part of an unknown's diagonal block, by Gershgorin's discs
 * of the blocks of its corners; >= 0 */
double ms_angle_springs_shift(const ms_model *model, const ms_coefficients *a, int32_t row);

#endif
