#include "sim/marks.h"

#include <stdio.h>
#include <string.h>

#include "base/isa.h"
#include "sim/sim.h"

/*------------------------------------- the scene ------------------------------------------------*/

typedef struct array {
  const char *name;
  const void *data;
  size_t bytes;
} array;

static void list_arrays(const ms_scene *s, array arrays[MS_SCENE_MARKS]) {
  const size_t n = (size_t)s->nparticles, m = (size_t)s->nsprings, real = sizeof(double);
  const array list[MS_SCENE_MARKS] = {
      {"particles.x", s->x, 3 * n * real},          {"particles.v", s->v, 3 * n * real},
      {"particles.mass", s->mass, n * real},        {"particles.pinned", s->pinned, n},
      {"springs.ij", s->ij, 2 * m * sizeof *s->ij}, {"springs.k", s->k, m * real},
      {"springs.rest", s->rest, m * real},          {"springs.damping", s->damping, m * real}};
  memcpy(arrays, list, sizeof list);
}

void ms_sim_hash_scene(msim_sim *sim) {
  array arrays[MS_SCENE_MARKS];
  if (sim->is_marked) return;
  list_arrays(sim->scene, arrays);
  for (int i = 0; i < MS_SCENE_MARKS; i++)
    sim->marks[i] = ms_hash(0, arrays[i].data, arrays[i].bytes);
  sim->is_marked = 1;
}

static void mark_hash(ms_mark *mark, void *data, const char *name, uint64_t hash) {
  char text[24];
  snprintf(text, sizeof text, "#%016llx", (unsigned long long)hash);
  mark(data, name, text, 1);
}

static void mark_numbers(ms_mark *mark, void *data, const char *name, int n, const double *value) {
  char text[128] = "";
  size_t used = 0;
  for (int i = 0; i < n; i++)
    used += (size_t)snprintf(text + used, sizeof text - used, "%s%s", i ? " " : "",
                             ms_number_text(value[i]).text);
  mark(data, name, text, 0);
}

static void mark_count(ms_mark *mark, void *data, const char *name, int32_t count) {
  mark_numbers(mark, data, name, 1, &(double){count});
}

static void mark_planes(const ms_scene *s, ms_mark *mark, void *data) {
  for (int32_t i = 0; i < s->nplanes; i++) {
    const msim_plane *p = &s->planes[i];
    const double numbers[] = {p->normal[0], p->normal[1],   p->normal[2],
                              p->offset,    p->restitution, p->friction};
    char name[32];
    snprintf(name, sizeof name, "planes[%d]", i);
    mark_hash(mark, data, name, ms_hash(0, numbers, sizeof numbers));
  }
}

static void mark_scene(const msim_sim *sim, ms_mark *mark, void *data) {
  const ms_scene *s = sim->scene;
  array arrays[MS_SCENE_MARKS];
  list_arrays(s, arrays);
  mark_count(mark, data, "the number of particles", s->nparticles);
  mark_count(mark, data, "the number of springs", s->nsprings);
  mark_count(mark, data, "the number of planes", s->nplanes);
  for (int i = 0; i < MS_SCENE_MARKS; i++) mark_hash(mark, data, arrays[i].name, sim->marks[i]);
  mark_planes(s, mark, data);
  mark_numbers(mark, data, "gravity", 3, s->gravity);
  mark_numbers(mark, data, "drag", 1, &s->drag);
}

/*------------------------------------- options --------------------------------------------------*/

/* 1: the option may differ between the parts of a run: no bit of a state depends on it. */
static int is_free(const char *name) {
  static const char *const names[] = {"steps",   "t_end",       "every", "fps",
                                      "threads", "plugin_path", "sync"};
  for (size_t i = 0; i < sizeof names / sizeof *names; i++)
    if (strcmp(names[i], name) == 0) return 1;
  return 0;
}

/* The options as the caller gave them, where `auto` has replaced some. */
static msim_options asked(const msim_sim *sim) {
  msim_options opt = sim->opt;
  if (ms_sim_selects(sim)) {
    opt.integrator = MS_AUTO, opt.tol = sim->selection.tol, opt.h = MSIM_H_AUTO;
    opt.collision = sim->selection.collision;
  }
  return opt;
}

static void mark_options(const msim_sim *sim, ms_mark *mark, void *data) {
  const msim_options opt = asked(sim);
  const msim_option_entry *entry;
  for (int32_t i = 0; (entry = msim_option_info(i)) != NULL; i++) {
    ms_number number;
    if (!is_free(entry->name)) mark(data, entry->name, ms_option_value(&opt, i, &number), 0);
  }
}

void ms_sim_marks(const msim_sim *sim, ms_mark *mark, void *data) {
  static const char *const kernels[] = {"baseline", "avx2", "avx512"};
  mark(data, "msim", msim_version(), 0);
  mark(data, "MSIM_ISA", kernels[sim->motion->model.isa], 0);
  mark_scene(sim, mark, data);
  mark_options(sim, mark, data);
}
