/* energy_monitor - energy monitor: detect motion beyond what energy allows, and keep the last good
 * state
 *
 * Springs, planes, colliders at rest, pins, damping and drag add no energy to a scene; gravity and
 * constant forces F add their work. So from a start with kinetic energy K0 and elastic energy E0
 * exact motion keeps
 *   K + E <= S,  S = K0 + E0 + sum (m g + F).(x - x0) over all free particles,
 * and no particle is ever faster than sqrt(2 S/m), so that the longest side L of the box around all
 * particles, L0 at the start, keeps
 *   L <= L0 + 2 t sqrt(2 S/m_least), S the largest so far.
 * The work of moving pins and colliders and of a force function adds to S, at most run.moved, and
 * what the potential of that function loses. A method may exceed both by its error, which is a
 * fraction of the energy available in the scene.
 * For scenes that start without energy, S contains a least amount of it:
 *   - W (L0 + a h^2), W = M g + sum |F|, a = g + max |F|/m: a fall of the free mass M through the
 *     scene, or, where that is more, from the highest particle down to a plane or collider; and one
 *     step of free fall;
 *   - sum k d^2/2 with d = sqrt(eps) max |x|, far above rounding errors, plus twice the depth of
 *     the particle farthest behind a plane or in a collider, which is moved out of it;
 *   - for springs whose law has energies below that at rest, a bound on these (scene/laws.h); where
 *     there is none, no motion is beyond S.
 * Lifting reduces the work of external forces, down to 0. Motion beyond a hundred times either
 * bound ends the run with MSIM_UNSTABLE, and the sim returns to the last good state, the last one
 * that passed a check. It does so, too, after any other numerical event in a state beyond the
 * bounds.
 *
 * A check costs one evaluation of energy, about as much as one of forces. Implicit steps cost many
 * times that and are all checked; explicit ones if their number is a multiple of 160; both before a
 * frame is shown and at the end of the run. Setting a state, a step or springs starts anew. Checks
 * only read: no bit of the motion depends on them. */
#ifndef MS_ENERGY_MONITOR_H
#define MS_ENERGY_MONITOR_H

#include "physics/totals.h"
#include "sim/run_state.h"

/* The last good state of one island */
typedef struct ms_last_good_state {
  double *x, *v;    /* vectors of its model; NULL: the monitor is off */
  double h_before;  /* of this state */
  int tag;          /* of this state: its tag, if that may be restored */
  int at_rest;      /* of this state */
  ms_totals totals; /* of the state measured last */
  ms_totals *parts; /* scratch */
} ms_last_good_state;

/* The energy monitor of the whole sim */
typedef struct ms_energy_monitor {
  double energy_bound;        /* the largest energy bound S so far, J */
  double start_bound;         /* S without the work of external forces since the start, J */
  double start_external_work; /* sum (m g + F).x at the start, J */
  double start_moved;         /* run.moved at the start, J */
  double extent;              /* L0, m */
  double least_mass;          /* m_least, kg; 0: no particle is free */
  double t0;                  /* time of the start, s */
  ms_run_state good;          /* that of the last good state */
} ms_energy_monitor;

/* Allocate the memory for an island, if options.watch is on. MSIM_ERR_MEMORY. */
msim_status ms_energy_monitor_create(const msim_sim *sim, const ms_model *model,
                                     ms_last_good_state *good, msim_error *err);
void ms_energy_monitor_destroy(const ms_model *model, ms_last_good_state *good);

/* Start monitoring in the present state. */
void ms_energy_monitor_start(msim_sim *sim);

/* 1: the step just made is one of those that are checked. */
int ms_energy_monitor_is_due(const msim_sim *sim);

/* Check the present state, unless that was done. A good state becomes the last good one; otherwise
 * the sim returns to the last good one: MSIM_UNSTABLE. */
msim_status ms_energy_monitor_check(msim_sim *sim, msim_error *err);

/* Write the monitor to a checkpoint, or read it: w of the sim; and that of an island, whose x and v
 * are read before. run: that of the present state, read before; is_present: it is the last good
 * one. */
void ms_energy_monitor_archive(ms_archive *bytes, const msim_sim *sim, const ms_run_state *run,
                               ms_energy_monitor *w);
void ms_energy_monitor_archive_island(ms_archive *bytes, const msim_sim *sim, int is_present,
                                      const ms_stepper *s, ms_last_good_state *good);

/* To be called when all islands are read. is_present: as above */
void ms_energy_monitor_finish_reading(msim_sim *sim, int is_present);

/* After a step that failed: if the state before it is beyond the bounds, return to the last good
 * state, and append that to err. */
void ms_energy_monitor_restore(msim_sim *sim, msim_error *err);

#endif
