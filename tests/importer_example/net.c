/* net - an importer of msim for a small text format of particles and springs
 *
 * An example to start an importer plugin from. It needs only the headers of msim: a plugin does not
 * link to libmsim. Each line is one of these; # begins a comment:
 *
 *     gravity X Y Z
 *     particle X Y Z MASS
 *     pinned I              particles count from 0
 *     spring I J K REST */
#define _POSIX_C_SOURCE 200809L /* newlocale */
#include <errno.h>
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <msim/importer.h>

enum { GRAVITY, PARTICLE, PINNED, SPRING, NWORDS, BLANK, DEFECTIVE, LONGEST_LINE = 256 };
static const struct {
  const char *word, *form;
} lines[NWORDS] = {[GRAVITY] = {"gravity", "XXX"}, /* X: a number */
                   [PARTICLE] = {"particle", "XXXX"},
                   [PINNED] = {"pinned", "I"}, /* I: an index */
                   [SPRING] = {"spring", "IIXX"}};

/*------------------------------------- reading --------------------------------------------------*/

/* What kind of line it is, and its numbers. */
static int parse_line(const char *line, double numbers[4]) {
  char word[16] = "", *end;
  int length = 0, kind = 0;
  if (sscanf(line, " %15[^# \t\r\n]%n", word, &length) < 1) return BLANK;
  while (kind < NWORDS && strcmp(word, lines[kind].word) != 0) kind++;
  if (kind == NWORDS) return DEFECTIVE;
  line += length;
  for (const char *form = lines[kind].form; *form; form++, numbers++, line = end) {
    *numbers = strtod(line, &end);
    const int is_index = *numbers >= 0 && *numbers <= 0x7fffffff && *numbers == (int)*numbers;
    if (end == line || (*form == 'I' && !is_index)) return DEFECTIVE;
  }
  line += strspn(line, " \t\r\n");
  return *line && *line != '#' ? DEFECTIVE : kind;
}

/* Memory of the host for the values of the scene; NULL where there are none. */
typedef struct arrays {
  double *gravity, *x, *mass, *k, *rest;
  int64_t *pinned, *ij;
} arrays;

/* Append the numbers of the line number `at` of its kind. */
static void store(const arrays *to, int kind, int64_t at, const double *numbers) {
  if (kind == GRAVITY) memcpy(to->gravity, numbers, 3 * sizeof *numbers);
  if (kind == PARTICLE) memcpy(to->x + 3 * at, numbers, 3 * sizeof *numbers);
  if (kind == PARTICLE) to->mass[at] = numbers[3];
  if (kind == PINNED) to->pinned[at] = (int64_t)numbers[0];
  if (kind != SPRING) return;
  to->ij[2 * at] = (int64_t)numbers[0], to->ij[2 * at + 1] = (int64_t)numbers[1];
  to->k[at] = numbers[2], to->rest[at] = numbers[3];
}

/* Count the lines of each kind, and store those below the `counts` of an earlier reading, unless
 * `to` is NULL. A message does not name the file: the host does. */
static msim_status read_lines(const msim_host *host, FILE *file, const arrays *to,
                              int64_t counts[NWORDS]) {
  char line[LONGEST_LINE];
  double numbers[4];
  int64_t read[NWORDS] = {0};
  rewind(file);
  for (long row = 1; fgets(line, sizeof line, file); row++) {
    const int kind = strlen(line) < sizeof line - 1 ? parse_line(line, numbers) : DEFECTIVE;
    if (kind == DEFECTIVE) {
      host->fail(host,
                 "line %ld is none of `gravity X Y Z`, `particle X Y Z MASS`, `pinned I` and "
                 "`spring I J K REST`",
                 row);
      return MSIM_ERR_ARG;
    }
    if (kind == BLANK) continue;
    if (to && read[kind] < counts[kind]) store(to, kind, read[kind], numbers);
    read[kind]++;
  }
  if (!to) memcpy(counts, read, sizeof read);
  return MSIM_OK;
}

/* Announce a node, and get the memory for its values. A node without rows is left out. */
static msim_status add(const msim_tree *tree, const char *path, int32_t kind, int32_t rank,
                       int64_t rows, int64_t width, void *room) {
  void *memory = NULL;
  const msim_node node = {
      .size = sizeof node, .path = path, .kind = kind, .rank = rank, .dims = {rows, width}};
  const msim_status status = rows > 0 ? tree->add(tree, &node, &memory) : MSIM_OK;
  if (room) memcpy(room, &memory, sizeof memory);
  return status;
}

/* Groups come before what they contain. The host checks all values, so this does not. */
static msim_status add_all(const msim_tree *tree, const int64_t counts[NWORDS], arrays *to) {
  const int64_t n = counts[PARTICLE], m = counts[SPRING];
  int64_t *version;
  msim_status status = add(tree, "msim", MSIM_NODE_WHOLE, 0, 1, 1, &version);
  if (!status) *version = 1;
  if (!status && counts[GRAVITY])
    status = add(tree, "gravity", MSIM_NODE_REAL, 1, 3, 1, &to->gravity);
  if (!status) status = add(tree, "particles", MSIM_NODE_GROUP, 0, n, 1, NULL);
  if (!status) status = add(tree, "particles/x", MSIM_NODE_REAL, 2, n, 3, &to->x);
  if (!status) status = add(tree, "particles/mass", MSIM_NODE_REAL, 1, n, 1, &to->mass);
  if (!status)
    status = add(tree, "particles/pinned", MSIM_NODE_WHOLE, 1, counts[PINNED], 1, &to->pinned);
  if (!status) status = add(tree, "springs", MSIM_NODE_GROUP, 0, m, 1, NULL);
  if (!status) status = add(tree, "springs/ij", MSIM_NODE_WHOLE, 2, m, 2, &to->ij);
  if (!status) status = add(tree, "springs/k", MSIM_NODE_REAL, 1, m, 1, &to->k);
  if (!status) status = add(tree, "springs/rest", MSIM_NODE_REAL, 1, m, 1, &to->rest);
  return status;
}

