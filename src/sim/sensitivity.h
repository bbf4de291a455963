/* sensitivity - how much errors grow after the step that made them
 *
 * Error control and verification bound the error of each step. Where the motion is chaotic, errors
 * grow exponentially from there on, and tol says little about the error at the end. So a small
 * disturbance d = (dx, dv) of each island follows the run by the linearized equations of motion
 * (Benettin, Galgani, Giorgilli and Strelcyn, Meccanica 15 (1980) 9), by symplectic Euler:
 *   dv' = dv + H M^-1 (J(x) dx + D(x) dv),   dx' = dx + H dv',
 * J and D as in force.h, and is scaled back to length 1 after each stride. Whatever its direction
 * at first, it soon is the one that grows most. Steps that keep tol then lead to
 *   E' = E |d'|/|d| + H/T,   in units of tol; T: length of the run; |.|: the norm of norm.h,
 * which ends at 1 where errors neither grow nor fade. E > 30 is reported, once a run.
 *
 * H is constant, as else its changes would feed energy into d (parametric resonance), and nearly as
 * long as it is stable; x is interpolated to the ends of strides. A product with J and D costs one
 * to three evaluations in islands of up to 128 springs. In larger ones, where it would cost ten,
 * and where products come to more than a tenth of all evaluations, as with long implicit steps or
 * inexpensive ones at the stability limit, the growth is not measured. Impacts and constraints are
 * not linearized: it is measured until the first contact. explain says so. No bit of the motion
 * depends on any of this. */
#ifndef MS_SENSITIVITY_H
#define MS_SENSITIVITY_H

#include "base/bytes.h"
#include "base/text.h"
#include "integrate/integrator.h"

/* The disturbance of one island */
typedef struct ms_disturbance {
  double *dx, *dv; /* m, m/s; NULL: there is none */
  double stride;   /* H, s; INFINITY: no force depends on x or v */
  double time;     /* s: since the last stride */
  double error;    /* E */
} ms_disturbance;

typedef enum ms_sensitivity_state {
  MS_SENSITIVITY_MEASURED,
  MS_SENSITIVITY_TOO_EXPENSIVE,
  MS_SENSITIVITY_CONTACT, /* particles have met planes */
  MS_SENSITIVITY_REPORTED
} ms_sensitivity_state;

/* Of the whole run */
typedef struct ms_sensitivity {
  int64_t evaluations0, contacts0; /* stats where it started */
  int64_t products;
  int32_t state; /* ms_sensitivity_state */
} ms_sensitivity;

struct msim_sim;
struct ms_motion;

/* Memory for an island of few springs, where options.watch is on and there is a tol. */
msim_status ms_sensitivity_create(const struct msim_sim *sim, const ms_model *model,
                                  ms_disturbance *d, msim_error *err);
void ms_sensitivity_destroy(const ms_model *model, ms_disturbance *d);

/* The present state is where the run starts. */
void ms_sensitivity_start(struct msim_sim *sim);

/* ... where the motion of the island starts. */
void ms_sensitivity_start_island(struct ms_motion *m);

/* After a step of h */
void ms_sensitivity_follow(struct msim_sim *sim, double h);

void ms_sensitivity_explain(const struct msim_sim *sim, ms_text *out);

void ms_sensitivity_archive(ms_bytes *bytes, ms_sensitivity *s);
void ms_sensitivity_archive_island(ms_bytes *bytes, ms_shape shape, ms_disturbance *d);

#endif
