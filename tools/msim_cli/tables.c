#include "tables.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../common/message.h"
#include "ranks.h"

static const struct {
  const char *name, *title;
} kinds[NTABLES] = {
    [TABLE_ENERGIES] = {"energies", "step,t,kinetic,elastic,gravitational,total,work\n"},
    [TABLE_REACTIONS] = {"reactions", "step,t,particle,fx,fy,fz\n"},
    [TABLE_SPRINGS] = {"springs", "step,t,spring,tension,elongation,strain\n"},
};

const char *table_name(table_kind kind) { return kinds[kind].name; }

const char *table_title(table_kind kind) { return kinds[kind].title; }

/*------------------------------------- opening --------------------------------------------------*/

int table_open(table *t, table_kind kind, const msim_scene *scene, const char *path) {
  t->kind = kind;
  t->scene = scene;
  if (kind != TABLE_ENERGIES) {
    msim_scene_view view = {.size = sizeof view};
    msim_scene_get(scene, &view);
    const int32_t rows = view.nparticles > view.nsprings ? view.nparticles : view.nsprings;
    t->values = calloc(3 * (size_t)rows, sizeof *t->values);
    if (!t->values) return report_error("out of memory for a table of %s", kinds[kind].name);
  }
  if (!ranks_has_files()) return EXIT_OK;
  if (output_open(&t->start, path)) return EXIT_ERROR;
  fputs(kinds[kind].title, t->start.stream);
  return EXIT_OK;
}

/* Copy the lines before time t. A killed run may have left a part of one, which has no end. */
static void keep_rows(const output_file *start, double t) {
  char line[256];
  FILE *old = fopen(start->path, "r");
  while (old && fgets(line, sizeof line, old)) {
    const char *comma = strchr(line, ',');
    if (!comma) continue;
    char *end;
    const double row_t = strtod(comma + 1, &end);
    if (end != comma + 1 && row_t < t && strchr(line, '\n')) fputs(line, start->stream);
  }
  if (old) fclose(old);
}

/* Other ranks than 0 write nothing, but call the functions of the sim. */
static int start_muted(table *t) {
  t->stream = fopen("/dev/null", "w");
  return t->stream ? EXIT_OK : report_error("cannot open /dev/null: %s", strerror(errno));
}

int table_start(table *t, msim_sim *sim, int resumed) {
  msim_error err;
  msim_state state = {.size = MSIM_STATE_TIME};
  msim_sim_state(sim, &state);
  if (!ranks_has_files()) return start_muted(t);
  if (resumed) keep_rows(&t->start, state.t);
  errno = 0;
  if (output_close(&t->start, !ferror(t->start.stream))) return EXIT_ERROR;
  t->stream = fopen(t->start.path, "a");
  if (!t->stream) return report_error("cannot write '%s': %s", t->start.path, strerror(errno));
  if (!resumed || table_write(t, sim, &err) == MSIM_OK) return EXIT_OK;
  return report_error("%s", err.text);
}

/*------------------------------------- a frame --------------------------------------------------*/

static void put_energies(const table *t, const msim_state *now, const msim_energy *energy) {
  fprintf(t->stream, "%" PRId64 ",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", now->step, now->t,
          energy->kinetic, energy->elastic, energy->gravitational, energy->total, energy->work);
}

static void put_row(const table *t, const msim_state *now, int32_t i, const double a[3]) {
  fprintf(t->stream, "%" PRId64 ",%.17g,%" PRId32 ",%.17g,%.17g,%.17g\n", now->step, now->t, i,
          a[0], a[1], a[2]);
}

static void put_reactions(const table *t, const msim_state *now, msim_sim *sim) {
  msim_scene_view scene = {.size = sizeof scene};
  msim_scene_get(t->scene, &scene);
  msim_sim_reactions(sim, t->values);
  for (int32_t p = 0; p < scene.nparticles; p++)
    if (scene.pinned[p]) put_row(t, now, p, t->values + 3 * (size_t)p);
}

static void put_springs(const table *t, const msim_state *now, msim_sim *sim) {
  msim_scene_view scene = {.size = sizeof scene};
  msim_scene_get(t->scene, &scene);
  const size_t n = (size_t)scene.nsprings;
  double *tension = t->values, *elongation = tension + n, *strain = elongation + n;
  msim_sim_springs(sim, tension, elongation, strain);
  for (int32_t e = 0; e < scene.nsprings; e++)
    put_row(t, now, e, (double[]){tension[e], elongation[e], strain[e]});
}

msim_status table_write(table *t, msim_sim *sim, msim_error *err) {
  msim_state state = {.size = MSIM_STATE_TIME};
  msim_energy energy = {.size = sizeof energy};
  if (!t->stream) return MSIM_OK;
  msim_sim_state(sim, &state);
  msim_sim_energy(sim, &energy);
  if (!isfinite(energy.total)) return MSIM_OK;
  errno = 0;
  if (t->kind == TABLE_ENERGIES) put_energies(t, &state, &energy);
  if (t->kind == TABLE_REACTIONS) put_reactions(t, &state, sim);
  if (t->kind == TABLE_SPRINGS) put_springs(t, &state, sim);
  if (fflush(t->stream) == 0 && !ferror(t->stream)) return MSIM_OK;
  err->status = MSIM_ERR_IO;
  snprintf(err->text, sizeof err->text, "cannot write '%s': %s", t->start.path, strerror(errno));
  return MSIM_ERR_IO;
}

void table_close(table *t) {
  if (t->stream) fclose(t->stream);
  output_discard(&t->start);
  free(t->values);
}
