#include "scene/section.h"

/* Parts of equal size begin at these of n items, for rank nranks at n. */
static int64_t part_begin(int64_t n, int32_t rank, int32_t nranks) {
  return n / nranks * rank + n % nranks * rank / nranks;
}

/* The particle at or before `begin` at which a batch of the force function begins */
static int32_t align_to_batch(const ms_scene *scene, int32_t begin) {
  int32_t nfree = 0;
  if (!scene->force_function.potential || begin == scene->nparticles) return begin;
  for (int32_t p = 0; p < begin; p++) nfree += !scene->pinned[p];
  for (; nfree % MS_POTENTIAL_BATCH; begin--) nfree -= !scene->pinned[begin - 1];
  return begin;
}

ms_section ms_section_of_rank(const ms_scene *scene, int32_t rank, int32_t nranks) {
  const int64_t n = scene->nparticles, springs = scene->nsprings, cells = springs + scene->nfaces,
                cell = part_begin(cells, rank, nranks), next = part_begin(cells, rank + 1, nranks);
  const int32_t angle = (int32_t)part_begin(scene->angles.n, rank, nranks),
                first = align_to_batch(scene, (int32_t)part_begin(n, rank, nranks)),
                end = align_to_batch(scene, (int32_t)part_begin(n, rank + 1, nranks));
  ms_section s = {.first = first, .n = end - first, .first_angle = angle};
  s.first_spring = (int32_t)(cell < springs ? cell : springs);
  s.nsprings = (int32_t)(next < springs ? next : springs) - s.first_spring;
  s.first_face = (int32_t)(cell - s.first_spring);
  s.nfaces = (int32_t)(next - cell) - s.nsprings;
  s.nangles = (int32_t)part_begin(scene->angles.n, rank + 1, nranks) - angle;
  return s;
}

static void mark_all(const int32_t *particle, int64_t n, uint8_t *mark) {
  for (int64_t k = 0; k < n; k++) mark[particle[k]] = 1;
}

/* Mark all ends if one of them is pinned. */
static void mark_at_pin(const ms_scene *scene, const int32_t *end, int32_t n, uint8_t *mark) {
  int is_pinned = 0;
  for (int32_t k = 0; k < n; k++) is_pinned |= scene->pinned[end[k]];
  if (is_pinned) mark_all(end, n, mark);
}

static void mark_pins(const ms_scene *scene, uint8_t *mark) {
  for (int32_t p = 0; p < scene->nparticles; p++) mark[p] |= scene->pinned[p];
  for (int32_t e = 0; e < scene->nsprings; e++)
    mark_at_pin(scene, scene->ij + 2 * (size_t)e, 2, mark);
  for (int32_t e = 0; e < scene->angles.n; e++)
    mark_at_pin(scene, scene->angles.ijk + 3 * (size_t)e, 3, mark);
}

void ms_section_mark_others(const ms_scene *scene, const ms_section *s, int with_pins,
                            uint8_t *mark) {
  if (with_pins) mark_pins(scene, mark);
  if (s->nsprings)
    mark_all(scene->ij + 2 * (size_t)s->first_spring, 2 * (int64_t)s->nsprings, mark);
  if (s->nfaces) mark_all(scene->faces + 3 * (size_t)s->first_face, 3 * (int64_t)s->nfaces, mark);
  if (s->nangles)
    mark_all(scene->angles.ijk + 3 * (size_t)s->first_angle, 3 * (int64_t)s->nangles, mark);
  for (int32_t p = s->first; p < s->first + s->n; p++) mark[p] = 0;
}

void ms_section_mark_other_springs(const ms_scene *scene, const ms_section *s, int with_pins,
                                   uint8_t *mark, uint8_t *corner) {
  if (s->nfaces) mark_all(scene->faces + 3 * (size_t)s->first_face, 3 * (int64_t)s->nfaces, corner);
  for (int32_t e = 0; e < scene->nsprings; e++) {
    const int32_t i = scene->ij[2 * (size_t)e], j = scene->ij[2 * (size_t)e + 1];
    mark[e] = (corner[i] && corner[j]) || (with_pins && (scene->pinned[i] || scene->pinned[j]));
  }
  for (int32_t e = s->first_spring; e < s->first_spring + s->nsprings; e++) mark[e] = 0;
}
