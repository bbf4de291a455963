#include "scene/options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/sized.h"
#include "base/suggest.h"
#include "scene/scene.h"

/*------------------------------------- the table ------------------------------------------------*/

typedef enum option_type { WORD, REAL, INT32, INT64, CHOICE, SKIP } option_type;

typedef struct option {
  msim_option_entry entry;
  option_type type;
  size_t member; /* offset in msim_options */
  double least;  /* numbers: lower bound of the values, */
  int open;      /* which is excluded */
  double unset;  /* numbers: the value below `least` that means "not set", or the word that `values`
                    lists; NAN: none */
  uint32_t bit;  /* SKIP: the flag in skip_off */
  const char *example; /* a value as JSON; NULL: the default */
} option;

#define AT(m) offsetof(msim_options, m)
#define TEXT(name, values, preset, doc, m, example) \
  { {name, values, preset, doc}, WORD, AT(m), 0, 0, NAN, 0, example }
#define PICK(name, values, preset, doc, m) \
  { {name, values, preset, doc}, CHOICE, AT(m), 0, 0, NAN, 0, NULL }
#define ABOVE_0(name, preset, doc, m) \
  { {name, "number > 0", preset, doc}, REAL, AT(m), 0, 1, NAN, 0, NULL }
#define FLAG(name, what, bit) \
  { {"skip." name, "on | off", "on", "skip " what}, SKIP, AT(skip_off), 0, 0, NAN, bit, NULL }

