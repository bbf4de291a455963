#define _POSIX_C_SOURCE 200809L /* open */
#include "record/html.h"

#include <fcntl.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "base/text.h"
#include "base/vec3.h"
#include "record/frame_file.h"
#include "record/integer_code.h"
#include "record/player_page.h"
#include "scene/colliders.h"

/* The page begins with it. */
static const char mark[] = "<!doctype html>\n<!-- motion computed by msim, with its player";
static const char data_end[] = "</script>\n</html>\n";

enum { POSITION_BITS = 16, SPEED_BITS = 8, NUMBERS_OF_A_LINE = 600, A_POSE = 160 };

typedef struct recorder {
  const msim_host *host;
  int32_t n, ncolliders;
  int64_t frames;
  uint16_t *last, *before; /* 4n: x, y, z, speed of the last frame and of that before it */
  ms_frame_file file;
  char name[]; /* of the file, for messages */
} recorder;

/*------------------------------------- JSON -----------------------------------------------------*/

static void print_number(ms_frame_file *file, const char *key, double value) {
  ms_frame_file_print(file, "\"%s\":%s,", key, ms_text_format_double(value).text);
}

static void print_triple(ms_frame_file *file, const char *key, const double value[3]) {
  ms_frame_file_print(file, "\"%s\":[%s,%s,%s],", key, ms_text_format_double(value[0]).text,
                      ms_text_format_double(value[1]).text, ms_text_format_double(value[2]).text);
}

/* Without '<', which might end the block of data */
static void print_string(ms_frame_file *file, const char *key, const char *value) {
  ms_frame_file_print(file, "\"%s\":\"", key);
  for (const char *c = value; *c; c++) {
    if ((unsigned char)*c < ' ' || strchr("\"\\<", *c)) ms_frame_file_print(file, "\\u%04x", *c);
    else ms_frame_file_write(file, c, 1);
  }
  ms_frame_file_print(file, "\",");
}

static void print_planes(ms_frame_file *file, const msim_recording *what) {
  ms_frame_file_print(file, "\"planes\":[");
  for (int32_t i = 0; i < what->nplanes; i++) {
    ms_frame_file_print(file, i ? ",{" : "{");
    print_triple(file, "normal", what->planes[i].normal);
    ms_frame_file_print(file, "\"offset\":%s}", ms_text_format_double(what->planes[i].offset).text);
  }
  ms_frame_file_print(file, "],");
}

/* Of height fields only: the surface of an sdf is not drawn. */
static void print_heights(ms_frame_file *file, const msim_collider *c) {
  if (c->type != MSIM_COLLIDER_HEIGHTFIELD) return;
  ms_frame_file_print(file, ",\"n\":[%" PRId32 ",%" PRId32 "],\"heights\":[", c->n[0], c->n[1]);
  for (size_t i = 0; i < ms_colliders_count_values(c); i++)
    ms_frame_file_print(file, "%s%.7g", i ? "," : "", c->values[i]);
  ms_frame_file_print(file, "]");
}

static void print_collider(ms_frame_file *file, const msim_collider *c) {
  ms_frame_file_print(file, "{\"type\":\"%s\",\"inside\":%s", ms_colliders_get_type(c->type)->name,
                      c->inside ? "true" : "false");
  for (int k = 0; k < MS_COLLIDER_MEMBERS; k++) {
    const ms_collider_member *m = &ms_collider_members[k];
    const double *numbers = ms_colliders_get_member(c, m);
    if (!ms_colliders_type_has(c->type, m)) continue;
    ms_frame_file_print(file, ",\"%s\":%s", m->key.key, m->key.count > 1 ? "[" : "");
    for (int32_t i = 0; i < m->key.count; i++)
      ms_frame_file_print(file, "%s%s", i ? "," : "", ms_text_format_double(numbers[i]).text);
    if (m->key.count > 1) ms_frame_file_print(file, "]");
  }
  print_heights(file, c);
  ms_frame_file_print(file, "}");
}

static void print_colliders(ms_frame_file *file, const msim_recording *what) {
  ms_frame_file_print(file, "\"colliders\":[");
  for (int32_t i = 0; i < what->ncolliders; i++) {
    if (i) ms_frame_file_print(file, ",");
    print_collider(file, &what->colliders[i]);
  }
  ms_frame_file_print(file, "],");
}

/* Integer i of an array of the recording */
typedef uint32_t integer_at(const msim_recording *what, int64_t i);

static uint32_t bits_of(double value) {
  const float number = (float)fmin(value, FLT_MAX);
  uint32_t bits;
  memcpy(&bits, &number, sizeof bits);
  return bits;
}

static uint32_t mass_at(const msim_recording *what, int64_t i) { return bits_of(what->mass[i]); }
static uint32_t pinned_at(const msim_recording *what, int64_t i) { return what->pinned[i]; }
static uint32_t end_at(const msim_recording *what, int64_t i) { return (uint32_t)what->ij[i]; }
static uint32_t k_at(const msim_recording *what, int64_t i) { return bits_of(what->k[i]); }
static uint32_t rest_at(const msim_recording *what, int64_t i) { return bits_of(what->rest[i]); }
static uint32_t corner_at(const msim_recording *what, int64_t i) {
  return (uint32_t)what->faces[i];
}

