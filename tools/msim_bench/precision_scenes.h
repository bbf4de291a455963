/* precision_scenes - what moves in the bench `precision`: one scene for each thing that makes a
 * method better or worse than others */
#ifndef BENCH_PRECISION_SCENES_H
#define BENCH_PRECISION_SCENES_H

#include "msim/msim.h"

typedef struct precision_scene {
  const char *name;
  const char *doc;  /* for people */
  int32_t sides[2]; /* particles along an edge: of the whole bench, of --quick */
  double ends[2];   /* s: the time that is looked at */
  int damped;       /* forces depend on velocities */
  int impacts;      /* planes are hit */
  double stiff;     /* N/m: springs from here on are much stiffer than the others; 0: none are */
  msim_status (*build)(int32_t side, msim_scene *scene, msim_error *err);
} precision_scene;

/* The i-th scene, NULL past the end. */
const precision_scene *precision_scene_info(int i);

#endif
