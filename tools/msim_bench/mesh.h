/* mesh - what no lattice is: points at random in a plane, numbered at random */
#ifndef BENCH_MESH_H
#define BENCH_MESH_H

#include "msim/msim.h"

/* side^2 particles of 0.3 kg together, at random in a square of 1 m, springs to the five nearest of
 * each: about six a particle, in no order. The same in every run. */
msim_status mesh_add(msim_scene *scene, int32_t side, double k, msim_error *err);

#endif
