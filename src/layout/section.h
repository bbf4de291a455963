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
  int32_t nothers;
  const int32_t *other; /* nothers: ascending */
} ms_section;

/* A force function gets so many free particles at a time to add up their potentials. Sections begin
 * with the first one of these, so that sums over sections have the bits of one sum. */
enum { MS_POTENTIAL_BATCH = 64 };

/* The section of `rank`, one of nranks as equal as possible; without others. */
ms_section ms_section_of_rank(const ms_scene *scene, int32_t rank, int32_t nranks);

static inline ms_section ms_section_whole(const ms_scene *scene) {
  return ms_section_of_rank(scene, 0, 1);
}

static inline int64_t ms_section_first_cell(const ms_section *s) {
  return (int64_t)s->first_spring + s->first_face;
}

static inline int64_t ms_section_count_cells(const ms_section *s) {
  return (int64_t)s->nsprings + s->nfaces;
}

/* Mark the other particles. mark: nparticles, 0 at first; with_pins: 1 for all pinned particles,
 * too, and the ends of springs and angular springs at them */
void ms_section_mark_others(const ms_scene *scene, const ms_section *section, int with_pins,
                            uint8_t *mark);

/* The row in arrays of the section of a particle that they have */
static inline size_t ms_section_row(const ms_section *s, int32_t particle) {
  if (particle >= s->first && particle - s->first < s->n) return (size_t)(particle - s->first);
  int32_t low = 0, high = s->nothers;
  while (high - low > 1) {
    const int32_t middle = low + (high - low) / 2;
    if (s->other[middle] <= particle) low = middle;
    else high = middle;
  }
  return (size_t)s->n + (size_t)low;
}

/* The particle of a row */
static inline int32_t ms_section_particle(const ms_section *s, size_t row) {
  return row < (size_t)s->n ? s->first + (int32_t)row : s->other[row - (size_t)s->n];
}

#endif
