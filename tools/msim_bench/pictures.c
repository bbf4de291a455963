/* The plot of each benchmark: which rows it shows, and how. */
#include <math.h>
#include <string.h>

#include "picture.h"

static const char *text_of(const json_t *row, const char *key) {
  const char *text = json_string_value(json_object_get(row, key));
  return text ? text : "";
}

/* Returns NAN if the row has no such number. */
static double number_of(const json_t *row, const char *key) {
  const json_t *value = json_object_get(row, key);
  return json_is_number(value) ? json_number_value(value) : NAN;
}

static int is_measure(const json_t *row, const char *measure) {
  return strcmp(text_of(row, "measure"), measure) == 0;
}

/* Whether the step has the k and h of the summary. */
static int is_main_step(const json_t *row) {
  return number_of(row, "k") == 1000 && fabs(number_of(row, "h") * 60 - 1) < 1e-6;
}

static int linear_point(const json_t *row, picture_point *p) {
  *p = (picture_point){text_of(row, "solver"), text_of(row, "scene"), NAN, number_of(row, "ms")};
  return is_main_step(row) &&
         (is_measure(row, "step") || is_measure(row, "default") || is_measure(row, "stock"));
}

static int scaling_point(const json_t *row, picture_point *p) {
  *p = (picture_point){text_of(row, "solver"), text_of(row, "scene"), number_of(row, "particles"),
                       number_of(row, "ms")};
  return is_main_step(row) && is_measure(row, "step");
}

static int skip_point(const json_t *row, picture_point *p) {
  *p = (picture_point){text_of(row, "way"), text_of(row, "skip"), NAN, number_of(row, "ms")};
  return is_measure(row, "step");
}

static int forces_point(const json_t *row, picture_point *p) {
  *p = (picture_point){text_of(row, "contestant"), text_of(row, "scene"), number_of(row, "springs"),
                       1e-6 * number_of(row, "springs_per_s")};
  return is_measure(row, "step");
}

static int step_point(const json_t *row, picture_point *p) {
  *p = (picture_point){text_of(row, "curve"), "", number_of(row, "accuracy"), number_of(row, "ms")};
  return is_main_step(row) && is_measure(row, "step");
}

static int precision_point(const json_t *row, picture_point *p) {
  *p = (picture_point){text_of(row, "method"), text_of(row, "scene"), number_of(row, "error"),
                       number_of(row, "ms")};
  return is_measure(row, "rung") && json_is_true(json_object_get(row, "near_best"));
}

/* y is the index of the outcome; a larger one is worse. */
static int stability_point(const json_t *row, picture_point *p) {
  static const char *const words[] = {"stable", "bounded", "dissipated", "reported",
                                      "silent", "crash",   "hang"};
  *p = (picture_point){text_of(row, "method"), text_of(row, "scene"), number_of(row, "h"), NAN};
  for (int i = 0; i < 7; i++)
    if (strcmp(text_of(row, "outcome"), words[i]) == 0) p->y = i;
  return is_measure(row, "cell") && isfinite(p->y); /* a refused cell has no outcome */
}

const picture stability_picture = {.title = "outcome of runs under stress",
                                   .x_label = "h, s",
                                   .heat = 1,
                                   .point = stability_point};
const picture linear_picture = {.title = "one linearly implicit step, k = 1000 N/m, h = 1/60 s",
                                .y_label = "ms",
                                .bars = 1,
                                .point = linear_point};
const picture scaling_picture = {.title = "one linearly implicit step, k = 1000 N/m, h = 1/60 s",
                                 .x_label = "particles",
                                 .y_label = "ms",
                                 .point = scaling_point};
const picture skip_picture = {.title = "one step, with what is not needed left out and without",
                              .y_label = "ms",
                              .bars = 1,
                              .point = skip_point};
const picture forces_picture = {.title = "explicit steps",
                                .x_label = "springs",
                                .y_label = "million springs a second",
                                .point = forces_point};
const picture step_picture = {.title = "one nonlinear step, k = 1000 N/m, h = 1/60 s",
                              .x_label = "relative error of the velocity",
                              .x_format = "%.0e",
                              .y_label = "ms",
                              .point = step_point};
const picture precision_picture = {.title = "run time against error",
                                   .x_label = "relative error of the positions",
                                   .x_format = "%.0e",
                                   .y_label = "ms",
                                   .panels = 1,
                                   .point = precision_point};
