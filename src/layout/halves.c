#include "layout/halves.h"

/*------------------------------------- split rows -----------------------------------------------*/

/* Cost of the sums of a part, in entries. */
enum { PRICE_OF_SUMS = 2 };

static int32_t slots_of(int32_t degree) { return (degree + MS_GROUP - 1) / MS_GROUP; }

/* Rows of a slice, by descending number of springs. Returns their number. */
static int32_t by_degree(const ms_adjacency *a, int32_t nfree, int32_t group,
                         int32_t row[MS_GROUP]) {
  int32_t n = 0;
  for (int32_t r = group * MS_GROUP; n < MS_GROUP && r < nfree; r++, n++) {
    int32_t to = n;
    for (; to > 0 && ms_degree(a, row[to - 1]) < ms_degree(a, r); to--) row[to] = row[to - 1];
    row[to] = r;
  }
  return n;
}

/* How many of the first rows to split: this minimizes the entries and sums of split rows plus the
 * entries of the longest other row. */
static int32_t count_long(const ms_adjacency *a, const int32_t row[MS_GROUP], int32_t n) {
  int32_t best = 0, nlong = 0, spent = 0;
  for (int32_t k = 0; k <= n; k++) {
    const int32_t degree = k < n ? ms_degree(a, row[k]) : 0;
    if (k == 0 || spent + degree < best) best = spent + degree, nlong = k;
    spent += slots_of(degree) + PRICE_OF_SUMS;
  }
  return nlong;
}

/* Marks split rows by part = 0 and counts their parts. */
static void find_long(const ms_adjacency *a, int32_t nfree, ms_halves *out) {
  for (int32_t g = 0; g < out->ngroups; g++) {
    int32_t row[MS_GROUP];
    const int32_t nlong = count_long(a, row, by_degree(a, nfree, g, row));
    for (int32_t r = g * MS_GROUP; r < (g + 1) * MS_GROUP; r++) out->part[r] = -1;
    for (int32_t i = 0; i < nlong; i++) {
      out->part[row[i]] = 0;
      out->nparts += (slots_of(ms_degree(a, row[i])) + MS_PART - 1) / MS_PART;
    }
  }
}

static void number_parts(const ms_adjacency *a, ms_halves *out) {
  int32_t p = 0;
  for (int32_t r = 0; r < out->ngroups * MS_GROUP; r++) {
    if (out->part[r] < 0) continue;
    out->part[r] = p;
    for (int32_t slots = slots_of(ms_degree(a, r)); slots > 0; slots -= MS_PART)
      out->part_row[p++] = r;
  }
}

/*------------------------------------- one slice ------------------------------------------------*/

/* The half-edges of each lane of a slice that are still to be placed. */
typedef struct heads {
  const ms_half *next[MS_GROUP], *end[MS_GROUP];
  int32_t row; /* of lane 0 */
} heads;

static heads begin(const ms_adjacency *a, const ms_halves *halves, int32_t nfree, int32_t group) {
  heads h = {.row = group * MS_GROUP};
  for (int32_t lane = 0; lane < MS_GROUP && h.row + lane < nfree; lane++) {
    if (halves->part[h.row + lane] >= 0) continue;
    h.next[lane] = a->halves + a->first[h.row + lane];
    h.end[lane] = a->halves + a->first[h.row + lane + 1];
  }
  return h;
}

/* The least offset, neighbour - row, of the lanes' next half-edges; 0: all are placed. */
static int32_t least_offset(const heads *h) {
  int32_t least = INT32_MAX, any = 0;
  for (int32_t lane = 0; lane < MS_GROUP; lane++) {
    if (h->next[lane] == h->end[lane]) continue;
    const int32_t offset = h->next[lane]->neighbour - (h->row + lane);
    if (offset < least) least = offset;
    any = 1;
  }
  return any ? least : 0;
}

/* Entries of equal offset leave lanes empty where the mesh is irregular. Returns 1 if they are at
 * most 1.5 times as many as the longest row needs. */
