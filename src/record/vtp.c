#include "record/vtp.h"

#include <inttypes.h>
#include <stdarg.h>
#include <string.h>

#include "base/error.h"

const char ms_vtp_beginning[] = "<?xml version=\"1.0\"?>\n<!-- frame of msim -->\n";

/* What an array has one row for */
typedef enum item { ONCE, POINT, CELL, SPRING, SPRING_END, FACE, CORNER, NITEMS } item;

typedef struct array {
  const char *section, *name, *type;
  item item;
  int components, size; /* of a row; bytes of a component */
  int is_constant;
  size_t source; /* offset in msim_frame or msim_recording; NO_SOURCE: ends of the cells */
} array;

#define NO_SOURCE     SIZE_MAX
#define FRAME(member) 0, offsetof(msim_frame, member)
#define CONST(member) 1, offsetof(msim_recording, member)

enum { REACTION = 9 };

static const array arrays[MS_VTP_ARRAYS] = {
    {"FieldData", "TimeValue", "Float64", ONCE, 1, 8, FRAME(t)},
    {"FieldData", "Step", "Int64", ONCE, 1, 8, FRAME(step)},
    {"FieldData", "KineticEnergy", "Float64", ONCE, 1, 8, FRAME(kinetic)},
    {"FieldData", "PotentialEnergy", "Float64", ONCE, 1, 8, FRAME(potential)},
    {"FieldData", "ElasticEnergy", "Float64", ONCE, 1, 8, FRAME(elastic)},
    {"FieldData", "GravitationalEnergy", "Float64", ONCE, 1, 8, FRAME(gravitational)},
    {"PointData", "Velocity", "Float64", POINT, 3, 8, FRAME(v)},
    {"PointData", "Mass", "Float64", POINT, 1, 8, CONST(mass)},
    {"PointData", "Pinned", "UInt8", POINT, 1, 1, CONST(pinned)},
    [REACTION] = {"PointData", "Reaction", "Float32", POINT, 3, 4, FRAME(reaction)},
    {"CellData", "Strain", "Float32", CELL, 1, 4, FRAME(strain)},
    {"CellData", "Tension", "Float32", CELL, 1, 4, FRAME(tension)},
    {"Points", "Points", "Float64", POINT, 3, 8, FRAME(x)},
    {"Lines", "connectivity", "Int32", SPRING_END, 1, 4, CONST(ij)},
    {"Lines", "offsets", "Int32", SPRING, 1, 4, 1, NO_SOURCE},
    {"Polys", "connectivity", "Int32", CORNER, 1, 4, CONST(faces)},
    {"Polys", "offsets", "Int32", FACE, 1, 4, 1, NO_SOURCE},
};

/*------------------------------------- what frames have in common -------------------------------*/

static void append_text(ms_vtp *vtp, const char *format, ...) MS_PRINTF(2, 3);

static int has_array(const ms_vtp *vtp, int i) { return vtp->has_pins || i != REACTION; }

static void append_text(ms_vtp *vtp, const char *format, ...) {
  const size_t used = strlen(vtp->text);
  va_list args;
  va_start(args, format);
  vsnprintf(vtp->text + used, sizeof vtp->text - used, format, args);
  va_end(args);
}

static void open_section(ms_vtp *vtp, const char *before, const char *section,
                         const int64_t count[NITEMS]) {
  if (*before) append_text(vtp, "</%s>\n", before);
  if (strcmp(before, "FieldData") == 0)
    append_text(vtp,
                "<Piece NumberOfPoints=\"%" PRId64 "\" NumberOfVerts=\"0\" NumberOfLines=\"%" PRId64
                "\" NumberOfStrips=\"0\" NumberOfPolys=\"%" PRId64 "\">\n",
                count[POINT], count[SPRING], count[FACE]);
  append_text(vtp, "<%s>\n", section);
}

