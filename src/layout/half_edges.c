#include "layout/half_edges.h"

#include "base/vector.h"
#include "layout/spring_values.h"

/*------------------------------------- split rows -----------------------------------------------*/

/* Cost of the sums of a part, in entries. */
enum { COST_OF_SUMS = 2 };

static int32_t entries_for_degree(int32_t degree) { return (degree + MS_SLICE - 1) / MS_SLICE; }

/* Rows of a slice, by descending number of springs. Returns their number. */
static int32_t sort_rows_by_degree(const ms_adjacency *a, int32_t nfree, int32_t slice,
                                   int32_t row[MS_SLICE]) {
  int32_t n = 0;
  for (int32_t r = slice * MS_SLICE; n < MS_SLICE && r < nfree; r++, n++) {
    int32_t to = n;
    for (; to > 0 && ms_adjacency_degree(a, row[to - 1]) < ms_adjacency_degree(a, r); to--)
      row[to] = row[to - 1];
    row[to] = r;
  }
  return n;
}

/* How many of the first rows to split: this minimizes the entries and sums of split rows plus the
 * entries of the longest other row. */
static int32_t count_split_rows(const ms_adjacency *a, const int32_t row[MS_SLICE], int32_t n) {
  int32_t best = 0, nsplit = 0, spent = 0;
  for (int32_t k = 0; k <= n; k++) {
    const int32_t degree = k < n ? ms_adjacency_degree(a, row[k]) : 0;
    if (k == 0 || spent + degree < best) best = spent + degree, nsplit = k;
    spent += entries_for_degree(degree) + COST_OF_SUMS;
  }
  return nsplit;
}

void ms_half_edges_find_split_rows(const ms_adjacency *a, int32_t nfree, ms_half_edges *out) {
  for (int32_t g = 0; g < out->nslices; g++) {
    int32_t row[MS_SLICE];
    const int32_t n = sort_rows_by_degree(a, nfree, g, row), nsplit = count_split_rows(a, row, n);
    for (int32_t r = g * MS_SLICE; r < (g + 1) * MS_SLICE; r++) out->first_part[r] = -1;
    for (int32_t i = 0; i < n; i++) {
      if (a->is_split ? !a->is_split[row[i]] : i >= nsplit) continue;
      out->first_part[row[i]] = 0;
      out->nparts += (entries_for_degree(ms_adjacency_degree(a, row[i])) + MS_PART_ENTRIES - 1) /
                     MS_PART_ENTRIES;
    }
  }
}

static void number_parts(const ms_adjacency *a, ms_half_edges *out) {
  int32_t p = 0;
  for (int32_t r = 0; r < out->nslices * MS_SLICE; r++) {
    if (out->first_part[r] < 0) continue;
    out->first_part[r] = p;
    for (int32_t entries = entries_for_degree(ms_adjacency_degree(a, r)); entries > 0;
         entries -= MS_PART_ENTRIES)
      out->part_row[p++] = r;
  }
}

/*------------------------------------- one slice ------------------------------------------------*/

/* The half-edges of each lane of a slice that are still to be placed. */
typedef struct lane_cursors {
  const ms_half_edge *next[MS_SLICE], *end[MS_SLICE];
  int32_t row; /* of lane 0 */
} lane_cursors;

static lane_cursors begin_slice(const ms_adjacency *a, const ms_half_edges *half_edges,
                                int32_t nfree, int32_t slice) {
  lane_cursors h = {.row = slice * MS_SLICE};
  for (int32_t lane = 0; lane < MS_SLICE && h.row + lane < nfree; lane++) {
    if (ms_half_edges_is_split(half_edges, h.row + lane)) continue;
    h.next[lane] = a->half_edges + a->first[h.row + lane];
    h.end[lane] = a->half_edges + a->first[h.row + lane + 1];
  }
  return h;
}

/* The least offset, neighbour - row, of the lanes' next half-edges; 0: all are placed. */
static int32_t find_least_offset(const lane_cursors *h) {
  int32_t least = INT32_MAX, any = 0;
  for (int32_t lane = 0; lane < MS_SLICE; lane++) {
    if (h->next[lane] == h->end[lane]) continue;
    const int32_t offset = h->next[lane]->neighbour - (h->row + lane);
    if (offset < least) least = offset;
    any = 1;
  }
  return any ? least : 0;
}

/* Entries of equal offset leave lanes empty where the mesh is irregular. Returns 1 if they are at
 * most 1.5 times as many as the longest row needs. */