static const option table[] = {
    TEXT("integrator", "name", "", "time integration method; msim_cli list shows them", integrator,
         "\"velocity-verlet\""),
    {{"h", "number > 0 | auto", "1e-3",
      "step size in s, or the first one to try under error control; auto: 0.9 of the stability "
      "limit, or chosen for the scene"},
     REAL,
     AT(h),
     0,
     1,
     MSIM_H_AUTO,
     0,
     NULL},
    {{"steps", "whole number >= 0", "", "exact number of steps; overrides t_end"},
     INT64,
     AT(steps),
     0,
     0,
     -1,
     0,
     "1000"},
    {{"t_end", "number >= 0", "", "end time in s"}, REAL, AT(t_end), 0, 0, -1, 0, "2"},
    TEXT("solver", "name", "auto", "linear solver; msim_cli list shows them", solver, NULL),
    ABOVE_0("solver.rtol", "1e-8",
            "tolerance of the true residual relative to the right-hand side, in the norm of the "
            "inverse diagonal blocks",
            solver_rtol),
    {{"solver.max_iterations", "whole number >= 1", "2000",
      "maximum number of iterations of an iterative solver"},
     INT32,
     AT(solver_max_iterations),
     1,
     0,
     NAN,
     0,
     NULL},
    TEXT("solver.options", "text", "",
         "for the library behind the solver, in its own words; petsc takes those of PETSc",
         solver_options, "\"-ksp_type cg -pc_type gamg\""),
    PICK("jacobian", "exact | clamp", "exact",
         "derivative of spring forces: exact, or with the transverse term of compressed springs "
         "set to 0",
         jacobian),
    PICK("indefinite", "clamp | solve | stop", "clamp",
         "if the exact matrix is not positive definite: repeat the step with the clamped matrix, "
         "solve the indefinite system, or stop",
         indefinite),
    ABOVE_0("newton.rtol", "1e-8",
            "tolerance of the velocity of a nonlinear step, relative to its change in the step",
            newton_rtol),
    {{"newton.max_iterations", "whole number >= 1", "1000",
      "maximum number of Newton iterations in a step"},
     INT32,
     AT(newton_max_iterations),
     1,
     0,
     NAN,
     0,
     NULL},
    {{"newton.retries", "whole number >= 0", "",
      "maximum number of bisections of a step that does not converge or is not finite; default: 6 "
      "with nonlinear methods, else 0; unused under error control, which shortens such steps "
      "itself"},
     INT32,
     AT(newton_retries),
     0,
     0,
     -1,
     0,
     "6"},
    PICK("incomplete", "stop | accept", "stop",
         "a fixed step whose linear solver or Newton's method reached its maximum of iterations: "
         "stop: repeat it in substeps, or end the run; accept: make it with the iterate reached, "
         "and count it in incomplete_steps",
         incomplete),
    PICK("collision", "reflect | event", "reflect",
         "reflect: mirror the state at the end of the step; event: locate impacts inside the step",
         collision),
    {{"tol", "number > 0", "",
      "tolerance of the sum of the local errors of a run, relative to extent and speed of each "
      "connected part; chooses the step sizes; default: fixed steps of h, but 1e-6 for auto and "
      "for dop853 without steps"},
     REAL,
     AT(tol),
     0,
     1,
     0,
     0,
     "1e-6"},
    {{"threads", "whole number >= 0", "0",
      "maximum number of threads; 0: by the size of the scene; results do not depend on it"},
     INT32,
     AT(threads),
     0,
     0,
     NAN,
     0,
     NULL},
    PICK("heun.collision", "final | standard | literal", "final",
         "reflection by heun: of stage and result (final), of the result only (standard), of the "
         "stage only (literal)",
         heun_collision),
    PICK("precision", "double | single | auto", "auto",
         "precision of positions, velocities and forces in steps; single: faster, with errors of "
         "some 1e-5, for explicit methods up to order 4 with steps of h and "
         "linearly-implicit-euler; "
         "auto: double, but single where integrator = auto keeps tol with it",
         precision),
    PICK("verlet.start", "taylor | plain", "taylor", "velocity at -h/2: v0 - h/2 a0, or v0 itself",
         verlet_start),
    PICK(
        "contacts", "off | on", "off",
        "record which particles touch which planes and colliders in each step, with their impulses",
        contacts),
    PICK("watch", "on | off", "on",
         "energy monitor: end a run whose energy or extent exceeds what its initial state and "
         "gravity can supply; with tol, warn of chaotic motion, in which errors grow",
         watch),
    {{"every", "whole number >= 1", "", "number of steps between frames"},
     INT64,
     AT(every),
     1,
     0,
     0,
     0,
     "10"},
    {{"fps", "number > 0", "", "frames per simulated second; default: about 200 in the run"},
     REAL,
     AT(fps),
     0,
     1,
     0,
     0,
     "60"},
    PICK("sync", "off | on", "off",
         "on: flush each frame to the disk before the run continues, so that it survives a power "
         "failure",
         sync),
    FLAG("springs", "spring forces if there are no springs", MSIM_SKIP_SPRINGS),
    FLAG("damping", "damping forces if no spring is damped", MSIM_SKIP_DAMPING),
    FLAG("gravity", "nothing, because gravity is always added, at no cost", MSIM_SKIP_GRAVITY),
    FLAG("drag", "drag if it is 0", MSIM_SKIP_DRAG),
    FLAG("planes", "collision detection if there are no planes", MSIM_SKIP_PLANES),
    FLAG("kept_factor",
         "a new factorization if the lagged one is a sufficient preconditioner (solver = auto)",
         MSIM_SKIP_KEPT_FACTOR),
    FLAG("zero_rest_length", "the directions of springs if all rest lengths and dampings are 0",
         MSIM_SKIP_ZERO_REST_LENGTH),
    FLAG("two_d", "the third component of a planar scene", MSIM_SKIP_TWO_D),
    FLAG("at_rest", "steps of scenes at exact rest", MSIM_SKIP_AT_REST),
    FLAG("islands",
         "the common system of all particles if the scene has parts that no spring connects "
         "(islands)",
         MSIM_SKIP_ISLANDS),
    TEXT("plugin_path", "list of folders", "",
         "folders searched first for plugins, separated by ':'", plugin_path, NULL),
};
enum { NOPTIONS = sizeof table / sizeof *table };

const msim_option_entry *msim_option_info(int32_t i) {
  return i >= 0 && i < NOPTIONS ? &table[i].entry : NULL;
}

static const char *option_name(int32_t i, const void *data) {
  (void)data;
  return i < NOPTIONS ? table[i].entry.name : NULL;
}

static const option *find_option(const char *name) {
  for (int i = 0; i < NOPTIONS; i++)
    if (strcmp(table[i].entry.name, name) == 0) return &table[i];
  return NULL;
}

static int is_number(const option *o) {
  return o->type == REAL || o->type == INT32 || o->type == INT64;
}

const msim_option_entry *ms_options_find(const char *name, int *number) {
  const option *o = find_option(name);
  *number = o && is_number(o);
  return o ? &o->entry : NULL;
}

void ms_options_get_values(int32_t i, ms_option_values *values) {
  const option *o = &table[i];
  *values = (ms_option_values){.is_number = is_number(o),
                               .is_whole = o->type == INT32 || o->type == INT64,
                               .is_choice = o->type == CHOICE || o->type == SKIP,
                               .least = o->least,
                               .open = o->open,
                               .example = o->example};
}

/*------------------------------------- one member -----------------------------------------------*/

static void *option_member(msim_options *opt, const option *o) { return (char *)opt + o->member; }