static int by_offset(heads h) {
  ptrdiff_t longest = 0, slots = 0;
  for (int32_t lane = 0; lane < MS_GROUP; lane++)
    if (h.end[lane] - h.next[lane] > longest) longest = h.end[lane] - h.next[lane];
  for (int32_t offset; (offset = least_offset(&h)) != 0; slots++)
    for (int32_t lane = 0; lane < MS_GROUP; lane++)
      if (h.next[lane] != h.end[lane] && h.next[lane]->neighbour == h.row + lane + offset)
        h.next[lane]++;
  return 2 * slots <= 3 * longest;
}

/* Take the half-edges of the next entry from h; NULL in empty lanes. */
static void take_slot(heads *h, int aligned, const ms_half *slot[MS_GROUP]) {
  const int32_t offset = least_offset(h);
  for (int32_t lane = 0; lane < MS_GROUP; lane++) {
    const int takes = h->next[lane] != h->end[lane] &&
                      (!aligned || h->next[lane]->neighbour == h->row + lane + offset);
    slot[lane] = takes ? h->next[lane]++ : NULL;
  }
}

/*------------------------------------- all slice ranges -----------------------------------------*/

static int32_t count_slots(heads h) {
  const int aligned = by_offset(h);
  const ms_half *slot[MS_GROUP];
  int32_t n = 0;
  for (; least_offset(&h) != 0; n++) take_slot(&h, aligned, slot);
  return n;
}

/* The row at lane 0 if the neighbours are consecutive rows, empty lanes included; else -1. */
static int32_t run_of(const ms_rows *rows, const ms_half *const slot[MS_GROUP]) {
  int32_t start = -1;
  for (int32_t lane = 0; lane < MS_GROUP; lane++) {
    if (!slot[lane]) continue;
    const int32_t here = slot[lane]->neighbour - lane;
    if (here < 0 || here + MS_GROUP > rows->stride || (start >= 0 && here != start)) return -1;
    start = here;
  }
  return start;
}

/* Padding refers to an existing row: the one that continues the run, or else `row`. */
static void write_slot(const ms_rows *rows, int32_t row, const ms_half *const slot[MS_GROUP],
                       int32_t s, ms_halves *out) {
  out->start[s] = run_of(rows, slot);
  for (int32_t lane = 0; lane < MS_GROUP; lane++) {
    const int32_t any = out->start[s] >= 0 ? out->start[s] + lane : row;
    out->neighbour[MS_GROUP * s + lane] = slot[lane] ? slot[lane]->neighbour : any;
    out->spring[MS_GROUP * s + lane] = slot[lane] ? slot[lane]->spring : -1;
  }
}

static void fill_group(const ms_adjacency *a, const ms_rows *rows, int32_t group, ms_halves *out) {
  heads h = begin(a, out, rows->nfree, group);
  const int aligned = by_offset(h);
  const ms_half *slot[MS_GROUP];
  for (int32_t s = out->first[group]; s < out->first[group + 1]; s++) {
    take_slot(&h, aligned, slot);
    write_slot(rows, h.row, slot, s, out);
  }
}

static void fill_long(const ms_adjacency *a, const ms_rows *rows, int32_t row, ms_halves *out) {
  const ms_half *slot[MS_GROUP];
  int32_t s = out->first[out->ngroups + out->part[row]];
  for (int32_t e = a->first[row]; e < a->first[row + 1]; e += MS_GROUP) {
    for (int32_t lane = 0; lane < MS_GROUP; lane++)
      slot[lane] = e + lane < a->first[row + 1] ? a->halves + e + lane : NULL;
    write_slot(rows, row, slot, s++, out);
  }
}

/* Number the entries of each slice range. Returns their number; beyond the limit of INT32_MAX / 8,
 * a number above it. */
static int64_t divide(const ms_adjacency *a, const ms_rows *rows, ms_halves *out) {
  const int64_t most = INT32_MAX / MS_GROUP;
  int64_t slots = 0;
  int32_t *end = out->first + 1;
  for (int32_t g = 0; g < out->ngroups && slots <= most; g++) {
    slots += count_slots(begin(a, out, rows->nfree, g));
    *end++ = (int32_t)slots;
  }
  for (int32_t p = 0; p < out->nparts && slots <= most; p++) {
    const int32_t row = out->part_row[p];
    const int32_t left = slots_of(ms_degree(a, row)) - MS_PART * (p - out->part[row]);
    slots += left < MS_PART ? left : MS_PART;
    *end++ = (int32_t)slots;
  }
  return slots;
}

