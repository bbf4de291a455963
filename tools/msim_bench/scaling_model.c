#include "scaling_model.h"

#include <math.h>

/* Assumed, as one machine does not show them: seconds of a message, bytes a second and ranks of a
 * node */
static const double ALPHA = 2e-6, BETA = 25e9, NODE = 64;

double model_ghosts(int is_solid, double n) {
  const double s = is_solid ? cbrt(n) : sqrt(n);
  return is_solid ? 6 * s * s + 12 * s + 8 : 8 * s + 16;
}

double model_ghosts_of_half(int is_solid, double n) {
  return is_solid ? cbrt(n) * cbrt(n) : 2 * sqrt(n);
}

double model_seconds(int is_solid, double n, double ranks, double per_particle,
                     double collectives) {
  const double neighbours = is_solid ? 26 : 8, nodes = ranks / NODE;
  const double bytes = nodes > 1 ? MODEL_GHOST_BYTES * model_ghosts(is_solid, n / nodes) : 0;
  return per_particle * n / ranks + neighbours * ALPHA + bytes / BETA +
         collectives * ALPHA * log2(ranks);
}
