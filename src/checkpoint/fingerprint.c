#include "checkpoint/fingerprint.h"

#include <stdio.h>
#include <string.h>

#include "base/isa.h"
#include "methods/methods.h"
#include "scene/laws.h"
#include "sim/rank_scene.h"

/*------------------------------------- the scene ------------------------------------------------*/

typedef struct array {
  const char *name;
  const void *data;
  size_t bytes;
} array;

/* The scene before its first edit; checkpoints contain the edited one */
static const ms_scene *unedited_scene(const msim_sim *sim) {
  return sim->edited_from ? sim->edited_from : sim->scene;
}

/* The scene with the forces and pins that the sim was made with; checkpoints contain later ones */
static const ms_scene *created_scene(const msim_sim *sim) {
  return sim->created_from ? sim->created_from : unedited_scene(sim);
}

static void list_arrays(const ms_scene *s, const ms_scene *created, array arrays[MS_SCENE_HASHES]) {
  const size_t n = (size_t)s->nparticles, m = (size_t)s->nsprings, real = sizeof(double);
  const double *force = created->force;
  const array list[MS_SCENE_HASHES] = {{"particles.x", created->x, 3 * n * real},
                                       {"particles.v", created->v, 3 * n * real},
                                       {"particles.mass", s->mass, n * real},
                                       {"particles.pinned", created->pinned, n},
                                       {"springs.ij", s->ij, 2 * m * sizeof *s->ij},
                                       {"springs.k", s->k, m * real},
                                       {"springs.rest", s->rest, m * real},
                                       {"springs.damping", s->damping, m * real},
                                       {"particles.force", force, force ? 3 * n * real : 0}};
  memcpy(arrays, list, sizeof list);
}

/* The hash of an array that is passed on in pieces of any length */
typedef struct hash_state {
  uint64_t hash;
  size_t n; /* bytes of the last word, which is not complete */
  unsigned char last[8];
} hash_state;

static void add_piece(hash_state *s, const void *data, size_t size) {
  const unsigned char *at = data, *end = at + size;
  while (s->n && s->n < sizeof s->last && at < end) s->last[s->n++] = *at++;
  if (s->n == sizeof s->last) s->hash = ms_archive_hash_words(s->hash, s->last, s->n), s->n = 0;
  const size_t left = (size_t)(end - at), rest = left % sizeof s->last;
  if (s->n || left == 0) return;
  s->hash = ms_archive_hash_words(s->hash, at, left);
  memcpy(s->last, end - rest, rest);
  s->n = rest;
}

/* Of slices the hashes pass from rank to rank. */
static void hash_slices(msim_sim *sim) {
  const ms_rank_scene *kept = sim->kept;
  const ms_scene counts = {
      .nparticles = kept->nparticles, .nsprings = kept->nsprings, .force = kept->slice->force};
  array mine[MS_SCENE_HASHES], whole[MS_SCENE_HASHES];
  hash_state states[MS_SCENE_HASHES] = {{0}};
  list_arrays(kept->slice, kept->slice, mine);
  list_arrays(&counts, &counts, whole);
  for (int i = 0; i < MS_SCENE_HASHES; i++)
    states[i].hash = ms_archive_hash_begin(0, whole[i].bytes);
  for (int32_t r = 0; r < sim->ranks->n; r++) {
    for (int i = 0; i < MS_SCENE_HASHES && r == sim->ranks->rank; i++)
      add_piece(&states[i], mine[i].data, mine[i].bytes);
    ms_ranks_broadcast(sim->ranks, r, sizeof states, states);
  }
  for (int i = 0; i < MS_SCENE_HASHES && !sim->ranks->failed; i++)
    sim->scene_hashes[i] = ms_archive_hash_last(states[i].hash, states[i].last, states[i].n);
  sim->scene_is_hashed = 1;
}

void ms_fingerprint_hash_scene(msim_sim *sim) {
  array arrays[MS_SCENE_HASHES];
  if (sim->scene_is_hashed) return;
  if (sim->kept) {
    hash_slices(sim);
    return;
  }
  list_arrays(unedited_scene(sim), created_scene(sim), arrays);
  for (int i = 0; i < MS_SCENE_HASHES; i++)
    sim->scene_hashes[i] = ms_archive_hash(0, arrays[i].data, arrays[i].bytes);
  sim->scene_is_hashed = 1;
}

