#include <string.h>

#include "integrate/methods.h"

/* v += h b_i a(x),  x += h a_i v,  in turn: b_1 a_1 b_2 a_2 ... a_11 b_12, the same from both ends.
 * Coefficients: Blanes and Moan, J. Comput. Appl. Math. 142 (2002) 313, method SRKN_11^6. The last
 * kick and the first of the next step are of one force: 11 evaluations a step. */
enum { DRIFTS = 11, KICKS = 12 };

#define B6                                                                                   \
  (0.5 - (0.0414649985182624 + 0.198128671918067 - 0.0400061921041533 + 0.0752539843015807 - \
          0.0115113874206879))
#define A6                                                                                  \
  (1 - 2 * (0.123229775946271 + 0.290553797799558 - 0.127049212625417 - 0.246331761062075 + \
            0.357208872795928))
static const double kick[KICKS] = {0.0414649985182624,
                                   0.198128671918067,
                                   -0.0400061921041533,
                                   0.0752539843015807,
                                   -0.0115113874206879,
                                   B6,
                                   B6,
                                   -0.0115113874206879,
                                   0.0752539843015807,
                                   -0.0400061921041533,
                                   0.198128671918067,
                                   0.0414649985182624};
static const double drift[DRIFTS] = {0.123229775946271,  0.290553797799558,  -0.127049212625417,
                                     -0.246331761062075, 0.357208872795928,  A6,
                                     0.357208872795928,  -0.246331761062075, -0.127049212625417,
                                     0.290553797799558,  0.123229775946271};

enum { STAGE = 2 }; /* work vectors: the acceleration, in turn, and this one */

/* Stages lie in x_next and in a vector of our own, in turn, so that forces find the pinned rows in
 * both. */
static void start(ms_stepper *s) {
  const ms_rows *rows = &s->model->rows;
  memcpy(s->work[STAGE], s->x, (size_t)rows->dims * (size_t)rows->stride * sizeof *s->x);
}

static msim_status step(ms_stepper *s, msim_error *err) {
  (void)err;
  const ms_shape shape = s->model->shape;
  const int now = s->warm == 2; /* warm: 1 + the work vector that holds a */
  double *a = s->work[now], *x = s->x_next, *other = s->work[STAGE], *v = s->v_next;
  if (!s->warm) ms_acceleration(s, s->x, NULL, a);
  ms_combine(shape, s->v, s->h * kick[0], a, v);
  ms_combine(shape, s->x, s->h * drift[0], v, x);
  for (int i = 1; i < DRIFTS; i++) {
    ms_evaluate(s, &(ms_pass){.x = x,
                              .v_to = v,
                              .v_from = v,
                              .h = s->h * kick[i],
                              .x_to = other,
                              .x_from = x,
                              .drift = s->h * drift[i]});
    double *next = other;
    other = x, x = next;
  }
  ms_evaluate(
      s,
      &(ms_pass){.x = x, .a = s->work[1 - now], .v_to = v, .v_from = v, .h = s->h * kick[DRIFTS]});
  s->warm_next = ms_reflect(s, x, v) ? 0 : 2 - now;
  return MSIM_OK;
}

/* From z = h w = 3.1414 to 3.1424 a mode grows by up to 4e-4 a step, past that none up to 6.3 */
static double limit(const ms_bounds *b) { return 3.1414 / b->omega; }

const ms_integrator ms_rkn6 = {
    .entry = {.name = "rkn6",
              .doc =
                  "Runge-Kutta-Nystroem, symplectic, 11 stages; for forces that do not depend on "
                  "velocities; stable below h omega = 3.1 (Blanes and Moan 2002)",
              .order = 6},
    .separable = 1,
    .one_step = 1,
    .nwork = 3,
    .start = start,
    .step = step,
    .limit = limit};
