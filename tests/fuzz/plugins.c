/* Fuzz target: the function tables of a recorder and of an importer and all of their results come
 * from the input; msim must trust none of them. */
#define _POSIX_C_SOURCE 200809L /* setenv */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "input.h"
#include "msim/importer.h"
#include "msim/recorder.h"

enum { MOST_BYTES = 4 << 20 };

__attribute__((visibility("default"))) const msim_recorder_type *fuzz_recorder(void);
__attribute__((visibility("default"))) const msim_importer *fuzz_importer(void);

/* Everything that a plugin is given must be readable. */
static void read_all(const void *data, size_t size) {
  static volatile unsigned sum;
  for (size_t i = 0; i < size; i++) sum = sum + ((const uint8_t *)data)[i];
}

/*------------------------------------- a recorder -----------------------------------------------*/

static const msim_host *lender;
static int32_t n;
static uint8_t saved[1 << 14]; /* a checkpoint of the run */
static size_t saved_length;

static void read_doubles(const double *x, int64_t count) { read_all(x, (size_t)count * sizeof *x); }

static msim_status open_file(const msim_host *host, const msim_recording *what, void **self) {
  lender = host;
  n = what->n;
  read_doubles(what->times, what->nframes);
  read_doubles(what->mass, n);
  read_doubles(what->k, what->nsprings);
  read_doubles(what->rest, what->nsprings);
  read_all(what->ij, 2 * (size_t)what->nsprings * sizeof *what->ij);
  read_all(what->scene, what->scene_length + 1);
  *self = input_next() % 8 ? host->alloc(host, 1) : NULL;
  return input_status(host);
}

static msim_status write_frame(void *self, const msim_frame *frame) {
  (void)self;
  read_doubles(frame->x, 3 * n);
  read_doubles(frame->v, 3 * n);
  if (frame->checkpoint) read_all(frame->checkpoint, frame->checkpoint_length);
  return input_status(lender);
}

static msim_status close_file(void *self) {
  const msim_status status = input_status(lender);
  lender->free(lender, self);
  return status;
}

static msim_status resume(const msim_host *host, const msim_recording *what, msim_resumption *from,
                          void **self) {
  const unsigned how = input_next();
  from->frames = how & 1 ? input_integer() : 2;
  from->step = how & 2 ? input_integer() : 2;
  from->checkpoint = how & 4 ? NULL : saved;
  from->checkpoint_length = how & 8 ? input_next() : saved_length;
  return open_file(host, what, self);
}

static int32_t recognize(const msim_host *host, const char *path) {
  (void)host, (void)path;
  return (int32_t)input_integer();
}

/* The members that all tables have. */
static void spoil_head(unsigned spoilt, uint32_t *abi, uint32_t *size, const char **name) {
  static const char *const names[] = {"hdf5", NULL, "", "csv", "hdf5 "};
  if (spoilt & 256) *abi = input_next();
  if (spoilt & 512) *size = input_next();
  if (spoilt & 1024) *name = names[input_next() % (sizeof names / sizeof *names)];
}

const msim_recorder_type *fuzz_recorder(void) {
  static msim_recorder_type table;
  const unsigned spoilt = input_fault_bits();
  table = (msim_recorder_type){.abi = MSIM_RECORDER_ABI,
                               .size = sizeof table,
                               .name = "hdf5",
                               .extension = spoilt & 1 ? NULL : ".vtkhdf",
                               .library = spoilt & 2 ? NULL : "none",
                               .license = spoilt & 4 ? NULL : "MIT",
                               .open = spoilt & 8 ? NULL : open_file,
                               .write = spoilt & 16 ? NULL : write_frame,
                               .close = spoilt & 32 ? NULL : close_file,
                               .resume = spoilt & 64 ? NULL : resume,
                               .recognize = spoilt & 128 ? NULL : recognize};
  spoil_head(spoilt, &table.abi, &table.size, &table.name);
  return spoilt & 2048 ? NULL : &table;
}

/*------------------------------------- an importer ----------------------------------------------*/

static const char *pick_path(char *own, size_t size) {
  static const char *const paths[] = {"msim",
                                      "gravity",
                                      "drag",
                                      "particles",
                                      "particles/x",
                                      "particles/v",
                                      "springs",
                                      "particles/mass",
                                      "particles/pinned",
                                      "springs/ij",
                                      "springs/k",
                                      "springs/rest",
                                      "springs/damping",
                                      "planes",
                                      "planes/0",
                                      "planes/1",
                                      "planes/friction",
                                      "planes/0/normal",
                                      "planes/0/offset",
                                      "run",
                                      "run/h",
                                      "run/steps",
                                      "run/integrator",
                                      "objects",
                                      "objects/0",
                                      "objects/0/type",
                                      "objects/0/n",
                                      "name",
                                      NULL,
                                      ""};
  enum { NPATHS = sizeof paths / sizeof *paths };
  const unsigned pick = input_next();
  if (pick < NPATHS) return paths[pick];
  const size_t length = pick == NPATHS ? size - 1 : pick % 16;
  for (size_t i = 0; i < length; i++) own[i] = i < 16 ? (char)input_next() : 'x';
  own[length] = '\0';
  return own;
}

