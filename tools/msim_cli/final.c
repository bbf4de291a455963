#include "final.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>

#include "../common/message.h"
#include "ranks.h"
#include "stats.h"

const char final_beginning[] = "{\"msim\": 1, \"status\": \"";

/*------------------------------------- writing --------------------------------------------------*/

/* Write and free the value; 17 digits, which give the same bits when read. Returns 0 on failure. */
static int put_value(FILE *stream, json_t *value) {
  int done = value && json_dumpf(value, stream, JSON_ENCODE_ANY | JSON_REAL_PRECISION(17)) == 0;
  json_decref(value);
  return done;
}

static int put_key(FILE *stream, const char *key, json_t *value) {
  return fprintf(stream, ",\n \"%s\": ", key) > 0 && put_value(stream, value);
}

static json_t *triple(const double *x) { return json_pack("[fff]", x[0], x[1], x[2]); }

/* One triple at a time: a tree of the whole array would need ten times its memory. */
static int put_triples(FILE *stream, const char *key, int32_t n, const double *x /* 3n */) {
  int done = fprintf(stream, ",\n \"%s\": [", key) > 0;
  for (int32_t i = 0; i < n && done; i++)
    done = fputs(i ? ",\n  " : "", stream) >= 0 && put_value(stream, triple(x + 3 * (size_t)i));
  return done && fputc(']', stream) != EOF;
}

/* NULL: out of memory. */
static json_t *stats_object(const msim_stats *stats) {
  json_t *object = json_object(), *seconds = json_object();
  const char *name;
  int64_t count;
  double s;
  int failed = 0;
  for (int i = 0; (name = stats_counter(stats, i, &count)) != NULL; i++)
    failed |= json_object_set_new(object, name, json_integer(count));
  for (int i = 0; (name = stats_phase(stats, i, &s)) != NULL; i++)
    failed |= json_object_set_new(seconds, name, json_real(s));
  failed |= json_object_set_new(object, "seconds", seconds);
  if (!failed) return object;
  json_decref(object);
  return NULL;
}

static json_t *energy_object(const msim_energy *energy) {
  json_t *object = json_pack("{sfsfsfsf}", "kinetic", energy->kinetic, "elastic", energy->elastic,
                             "gravitational", energy->gravitational, "total", energy->total);
  if (energy->work == 0 || !object) return object;
  if (json_object_set_new(object, "work", json_real(energy->work)) == 0) return object;
  json_decref(object);
  return NULL;
}

static const char *status_word(msim_status status) {
  switch (status) {
    case MSIM_NOT_SPD:
      return "not_spd";
    case MSIM_NOT_CONVERGED:
      return "not_converged";
    case MSIM_NOT_FINITE:
      return "not_finite";
    case MSIM_UNSTABLE:
      return "unstable";
    case MSIM_FORCE_FAILED:
      return "force_failed";
    case MSIM_STOPPED:
      return "stopped";
    default:
      return "ok";
  }
}

/* The indices of broken springs */
static int put_broken(FILE *stream, int32_t n, const uint8_t *broken) {
  int done = fprintf(stream, ",\n \"broken\": [") > 0, first = 1;
  for (int32_t e = 0; e < n && done; e++) {
    if (!broken[e]) continue;
    done = fprintf(stream, "%s%d", first ? "" : ", ", (int)e) > 0;
    first = 0;
  }
  return done && fputc(']', stream) != EOF;
}

typedef struct content {
  msim_status status;
  msim_state state;
  msim_energy energy;
  msim_stats stats;
  double *reactions; /* 3n; NULL: no particle is pinned */
  int32_t ncontacts; /* -1: contacts are not recorded */
  const msim_contact *contacts;
  msim_islands islands;
  uint8_t *broken; /* nsprings; NULL: no spring is broken */
} content;

static int put_contact(FILE *stream, const msim_contact *c) {
  const char *kind = c->plane >= 0 ? "plane" : "collider";
  return put_value(
      stream, json_pack("{sisiso?so?so?}", "particle", (int)c->particle, kind,
                        (int)(c->plane >= 0 ? c->plane : c->collider), "point", triple(c->point),
                        "normal", triple(c->normal), "impulse", triple(c->impulse)));
}

static int put_contacts(FILE *stream, const content *c) {
  if (c->ncontacts < 0) return 1;
  int done = fputs(",\n \"contacts\": [", stream) >= 0;
  for (int32_t i = 0; i < c->ncontacts && done; i++)
    done = fputs(i ? ",\n  " : "", stream) >= 0 && put_contact(stream, &c->contacts[i]);
  return done && fputc(']', stream) != EOF;
}

static int put_numbers(FILE *stream, const char *key, int32_t n, const double *values) {
  int done = fprintf(stream, ",\n  \"%s\": [", key) > 0;
  for (int32_t i = 0; i < n && done; i++)
    done = fprintf(stream, "%s%.17g", i ? ", " : "", values[i]) > 0;
  return done && fputc(']', stream) != EOF;
}