static int is_offset_order_worthwhile(lane_cursors h) {
  ptrdiff_t longest = 0, entries = 0;
  for (int32_t lane = 0; lane < MS_SLICE; lane++)
    if (h.end[lane] - h.next[lane] > longest) longest = h.end[lane] - h.next[lane];
  for (int32_t offset; (offset = find_least_offset(&h)) != 0; entries++)
    for (int32_t lane = 0; lane < MS_SLICE; lane++)
      if (h.next[lane] != h.end[lane] && h.next[lane]->neighbour == h.row + lane + offset)
        h.next[lane]++;
  return 2 * entries <= 3 * longest;
}

/* Take the half-edges of the next entry from h; NULL in empty lanes. */
static void take_entry(lane_cursors *h, int aligned, const ms_half_edge *entry[MS_SLICE]) {
  const int32_t offset = find_least_offset(h);
  for (int32_t lane = 0; lane < MS_SLICE; lane++) {
    const int takes = h->next[lane] != h->end[lane] &&
                      (!aligned || h->next[lane]->neighbour == h->row + lane + offset);
    entry[lane] = takes ? h->next[lane]++ : NULL;
  }
}

/*------------------------------------- all slice ranges -----------------------------------------*/

/* The row at lane 0 if the neighbours are consecutive rows, empty lanes included; else -1. */
static int32_t find_run_start(const ms_unknowns *rows, const ms_half_edge *const entry[MS_SLICE]) {
  int32_t start = -1;
  for (int32_t lane = 0; lane < MS_SLICE; lane++) {
    if (!entry[lane]) continue;
    const int32_t here = entry[lane]->neighbour - lane;
    if (here < 0 || here + MS_SLICE > rows->stride || (start >= 0 && here != start)) return -1;
    start = here;
  }
  return start;
}

/* Returns the entries of a slice, and adds those whose neighbours are scattered to *scattered. */
static int32_t count_slice_entries(const ms_unknowns *rows, lane_cursors h, int32_t *scattered) {
  const int aligned = is_offset_order_worthwhile(h);
  const ms_half_edge *entry[MS_SLICE];
  int32_t n = 0;
  for (; find_least_offset(&h) != 0; n++) {
    take_entry(&h, aligned, entry);
    *scattered += find_run_start(rows, entry) < 0;
  }
  return n;
}

/* Padding refers to an existing row: the one that continues the run, or else `row`. */
static void write_lanes(const ms_unknowns *rows, int32_t row,
                        const ms_half_edge *const entry[MS_SLICE], int32_t s, ms_half_edges *out) {
  const int32_t start = find_run_start(rows, entry);
  out->entry[s].start = start >= 0 ? start : ~out->nscattered++;
  for (int32_t lane = 0; lane < MS_SLICE; lane++) {
    if (start < 0)
      out->scattered[MS_SLICE * (out->nscattered - 1) + lane] =
          entry[lane] ? entry[lane]->neighbour : row;
    out->spring[MS_SLICE * s + lane] = entry[lane] ? entry[lane]->spring : -1;
  }
}

static void fill_slice(const ms_adjacency *a, const ms_unknowns *rows, int32_t slice,
                       ms_half_edges *out) {
  lane_cursors h = begin_slice(a, out, rows->nfree, slice);
  const int aligned = is_offset_order_worthwhile(h);
  const ms_half_edge *entry[MS_SLICE];
  for (int32_t s = out->first[slice]; s < out->first[slice + 1]; s++) {
    take_entry(&h, aligned, entry);
    write_lanes(rows, h.row, entry, s, out);
  }
}

static void fill_split_row(const ms_adjacency *a, const ms_unknowns *rows, int32_t row,
                           ms_half_edges *out) {
  const ms_half_edge *entry[MS_SLICE];
  int32_t s = out->first[out->nslices + out->first_part[row]];
  for (int32_t e = a->first[row]; e < a->first[row + 1]; e += MS_SLICE) {
    for (int32_t lane = 0; lane < MS_SLICE; lane++)
      entry[lane] = e + lane < a->first[row + 1] ? a->half_edges + e + lane : NULL;
    write_lanes(rows, row, entry, s++, out);
  }
}

/* Number the entries of each slice range, and count those that may be scattered. Returns their
 * number; beyond the limit of INT32_MAX / 8, a number above it. */