static void list_hash(ms_fingerprint_visitor *mark, void *data, const char *name, uint64_t hash) {
  char text[24];
  snprintf(text, sizeof text, "#%016llx", (unsigned long long)hash);
  mark(data, name, text, 1);
}

static void list_numbers(ms_fingerprint_visitor *mark, void *data, const char *name, int n,
                         const double *value) {
  char text[128] = "";
  size_t used = 0;
  for (int i = 0; i < n; i++)
    used += (size_t)snprintf(text + used, sizeof text - used, "%s%s", i ? " " : "",
                             ms_text_format_double(value[i]).text);
  mark(data, name, text, 0);
}

static void list_count(ms_fingerprint_visitor *mark, void *data, const char *name, int32_t count) {
  list_numbers(mark, data, name, 1, &(double){count});
}

static const char PLANES_CONSTRAIN[] = "planes_constrain";

static void list_planes(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  for (int32_t i = 0; i < s->nplanes; i++) {
    const msim_plane *p = &s->planes[i];
    const double numbers[] = {p->normal[0], p->normal[1],   p->normal[2],
                              p->offset,    p->restitution, p->friction};
    char name[32];
    snprintf(name, sizeof name, "planes[%d]", i);
    list_hash(mark, data, name, ms_archive_hash(0, numbers, sizeof numbers));
  }
  list_count(mark, data, PLANES_CONSTRAIN, s->nplanes && s->planes_constrain);
}

/* Laws by kind and numbers. Of a callback only the struct's numbers can be compared: the caller
 * supplies the same function again. */
static void list_laws(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  if (!s->law) return;
  for (int32_t i = 0; i < s->nlaws; i++) {
    const msim_law *law = &s->laws[i].given;
    const size_t bytes = (size_t)law->n * sizeof(double);
    const double numbers[] = {law->kind,          law->n,
                              law->half_width,    law->limit,
                              law->largest_slope, law->energy_depth,
                              law->break_strain,  law->break_force};
    uint64_t hash = ms_archive_hash(0, numbers, sizeof numbers);
    if (law->coefficients) hash = ms_archive_hash(hash, law->coefficients, bytes);
    if (law->stretch) hash = ms_archive_hash(hash, law->stretch, bytes);
    if (law->force) hash = ms_archive_hash(hash, law->force, bytes);
    char name[32];
    snprintf(name, sizeof name, "laws[%d]", i + 1);
    list_hash(mark, data, name, hash);
  }
  const size_t bytes = (size_t)s->nsprings * sizeof *s->law;
  list_hash(mark, data, "springs.law", ms_archive_hash(0, s->law, bytes));
}

static void list_angles(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  const ms_scene_angles *g = &s->angles;
  const size_t n = (size_t)g->n, real = sizeof(double);
  if (n == 0) return;
  uint64_t hash = ms_archive_hash(0, g->ijk, 3 * n * sizeof *g->ijk);
  hash = ms_archive_hash(ms_archive_hash(hash, g->k, n * real), g->rest, n * real);
  list_hash(mark, data, "angles", ms_archive_hash(hash, g->damping, n * real));
}

static void list_colliders(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  for (int32_t i = 0; i < s->ncolliders; i++) {
    char name[32];
    snprintf(name, sizeof name, "colliders[%d]", i);
    list_hash(mark, data, name, ms_colliders_hash(&s->colliders[i], 0));
  }
}

static void list_motions(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  for (int32_t i = 0; i < s->nmotions; i++) {
    const ms_motion *m = &s->motions[i];
    const size_t n = (size_t)m->n, nt = (size_t)m->nt, real = sizeof(double);
    char name[32];
    uint64_t hash = ms_archive_hash((uint64_t)m->interpolation, m->particles, n * sizeof(int32_t));
    hash = ms_archive_hash(ms_archive_hash(hash, m->t, nt * real), m->x, 3 * n * nt * real);
    snprintf(name, sizeof name, "motions[%d]", i);
    list_hash(mark, data, name, hash);
  }
}