/* Where there are several, apart from that of the pinned particles */
static int put_islands(FILE *stream, const content *c) {
  const msim_islands *all = &c->islands;
  if (all->n - (c->reactions != NULL) < 2) return 1;
  int done = fputs(",\n \"islands\": {\"of\": [", stream) >= 0;
  for (int32_t p = 0; p < c->state.n && done; p++)
    done = fprintf(stream, "%s%d", p ? ", " : "", (int)all->of[p]) > 0;
  return done && fputc(']', stream) != EOF &&
         put_numbers(stream, "kinetic", all->n, all->kinetic) &&
         put_numbers(stream, "elastic", all->n, all->elastic) &&
         put_numbers(stream, "gravitational", all->n, all->gravitational) &&
         fputc('}', stream) != EOF;
}

static int put_content(FILE *stream, const content *c) {
  const msim_state *s = &c->state;
  return fprintf(stream, "%s%s\"", final_beginning, status_word(c->status)) > 0 &&
         put_key(stream, "step", json_integer(s->step)) && put_key(stream, "t", json_real(s->t)) &&
         put_key(stream, "h", json_real(s->h)) && put_triples(stream, "x", s->n, s->x) &&
         put_triples(stream, "v", s->n, s->v) &&
         (!s->v_half || put_triples(stream, "v_half", s->n, s->v_half)) &&
         (!c->reactions || put_triples(stream, "reactions", s->n, c->reactions)) &&
         (!c->broken || put_broken(stream, s->nsprings, c->broken)) && put_contacts(stream, c) &&
         put_key(stream, "energy", energy_object(&c->energy)) && put_islands(stream, c) &&
         put_key(stream, "momentum", triple(c->energy.momentum)) &&
         put_key(stream, "angular_momentum", triple(c->energy.angular_momentum)) &&
         put_key(stream, "stats", stats_object(&c->stats)) && fputs("}\n", stream) >= 0;
}

static int all_finite(size_t n, const double *x) {
  for (size_t i = 0; i < n; i++)
    if (!isfinite(x[i])) return 0;
  return 1;
}

/* The key of a number that is not finite, which JSON cannot represent; NULL: all are finite. */
static const char *find_not_finite(const content *c) {
  const msim_state *s = &c->state;
  const msim_energy *e = &c->energy;
  size_t n = 3 * (size_t)s->n;
  if (!isfinite(s->t)) return "t";
  if (!all_finite(n, s->x)) return "x";
  if (!all_finite(n, s->v)) return "v";
  if (s->v_half && !all_finite(n, s->v_half)) return "v_half";
  if (c->reactions && !all_finite(n, c->reactions)) return "reactions";
  const double energies[] = {e->kinetic, e->elastic, e->gravitational, e->total, e->work};
  if (!all_finite(5, energies)) return "energy";
  if (!all_finite(3, e->momentum)) return "momentum";
  return all_finite(3, e->angular_momentum) ? NULL : "angular_momentum";
}

static int has_pinned(const msim_scene *scene) {
  msim_scene_view view = {.size = sizeof view};
  msim_scene_get(scene, &view);
  for (int32_t p = 0; p < view.nparticles; p++)
    if (view.pinned[p]) return 1;
  return 0;
}

static int write_content(output_file *file, const content *c) {
  if (!ranks_has_files()) return EXIT_OK;
  const char *offender = find_not_finite(c);
  if (offender)
    return report_error("'%s' is not written, because '%s' of the state is not finite", file->path,
                        offender);
  errno = 0;
  return output_close(file, put_content(file->stream, c));
}

int final_write(output_file *file, const msim_scene *scene, msim_sim *sim, msim_status status) {
  content c = {.status = status,
               .state = {.size = sizeof c.state},
               .energy = {.size = sizeof c.energy},
               .stats = {.size = sizeof c.stats},
               .islands = {.size = sizeof c.islands}};
  msim_sim_state(sim, &c.state);
  msim_sim_energy(sim, &c.energy);
  msim_sim_stats(sim, &c.stats);
  if (msim_sim_islands(sim, &c.islands) != MSIM_OK)
    return report_error("out of memory for islands of '%s'", file->path);
  if (msim_sim_contacts(sim, &c.ncontacts, &c.contacts) != MSIM_OK) c.ncontacts = -1;
  if (has_pinned(scene)) {
    c.reactions = malloc((size_t)c.state.n * 3 * sizeof *c.reactions);
    if (!c.reactions) return report_error("out of memory for reactions of '%s'", file->path);
    msim_sim_reactions(sim, c.reactions);
  }
  if (c.stats.broken) {
    c.broken = malloc((size_t)c.state.nsprings);
    if (c.broken) msim_sim_broken(sim, c.broken);
  }
  const int failed = c.stats.broken && !c.broken
                         ? report_error("out of memory for broken springs of '%s'", file->path)
                         : write_content(file, &c);
  free(c.reactions), free(c.broken);
  return failed;
}

/*------------------------------------- reading --------------------------------------------------*/

typedef struct initial_state {
  const char *path;
  json_t *root;
  msim_state state;
  double *x, *v, *v_half; /* 3n: what state points to */
} initial_state;

