/* laws - the laws of springs in a scene: checked, and prepared for evaluation (physics/law.h) */
#ifndef MS_LAWS_H
#define MS_LAWS_H

#include "scene/scene.h"

/* A part of a table: f = a + b s + c s^2 + d s^3, s = e - start; energy: its integral at s = 0 */
typedef struct ms_law_piece {
  double start, a, b, c, d, energy;
} ms_law_piece;

typedef struct ms_law {
  msim_law given;      /* as the caller gave it; its arrays are `numbers` */
  double *numbers;     /* coefficients, or stretch and force of the table */
  ms_law_piece *piece; /* TABLE: n + 1, the first and the last one linear: piece[i] ends, and
                          piece[i + 1] starts, at stretch[i] */
  double slope;        /* >= |df/de|: N/m, or 1 if `scales` */
  double depth;        /* >= -E: the energy below that at rest, J, or m^2 if `scales` */
  int scales;          /* 1: force, slope and energy are k times those of k = 1 */
} ms_law;

/* Springs break in sims whose scene has a law with a threshold. Solvers are chosen when islands are
 * built: for springs that have broken before. MS_BREAKING: marked by one rank, not yet by all. */
enum { MS_INTACT, MS_BROKEN, MS_BROKEN_BEFORE, MS_BREAKING };

static inline int ms_law_breaks(const ms_law *law) {
  return law->given.break_strain > 0 || law->given.break_force > 0;
}

static inline int ms_law_exceeds_threshold(const ms_law *law, double stretch, double force,
                                           double rest) {
  return (law->given.break_strain > 0 && rest > 0 && stretch > law->given.break_strain * rest) ||
         (law->given.break_force > 0 && force > law->given.break_force);
}

/* 1: the scene has a law by which springs break. */
int ms_scene_breaks(const ms_scene *scene);

/* Let the springs of the scene break, if it has such a law; they are intact. The scene belongs to
 * one sim alone. MSIM_ERR_MEMORY */
msim_status ms_scene_prepare_breaking(ms_scene *scene, msim_error *err);

/* 1: the spring exerts no force, whatever its k, damping and law. */
static inline int ms_scene_is_broken(const ms_scene *s, int32_t spring) {
  return s->broken && s->broken[spring] > s->hides_broken;
}

/* The damping of a spring, N s/m */
static inline double ms_scene_damping(const ms_scene *s, int32_t spring) {
  return ms_scene_is_broken(s, spring) ? 0 : s->damping[spring];
}

/* The law of a spring; NULL: linear */
static inline const ms_law *ms_scene_law(const ms_scene *s, int32_t spring) {
  return s->law && s->law[spring] ? &s->laws[s->law[spring] - 1] : NULL;
}

/* A bound on |df/de| of a spring, N/m: k if it is linear */
static inline double ms_scene_stiffness(const ms_scene *s, int32_t spring) {
  const ms_law *law = ms_scene_law(s, spring);
  if (ms_scene_is_broken(s, spring)) return 0;
  if (!law) return s->k[spring];
  return law->scales ? s->k[spring] * law->slope : law->slope;
}

/* A bound on the energy of a spring below that at rest, J; INFINITY: there is none. */
double ms_scene_energy_depth(const ms_scene *s, int32_t spring);

/* The name of a kind of law in scene files: "linear", "tension", ...; NULL past the last one. */
const char *ms_laws_kind_name(int32_t kind);

/* Prepare a checked law: copies its arrays. 0: out of memory. */
int ms_laws_prepare(const msim_allocator *alloc, const msim_law *given, ms_law *law);
void ms_laws_free_one(const msim_allocator *alloc, ms_law *law);

/* Copy the laws of `from`, their numbers and broken springs to `to`, which has its springs. 0: out
 * of memory. */
int ms_laws_copy(const ms_scene *from, ms_scene *to);
void ms_laws_free(ms_scene *s);

#endif
