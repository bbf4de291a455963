/* impact_location - one step with impacts located in time, for methods that resolve the springs
 *
 * The whole step is made first. Then the distance of each particle from each plane is a polynomial
 * of time: the method's dense output or, if Hermite's cubic of x and v comes near the plane, his
 * quintic of x, v and a at both ends. Its Bernstein coefficients give the first impact, however
 * short (bernstein.h). The step ends there, all particles that touch a plane bounce at once, and
 * the next substep makes the rest: so the order of the method is kept.
 * After MS_MAX_IMPACT_SUBSTEPS substeps, or if the step exceeds ms_impact_location_longest_step(),
 * each particle with an impact follows a path of its own instead (particle_path.h), of order 2.
 *
 * Reactions keep particles in contact on their planes in each evaluation (contact_set.h). If such a
 * particle stops, begins to slip, turns sharply, or is lifted in a substep, its own path replaces
 * the motion in that substep. */
#ifndef MS_IMPACT_LOCATION_H
#define MS_IMPACT_LOCATION_H

#include "contact/contact_set.h"

enum { MS_MAX_CHANGE_SUBSTEPS = 8, MS_MAX_IMPACT_SUBSTEPS = 64 };

/* One step of s->h by `method`. May change s->h, s->t, s->x and s->v, which ms_events_step()
 * restores. */
msim_status ms_impact_location_step(const ms_integrator *method, ms_stepper *s, msim_error *err);

/* The longest step (s) that is divided at impacts so that the method keeps its order p; 0 for
 * methods with p <= 2, as particle paths keep these orders. omega: a bound on frequencies (1/s) */
double ms_impact_location_longest_step(const ms_integrator *method, double omega);

#endif