/* Index of the word in "a | b | c"; -1: not in it. */
static int32_t find_choice(const char *values, const char *word) {
  size_t length = strlen(word);
  int32_t i = 0;
  for (const char *v = values; v; i++) {
    const char *bar = strstr(v, " | ");
    size_t n = bar ? (size_t)(bar - v) : strlen(v);
    if (n == length && strncmp(v, word, n) == 0) return i;
    v = bar ? bar + 3 : NULL;
  }
  return -1;
}

int ms_options_accepts_word(const msim_option_entry *entry, const char *value) {
  return find_choice(entry->values, value) > 0;
}

void ms_options_describe_values(const msim_option_entry *entry, size_t size, char *text) {
  const char *word = entry->values, *bar;
  size_t n = 0;
  for (; (bar = strstr(word, " | ")) != NULL; word = bar + 3)
    n += (size_t)snprintf(text + n, size - n, "%.*s%s", (int)(bar - word), word,
                          strstr(bar + 3, " | ") ? ", " : " or ");
  snprintf(text + n, size - n, "%s", word);
}

static int in_range(const option *o, double value) {
  return isfinite(value) && (o->open ? value > o->least : value >= o->least);
}

static msim_status refuse_value(const option *o, const char *found, msim_error *err) {
  char values[64];
  ms_options_describe_values(&o->entry, sizeof values, values);
  return ms_error_set(err, MSIM_ERR_ARG, "%s is '%s'; it must be %s%s%s", o->entry.name, found,
                      o->type == CHOICE || o->type == SKIP ? "" : "a ", values,
                      o->type == REAL && strchr(found, ',') ? ", with a decimal point" : "");
}

static msim_status set_number(msim_options *opt, const option *o, const char *value,
                              msim_error *err) {
  double real = 0;
  int64_t whole = 0;
  if (o->type == REAL && ms_options_accepts_word(&o->entry, value)) {
    *(double *)option_member(opt, o) = o->unset;
    return MSIM_OK;
  }
  int parsed =
      o->type == REAL ? ms_text_parse_double(value, &real) : ms_text_parse_int64(value, &whole);
  if (o->type != REAL) real = (double)whole;
  if (!parsed || !in_range(o, real)) return refuse_value(o, value, err);
  if (o->type == INT32 && whole > INT32_MAX)
    return ms_error_set(err, MSIM_ERR_ARG, "%s is '%s'; it must be at most %d", o->entry.name,
                        value, INT32_MAX);
  if (o->type == REAL) *(double *)option_member(opt, o) = real;
  else if (o->type == INT64) *(int64_t *)option_member(opt, o) = whole;
  else *(int32_t *)option_member(opt, o) = (int32_t)whole;
  return MSIM_OK;
}

static msim_status set_option(msim_options *opt, const option *o, const char *value,
                              msim_error *err) {
  if (is_number(o)) return set_number(opt, o, value, err);
  if (o->type == WORD) {
    if (!*value) return refuse_value(o, value, err);
    *(const char **)option_member(opt, o) = value;
    return MSIM_OK;
  }
  int32_t pick = find_choice(o->entry.values, value);
  if (pick < 0) return refuse_value(o, value, err);
  if (o->type == CHOICE) *(int32_t *)option_member(opt, o) = pick;
  else if (pick == 1) opt->skip_off |= o->bit;
  else opt->skip_off &= ~o->bit;
  return MSIM_OK;
}

/*------------------------------------- values as text -------------------------------------------*/

/* The word with index `pick` in "a | b | c". */
static void format_choice(const char *values, int32_t pick, ms_number_text_buffer *word) {
  for (; pick > 0; pick--) values = strstr(values, " | ") + 3;
  const char *bar = strstr(values, " | ");
  const size_t length = bar ? (size_t)(bar - values) : strlen(values);
  snprintf(word->text, sizeof word->text, "%.*s", (int)length, values);
}

static void format_number(const option *o, const void *member, ms_number_text_buffer *number) {
  double value = 0;
  if (o->type == REAL) value = *(const double *)member;
  else if (o->type == INT64) value = (double)*(const int64_t *)member;
  else value = *(const int32_t *)member;
  if (value != o->unset) *number = ms_text_format_double(value);
  else if (strstr(o->entry.values, " | ")) format_choice(o->entry.values, 1, number);
}

const char *ms_options_format_value(const msim_options *opt, int32_t i,
                                    ms_number_text_buffer *number) {
  const option *o = &table[i];
  const void *member = (const char *)opt + o->member;
  number->text[0] = 0;
  if (o->type == WORD) {
    const char *word = *(const char *const *)member;
    return word ? word : number->text;
  }
  if (o->type == CHOICE) format_choice(o->entry.values, *(const int32_t *)member, number);
  else if (o->type == SKIP) format_choice(o->entry.values, (opt->skip_off & o->bit) != 0, number);
  else format_number(o, member, number);
  return number->text;
}

