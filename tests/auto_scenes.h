/* auto_scenes - small scenes for integrator = auto, each with the length of a run and an error
 * bound */
#ifndef AUTO_SCENES_H
#define AUTO_SCENES_H

#include "scenes.h"
#include "sim/sim.h"

static inline msim_scene *soft_cloth(void) { return hanging_cloth(5, 30, 0); }
static inline msim_scene *stiff_cloth(void) { return hanging_cloth(5, 3e4, 0); }
static inline msim_scene *damped_cloth(void) { return hanging_cloth(5, 300, 0.05); }
static inline msim_scene *large_cloth(void) { return hanging_cloth(9, 3e4, 0); }
static inline msim_scene *felt(void) { return hanging_cloth(5, 3000, 10); }

static inline msim_scene *pendulum(void) { return swinging_rope(6, 500, 0); }

static inline msim_scene *ball(void) {
  const double x[3] = {0, 0, 1}, v[3] = {0};
  msim_scene *scene = make_single_particle(x, v, 9.81);
  plane(scene, 0, 0, 1, 0, 0.5, 0);
  return scene;
}

typedef struct example {
  const char *name;
  msim_scene *(*make)(void);
  double t_end;
  /* allowed error over tol; above 1 where the error is estimated and not controlled: with few
   * particles, for which dop853 chooses the steps, and with verlet, whose steps are not verified */
  double error_limit;
} example;

static const example examples[] = {{"soft cloth", soft_cloth, 0.6, 1},
                                   {"stiff cloth", stiff_cloth, 0.2, 1},
                                   {"large cloth", large_cloth, 0.2, 2},
                                   {"damped cloth", damped_cloth, 0.5, 1},
                                   {"felt", felt, 0.5, 1},
                                   {"rope pendulum", pendulum, 1, 2},
                                   {"ball on plane", ball, 1.2, 1}};
enum { NEXAMPLES = sizeof examples / sizeof *examples };

static inline msim_options options_of(const char *method, double tol, double t_end) {
  msim_options opt;
  msim_options_init(&opt, sizeof opt);
  opt.integrator = method, opt.tol = tol, opt.t_end = t_end, opt.solver = "pcg";
  return opt;
}

enum { MOST = 3 * 81 }; /* coordinates of the largest scene */

/* A block of 1 kg, pinned at a face, bends; damping of 1/4 of critical */
static inline msim_scene *damped_solid(void) {
  enum { SIDE = 8 };
  const double g[3] = {0, 0, -9.81};
  int32_t face[SIDE * SIDE];
  for (int32_t i = 0; i < SIDE * SIDE; i++) face[i] = i;
  const msim_lattice block = {.size = sizeof block,
                              .n = {SIDE, SIDE, SIDE},
                              .extent = {0.2, 0.2, 0.2},
                              .mass = 1,
                              .k = 2000,
                              .damping = 0.7,
                              .npinned = SIDE * SIDE,
                              .pinned = face};
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  assert_ok(msim_scene_add_lattice(scene, &block, err));
  assert_ok(msim_scene_set_gravity(scene, g, err));
  return scene;
}

#endif
