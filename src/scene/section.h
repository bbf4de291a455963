/* section - a part of a scene for output: particles, springs, faces and angular springs that follow
 * each other in the scene
 *
 * Arrays of a state of the section have 3 numbers of each of its particles, and then of each other
 * particle that its springs, faces and angular springs refer to. */
#ifndef MS_SECTION_H
#define MS_SECTION_H

#include "scene/scene.h"

typedef struct ms_section {
  int32_t first, n;               /* particles */
  int32_t first_spring, nsprings; /* springs, and then faces: the cells of frames */
  int32_t first_face, nfaces;
  int32_t first_angle, nangles;
  int32_t nothers, nother_springs;
  const int32_t *other;        /* nothers: ascending; NULL: those that follow the n in the scene */
  const int32_t *other_spring; /* likewise, of faces and pins */
} ms_section;

/* A force function gets so many free particles at a time to add up their potentials. Sections begin
 * with the first one of these, so that sums over sections have the bits of one sum. */
enum { MS_POTENTIAL_BATCH = 64 };

/* The section of `rank`, one of nranks as equal as possible; without others. */
ms_section ms_section_of_rank(const ms_scene *scene, int32_t rank, int32_t nranks);

/* That of the rank that has read a part of a scene file */
static inline ms_section ms_section_of_part(const ms_scene_part *part) {
  const ms_scene counts = {
      .nparticles = part->nparticles, .nsprings = part->nsprings, .nfaces = part->nfaces};
  return ms_section_of_rank(&counts, part->rank, part->nranks);
}

static inline ms_section ms_section_whole(const ms_scene *scene) {
  return ms_section_of_rank(scene, 0, 1);
}

static inline int64_t ms_section_first_cell(const ms_section *s) {
  return (int64_t)s->first_spring + s->first_face;
}

static inline int64_t ms_section_count_cells(const ms_section *s) {
  return (int64_t)s->nsprings + s->nfaces;
}

/* The index of a number in an ascending list that has it */
static inline int32_t ms_section_search(int32_t n, const int32_t *list, int32_t number) {
  int32_t low = 0, high = n;
  while (high - low > 1) {
    const int32_t middle = low + (high - low) / 2;
    if (list[middle] <= number) low = middle;
    else high = middle;
  }
  return low;
}

/* The row in arrays of the section of a particle that they have */
static inline size_t ms_section_row(const ms_section *s, int32_t particle) {
  if (!s->other || (particle >= s->first && particle - s->first < s->n))
    return (size_t)(particle - s->first);
  return (size_t)s->n + (size_t)ms_section_search(s->nothers, s->other, particle);
}

/* The same of a spring */
static inline int32_t ms_section_spring_row(const ms_section *s, int32_t spring) {
  const int32_t at = spring - s->first_spring;
  if (!s->other_spring || (at >= 0 && at < s->nsprings)) return at;
  return s->nsprings + ms_section_search(s->nother_springs, s->other_spring, spring);
}

/* The spring of a row */
static inline int32_t ms_section_spring(const ms_section *s, int32_t row) {
  if (!s->other_spring || row < s->nsprings) return s->first_spring + row;
  return s->other_spring[row - s->nsprings];
}

/* The particle of a row */
static inline int32_t ms_section_particle(const ms_section *s, size_t row) {
  return !s->other || row < (size_t)s->n ? s->first + (int32_t)row : s->other[row - (size_t)s->n];
}

#endif