static int take_triple(const initial_state *in, const char *key, int32_t i, double *to) {
  const json_t *row = json_array_get(json_object_get(in->root, key), (size_t)i);
  if (json_array_size(row) != 3)
    return report_error("%s: %s[%d] must be three numbers", in->path, key, (int)i);
  for (size_t k = 0; k < 3; k++) {
    const json_t *number = json_array_get(row, k);
    if (!json_is_number(number))
      return report_error("%s: %s[%d][%d] must be a number", in->path, key, (int)i, (int)k);
    to[k] = json_number_value(number);
  }
  return EXIT_OK;
}

/* Read an array of n triples, to be freed by the caller; *to stays NULL without such a key. */
static int take_triples(const initial_state *in, const char *key, double **to) {
  const json_t *rows = json_object_get(in->root, key);
  int32_t n = in->state.n;
  if (!rows) return EXIT_OK;
  if (!json_is_array(rows))
    return report_error("%s: %s must be an array of %d triples, one per particle of the scene",
                        in->path, key, (int)n);
  if (json_array_size(rows) != (size_t)n)
    return report_error(
        "%s: %s must be an array of %d triples, one per particle of the scene, but it has %zu",
        in->path, key, (int)n, json_array_size(rows));
  *to = malloc(((size_t)n + 1) * 3 * sizeof **to);
  if (!*to) return report_error("out of memory for %s of '%s'", key, in->path);
  for (int32_t i = 0; i < n; i++)
    if (take_triple(in, key, i, *to + 3 * (size_t)i)) return EXIT_ERROR;
  return EXIT_OK;
}

static int take_time(initial_state *in) {
  const json_t *step = json_object_get(in->root, "step"), *t = json_object_get(in->root, "t");
  const json_t *h = json_object_get(in->root, "h");
  if (step && (!json_is_integer(step) || json_integer_value(step) < 0))
    return report_error("%s: step must be a whole number >= 0", in->path);
  if (t && !json_is_number(t)) return report_error("%s: t must be a number", in->path);
  if (h && !json_is_number(h)) return report_error("%s: h must be a number", in->path);
  in->state.h = json_number_value(h); /* 0 if it is missing: v_half then belongs to no h */
  if (step) in->state.step = json_integer_value(step);
  if (t) in->state.t = json_number_value(t);
  return EXIT_OK;
}

static int take_state(initial_state *in) {
  const json_t *version = json_object_get(in->root, "msim");
  if (!json_is_object(in->root) || !version)
    return report_error("%s is not a final state, as --final writes: it has no key 'msim'",
                        in->path);
  if (!json_is_integer(version) || json_integer_value(version) != 1)
    return report_error("%s: msim must be 1, the version of the format", in->path);
  if (take_time(in) || take_triples(in, "x", &in->x) || take_triples(in, "v", &in->v) ||
      take_triples(in, "v_half", &in->v_half))
    return EXIT_ERROR;
  if (!in->x || !in->v)
    return report_error("%s is not a final state, as --final writes: it has no key '%s'", in->path,
                        in->x ? "v" : "x");
  in->state.x = in->x;
  in->state.v = in->v;
  in->state.v_half = in->v_half;
  return EXIT_OK;
}

/* Break the springs of the key `broken`, if there is one. */
static int break_springs(const initial_state *in, msim_sim *sim) {
  const json_t *list = json_object_get(in->root, "broken");
  msim_error err;
  if (!list) return EXIT_OK;
  if (!json_is_array(list))
    return report_error("%s: broken must be an array of indices of springs", in->path);
  for (size_t i = 0; i < json_array_size(list); i++) {
    const json_t *item = json_array_get(list, i);
    const json_int_t index = json_integer_value(item);
    const int32_t spring = index >= 0 && index <= INT32_MAX ? (int32_t)index : -1;
    if (!json_is_integer(item))
      return report_error("%s: broken[%zu] must be the index of a spring", in->path, i);
    if (msim_sim_break(sim, 1, &spring, &err) != MSIM_OK)
      return report_error("%s: broken[%zu]: %s", in->path, i, err.text);
  }
  return EXIT_OK;
}

int final_read(const char *path, msim_sim *sim) {
  json_error_t error;
  msim_error err;
  initial_state in = {.path = path, .state = {.size = sizeof in.state}};
  int status = EXIT_OK;
  msim_sim_state(sim, &in.state);
  in.root = json_load_file(path, JSON_REJECT_DUPLICATES, &error);
  if (!in.root)
    status = error.line > 0
                 ? report_error("%s:%d:%d: %s", path, error.line, error.column, error.text)
                 : report_error("%s", error.text);
  else status = take_state(&in);
  status = ranks_agree(status);
  if (!status && msim_sim_set_state(sim, &in.state, &err) != MSIM_OK)
    status = report_error("%s: %s", path, err.text);
  if (!status) status = break_springs(&in, sim);
  json_decref(in.root);
  free(in.x);
  free(in.v);
  free(in.v_half);
  return status;
}
