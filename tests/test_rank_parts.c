/* Tests of the parts of ranks: the bisection against a sort, parts against loops over the scene,
 * the order of half-edges and angular springs against that of one process, ghosts after a refresh,
 * bytes against formulas. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "angle_scenes.h"
#include "layout/angles.h"
#include "layout/bisection.h"
#include "layout/halo.h"
#include "layout/layout.h"
#include "scene/section.h"
#include "layout/rank_order.h"
#include "rank_scenes.h"
#include "ranks.h"
#include "scene/scene.h"

/*------------------------------------- bisection ------------------------------------------------*/

static const double *sort_x;
static int sort_axis;

static int compare(const void *a, const void *b) {
  const int32_t i = *(const int32_t *)a, j = *(const int32_t *)b;
  const double p = sort_x[3 * i + sort_axis], q = sort_x[3 * j + sort_axis];
  return p < q ? -1 : p > q ? 1 : i - j;
}

/* The definition: sort along the longest side, cut in proportion to the ranks, and so on */
static void bisect_by_sorting(int32_t *item, int32_t n, int32_t first, int32_t nranks,
                              int32_t *of) {
  if (nranks == 1)
    for (int32_t k = 0; k < n; k++) of[item[k]] = first;
  if (nranks == 1) return;
  double side[3];
  for (int c = 0; c < 3; c++) {
    double low = INFINITY, high = -INFINITY;
    for (int32_t k = 0; k < n; k++)
      low = fmin(low, sort_x[3 * item[k] + c]), high = fmax(high, sort_x[3 * item[k] + c]);
    side[c] = high - low;
  }
  sort_axis = 0;
  for (int c = 1; c < 3; c++)
    if (side[c] > side[sort_axis]) sort_axis = c;
  qsort(item, (size_t)n, sizeof *item, compare);
  const int32_t half = nranks / 2, m = (int32_t)((int64_t)n * half / nranks);
  bisect_by_sorting(item, m, first, half, of);
  bisect_by_sorting(item + m, n - m, first + half, nranks - half, of);
}

static void check_bisection(const ms_scene *s, int32_t nranks) {
  int32_t *owner = malloc(4 * (size_t)s->nparticles), *other = malloc(4 * (size_t)s->nparticles),
          *item = malloc(4 * (size_t)s->nparticles), n = 0;
  assert_true(owner && other && item);
  for (int32_t p = 0; p < s->nparticles; p++) {
    other[p] = MS_NO_OWNER;
    if (!s->pinned[p]) item[n++] = p;
  }
  sort_x = s->x;
  bisect_by_sorting(item, n, 0, nranks, other);
  ms_bisection_assign(s, nranks, owner, item);
  assert_memory_equal(owner, other, 4 * (size_t)s->nparticles);
  ms_rank_part part = {.ranks = &(ms_ranks){.n = nranks}, .owner = owner};
  if (n >= 100 * nranks) assert_true(ms_rank_part_imbalance(s, &part) <= 1.01);
  free(owner), free(other), free(item);
}

static void bisection_is_that_of_a_sort(void **state) {
  (void)state;
  const int32_t counts[] = {1, 2, 3, 4, 5, 7, 8, 64};
  msim_scene *scenes[] = {hanging_cloth(80, 100, 0), pinned_block(20, 1, 100, 0),
                          random_mesh(900, 3, 0), folded_rope(5)};
  for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++) {
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
      check_bisection(scenes[k]->data, counts[i]);
    msim_scene_destroy(scenes[k]);
  }
}

/*------------------------------------- sections -------------------------------------------------*/

static double no_potential(void *data, int32_t n, const int32_t *particles, const double *x) {
  (void)data, (void)n, (void)particles, (void)x;
  return 0;
}

/* They follow each other, and begin where a force function gets a new batch of free particles. */
static void sections_begin_with_batches(void **state) {
  (void)state;
  msim_scene *scene = random_mesh(900, 3, 0);
  ms_scene *s = scene->data;
  for (int has_potential = 0; has_potential < 2; has_potential++) {
    s->force_function.potential = has_potential ? no_potential : NULL;
    for (int32_t nranks = 1; nranks <= 16; nranks++)
      for (int32_t r = 0, next = 0, nfree = 0; r < nranks; r++) {
        const ms_section is = ms_section_of_rank(s, r, nranks);
        assert_int_equal(is.first, next);
        if (has_potential) assert_int_equal(nfree % MS_POTENTIAL_BATCH, 0);
        assert_in_range(is.n, has_potential ? 0 : s->nparticles / nranks,
                        s->nparticles / nranks + (has_potential ? 2 * MS_POTENTIAL_BATCH : 1));
        for (; next < is.first + is.n; next++) nfree += !s->pinned[next];
        assert_true(r + 1 < nranks || next == s->nparticles);
      }
  }
  s->force_function.potential = NULL;
  msim_scene_destroy(scene);
}