static const char FUNCTION[] = "the force function", SELF_CONTACT[] = "self_contact";

/* Its name and flags, with the numbers that steps depend on */
static void list_function(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  const msim_force_function *f = &s->force_function;
  char text[160] = "";
  if (ms_scene_has_function(s))
    snprintf(text, sizeof text, "%s (flags %u, bounds %s N/m and %s N s/m%s)", f->name,
             (unsigned)f->flags, ms_text_format_double(f->largest_stiffness).text,
             ms_text_format_double(f->largest_damping).text, f->potential ? ", potential" : "");
  mark(data, FUNCTION, text, 0);
}

static void list_collider_motions(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  for (int32_t i = 0; i < s->ncolliders; i++) {
    const ms_collider_motion *m = &s->collider_motions[i];
    const size_t bytes = (size_t)m->x.nt * sizeof(double);
    char name[40];
    if (bytes == 0) continue;
    uint64_t hash = ms_archive_hash((uint64_t)m->x.interpolation, m->x.t, bytes);
    hash = ms_archive_hash(hash, m->x.x, 3 * bytes);
    if (m->rotation.nt) hash = ms_archive_hash(hash, m->rotation.x, 3 * bytes);
    snprintf(name, sizeof name, "colliders[%d].motion", i);
    list_hash(mark, data, name, hash);
  }
}

/* Only where there is self-contact the motion depends on faces. */
static void list_self_contact(const ms_scene *s, ms_fingerprint_visitor *mark, void *data) {
  const ms_scene_self_contact *of = &s->self_contact;
  list_numbers(mark, data, SELF_CONTACT, 2, (const double[]){of->thickness, of->friction});
  if (!ms_scene_has_self_contact(s)) return;
  const size_t bytes = 3 * (size_t)s->nfaces * sizeof *s->faces;
  list_hash(mark, data, "faces", ms_archive_hash(0, s->faces, bytes));
}

static void list_scene(const msim_sim *sim, ms_fingerprint_visitor *mark, void *data) {
  const ms_scene *s = unedited_scene(sim);
  array arrays[MS_SCENE_HASHES];
  list_arrays(s, created_scene(sim), arrays);
  list_count(mark, data, "the number of particles",
             sim->kept ? sim->kept->nparticles : s->nparticles);
  list_count(mark, data, "the number of springs", sim->kept ? sim->kept->nsprings : s->nsprings);
  list_count(mark, data, "the number of planes", s->nplanes);
  list_count(mark, data, "the number of colliders", s->ncolliders);
  for (int i = 0; i < MS_SCENE_HASHES; i++)
    list_hash(mark, data, arrays[i].name, sim->scene_hashes[i]);
  list_planes(s, mark, data);
  list_laws(s, mark, data);
  list_angles(s, mark, data);
  list_colliders(s, mark, data);
  list_count(mark, data, "the number of motions", created_scene(sim)->nmotions);
  list_motions(created_scene(sim), mark, data);
  list_function(s, mark, data);
  list_self_contact(s, mark, data);
  list_collider_motions(created_scene(sim), mark, data);
  for (int i = 0; i < MS_SCENE_PARAMETERS; i++) {
    const ms_scene_parameter *p = &ms_scene_parameters[i];
    list_numbers(mark, data, p->key.key, p->key.count,
                 ms_scene_get_parameter(created_scene(sim), p));
  }
}

/* The value that an entry without a line has; NULL: it has a line in every checkpoint. */
static const char *implied_value(const char *name) {
  if (strcmp(name, FUNCTION) == 0) return "";
  if (strcmp(name, SELF_CONTACT) == 0) return "0 0";
  if (strcmp(name, PLANES_CONSTRAIN) == 0) return "0";
  if (strcmp(name, "precision") == 0) return "double";
  return strcmp(name, "incomplete") == 0 ? "stop" : NULL;
}

int ms_fingerprint_is_implied(const char *name, const char *value) {
  const char *implied = implied_value(name);
  return implied && strcmp(implied, value) == 0;
}

