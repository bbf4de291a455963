#include "record/strain.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "physics/law.h"
#include "physics/reference.h"

/*------------------------------------- springs of the faces -------------------------------------*/

/* Hash table of springs by their ends; entries hold the row of a spring in a section + 1, or 0. */
typedef struct spring_table {
  const ms_strain_section *section;
  int32_t *entries;
  size_t mask; /* number of entries - 1, which is a power of 2 less 1 */
} spring_table;

static const int32_t *get_ends(const ms_strain_section *section, int32_t row) {
  return section->scene->ij + 2 * (size_t)ms_section_spring(&section->numbers, row);
}

/* The entry of a spring between two particles, or the empty one where it belongs */
static int32_t *find_entry(const spring_table *t, int32_t a, int32_t b) {
  const uint32_t low = (uint32_t)(a < b ? a : b), high = (uint32_t)(a < b ? b : a);
  size_t i = (size_t)((((uint64_t)high << 32 | low) * 0x9e3779b97f4a7c15u) >> 20) & t->mask;
  for (; t->entries[i]; i = (i + 1) & t->mask) {
    const int32_t *ends = get_ends(t->section, t->entries[i] - 1);
    if ((ends[0] == a && ends[1] == b) || (ends[0] == b && ends[1] == a)) break;
  }
  return &t->entries[i];
}

/* The spring with the lowest number counts where several have the same ends. */
static void add_spring(spring_table *t, int32_t row) {
  const ms_section *section = &t->section->in_whole;
  const int32_t *ends = get_ends(t->section, row);
  int32_t *entry = find_entry(t, ends[0], ends[1]);
  if (!*entry || ms_section_spring(section, row) < ms_section_spring(section, *entry - 1))
    *entry = row + 1;
}

static int fill_table(spring_table *t, const msim_allocator *alloc) {
  const int32_t n = t->section->in_whole.nsprings + t->section->in_whole.nother_springs;
  size_t size = 1;
  while (size < 2 * (size_t)n + 1) size *= 2;
  t->mask = size - 1;
  if (!MS_NEW(alloc, t->entries, size)) return 0;
  for (int32_t row = 0; row < n; row++) add_spring(t, row);
  return 1;
}

static void find_edges(ms_strain *s, const spring_table *t) {
  const ms_strain_section *of = t->section;
  for (int64_t i = 0; i < of->in_whole.nfaces; i++) {
    const int32_t *corner = of->scene->faces + 3 * (of->numbers.first_face + i);
    for (int c = 0; c < 3; c++) {
      const int32_t row = *find_entry(t, corner[c], corner[(c + 1) % 3]) - 1;
      s->edge[3 * i + c] = row < 0 ? -1 : ms_section_spring(&of->in_whole, row);
    }
  }
}

static int has_pins(const ms_scene *scene) {
  for (int32_t p = 0; p < scene->nparticles; p++)
    if (scene->pinned[p]) return 1;
  return 0;
}

msim_status ms_strain_init(ms_strain *s, const ms_strain_section *section, int32_t nparticles,
                           int reactions, const msim_allocator *alloc, msim_error *err) {
  spring_table table = {.section = section};
  const size_t ncells = (size_t)ms_section_count_cells(&section->in_whole);
  const int has_reactions = reactions && has_pins(section->scene);
  *s = (ms_strain){.nparticles = (size_t)nparticles};
  if (!MS_NEW(alloc, s->edge, 3 * (size_t)section->in_whole.nfaces) ||
      !MS_NEW(alloc, s->strain, ncells) || !MS_NEW(alloc, s->tension, ncells) ||
      (has_reactions && !MS_NEW(alloc, s->reaction, 3 * s->nparticles)) ||
      (section->in_whole.nfaces > 0 && !fill_table(&table, alloc)))
    return ms_error_set_memory(err, "the strain of a frame");
  find_edges(s, &table);
  ms_memory_free(alloc, table.entries);
  return MSIM_OK;
}