static void describe_arrays(ms_vtp *vtp, const int64_t count[NITEMS]) {
  const char *section = "";
  uint64_t offset = 0;
  for (int i = 0; i < MS_VTP_ARRAYS; i++) {
    const array *a = &arrays[i];
    if (strcmp(section, a->section) != 0) open_section(vtp, section, a->section, count);
    section = a->section;
    if (!has_array(vtp, i)) continue;
    append_text(
        vtp,
        "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" NumberOfTuples=\"%" PRId64
        "\" format=\"appended\" offset=\"%" PRIu64 "\"/>\n",
        a->type, a->name, a->components, count[a->item], offset);
    vtp->bytes[i] = (uint64_t)count[a->item] * (uint64_t)(a->components * a->size);
    offset += sizeof *vtp->bytes + vtp->bytes[i];
  }
}

/* A cell of c corners ends at c, 2 c, ... in the list of corners. */
static void fill_ends(int32_t *ends, int64_t cells, int corners) {
  for (int64_t i = 0; i < cells; i++) ends[i] = (int32_t)((i + 1) * corners);
}

static int copy_constants(ms_vtp *vtp, const msim_host *host, const msim_recording *what,
                          const int64_t count[NITEMS]) {
  size_t total = 1;
  for (int i = 0; i < MS_VTP_ARRAYS; i++) total += arrays[i].is_constant ? vtp->bytes[i] + 8 : 0;
  char *next = vtp->constants = host->alloc(host, total);
  for (int i = 0; i < MS_VTP_ARRAYS && next; i++) {
    const array *a = &arrays[i];
    if (!a->is_constant) continue;
    vtp->data[i] = next;
    if (a->source == NO_SOURCE)
      fill_ends((int32_t *)next, count[a->item], a->item == SPRING ? 2 : 3);
    else if (vtp->bytes[i] > 0)
      memcpy(next, *(const void *const *)((const char *)what + a->source), vtp->bytes[i]);
    next += (vtp->bytes[i] + 7) / 8 * 8; /* aligned */
  }
  return next != NULL;
}

int ms_vtp_init(ms_vtp *vtp, const msim_host *host, const msim_recording *what) {
  const int64_t count[NITEMS] = {[ONCE] = 1,
                                 [POINT] = what->n,
                                 [CELL] = (int64_t)what->nsprings + what->nfaces,
                                 [SPRING] = what->nsprings,
                                 [SPRING_END] = 2 * (int64_t)what->nsprings,
                                 [FACE] = what->nfaces,
                                 [CORNER] = 3 * (int64_t)what->nfaces};
  const uint16_t one = 1;
  *vtp = (ms_vtp){.constants = NULL};
  for (int32_t p = 0; p < what->n; p++) vtp->has_pins |= what->pinned[p];
  append_text(vtp,
              "%s<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"%s\" "
              "header_type=\"UInt64\">\n<PolyData>\n",
              ms_vtp_beginning, *(const char *)&one ? "LittleEndian" : "BigEndian");
  describe_arrays(vtp, count);
  append_text(vtp, "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_");
  return copy_constants(vtp, host, what, count);
}

void ms_vtp_free(ms_vtp *vtp, const msim_host *host) {
  host->free(host, vtp->constants);
  vtp->constants = NULL;
}

/*------------------------------------- a frame --------------------------------------------------*/

static const void *find_data(const ms_vtp *vtp, const msim_frame *frame, int i) {
  if (vtp->data[i]) return vtp->data[i];
  const char *member = (const char *)frame + arrays[i].source;
  return arrays[i].item == ONCE ? member : *(const char *const *)member;
}

int ms_vtp_write(const ms_vtp *vtp, const msim_frame *frame, FILE *stream) {
  fputs(vtp->text, stream);
  for (int i = 0; i < MS_VTP_ARRAYS; i++) {
    if (!has_array(vtp, i)) continue;
    fwrite(&vtp->bytes[i], sizeof *vtp->bytes, 1, stream);
    fwrite(find_data(vtp, frame, i), 1, vtp->bytes[i], stream);
  }
  fputs("\n</AppendedData>\n</VTKFile>\n", stream);
  return !ferror(stream);
}
