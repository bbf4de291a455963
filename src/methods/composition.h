/* composition - steps of composition methods: alternating kicks and drifts, for forces that depend
 * on positions only,
 *   v += h b_i a(x),  x += h a_i v
 * The last kick and the first of the next step use the same force. */
#ifndef MS_COMPOSITION_H
#define MS_COMPOSITION_H

#include "integrate/integrator.h"

typedef struct ms_composition {
  int drifts;
  const double *kick, *drift; /* drifts + 1; drifts */
  double gradient;            /* g: the kick in the middle is by a(x + g h^2 a(x)); 0: by a(x) */
} ms_composition;

/* Number of work vectors: 0 and 1, alternating, the acceleration; 2, the positions of a stage */
enum { MS_COMPOSITION_WORK = 3 };

void ms_composition_start(ms_stepper *s);
void ms_composition_step(ms_stepper *s, const ms_composition *method);

#endif