static int64_t number_entries(const ms_adjacency *a, const ms_unknowns *rows, ms_half_edges *out) {
  const int64_t most = INT32_MAX / MS_SLICE;
  int64_t entries = 0;
  int32_t *end = out->first + 1;
  for (int32_t g = 0; g < out->nslices && entries <= most; g++) {
    entries += count_slice_entries(rows, begin_slice(a, out, rows->nfree, g), &out->nscattered);
    *end++ = (int32_t)entries;
  }
  for (int32_t p = 0; p < out->nparts && entries <= most; p++) {
    const int32_t row = out->part_row[p];
    const int32_t left = entries_for_degree(ms_adjacency_degree(a, row)) -
                         MS_PART_ENTRIES * (p - out->first_part[row]);
    entries += left < MS_PART_ENTRIES ? left : MS_PART_ENTRIES;
    *end++ = (int32_t)entries;
    out->nscattered += end[-1] - end[-2];
  }
  return entries;
}

static msim_status make_slice_ranges(const ms_scene *scene, const ms_unknowns *rows,
                                     const ms_adjacency *a, ms_half_edges *out, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  if (!MS_NEW(alloc, out->first_part, rows->first_pinned))
    return ms_error_set_memory(err, "the half-edges of the springs");
  ms_half_edges_find_split_rows(a, rows->nfree, out);
  const size_t nparts = (size_t)out->nparts;
  if (!MS_NEW(alloc, out->part_row, nparts) ||
      !MS_NEW(alloc, out->part_sums, 6 * MS_SLICE * nparts) ||
      !MS_NEW(alloc, out->first, (size_t)out->nslices + nparts + 1))
    return ms_error_set_memory(err, "the half-edges of the springs");
  number_parts(a, out);
  if (!nparts) {
    ms_memory_free(alloc, out->first_part);
    out->first_part = NULL;
  }
  const int64_t entries = number_entries(a, rows, out);
  if (entries > INT32_MAX / MS_SLICE)
    return ms_error_set(err, MSIM_ERR_ARG,
                        "the springs need more than %d entries of %d half-edges, the limit of "
                        "32-bit indices; reduce the number of springs",
                        INT32_MAX / MS_SLICE, MS_SLICE);
  out->nentries = (int32_t)entries;
  return MSIM_OK;
}

static msim_status make_entries(const ms_scene *scene, const ms_unknowns *rows,
                                const ms_adjacency *a, ms_half_edges *out, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t entries = (size_t)out->nentries;
  if (!MS_NEW(alloc, out->entry, entries) || !MS_NEW(alloc, out->spring, MS_SLICE * entries) ||
      !MS_NEW(alloc, out->scattered, MS_SLICE * (size_t)out->nscattered))
    return ms_error_set_memory(err, "the half-edges of the springs");
  out->nscattered = 0;
  for (int32_t g = 0; g < out->nslices; g++) fill_slice(a, rows, g, out);
  for (int32_t r = 0; r < rows->nfree; r++)
    if (ms_half_edges_is_split(out, r)) fill_split_row(a, rows, r, out);
  return MSIM_OK;
}

msim_status ms_half_edges_create(const ms_scene *scene, const ms_unknowns *rows,
                                 const ms_springs *springs, const ms_adjacency *a,
                                 ms_half_edges *half_edges, msim_error *err) {
  *half_edges = (ms_half_edges){.nslices = rows->first_pinned / MS_SLICE};
  msim_status status = make_slice_ranges(scene, rows, a, half_edges, err);
  if (!status) status = make_entries(scene, rows, a, half_edges, err);
  return status ? status : ms_spring_values_create(scene, springs, half_edges, err);
}

void ms_half_edges_destroy(const ms_scene *scene, ms_half_edges *half_edges) {
  ms_spring_values_destroy(scene, half_edges);
  MS_FREE(&scene->alloc, half_edges->first, half_edges->first_part, half_edges->part_row,
          half_edges->part_sums, half_edges->entry, half_edges->scattered, half_edges->spring);
  *half_edges = (ms_half_edges){0};
}

void ms_half_edges_add_part_sums(const ms_half_edges *half_edges, int32_t components, size_t stride,
                                 double *vec) {
  for (int32_t p = 0; p < half_edges->nparts; p++) {
    for (int32_t c = 0; c < components; c++) {
      const double *s =
          half_edges->part_sums + MS_SLICE * ((size_t)c * (size_t)half_edges->nparts + (size_t)p);
      vec[(size_t)c * stride + (size_t)half_edges->part_row[p]] += ms_vector_sum_lanes(s);
    }
  }
}