/*------------------------------------- writing --------------------------------------------------*/

static const msim_node *find_node(int32_t n, const msim_node *nodes, const char *path) {
  for (int32_t i = 0; i < n; i++)
    if (strcmp(nodes[i].path, path) == 0) return &nodes[i];
  return NULL;
}

/* A node of rank 0 is one number for all. */
static double value(const msim_node *node, int64_t i) {
  if (node->rank == 0) i = 0;
  return node->kind == MSIM_NODE_WHOLE ? (double)((const int64_t *)node->data)[i]
                                       : ((const double *)node->data)[i];
}

/* 1: the motion depends on this node, and the format has no line for it. Name and faces are left
 * out. */
static int is_lost(const msim_node *node) {
  static const char *const kept[] = {
      "msim",       "name",      "gravity",          "particles/x",  "particles/mass",
      "springs/ij", "springs/k", "particles/pinned", "springs/rest", "faces"};
  if (strcmp(node->path, "drag") == 0) return value(node, 0) != 0;
  for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
    if (strcmp(node->path, kept[i]) == 0) return 0;
  return 1;
}

/* 17 digits give the same bits when they are read again. */
static void write_lines(FILE *file, int32_t n, const msim_node *nodes) {
  const msim_node *gravity = find_node(n, nodes, "gravity"),
                  *x = find_node(n, nodes, "particles/x"),
                  *mass = find_node(n, nodes, "particles/mass"),
                  *pinned = find_node(n, nodes, "particles/pinned"),
                  *ij = find_node(n, nodes, "springs/ij"), *k = find_node(n, nodes, "springs/k"),
                  *rest = find_node(n, nodes, "springs/rest");
  if (gravity)
    fprintf(file, "gravity %.17g %.17g %.17g\n", value(gravity, 0), value(gravity, 1),
            value(gravity, 2));
  for (int64_t i = 0; x && mass && i < x->dims[0]; i++)
    fprintf(file, "particle %.17g %.17g %.17g %.17g\n", value(x, 3 * i), value(x, 3 * i + 1),
            value(x, 3 * i + 2), value(mass, i));
  for (int64_t i = 0; pinned && i < pinned->dims[0]; i++)
    fprintf(file, "pinned %.17g\n", value(pinned, i));
  for (int64_t i = 0; ij && k && rest && i < ij->dims[0]; i++)
    fprintf(file, "spring %.17g %.17g %.17g %.17g\n", value(ij, 2 * i), value(ij, 2 * i + 1),
            value(k, i), value(rest, i));
}

/*------------------------------------- the importer ---------------------------------------------*/

/* An error is a status < 0 with a message for the user. */
static msim_status fail_io(const msim_host *host, const char *what) {
  host->fail(host, "cannot be %s: %s", what, strerror(errno));
  return MSIM_ERR_IO;
}

/* Numbers have a decimal point, whatever the locale of the program. */
static locale_t enter_c_locale(locale_t *before) {
  const locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  *before = uselocale(c);
  return c;
}

static void leave_c_locale(locale_t c, locale_t before) {
  uselocale(before);
  if (c) freelocale(c);
}

/* The host allocates the arrays of a scene once it knows their sizes, so the file is read twice. */
static msim_status load(const msim_host *host, const char *path, const msim_tree *tree) {
  int64_t counts[NWORDS];
  arrays to = {NULL};
  locale_t before;
  FILE *file = fopen(path, "r");
  if (!file) return fail_io(host, "read");
  const locale_t c = enter_c_locale(&before);
  msim_status status = read_lines(host, file, NULL, counts);
  if (!status) status = add_all(tree, counts, &to);
  if (!status) status = read_lines(host, file, &to, counts);
  if (!status && ferror(file)) status = fail_io(host, "read");
  leave_c_locale(c, before);
  fclose(file);
  return status;
}

static msim_status save(const msim_host *host, const char *path, int32_t n,
                        const msim_node *nodes) {
  locale_t before;
  for (int32_t i = 0; i < n; i++)
    if (is_lost(&nodes[i])) {
      host->fail(host, "the format has no %s; save the scene as *.json", nodes[i].path);
      return MSIM_ERR_UNSUPPORTED;
    }
  FILE *file = fopen(path, "w");
  if (!file) return fail_io(host, "written");
  const locale_t c = enter_c_locale(&before);
  write_lines(file, n, nodes);
  leave_c_locale(c, before);
  const int failed = ferror(file);
  return fclose(file) != 0 || failed ? fail_io(host, "written") : MSIM_OK;
}

/* The only symbol that the plugin exports. `name` is the extension without its dot. */
MSIM_IMPORTER_ENTRY(net) {
  static const msim_importer table = {.abi = MSIM_IMPORTER_ABI,
                                      .size = sizeof table,
                                      .name = "net",
                                      .extension = ".net",
                                      .library = "none",
                                      .license = "MIT",
                                      .load = load,
                                      .save = save};
  return &table;
}
