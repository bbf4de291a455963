/* random_mesh - an irregular scene: random points in a plane, in random order */
#ifndef BENCH_RANDOM_MESH_H
#define BENCH_RANDOM_MESH_H

#include "msim/msim.h"

/* Adds side^2 particles of 0.3 kg in total, at random in a square of 1 m, with springs to the five
 * nearest of each: about six per particle, in random order. The same in every run. */
msim_status random_mesh_add(msim_scene *scene, int32_t side, double k, msim_error *err);

#endif
