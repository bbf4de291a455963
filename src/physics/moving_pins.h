/* moving_pins - pinned particles with a prescribed motion: their rows, and the work of what moves
 * them
 *
 * The force R that moves a particle p obeys m a = F + R, with the force F of springs, gravity and
 * constant forces on it. With the energies of all particles, pinned ones included, its work is
 *   W = change of sum_p (m v^2/2 - (m g + F_p).x) + the elastic energy of springs between pinned
 *       particles, all functions of time, - integral of sum_p F_springs.v_p dt,
 * the springs being those to free particles. Energy less work is constant where nothing dissipates.
 */
#ifndef MS_MOVING_PINS_H
#define MS_MOVING_PINS_H

#include "physics/model.h"
#include "scene/motions.h"

/* A row of a model that moves as particle i of a motion of the scene */
typedef struct ms_moving_row {
  int32_t row, motion, i;
} ms_moving_row;

/* A spring of the model from a moving row to an unknown */
typedef struct ms_moving_spring {
  int32_t spring, other; /* other: the row of the unknown */
  ms_moving_row end;
} ms_moving_spring;

/* A corner (layout/angles.h) at a moving row */
typedef struct ms_moving_corner {
  int32_t corner;
  ms_moving_row end;
} ms_moving_corner;

typedef struct ms_moving_pins {
  int32_t n, nsprings, ncorners;
  ms_moving_row *row;       /* n */
  ms_moving_spring *spring; /* nsprings */
  ms_moving_corner *corner; /* ncorners */
  double speed;             /* the largest mean speed, m/s */
} ms_moving_pins;

/* *pins: NULL if no pinned particle of the model moves */
msim_status ms_moving_pins_create(const ms_model *model, ms_moving_pins **pins, msim_error *err);
void ms_moving_pins_destroy(const ms_scene *scene, ms_moving_pins *pins);

/* Particles and motions of the model's scene have other numbers now. mover: the motion of each
 * particle */
void ms_moving_pins_renumber(const ms_model *model, const ms_moving_row *mover);

/* Write the positions and velocities of moving rows at an instant. Nullable: v. */
void ms_moving_pins_set(const ms_model *model, ms_instant at, double *x, double *v);

/* -sum F_springs.v_p (W) in the state x, v, whose moving rows are set; v NULL: without damping, and
 * with the velocities of the instant */
double ms_moving_pins_compute_power(const ms_model *model, ms_instant at, const double *x,
                                    const double *v);

/* The first time of a motion of the scene, also of its colliders, after t, by more than rounding;
 * INFINITY: none */
double ms_moving_pins_next_time(const ms_scene *scene, double t);

/* Set the rows of moving particles of a scene in arrays, 3 nparticles. */
void ms_moving_pins_set_arrays(const ms_scene *scene, ms_instant at, double *x, double *v);

/* The energy of pinned particles and of the springs between them, in these arrays */
double ms_moving_pins_compute_energy(const ms_scene *scene, const double *x, const double *v);

#endif