/*------------------------------------- parts ----------------------------------------------------*/

/* A rank's part, or the layout of one process (part NULL) */
typedef struct built {
  ms_ranks *ranks;
  ms_rank_part *part;
  ms_rank_order order;
  ms_islands islands;
  ms_unknowns rows;
  ms_springs springs;
  ms_half_edges half_edges;
  ms_angles angles;
} built;

static const char *build(const ms_scene *s, const msim_comm *comm, built *b) {
  *b = (built){0};
  b->ranks = ms_ranks_create(comm, &s->alloc);
  if (!b->ranks || ms_rank_part_create(s, b->ranks, &b->part, NULL)) return "memory";
  if (ms_rank_order_create(s, b->part, 0, &b->order, NULL)) return "memory";
  if (ms_rank_part_create_island(s, b->part, &b->order, &b->islands, NULL)) return "memory";
  const ms_island island = ms_islands_get(&b->islands, 0);
  if (ms_layout_create(s, &island, &b->rows, &b->springs, &b->half_edges, NULL)) return "memory";
  return ms_angles_create(s, &island, &b->rows, &b->angles, NULL) ? "memory" : NULL;
}

static void destroy(const ms_scene *s, built *b) {
  ms_angles_destroy(s, &b->angles);
  ms_layout_destroy(s, &b->rows, &b->springs, &b->half_edges);
  ms_islands_destroy(s, &b->islands);
  ms_rank_order_destroy(s, &b->order);
  ms_rank_part_destroy(&s->alloc, b->part);
  ms_ranks_destroy(&s->alloc, b->ranks);
}

/* Mark the corners of angular springs at own particles that are not own; returns their number. */
static int32_t mark_angles(const ms_scene *s, const int32_t *owner, int32_t me, uint8_t *kind) {
  int32_t n = 0;
  for (int32_t e = 0; e < s->angles.n; e++) {
    const int32_t *ijk = s->angles.ijk + 3 * e;
    if (owner[ijk[0]] != me && owner[ijk[1]] != me && owner[ijk[2]] != me) continue;
    n++;
    for (int c = 0; c < 3; c++)
      if (owner[ijk[c]] != me) kind[ijk[c]] = owner[ijk[c]] < 0 ? 3 : 2;
  }
  return n;
}

/* Free particles, ghosts, pinned ones and springs are those that loops over the scene find. */
static const char *check_members(const ms_scene *s, const built *b) {
  const int32_t me = b->part->ranks->rank, *owner = b->part->owner;
  const ms_island m = ms_islands_get(&b->islands, 0);
  uint8_t *kind = calloc((size_t)s->nparticles, 1); /* 1 own, 2 ghost, 3 pinned */
  int32_t count[4] = {0}, springs = 0;
  if (!kind) return "memory";
  for (int32_t p = 0; p < s->nparticles; p++) kind[p] = owner[p] == me;
  for (int32_t e = 0; e < s->nsprings; e++) {
    const int32_t i = s->ij[2 * e], j = s->ij[2 * e + 1];
    if (owner[i] != me && owner[j] != me) continue;
    if (springs >= m.nsprings || m.spring[springs++] != e) return "another spring";
    if (owner[i] != me) kind[i] = owner[i] < 0 ? 3 : 2;
    if (owner[j] != me) kind[j] = owner[j] < 0 ? 3 : 2;
  }
  if (mark_angles(s, owner, me, kind) != m.nangles) return "other angular springs";
  for (int32_t p = 0; p < s->nparticles; p++) count[kind[p]]++;
  if (springs != m.nsprings || count[1] != m.nfree || count[2] != m.nghosts ||
      count[2] + count[3] != m.npinned)
    return "other numbers";
  for (int32_t k = 0; k < m.nfree; k++)
    if (kind[m.free[k]]-- != 1) return "another unknown";
  for (int32_t k = 0; k < m.npinned; k++)
    if (kind[m.pinned[k]] != (k < m.nghosts ? 2 : 3)) return "another ghost";
  for (int32_t k = 1; k < m.nghosts; k++)
    if (owner[m.pinned[k]] < owner[m.pinned[k - 1]] ||
        (owner[m.pinned[k]] == owner[m.pinned[k - 1]] && m.pinned[k] <= m.pinned[k - 1]))
      return "ghosts in another order";
  free(kind);
  return NULL;
}

/* The springs of a row in the order in which its forces are added, padding left out */
static int32_t list_row(const ms_half_edges *h, const ms_springs *springs, int32_t row,
                        int32_t *to) {
  const ms_half_edge_span span = ms_half_edges_of_row(h, row);
  int32_t n = 0;
  for (int32_t at = span.begin; at < span.end; at += span.step)
    if (h->spring[at] >= 0) to[n++] = ms_springs_number(springs, h->spring[at]);
  return n;
}

