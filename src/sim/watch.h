/* watch - is the motion one that energy allows? And the last state of which that was known
 *
 * Springs, planes, pins, damping and drag add no energy to a scene, and gravity what its work
 * comes to. So from a start with kinetic energy K0 and elastic energy E0 exact motion keeps
 *   K + E <= S,  S = K0 + E0 + sum m g.(x - x0) over all free particles,
 * and no particle is ever faster than sqrt(2 S/m), so that the longest side of the box around all
 * of them, L0 at the start, keeps
 *   L <= L0 + 2 t sqrt(2 S/m_least), S the largest so far.
 * A method may miss both by its error, which is a share of what the scene has to give, and so
 * S takes in what that is at least, for scenes that start with nothing:
 *   - M g (L0 + g h^2): a fall of all the free mass M through the scene, or, where that is more,
 *     from its farthest particle down to a plane; and one step of free fall;
 *   - sum k d^2/2 with d = sqrt(eps) max |x|, which rounding does not reach, and twice the depth
 *     of the particle farthest behind a plane, which is put out on the other side.
 * What is lifted takes back the work of gravity, down to 0. Motion beyond a hundred times either
 * bound is not that of the scene, and ends the run with MSIM_UNSTABLE; the state handed back is the
 * last one that was checked and kept before, as it is after any other numerical event whose state
 * is beyond the bounds.
 *
 * A check takes one evaluation of energy, about as long as one of forces. Implicit steps take many
 * times that and are all checked, explicit ones when their number is a multiple of 160, and both
 * before a frame is shown and at the end of the run. Setting a state, a step or springs starts
 * anew. Checks only read: no bit of the motion depends on them. */
#ifndef MS_WATCH_H
#define MS_WATCH_H

#include "integrate/control.h"
#include "physics/totals.h"

/* Of one island */
typedef struct ms_guard {
  ms_totals_copy kept; /* the last good state, vectors of its model; NULL: nothing is watched */
  ms_totals_copy last; /* that looked at last, until it is known to be good */
  double h_before;     /* with it */
  int warm;            /* the same, where it is the state that the method started from */
  int at_rest;         /* the same */
  ms_totals totals;    /* of the state looked at last */
  ms_totals *parts;    /* scratch */
} ms_guard;

/* Of the whole sim */
typedef struct ms_watch {
  double supply; /* the largest S so far, J */
  double energy; /* S but for the work of gravity since the start, J */
  double work;   /* sum m g.x at the start, J */
  double extent; /* L0, m */
  double least;  /* m_least, kg; 0: no particle is free */
  double t0;     /* of the start, s */
  int64_t step;  /* looked at last and found good: of the state kept; the rest as in msim_sim */
  double t, t_lost;
  ms_control control;
} ms_watch;

/* Memory of an island, where options.watch is on. */
msim_status ms_watch_create(const msim_sim *sim, const ms_model *model, ms_guard *guard,
                            msim_error *err);
void ms_watch_destroy(const ms_model *model, ms_guard *guard);

/* The present state is where the motion starts. */
void ms_watch_start(msim_sim *sim);

/* After a step: is it one of those that are checked? */
int ms_watch_is_due(const msim_sim *sim);

/* Check the present state, unless that was done. A good one is kept; else the kept one takes its
 * place. */
msim_status ms_watch_check(msim_sim *sim, msim_error *err);

/* What a checkpoint says of w, which is the sim's or shall be, and of an island whose x and v are
 * there already. is_present: they are those of the state kept. */
void ms_watch_history(ms_bytes *bytes, const msim_sim *sim, ms_watch *w);
void ms_guard_history(ms_bytes *bytes, const msim_sim *sim, int is_present, const ms_stepper *s,
                      ms_guard *guard);

/* A step failed, and err says why. If the state before it was beyond the bounds already, the kept
 * one takes its place, and err says so too. */
void ms_watch_retreat(msim_sim *sim, msim_error *err);

#endif