void ms_strain_free(ms_strain *s, const msim_allocator *alloc) {
  MS_FREE(alloc, s->edge, s->strain, s->tension, s->exact, s->reaction);
  *s = (ms_strain){0};
}

/*------------------------------------- a frame --------------------------------------------------*/

static float to_float(double value) { return (float)fmax(fmin(value, FLT_MAX), -FLT_MAX); }

/* Strain and tension of one cell */
typedef struct cell {
  float strain, tension;
} cell;

/* row: of the section */
static cell compute_spring(const ms_strain_section *section, int32_t row) {
  const ms_scene *scene = section->scene;
  const int32_t e = ms_section_spring(&section->numbers, row);
  const int32_t *ij = scene->ij + 2 * (size_t)e;
  const double *a = section->x + 3 * ms_section_row(&section->numbers, ij[0]);
  const double *b = section->x + 3 * ms_section_row(&section->numbers, ij[1]);
  const double rest = scene->rest[e];
  const double length = ms_vec3_norm((double[]){b[0] - a[0], b[1] - a[1], b[2] - a[2]});
  return (cell){rest > 0 ? to_float((length - rest) / rest) : 0,
                to_float(ms_law_value_of(scene, e, length).force)};
}

/* Other springs are computed again. */
static cell get_spring(const ms_strain *s, const ms_strain_section *section, int32_t e) {
  const int32_t row = ms_section_spring_row(&section->in_whole, e);
  if (row >= section->in_whole.nsprings) return compute_spring(section, row);
  return (cell){s->strain[row], s->tension[row]};
}

static cell compute_face(const ms_strain *s, const ms_strain_section *section,
                         const int32_t edge[3]) {
  double strain = 0, tension = 0;
  int count = 0;
  for (int c = 0; c < 3; c++) {
    if (edge[c] < 0) continue;
    const cell side = get_spring(s, section, edge[c]);
    strain += (double)side.strain, tension += (double)side.tension;
    count++;
  }
  return count ? (cell){(float)(strain / count), (float)(tension / count)} : (cell){0, 0};
}

/* ... after all springs */
static void compute_cells(ms_strain *s, const ms_strain_section *section) {
  const int32_t n = section->in_whole.nsprings;
  for (int64_t k = 0; k < ms_section_count_cells(&section->in_whole); k++) {
    const cell it = k < n ? compute_spring(section, (int32_t)k)
                          : compute_face(s, section, s->edge + 3 * (k - n));
    s->strain[k] = it.strain, s->tension[k] = it.tension;
  }
}

static msim_status reserve_exact(ms_strain *s, size_t rows, const msim_allocator *alloc,
                                 msim_error *err) {
  if (rows <= s->rows) return MSIM_OK;
  ms_memory_free(alloc, s->exact);
  s->rows = 0;
  if (!MS_NEW(alloc, s->exact, 3 * rows)) return ms_error_set_memory(err, "the reactions");
  s->rows = rows;
  return MSIM_OK;
}

static void compute_reactions(ms_strain *s, const ms_strain_section *section, size_t rows) {
  const ms_scene *scene = section->scene;
  ms_reference_compute_reactions(scene, &section->numbers, section->x, section->v, s->exact);
  memset(s->reaction, 0, 3 * s->nparticles * sizeof *s->reaction);
  for (size_t i = 0; i < rows; i++) {
    if (!scene->pinned[ms_section_particle(&section->numbers, i)]) continue;
    float *to = s->reaction + 3 * (size_t)ms_section_particle(&section->in_whole, i);
    for (size_t c = 0; c < 3; c++) to[c] = to_float(s->exact[3 * i + c]);
  }
}

msim_status ms_strain_compute(ms_strain *s, const ms_strain_section *section,
                              const msim_allocator *alloc, msim_error *err) {
  const size_t rows = (size_t)section->in_whole.n + (size_t)section->in_whole.nothers;
  compute_cells(s, section);
  if (!s->reaction) return MSIM_OK;
  const msim_status status = reserve_exact(s, rows, alloc, err);
  if (!status) compute_reactions(s, section, rows);
  return status;
}