/* Of each integer the difference to the one `stride` before is written. */
static void print_integers(ms_frame_file *file, const msim_recording *what, const char *key,
                           integer_at *at, int64_t count, int stride) {
  ms_integer_code code;
  ms_frame_file_print(file, "\"%s\":\"", key);
  ms_integer_code_begin(&code, file, 32);
  for (int64_t i = 0; i < count; i++)
    ms_integer_code_put(&code, at(what, i) - (i < stride ? 0 : at(what, i - stride)));
  ms_integer_code_end(&code);
  ms_frame_file_print(file, "\",");
}

static void print_scene(ms_frame_file *file, const msim_recording *what) {
  ms_frame_file_print(file, "{\"msim\":1,");
  print_string(file, "name", what->title);
  print_triple(file, "gravity", what->gravity);
  print_planes(file, what);
  print_colliders(file, what);
  print_integers(file, what, "mass", mass_at, what->n, 1);
  print_integers(file, what, "pinned", pinned_at, what->n, 1);
  print_integers(file, what, "ij", end_at, 2 * (int64_t)what->nsprings, 2);
  print_integers(file, what, "k", k_at, what->nsprings, 1);
  print_integers(file, what, "rest", rest_at, what->nsprings, 1);
  print_integers(file, what, "faces", corner_at, 3 * (int64_t)what->nfaces, 3);
  ms_frame_file_print(file,
                      "\"particles\":%" PRId32 ",\"springs\":%" PRId32 ",\"triangles\":%" PRId32
                      ",\"frames\":%" PRId64 "}\n",
                      what->n, what->nsprings, what->nfaces, what->nframes);
}

/*------------------------------------- frames ---------------------------------------------------*/

typedef struct frame_range {
  double low[3], high[3]; /* bounding box of the particles */
  double fastest;
} frame_range;

static frame_range range_of(const msim_frame *frame, int32_t n) {
  frame_range range = {.fastest = 0};
  for (int32_t i = 0; i < n; i++) {
    const double *x = frame->x + 3 * (size_t)i;
    for (int c = 0; c < 3; c++) {
      range.low[c] = i ? fmin(range.low[c], x[c]) : x[c];
      range.high[c] = i ? fmax(range.high[c], x[c]) : x[c];
    }
    range.fastest = fmax(range.fastest, ms_vec3_norm(frame->v + 3 * (size_t)i));
  }
  return range;
}

/* 0 to `levels`, of a share 0 to 1; 0 also of NaN, where the range is empty */
static uint16_t level_of(double share, int levels) {
  return (uint16_t)(share > 0 ? floor(fmin(share, 1) * levels + 0.5) : 0);
}

/* Component c of particle i, 3: its speed. Halves, as high - low might overflow. */
static uint16_t quantize(const msim_frame *frame, const frame_range *range, int32_t i, int c) {
  if (c == 3) return level_of(ms_vec3_norm(frame->v + 3 * (size_t)i) / range->fastest, 255);
  const double low = range->low[c] / 2, high = range->high[c] / 2;
  return level_of((frame->x[3 * (size_t)i + (size_t)c] / 2 - low) / (high - low), 65535);
}

/* What the two frames before do not predict of component c, q - 2 q' + q'', as the difference to
 * the particle before */
static void put_component(recorder *r, ms_integer_code *code, const msim_frame *frame,
                          const frame_range *range, int c) {
  uint16_t *last = r->last + (size_t)c * (size_t)r->n, *before = last + (r->before - r->last);
  uint32_t neighbour = 0;
  for (int32_t i = 0; i < r->n; i++) {
    const uint16_t q = quantize(frame, range, i, c);
    const uint32_t residual = (uint32_t)(q - 2 * last[i] + before[i]);
    ms_integer_code_put(code, residual - neighbour);
    neighbour = residual;
    before[i] = r->frames ? last[i] : q;
    last[i] = q;
  }
}

static void print_components(recorder *r, const char *key, const msim_frame *frame,
                             const frame_range *range, int first, int end) {
  ms_integer_code code;
  ms_frame_file_print(&r->file, "\"%s\":\"", key);
  ms_integer_code_begin(&code, &r->file, first < 3 ? POSITION_BITS : SPEED_BITS);
  for (int c = first; c < end; c++) put_component(r, &code, frame, range, c);
  ms_integer_code_end(&code);
}

static void print_poses(const recorder *r, ms_frame_file *file, const double *poses) {
  if (!poses) return;
  ms_frame_file_print(file, "\"poses\":[");
  for (int32_t i = 0; i < 6 * r->ncolliders; i++)
    ms_frame_file_print(file, "%s%s",
                        i % 6 ? ","
                        : i   ? "],["
                              : "[",
                        ms_text_format_double(poses[i]).text);
  ms_frame_file_print(file, "]],");
}

