/* batch - time of many small scenes that are stepped together on all cores, relative to their times
 * alone */
#ifndef BENCH_BATCH_H
#define BENCH_BATCH_H

#include "bench_scenes.h"
#include "timing.h"

/* n sims of the scene, from its state, by explicit steps or by implicit ones: the time of stepping
 * one after the other over that of msim_sim_step_many, for each core; 1 is ideal, NAN a failure. */
double batch_measure_efficiency(const moving_scene *m, int n, int implicit, const timing_limits *p);

#endif