/* The same of its corners of angular springs, as 3 angle + corner */
static int32_t list_corners(const ms_angles *g, int32_t row, int32_t *to) {
  int32_t n = 0;
  for (int32_t at = g->n ? g->of.first[row] : 0; g->n && at < g->of.first[row + 1]; at++)
    to[n++] = 3 * g->angle[g->of.item[at] / 3] + g->of.item[at] % 3;
  return n;
}

static const char *compare_corners(const ms_scene *s, const ms_island *island,
                                   const ms_unknowns *rows, const int32_t *row_of, const built *b) {
  ms_angles g;
  int32_t *here = malloc(12 * (size_t)s->angles.n + 1),
          *there = malloc(12 * (size_t)s->angles.n + 1);
  const char *wrong =
      !here || !there || ms_angles_create(s, island, rows, &g, NULL) ? "memory" : NULL;
  for (int32_t r = 0; r < rows->nfree && !wrong; r++) {
    const int32_t own = row_of[rows->particle[r]];
    if (own < 0 || own >= b->rows.nfree) continue;
    const int32_t n = list_corners(&g, r, there);
    if (list_corners(&b->angles, own, here) != n) wrong = "other corners";
    else if (memcmp(here, there, 4 * (size_t)n) != 0) wrong = "another order of corners";
  }
  ms_angles_destroy(s, &g);
  free(here), free(there);
  return wrong;
}

static const char *compare_rows(const ms_scene *s, const built *b) {
  int32_t *here = malloc(4 * (size_t)s->nsprings), *there = malloc(4 * (size_t)s->nsprings),
          *row_of = malloc(4 * (size_t)s->nparticles);
  ms_islands islands;
  const char *wrong = !here || !there || !row_of ? "memory" : NULL;
  for (int32_t p = 0; p < s->nparticles && !wrong; p++) row_of[p] = -1;
  if (!wrong) ms_unknowns_find_rows(&b->rows, row_of);
  if (!wrong && ms_islands_create(s, 0, &islands, NULL)) return "memory";
  for (int32_t i = 0; i < islands.n && !wrong; i++) {
    ms_unknowns rows;
    ms_springs springs;
    ms_half_edges h;
    const ms_island island = ms_islands_get(&islands, i);
    if (ms_layout_create(s, &island, &rows, &springs, &h, NULL)) return "memory";
    for (int32_t r = 0; r < rows.nfree; r++) {
      const int32_t own = row_of[rows.particle[r]];
      if (own < 0 || own >= b->rows.nfree) continue;
      const int32_t n = list_row(&h, &springs, r, there);
      if (list_row(&b->half_edges, &b->springs, own, here) != n) wrong = "other half-edges";
      else if (memcmp(here, there, 4 * (size_t)n) != 0) wrong = "another order of half-edges";
      if (ms_half_edges_is_split(&h, r) != ms_half_edges_is_split(&b->half_edges, own))
        wrong = "another split";
    }
    if (!wrong) wrong = compare_corners(s, &island, &rows, row_of, b);
    ms_layout_destroy(s, &rows, &springs, &h);
  }
  ms_islands_destroy(s, &islands);
  free(here), free(there), free(row_of);
  return wrong;
}

static const char *check_refresh(const ms_scene *s, const built *b) {
  const ms_unknowns *rows = &b->rows;
  ms_halo *halo;
  double *x = ms_unknowns_new_vector(s, rows), *v = ms_unknowns_new_vector(s, rows);
  const char *wrong = NULL;
  if (!x || !v || ms_halo_create(s, rows, b->part, &halo, NULL)) return "no halo";
  for (int both = 0; both < 2; both++) {
    for (int32_t r = 0; r < 3 * rows->stride; r++) x[r] = v[r] = -1;
    for (int32_t r = 0; r < rows->nfree; r++)
      for (int32_t c = 0; c < 3; c++)
        x[c * rows->stride + r] = 3 * rows->particle[r] + c, v[c * rows->stride + r] = 0.5;
    ms_halo_refresh(halo, 3, rows->stride, x, both ? v : NULL);
    for (int32_t r = rows->nfree; r < rows->stride; r++)
      for (int32_t c = 0; c < 3; c++) {
        const int is_ghost = r >= rows->first_pinned && r < rows->first_fixed;
        const double expected = is_ghost ? 3 * rows->particle[r] + c : -1;
        if (x[c * rows->stride + r] != expected) wrong = "another x";
        if (v[c * rows->stride + r] != (is_ghost && both ? 0.5 : -1)) wrong = "another v";
      }
  }
  int64_t out = halo->first_out[halo->n];
  if (halo->bytes != 24 * out + 48 * out) wrong = "other bytes";
  ms_halo_destroy(s, halo);
  MS_FREE(&s->alloc, x, v);
  return wrong;
}