static msim_status make_segments(const ms_scene *scene, const ms_rows *rows, const ms_adjacency *a,
                                 ms_halves *out, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  out->part = ms_new(alloc, (size_t)rows->first_pinned, sizeof(int32_t));
  if (!out->part) return ms_fail_memory(err, "the springs of each row");
  find_long(a, rows->nfree, out);
  const size_t nparts = (size_t)out->nparts;
  out->part_row = ms_new(alloc, nparts, sizeof(int32_t));
  out->part_sums = ms_new(alloc, 6 * MS_GROUP * nparts, sizeof(double));
  out->first = ms_new(alloc, (size_t)out->ngroups + nparts + 1, sizeof(int32_t));
  if (!out->part_row || !out->part_sums || !out->first)
    return ms_fail_memory(err, "the springs of each row");
  number_parts(a, out);
  const int64_t slots = divide(a, rows, out);
  if (slots > INT32_MAX / MS_GROUP)
    return ms_fail(err, MSIM_ERR_ARG, "the springs need more than %d slots of %d lanes",
                   INT32_MAX / MS_GROUP, MS_GROUP);
  out->nslots = (int32_t)slots;
  return MSIM_OK;
}

static msim_status make_slots(const ms_scene *scene, const ms_rows *rows, const ms_adjacency *a,
                              ms_halves *out, msim_error *err) {
  const msim_allocator *alloc = &scene->alloc;
  const size_t slots = (size_t)out->nslots, lanes = MS_GROUP * slots;
  out->start = ms_new(alloc, slots, sizeof(int32_t));
  out->neighbour = ms_new(alloc, lanes, sizeof(int32_t));
  out->spring = ms_new(alloc, lanes, sizeof(int32_t));
  out->k = ms_new(alloc, lanes, sizeof(double));
  out->rest = ms_new(alloc, lanes, sizeof(double));
  out->damping = ms_new(alloc, lanes, sizeof(double));
  if (!out->start || !out->neighbour || !out->spring || !out->k || !out->rest || !out->damping)
    return ms_fail_memory(err, "the springs of each row");
  for (int32_t g = 0; g < out->ngroups; g++) fill_group(a, rows, g, out);
  for (int32_t r = 0; r < rows->nfree; r++)
    if (out->part[r] >= 0) fill_long(a, rows, r, out);
  return MSIM_OK;
}

void ms_halves_update(const ms_springs *springs, ms_halves *halves) {
  for (int32_t at = 0; at < MS_GROUP * halves->nslots; at++) {
    const int32_t e = halves->spring[at];
    if (e < 0) continue;
    halves->k[at] = springs->k[e];
    halves->rest[at] = springs->rest[e];
    halves->damping[at] = springs->damping[e];
  }
}

msim_status ms_halves_create(const ms_scene *scene, const ms_rows *rows, const ms_springs *springs,
                             const ms_adjacency *a, ms_halves *halves, msim_error *err) {
  *halves = (ms_halves){.ngroups = rows->first_pinned / MS_GROUP};
  msim_status status = make_segments(scene, rows, a, halves, err);
  if (!status) status = make_slots(scene, rows, a, halves, err);
  if (!status) ms_halves_update(springs, halves);
  return status;
}

void ms_halves_destroy(const ms_scene *scene, ms_halves *halves) {
  void *arrays[] = {halves->first, halves->part,      halves->part_row, halves->part_sums,
                    halves->start, halves->neighbour, halves->spring,   halves->k,
                    halves->rest,  halves->damping};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) ms_delete(&scene->alloc, arrays[i]);
  *halves = (ms_halves){0};
}

void ms_halves_add_parts(const ms_halves *halves, int32_t components, size_t stride, double *vec) {
  for (int32_t p = 0; p < halves->nparts; p++) {
    for (int32_t c = 0; c < components; c++) {
      const double *s =
          halves->part_sums + MS_GROUP * ((size_t)c * (size_t)halves->nparts + (size_t)p);
      vec[(size_t)c * stride + (size_t)halves->part_row[p]] +=
          ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
    }
  }
}
