/* step_energy - does a step with contact add energy? One that does may be shortened. Energies and
 * work are those of all ranks, and all functions are collective. */
#ifndef MS_STEP_ENERGY_H
#define MS_STEP_ENERGY_H

#include "contact/contact_set.h"

/* J */
typedef struct ms_step_energy {
  double most; /* the kinetic, elastic and potential energy that a step may lead to, without work */
  double linear; /* what the linearization of springs may add to it */
  double motion; /* kinetic and elastic energy at the start */
} ms_step_energy;

/* The kinetic, elastic and potential energy of the unknowns of this rank, J; *motion: the first
 * two. parts: scratch, ms_totals_count_parts */
double ms_step_energy_sum(const ms_model *model, const double *x, const double *v, ms_totals *parts,
                          double *motion);

/* The energy at the start of the step, or, if that is more, that with pins that have moved already,
 * as implicit Euler moves them first. v: the velocities at the start */
ms_step_energy ms_step_energy_bound(ms_stepper *s, const double *v);

/* The energy at the end of the step just made, with the pins at their ends; *motion: its kinetic
 * and elastic part */
double ms_step_energy_find_end(const ms_stepper *s, double *motion);

/* A bound on the work of moving pins and of a force function in the step just made, J: twice its
 * trapezoidal rule */
double ms_step_energy_bound_work(ms_stepper *s, const double *v);

/* Divides the displacement and the velocity of all particles by 2 until energy less work is at
 * most `most`, and reflects particles that are inside obstacles then. So the step tends to no
 * motion, which adds no energy; where solids move, to the mean motion of those that are in contact,
 * and the impulse by which they carry the body along does work. If no step is short enough, as
 * where a solid presses a body against another one, or against pins, the one of least energy is
 * made. */
void ms_step_energy_shorten(ms_stepper *s, double most);

#endif
