/* sensitivity - how much errors grow after the step that made them
 *
 * Error control and verification bound the error of each step. Where the motion is chaotic, errors
 * grow exponentially from there on, and tol says little about the error at the end. So a small
 * disturbance d = (dx, dv) of each island follows the run by the linearized equations of motion
 * (Benettin, Galgani, Giorgilli and Strelcyn, Meccanica 15 (1980) 9), by velocity Verlet:
 *   dx' = dx + H dv + H^2/2 a,   w = dv + H/2 a,   a' = M^-1 (F(x + dx', w) - F(x, 0)),
 *   dv' = w + H/2 a',
 * and is scaled back to its first length after each stride. Whatever its direction at first, it
 * soon is the one that grows most. Steps that keep tol then lead to
 *   E' = (E + H/T) |d'|/|d|,   in units of tol; T: length of the run; |.|: the norm of norm.h,
 * which ends at 1 where errors neither grow nor fade. E > 30 is reported, once a run.
 *
 * A disturbed particle meets a plane earlier by dx.n/v.n, with another velocity, so that an impact
 * changes the parts of d along the plane's normal n (the saltation matrix: Aizerman and Gantmacher,
 * Quarterly Journal of Mechanics and Applied Mathematics 11 (1958) 385; a = F.n/m, v: approach):
 *   dx' = -e dx,   dv' = -e dv + (1 + e) a/v dx;   both are 0 where the particle rests.
 * An impact with e < 1 whose bounce is over within a stride is one on the way to rest. Friction is
 * not linearized, and the acceleration is that at the end of the step. So growth at impacts is an
 * estimate: of 140 blocks that landed on planes it was reported in all that missed tol by chaos,
 * and in one of seven whose error was small at the end.
 *
 * H is constant, as else its changes would feed energy into d (parametric resonance), and nearly as
 * long as it is stable, half that where there are planes; x is interpolated to the ends of strides.
 * A stride costs two evaluations, a step with impacts one. Where they come to more than a fifth of
 * all others, as with long implicit steps or inexpensive ones at the stability limit, the growth is
 * not measured, nor in islands of more than 128 springs, until the first contact: from there on
 * steps are short. explain says so. No bit of the motion depends on any of this. */
#ifndef MS_SENSITIVITY_H
#define MS_SENSITIVITY_H

#include "base/bytes.h"
#include "base/text.h"
#include "integrate/integrator.h"

/* The disturbance of one island */
typedef struct ms_disturbance {
  double *dx, *dv; /* m, m/s; NULL: there is none */
  double *x, *v;   /* the state where the next step starts, m, m/s */
  double *a;       /* of the disturbance, where the last stride ended, m/s^2 */
  double *f;       /* scratch */
  double stride;   /* H, s; INFINITY: no force depends on x or v */
  double time;     /* s: since the last stride */
  double error;    /* E */
} ms_disturbance;

typedef enum ms_sensitivity_state {
  MS_SENSITIVITY_MEASURED,
  MS_SENSITIVITY_TOO_EXPENSIVE,
  MS_SENSITIVITY_REPORTED
} ms_sensitivity_state;

/* Of the whole run */
typedef struct ms_sensitivity {
  int64_t evaluations0, contacts0; /* stats where it started */
  int64_t evaluations;             /* for the disturbances; stats does not count them */
  int32_t state;                   /* ms_sensitivity_state */
  int32_t has_contact;             /* 1: particles have met planes */
} ms_sensitivity;

struct msim_sim;
struct ms_motion;

/* Memory for an island that has few springs or may meet planes, where options.watch is on and
 * there is a tol. */
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
void ms_sensitivity_archive_island(ms_bytes *bytes, struct ms_motion *m);

#endif
