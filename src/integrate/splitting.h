/* splitting - kicks, by forces of positions alone, and drifts in turn:
 *   v += h b_i a(x),  x += h a_i v
 * The last kick and the first of the next step are of one force. */
#ifndef MS_SPLITTING_H
#define MS_SPLITTING_H

#include "integrate/integrator.h"

typedef struct ms_splitting {
  int drifts;
  const double *kick, *drift; /* drifts + 1; drifts */
  double gradient;            /* g: the kick in the middle is by a(x + g h^2 a(x)); 0: by a(x) */
} ms_splitting;

/* Work vectors: the acceleration, in turn, and a stage. */
enum { MS_SPLITTING_WORK = 3 };

void ms_splitting_start(ms_stepper *s);
void ms_splitting_step(ms_stepper *s, const ms_splitting *method);

#endif