/*------------------------------------- options --------------------------------------------------*/

/* 1: the option may differ between the parts of a run: no bit of a state depends on it. */
static int is_ignored(const char *name) {
  static const char *const names[] = {"steps",   "t_end",       "every", "fps",
                                      "threads", "plugin_path", "sync",  "contacts"};
  for (size_t i = 0; i < sizeof names / sizeof *names; i++)
    if (strcmp(names[i], name) == 0) return 1;
  return 0;
}

/* The options as the caller gave them, where `auto` or ranks have replaced some; of a named method,
 * precision = auto is double. */
static msim_options requested_options(const msim_sim *sim) {
  msim_options opt = sim->config.opt;
  opt.solver = sim->solver;
  if (ms_sim_selects(sim)) {
    opt.integrator = MS_AUTO, opt.tol = sim->config.choice.tol, opt.h = MSIM_H_AUTO;
    opt.collision = sim->config.choice.collision;
    opt.precision = sim->config.choice.precision;
  } else if (opt.precision == MSIM_PRECISION_AUTO) {
    opt.precision = MSIM_PRECISION_DOUBLE;
  }
  return opt;
}

static void list_options(const msim_sim *sim, ms_fingerprint_visitor *mark, void *data) {
  const msim_options opt = requested_options(sim);
  const msim_option_entry *entry;
  for (int32_t i = 0; (entry = msim_option_info(i)) != NULL; i++) {
    ms_number_text_buffer number;
    if (!is_ignored(entry->name))
      mark(data, entry->name, ms_options_format_value(&opt, i, &number), 0);
  }
}

void ms_fingerprint_list(const msim_sim *sim, ms_fingerprint_visitor *mark, void *data) {
  static const char *const kernels[] = {"baseline", "avx2", "avx512"};
  mark(data, "msim", msim_version(), 0);
  mark(data, "MSIM_ISA", kernels[sim->islands->model.isa], 0);
  list_scene(sim, mark, data);
  list_options(sim, mark, data);
}

/*------------------------------------- comparison -----------------------------------------------*/

/* The sim's fingerprint, compared with that of the checkpoint */
typedef struct comparison {
  const char *next, *end; /* lines not compared yet */
  msim_status status;
  msim_error *err;
} comparison;

/* The value in the next line, if that has this name: its beginning; *size: its length. Else the
 * implied value, or NULL. */
static const char *find_value(comparison *c, const char *name, size_t *size) {
  const size_t length = strlen(name);
  const char *line = c->next, *end = memchr(line, '\n', (size_t)(c->end - line));
  if (!end || (size_t)(end - line) <= length || memcmp(line, name, length) != 0 ||
      line[length] != '=') {
    const char *implied = implied_value(name);
    *size = implied ? strlen(implied) : 0;
    return implied;
  }
  *size = (size_t)(end - line) - length - 1;
  c->next = end + 1;
  return line + length + 1;
}

/* Up to the first difference both have the same names in the same order. */
static void compare_entry(void *data, const char *name, const char *value, int is_hash) {
  comparison *c = data;
  size_t size;
  if (c->status) return;
  const char *there = find_value(c, name, &size);
  if (!there) {
    c->status = ms_error_set(c->err, MSIM_ERR_ARG,
                             "the checkpoint has no entry for %s: it was made by another version "
                             "of msim or from another scene",
                             name);
    return;
  }
  if (size == strlen(value) && memcmp(there, value, size) == 0) return;
  if (is_hash)
    c->status = ms_error_set(c->err, MSIM_ERR_ARG, "%s differs from that in the checkpoint", name);
  else
    c->status = ms_error_set(c->err, MSIM_ERR_ARG, "%s is %s here and %.*s in the checkpoint", name,
                             *value ? value : "not given",
                             size ? (int)(size < 100 ? size : 100) : 9, size ? there : "not given");
}

msim_status ms_fingerprint_compare(const msim_sim *sim, const char *there, size_t size,
                                   msim_error *err) {
  comparison c = {.next = there, .end = there + size, .err = err};
  ms_fingerprint_list(sim, compare_entry, &c);
  return c.status;
}