static const char *check_part(msim_comm *comm, void *data) {
  const ms_scene *s = data;
  built b;
  const char *wrong = build(s, comm, &b);
  if (!wrong) wrong = check_members(s, &b);
  if (!wrong) wrong = compare_rows(s, &b);
  if (!wrong) wrong = check_refresh(s, &b);
  destroy(s, &b);
  return wrong;
}

/* Two ropes with angular springs, which are separate islands: their angles are numbered in turn,
 * from the last to the first. */
static msim_scene *two_ropes(void) {
  const int32_t n = 600;
  const double mass = 0.01, k = 100;
  msim_scene *scene;
  assert_ok(msim_scene_create(NULL, &scene, err));
  for (int32_t i = 0; i < 2 * n; i++) {
    const double x[3] = {0.1 * (i % n), i / n, 0};
    assert_ok(msim_scene_add_particles(scene, 1, x, NULL, &mass, err));
    if (i % n == 0) continue;
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[]){i - 1, i}, &k, NULL, NULL, err));
  }
  for (int32_t a = 2 * (n - 2) - 1; a >= 0; a--) {
    const int32_t i = a / 2 + n * (a % 2), ijk[3] = {i, i + 1, i + 2};
    assert_ok(msim_scene_add_angles(scene, 1, ijk, &k, NULL, NULL, err));
  }
  return scene;
}

static void parts_are_those_of_loops_over_the_scene(void **state) {
  (void)state;
  msim_scene *scenes[] = {hanging_cloth(12, 100, 0),
                          pinned_block(8, 1, 100, 0),
                          random_mesh(600, 3, 0.1),
                          random_mesh(20, 4, 0),
                          folded_rope(5),
                          bending_cloth(12, 400, 0.01, 0.001),
                          bent_scene((chain){60, 100, 0.1, 0, 0}),
                          two_ropes()};
  for (size_t k = 0; k < sizeof scenes / sizeof *scenes; k++) {
    for (int32_t n = 1; n <= MOST_RANKS; n++) {
      const char *wrong = run_ranks(n, check_part, scenes[k]->data);
      if (wrong) fail_msg("scene %zu, %d ranks: %s", k, n, wrong);
    }
    msim_scene_destroy(scenes[k]);
  }
}

/*------------------------------------- the model of ghosts --------------------------------------*/

/* The largest number of ghosts of all parts */
static int32_t count_ghosts(const ms_scene *s, int32_t nranks) {
  int32_t *owner = malloc(4 * (size_t)s->nparticles), *scratch = malloc(4 * (size_t)s->nparticles),
          *seen_by = malloc(4 * (size_t)s->nparticles), most = 0;
  assert_true(owner && scratch && seen_by);
  ms_bisection_assign(s, nranks, owner, scratch);
  for (int32_t p = 0; p < s->nparticles; p++) seen_by[p] = -1;
  for (int32_t r = 0; r < nranks; r++) {
    int32_t n = 0;
    for (int32_t end = 0; end < 2 * s->nsprings; end++) {
      const int32_t p = s->ij[end], q = s->ij[end ^ 1];
      if (owner[q] != r || owner[p] < 0 || owner[p] == r || seen_by[p] == r) continue;
      seen_by[p] = r, n++;
    }
    if (n > most) most = n;
  }
  free(owner), free(scratch), free(seen_by);
  return most;
}

/* Springs of a cloth reach 2 particles along its lines and 1 along diagonals, those of a lattice 1
 * in all directions. A cut through lines of n particles has 2 n ghosts on either side, one through
 * layers n^2; a square of s^2 particles inside a cloth has 4 x 2 s + 4. */
static void ghosts_are_as_many_as_the_model_says(void **state) {
  (void)state;
  msim_scene *cloth = hanging_cloth(96, 100, 0), *jelly = pinned_block(20, 1, 100, 0);
  assert_int_equal(count_ghosts(cloth->data, 2), 2 * 96);
  assert_int_equal(count_ghosts(jelly->data, 2), 20 * 20 - 20); /* 20 in the cut are pinned */
  const double s = 96 / 8., model = 8 * s + 4;
  assert_true(fabs(count_ghosts(cloth->data, 64) - model) <= 0.09 * model);
  msim_scene_destroy(cloth);
  msim_scene_destroy(jelly);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bisection_is_that_of_a_sort),
      cmocka_unit_test(sections_begin_with_batches),
      cmocka_unit_test(parts_are_those_of_loops_over_the_scene),
      cmocka_unit_test(ghosts_are_as_many_as_the_model_says),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