/*------------------------------------- public ---------------------------------------------------*/

/* Sizes of structs that hold one member at least. */
static int has_member(size_t size) { return size >= MS_SIZE_THROUGH(msim_options, integrator); }

int ms_options_have_frame_times(const msim_options *opt) { return opt->tol > 0 && opt->every <= 0; }

int ms_options_accept_incomplete(const msim_options *opt) {
  return opt->incomplete == MSIM_INCOMPLETE_ACCEPT && !(opt->tol > 0);
}

msim_status msim_options_init(msim_options *opt, size_t size) {
  if (!opt) return MSIM_ERR_ARG;
  if (!has_member(size)) return MSIM_ERR_SIZE;
  msim_options full = {.size = size};
  for (int i = 0; i < NOPTIONS; i++) {
    const option *o = &table[i];
    if (*o->entry.preset) set_option(&full, o, o->entry.preset, NULL);
    else if (o->type == INT32) *(int32_t *)option_member(&full, o) = (int32_t)o->unset;
    else if (o->type == INT64) *(int64_t *)option_member(&full, o) = (int64_t)o->unset;
    else if (o->type == REAL) *(double *)option_member(&full, o) = o->unset;
  }
  memset(opt, 0, size); /* members of a newer msim, too */
  memcpy(opt, &full, size < sizeof full ? size : sizeof full);
  return MSIM_OK;
}

/* Write to the caller's options, as far as their size goes. */
static void write_options(const msim_options *full, msim_options *opt) {
  (void)ms_sized_write(opt, full, sizeof *full); /* ms_options_copy has checked the size */
}

msim_status msim_options_set(msim_options *opt, const char *name, const char *value,
                             msim_error *err) {
  if (!opt || !name || !value) return ms_error_set(err, MSIM_ERR_ARG, "opt, name or value is NULL");
  const option *o = find_option(name);
  if (!o)
    return ms_error_set(err, MSIM_ERR_ARG, "there is no option '%s'%s", name,
                        ms_suggest_hint(name, option_name, NULL).text);
  msim_options full;
  msim_status status = ms_options_copy(opt, &full, err);
  if (!status) status = set_option(&full, o, value, err);
  if (status) return status;
  write_options(&full, opt);
  return ms_error_clear(err);
}

msim_status msim_options_from_scene(msim_options *opt, const msim_scene *scene, msim_error *err) {
  if (!opt || !scene) return ms_error_set(err, MSIM_ERR_ARG, "opt or scene is NULL");
  msim_options full;
  msim_status status = ms_options_copy(opt, &full, err);
  full.size = sizeof full;
  for (int32_t i = 0; i < scene->data->nrun && !status; i++)
    status = msim_options_set(&full, scene->data->run[i].name, scene->data->run[i].value, err);
  if (status) return status;
  write_options(&full, opt);
  return ms_error_clear(err);
}

msim_status ms_options_copy(const msim_options *from, msim_options *to, msim_error *err) {
  if (!has_member(from->size))
    return ms_error_set(err, MSIM_ERR_SIZE, "options.size is %zu: call msim_options_init first",
                        from->size);
  const msim_status status = ms_sized_check(from, sizeof *from, 0, "options", "options", err);
  if (status) return status;
  msim_options_init(to, sizeof *to);
  memcpy(to, from, from->size < sizeof *to ? from->size : sizeof *to);
  return MSIM_OK;
}

static msim_status check_option(const msim_options *opt, const option *o, msim_error *err) {
  const void *member = (const char *)opt + o->member;
  double value = 0;
  if (o->type == REAL) value = *(const double *)member;
  else if (o->type == INT64) value = (double)*(const int64_t *)member;
  else if (o->type == INT32 || o->type == CHOICE) value = *(const int32_t *)member;
  else return MSIM_OK;
  if (value == o->unset) return MSIM_OK;
  int good = in_range(o, value);
  if (o->type == CHOICE) {
    int32_t choices = 1;
    for (const char *v = o->entry.values; (v = strstr(v, " | ")) != NULL; v += 3) choices++;
    good = value >= 0 && value < choices;
  }
  if (good) return MSIM_OK;
  char found[32];
  snprintf(found, sizeof found, "%g", value);
  return refuse_value(o, found, err);
}

msim_status ms_options_check(const msim_options *opt, msim_error *err) {
  for (int i = 0; i < NOPTIONS; i++) {
    msim_status status = check_option(opt, &table[i], err);
    if (status) return status;
  }
  return MSIM_OK;
}