static msim_status write_html_frame(void *self, const msim_frame *frame) {
  recorder *r = self;
  const frame_range range = range_of(frame, r->n);
  ms_frame_file_print(&r->file, "{\"step\":%" PRId64 ",", frame->step);
  print_number(&r->file, "t", frame->t);
  print_number(&r->file, "kinetic", frame->kinetic);
  print_number(&r->file, "elastic", frame->elastic);
  print_number(&r->file, "gravitational", frame->gravitational);
  print_triple(&r->file, "low", range.low);
  print_triple(&r->file, "high", range.high);
  print_number(&r->file, "fastest", range.fastest);
  print_poses(r, &r->file, frame->poses);
  print_components(r, "x", frame, &range, 0, 3);
  ms_frame_file_print(&r->file, "\",");
  print_components(r, "speed", frame, &range, 3, 4);
  ms_frame_file_print(&r->file, "\"}\n");
  r->frames++;
  return ms_frame_file_end_frame(&r->file);
}

/*------------------------------------- the page -------------------------------------------------*/

static msim_status close_html(void *self) {
  recorder *r = self;
  ms_frame_file_print(&r->file, "%s", data_end);
  ms_frame_file_end_frame(&r->file);
  const msim_status status = ms_frame_file_close(&r->file);
  r->host->free(r->host, r->last);
  r->host->free(r->host, r);
  return status;
}

/* Rounded down to two digits */
static double round_down(double value) {
  const double unit = pow(10, floor(log10(value)) - 1);
  return floor(value / unit) * unit;
}

/* `before`: bytes of the page before the first frame */
static msim_status check_size(const recorder *r, const msim_recording *what, int64_t before) {
  const int64_t n = what->n;
  const int64_t frame = NUMBERS_OF_A_LINE + A_POSE * (int64_t)what->ncolliders +
                        ms_integer_code_bound(3 * n, POSITION_BITS) +
                        ms_integer_code_bound(n, SPEED_BITS);
  const int64_t total = before + (what->nframes + 1) * frame;
  if (total <= MS_HTML_LIMIT) return MSIM_OK;
  const int64_t room = (MS_HTML_LIMIT - before) / frame - 1;
  const double duration = what->times[what->nframes - 1] - what->times[0];
  if (room < 2)
    r->host->fail(r->host,
                  "%s: %d particles and %d springs are too many for a page, which is limited to "
                  "%d MB; record a .vtkhdf or .csv file",
                  r->name, what->n, what->nsprings, MS_HTML_LIMIT / 1000000);
  else
    r->host->fail(r->host,
                  "%s: the page might have up to %.0f MB, and is limited to %d MB; record at most "
                  "%lld of its %lld frames, by --fps %g or less, or a larger --every",
                  r->name, (double)total / 1e6, MS_HTML_LIMIT / 1000000, (long long)room,
                  (long long)what->nframes, round_down((double)(room - 1) / duration));
  return MSIM_ERR_ARG;
}

static msim_status fail_memory(const msim_host *host, const char *name) {
  host->fail(host, "%s: out of memory for the html recorder", name);
  return MSIM_ERR_MEMORY;
}

/* NULL: out of memory */
static recorder *create_html_recorder(const msim_host *host, const msim_recording *what,
                                      const char *name) {
  const size_t bytes = strlen(name) + 1, history = 8 * (size_t)what->n * sizeof(uint16_t);
  recorder *r = host->alloc(host, sizeof *r + bytes);
  if (!r) return NULL;
  uint16_t *last = host->alloc(host, history + 1);
  if (!last) {
    host->free(host, r);
    return NULL;
  }
  memset(last, 0, history);
  memset(r, 0, offsetof(recorder, file));
  memcpy(r->name, name, bytes);
  r->host = host;
  r->n = what->n;
  r->ncolliders = what->ncolliders;
  r->last = last;
  r->before = last + 4 * (size_t)what->n;
  return r;
}

static msim_status open_html(const msim_host *host, const msim_recording *what, void **self) {
  const char *name = what->name ? what->name : what->path;
  recorder *r = create_html_recorder(host, what, name);
  *self = NULL;
  if (!r) return fail_memory(host, name);
  ms_frame_file_open(&r->file, host, what, r->name);
  ms_frame_file_write(&r->file, ms_player_page, ms_player_page_length);
  print_scene(&r->file, what);
  msim_status status = ms_frame_file_end_frame(&r->file);
  if (!status) status = check_size(r, what, r->file.length);
  if (status) close_html(r);
  else *self = r;
  return status;
}

static int32_t recognize_html(const msim_host *host, const char *path) {
  char first[sizeof mark] = "";
  (void)host;
  int fd = open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return 0;
  ssize_t count = read(fd, first, sizeof mark - 1);
  close(fd);
  return count > 0 && strcmp(first, mark) == 0;
}

const msim_recorder_type *ms_html_recorder_type(void) {
  static const msim_recorder_type type = {
      .abi = MSIM_RECORDER_ABI,
      .size = sizeof type,
      .name = "html",
      .extension = ".html",
      .library = "msim",
      .license = "MIT",
      .open = open_html,
      .write = write_html_frame,
      .close = close_html,
      .recognize = recognize_html,
  };
  return &type;
}
