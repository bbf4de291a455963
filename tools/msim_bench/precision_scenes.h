/* precision_scenes - the scenes of the benchmark `precision`, each with one property that favours
 * some methods over others */
#ifndef BENCH_PRECISION_SCENES_H
#define BENCH_PRECISION_SCENES_H

#include "msim/msim.h"

typedef struct precision_scene {
  const char *name;
  const char *doc;  /* description to print */
  int32_t sides[2]; /* particles along an edge: in a full run, with --quick */
  double ends[2];   /* s: end of the run, likewise */
  int damped;       /* forces depend on velocities (damping or friction) */
  int impacts;      /* particles hit planes */
  double stiff;     /* N/m: springs of at least this k are much stiffer than the others; 0: none */
  msim_status (*build)(int32_t side, msim_scene *scene, msim_error *err);
} precision_scene;

/* The i-th scene; NULL past the end. */
const precision_scene *precision_scene_info(int i);

#endif
