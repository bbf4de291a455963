/* method_state - reads and writes the state of a method that later steps depend on, for checkpoints
 *
 *   x, v, h
 *   tag        the cached-stage tag, and the work vectors it refers to (integrator.h, `carried`)
 *   h_before   for two-step methods, and for the a that Newmark's method carries
 *   a          of ms_contact_set, and its hash, with collision = event; the set follows from x, v
 *   the last step, for dense output: its start, h and the slopes known so far
 *
 * All other vectors are written before they are read. */
#ifndef MS_METHOD_STATE_H
#define MS_METHOD_STATE_H

#include "base/archive.h"
#include "integrate/integrator.h"

/* Passes this state to or from an archive (archive.h), from one to a stepper that was started,
 * whatever steps it has made since. inside: 1, with the last step. */
void ms_method_state_archive(ms_archive *bytes, const ms_integrator *method, ms_stepper *s,
                             int inside);

/* Passes the work vectors that a cached-stage tag of the method refers to; 0: none. */
void ms_method_state_archive_carried(ms_archive *bytes, const ms_integrator *method,
                                     const ms_stepper *s, int tag);

#endif
