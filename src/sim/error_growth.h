/* error_growth - measure how much errors grow after the step that made them
 *
 * Error control and verification bound the error of each step. Where the motion is chaotic, errors
 * grow exponentially from there on, and tol says little about the error at the end. So a small
 * disturbance d = (dx, dv) of each island follows the run by the linearized equations of motion
 * (Benettin, Galgani, Giorgilli and Strelcyn, Meccanica 15 (1980) 9), by velocity Verlet with the
 * stride H:
 *   dx' = dx + H dv + H^2/2 a,   w = dv + H/2 a,   a' = M^-1 (F(x + dx', w) - F(x, 0)),
 *   dv' = w + H/2 a'.
 * It is scaled back to its first length after each stride. Whatever its first direction, it soon is
 * the one that grows most. Steps that keep tol then lead to
 *   E' = (E + H/T) |d'|/|d|,   in units of tol; T: length of the run; |.|: the norm of norm.h,
 * which is 1 at the end if errors neither grow nor decay. E > 30 is reported, once a run.
 *
 * A disturbed particle meets a plane earlier by dx.n/v.n, with another velocity, so that an impact
 * changes the components of d along the plane's normal n (the saltation matrix: Aizerman and
 * Gantmacher, Quarterly Journal of Mechanics and Applied Mathematics 11 (1958) 385; a = F.n/m, v:
 * approach velocity, e: restitution):
 *   dx' = -e dx,   dv' = -e dv + (1 + e) a/v dx;   both are 0 where the particle rests.
 * After an impact with e < 1 whose bounce is over within a stride the particle counts as resting.
 * Friction is not linearized, and a is taken at the end of the step. So growth at impacts is an
 * estimate: of 140 blocks that landed on planes it was reported in all that missed tol by chaos,
 * and in one of seven whose error was small at the end.
 *
 * H is constant, as otherwise its changes would feed energy into d (parametric resonance), and 0.9
 * of its stability limit, half that with planes; new springs start the measurement anew with
 * another. x is interpolated to the ends of strides. A stride costs two evaluations, a step with
 * impacts one. If they come to more than a fifth of all others, as with long implicit steps or
 * inexpensive ones at the stability limit, or a step to more than 64 strides, the growth is not
 * measured (from the start on if fixed steps of auto show it in advance), nor is it in islands of
 * more than 128 springs, until the first contact: from there on steps are short. `explain` reports
 * that. No bit of the motion depends on any of this. */
#ifndef MS_ERROR_GROWTH_H
#define MS_ERROR_GROWTH_H

#include "base/archive.h"
#include "base/text.h"
#include "integrate/integrator.h"

/* The disturbance of one island */
typedef struct ms_disturbance {
  double *dx, *dv; /* m, m/s; NULL: nothing is measured */
  double *x, *v;   /* the state at the start of the next step, m, m/s */
  double *a;       /* acceleration of the disturbance at the end of the last stride, m/s^2 */
  double *f;       /* scratch */
  double stride;   /* H, s; INFINITY: no force depends on x or v */
  double time;     /* s: time since the end of the last stride */
  double error;    /* E */
} ms_disturbance;

typedef enum ms_error_growth_state {
  MS_ERROR_GROWTH_MEASURED,
  MS_ERROR_GROWTH_TOO_EXPENSIVE,
  MS_ERROR_GROWTH_REPORTED
} ms_error_growth_state;

/* Of the whole run */
typedef struct ms_error_growth {
  int64_t evaluations0, contacts0; /* stats at the start */
  int64_t evaluations;             /* for the disturbances; stats does not count them */
  int32_t state;                   /* ms_error_growth_state */
  int32_t has_contact;             /* 1: particles have met planes */
} ms_error_growth;

struct msim_sim;
struct ms_island_sim;

/* 1: the island has few springs or may meet planes. */
int ms_error_growth_is_measurable(const ms_model *model);

/* Allocate vectors if options.watch is on, there is a tol, and the growth is measurable.
 * MSIM_ERR_MEMORY. */
msim_status ms_error_growth_create(const struct msim_sim *sim, const ms_model *model,
                                   ms_disturbance *d, msim_error *err);
void ms_error_growth_destroy(const ms_model *model, ms_disturbance *d);

/* Start measuring in the present state. */
void ms_error_growth_start(struct msim_sim *sim);

void ms_error_growth_start_island(struct ms_island_sim *m);

/* The springs have changed, and with them the stable stride. */
void ms_error_growth_change_springs(struct msim_sim *sim);

/* Follow the step of h just accepted. */
void ms_error_growth_follow(struct msim_sim *sim, double h);

/* The line of msim_sim_explain: whether it is measured, or why not; none without a tol or with
 * options.watch off */
void ms_error_growth_explain(const struct msim_sim *sim, ms_text *out);

void ms_error_growth_archive(ms_archive *bytes, ms_error_growth *s);
void ms_error_growth_archive_island(ms_archive *bytes, struct ms_island_sim *m);

#endif
