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