/* Shapes that occur in a particle system, so that some are accepted. */
static void pick_shape(msim_node *node) {
  const unsigned shape = input_next();
  node->kind = (int32_t)(shape % 4);
  node->rank = (int32_t)(shape / 4 % 4);
  for (int i = 0; i < MSIM_NODE_MOST_DIMS; i++) {
    const unsigned dim = input_next();
    node->dims[i] = dim < 16 ? (int64_t)dim : dim < 32 ? input_integer() : 3;
  }
  if (shape & 128) node->kind = (int32_t)input_integer();
  if (shape & 64) node->rank = (int32_t)input_integer();
}

static void fill(const msim_node *node, void *room) {
  int64_t count = 1;
  for (int32_t i = 0; i < node->rank; i++) count *= node->dims[i];
  for (int64_t i = 0; i < count; i++) {
    if (node->kind == MSIM_NODE_TEXT) ((char *)room)[i] = (char)input_next();
    else if (node->kind == MSIM_NODE_REAL) ((double *)room)[i] = input_number();
    else ((int64_t *)room)[i] = input_integer();
  }
}

static msim_status load(const msim_host *host, const char *path, const msim_tree *tree) {
  char own[300];
  (void)path;
  for (unsigned left = input_next() % 32; left > 0; left--) {
    void *room = NULL;
    msim_node node = {.size = sizeof node, .path = pick_path(own, sizeof own)};
    pick_shape(&node);
    const msim_status status = tree->add(tree, &node, &room);
    if (status && input_next() % 4) return status;
    if (!status && room) fill(&node, room);
  }
  return input_status(host);
}

static msim_status save(const msim_host *host, const char *path, int32_t count,
                        const msim_node *nodes) {
  for (int32_t i = 0; i < count; i++) {
    size_t size = nodes[i].kind == MSIM_NODE_TEXT ? 1 : 8;
    for (int32_t d = 0; d < nodes[i].rank; d++) size *= (size_t)nodes[i].dims[d];
    read_all(nodes[i].path, strlen(nodes[i].path));
    read_all(nodes[i].data, size);
  }
  if (input_next() % 4) fclose(fopen(path, "wb"));
  return input_status(host);
}

const msim_importer *fuzz_importer(void) {
  static msim_importer table;
  const unsigned spoilt = input_fault_bits();
  table = (msim_importer){.abi = MSIM_IMPORTER_ABI,
                          .size = sizeof table,
                          .name = "hdf5",
                          .extension = spoilt & 1 ? NULL : ".h5",
                          .library = spoilt & 2 ? NULL : "none",
                          .license = spoilt & 4 ? NULL : "MIT",
                          .load = spoilt & 8 ? NULL : load,
                          .save = spoilt & 16 ? NULL : save};
  spoil_head(spoilt, &table.abi, &table.size, &table.name);
  return spoilt & 2048 ? NULL : &table;
}

/*------------------------------------- runs -----------------------------------------------------*/

static int write_state(msim_sim *sim, void *recorder) {
  msim_error err;
  (void)sim;
  const msim_status status = msim_recorder_write(recorder, &err);
  fuzz_check_error(status, &err);
  return status != MSIM_OK;
}

static void record(msim_sim *sim, const char *path) {
  static msim_status (*const ways[])(msim_sim *, const char *, msim_recorder **, msim_error *) = {
      msim_recorder_open, msim_recorder_replace, msim_recorder_resume};
  msim_error err;
  msim_recorder *recorder;
  const unsigned way = input_next();
  if (way & 4) fuzz_write((const uint8_t *)"?", 1);
  else remove(path);
  const msim_status status = ways[way % 4 % 3](sim, path, &recorder, &err);
  fuzz_check_error(status, &err);
  fuzz_check(!status == !!recorder, "a recorder or an error");
  if (status) return;
  fuzz_check_error(msim_sim_run(sim, write_state, recorder, &err), &err);
  fuzz_check_error(msim_recorder_close(recorder, &err), &err);
}

static void try_recorder(const char *path) {
  msim_error err;
  msim_scene *scene = fuzz_rope(NULL, "\"steps\": 4, \"every\": 1");
  msim_sim *sim = fuzz_make_sim(scene);
  if (saved_length == 0) {
    msim_sim *other = fuzz_make_sim(scene);
    msim_sim_step(other, 2, NULL);
    fuzz_check(msim_sim_save(other, saved, sizeof saved, &saved_length, &err) == MSIM_OK, err.text);
    msim_sim_destroy(other);
  }
  record(sim, path);
  fuzz_check_error(msim_sim_step(sim, 1, &err), &err);
  msim_sim_destroy(sim);
  msim_scene_destroy(scene);
}

static void try_importer(const char *path) {
  fuzz_budget budget;
  const msim_allocator alloc = fuzz_allocator(&budget, MOST_BYTES);
  msim_error err;
  msim_scene *scene;
  fuzz_write((const uint8_t *)"?", 1);
  const msim_status status = msim_scene_load(&alloc, path, &scene, &err);
  fuzz_check_error(status, &err);
  if (status) return;
  fuzz_run_scene(scene, "velocity-verlet", &budget, MOST_BYTES);
  fuzz_check_error(msim_scene_save(scene, path, &err), &err);
  msim_scene_destroy(scene);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  setenv("MSIM_PLUGIN_PATH", FAKES, 1);
  input_begin(data, size);
  const int is_recorder = input_next() & 1;
  const char *path = fuzz_path(is_recorder ? "run.vtkhdf" : "scene.h5");
  if (is_recorder) try_recorder(path);
  else try_importer(path);
  remove(path);
  return 0;
}
