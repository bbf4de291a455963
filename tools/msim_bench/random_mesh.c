#include "random_mesh.h"

#include <stdio.h>
#include <stdlib.h>

enum { NEAREST = 5 };

/* Points are found through a grid of cells, with about one point in each. */
typedef struct mesh {
  int32_t side, n, nsprings;
  double *x, *mass;
  int32_t *first;  /* side^2 + 1: index in `inside` of the first point of each cell */
  int32_t *inside; /* n: points, sorted by cell */
  int32_t *near;   /* n lists of NEAREST points, -1: none */
  int32_t *ij;     /* 2 NEAREST n */
} mesh;

static uint64_t random_bits(uint64_t *state) {
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return *state >> 33;
}

static double uniform(uint64_t *state) { return (double)random_bits(state) / 2147483648.0; }

static int32_t cell_of(const mesh *m, int32_t p) {
  const int32_t column = (int32_t)(m->x[3 * p] * m->side),
                row = (int32_t)(m->x[3 * p + 1] * m->side);
  return row * m->side + column;
}

static void fill_cells(mesh *m) {
  const int32_t ncells = m->side * m->side;
  for (int32_t p = 0; p < m->n; p++) m->first[cell_of(m, p) + 1]++;
  for (int32_t c = 0; c < ncells; c++) m->first[c + 1] += m->first[c];
  for (int32_t p = m->n - 1; p >= 0; p--) m->inside[--m->first[cell_of(m, p) + 1]] = p;
  for (int32_t c = 0; c < ncells; c++) m->first[c] = m->first[c + 1];
  m->first[ncells] = m->n;
}

static double distance2(const mesh *m, int32_t p, int32_t q) {
  const double dx = m->x[3 * q] - m->x[3 * p], dy = m->x[3 * q + 1] - m->x[3 * p + 1];
  return dx * dx + dy * dy;
}

/* Inserts q into the list of the nearest points of p, if it is near enough. found: length of the
 * list; returns the new length. */
static int32_t insert_neighbour(const mesh *m, int32_t p, int32_t q, int32_t found) {
  int32_t *near = m->near + NEAREST * p, at = found < NEAREST ? found : NEAREST;
  while (at > 0 && distance2(m, p, near[at - 1]) > distance2(m, p, q)) {
    if (at < NEAREST) near[at] = near[at - 1];
    at--;
  }
  if (at < NEAREST) near[at] = q;
  return found < NEAREST ? found + 1 : NEAREST;
}

static void find_nearest(const mesh *m, int32_t p) {
  enum { REACH = 3 }; /* cells; these almost always hold five other points */
  const int32_t cell = cell_of(m, p), row = cell / m->side, column = cell % m->side;
  int32_t found = 0;
  for (int32_t i = 0; i < NEAREST; i++) m->near[NEAREST * p + i] = -1;
  for (int32_t r = row - REACH; r <= row + REACH; r++)
    for (int32_t c = column - REACH; c <= column + REACH; c++) {
      if (r < 0 || c < 0 || r >= m->side || c >= m->side) continue;
      const int32_t at = r * m->side + c;
      for (int32_t i = m->first[at]; i < m->first[at + 1]; i++)
        if (m->inside[i] != p) found = insert_neighbour(m, p, m->inside[i], found);
    }
}

static int has_neighbour(const mesh *m, int32_t p, int32_t q) {
  for (int32_t i = 0; i < NEAREST; i++)
    if (m->near[NEAREST * p + i] == q) return 1;
  return 0;
}

static void connect_nearest(mesh *m, uint64_t *seed) {
  for (int32_t p = 0; p < m->n; p++)
    for (int32_t i = 0; i < NEAREST; i++) {
      const int32_t q = m->near[NEAREST * p + i];
      if (q < 0 || (has_neighbour(m, q, p) && q < p)) continue;
      m->ij[2 * m->nsprings] = p;
      m->ij[2 * m->nsprings++ + 1] = q;
    }
  for (int32_t e = m->nsprings - 1; e > 0; e--) {
    const int32_t other = (int32_t)(random_bits(seed) % (uint64_t)(e + 1));
    for (int i = 0; i < 2; i++) {
      const int32_t kept = m->ij[2 * e + i];
      m->ij[2 * e + i] = m->ij[2 * other + i];
      m->ij[2 * other + i] = kept;
    }
  }
}

static void make_mesh(mesh *m) {
  uint64_t seed = 42;
  for (int32_t p = 0; p < m->n; p++) {
    for (int c = 0; c < 2; c++) m->x[3 * p + c] = uniform(&seed);
    m->mass[p] = 0.3 / m->n;
  }
  fill_cells(m);
  for (int32_t p = 0; p < m->n; p++) find_nearest(m, p);
  connect_nearest(m, &seed);
}

msim_status random_mesh_add(msim_scene *scene, int32_t side, double k, msim_error *err) {
  const size_t n = (size_t)side * (size_t)side;
  mesh m = {.side = side,
            .n = (int32_t)n,
            .x = calloc(3 * n, sizeof(double)),
            .mass = calloc(n, sizeof(double)),
            .first = calloc(n + 2, sizeof(int32_t)),
            .inside = calloc(n, sizeof(int32_t)),
            .near = calloc(NEAREST * n, sizeof(int32_t)),
            .ij = calloc(2 * NEAREST * n, sizeof(int32_t))};
  double *stiffness = calloc(NEAREST * n, sizeof(double));
  msim_status status = MSIM_ERR_MEMORY;
  if (m.x && m.mass && m.first && m.inside && m.near && m.ij && stiffness) {
    make_mesh(&m);
    for (int32_t e = 0; e < m.nsprings; e++) stiffness[e] = k;
    status = msim_scene_add_particles(scene, m.n, m.x, NULL, m.mass, err);
    if (!status)
      status = msim_scene_add_springs(scene, m.nsprings, m.ij, stiffness, NULL, NULL, err);
  } else {
    snprintf(err->text, sizeof err->text, "out of memory for a mesh");
  }
  void *arrays[] = {m.x, m.mass, m.first, m.inside, m.near, m.ij, stiffness};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
  return status;
}
