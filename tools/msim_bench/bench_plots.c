/* The plot of each benchmark: which rows it shows, and how. */
#include <math.h>
#include <string.h>

#include "plot.h"

static const char *text_of(const json_t *row, const char *key) {
  const char *text = json_string_value(json_object_get(row, key));
  return text ? text : "";
}

/* Returns NAN if the row has no such number. */
static double json_number_of(const json_t *row, const char *key) {
  const json_t *value = json_object_get(row, key);
  return json_is_number(value) ? json_number_value(value) : NAN;
}

static int is_measure(const json_t *row, const char *measure) {
  return strcmp(text_of(row, "measure"), measure) == 0;
}

/* Whether the step has the k and h of the summary. */
static int is_main_step(const json_t *row) {
  return json_number_of(row, "k") == 1000 && fabs(json_number_of(row, "h") * 60 - 1) < 1e-6;
}

static int linear_point(const json_t *row, plot_point *p) {
  *p = (plot_point){text_of(row, "solver"), text_of(row, "scene"), NAN, json_number_of(row, "ms")};
  return is_main_step(row) &&
         (is_measure(row, "step") || is_measure(row, "default") || is_measure(row, "stock"));
}

static int scaling_point(const json_t *row, plot_point *p) {
  *p = (plot_point){text_of(row, "solver"), text_of(row, "scene"), json_number_of(row, "particles"),
                    json_number_of(row, "ms")};
  return is_main_step(row) && is_measure(row, "step");
}

static int skip_point(const json_t *row, plot_point *p) {
  *p = (plot_point){text_of(row, "way"), text_of(row, "skip"), NAN, json_number_of(row, "ms")};
  return is_measure(row, "step");
}

static int forces_point(const json_t *row, plot_point *p) {
  *p = (plot_point){text_of(row, "contestant"), text_of(row, "scene"),
                    json_number_of(row, "springs"), 1e-6 * json_number_of(row, "springs_per_s")};
  return is_measure(row, "step");
}

static int step_point(const json_t *row, plot_point *p) {
  *p = (plot_point){text_of(row, "curve"), "", json_number_of(row, "accuracy"),
                    json_number_of(row, "ms")};
  return is_main_step(row) && is_measure(row, "step");
}

static int precision_point(const json_t *row, plot_point *p) {
  *p = (plot_point){text_of(row, "method"), text_of(row, "scene"), json_number_of(row, "error"),
                    json_number_of(row, "ms")};
  return is_measure(row, "rung") && json_is_true(json_object_get(row, "near_best"));
}

/* y is the index of the outcome; a larger one is worse. */
static int stability_point(const json_t *row, plot_point *p) {
  static const char *const words[] = {"stable", "bounded", "dissipated", "reported",
                                      "silent", "crash",   "hang"};
  *p = (plot_point){text_of(row, "method"), text_of(row, "scene"), json_number_of(row, "h"), NAN};
  for (int i = 0; i < 7; i++)
    if (strcmp(text_of(row, "outcome"), words[i]) == 0) p->y = i;
  return is_measure(row, "cell") && isfinite(p->y); /* a refused cell has no outcome */
}

const plot stability_picture = {.title = "outcome of runs under stress",
                                .x_label = "h, s",
                                .heat = 1,
                                .point = stability_point};
const plot linear_picture = {.title = "one linearly implicit step, k = 1000 N/m, h = 1/60 s",
                             .y_label = "ms",
                             .bars = 1,
                             .point = linear_point};
const plot scaling_picture = {.title = "one linearly implicit step, k = 1000 N/m, h = 1/60 s",
                              .x_label = "particles",
                              .y_label = "ms",
                              .point = scaling_point};
const plot skip_picture = {.title = "one step, with what is not needed left out and without",
                           .y_label = "ms",
                           .bars = 1,
                           .point = skip_point};
const plot forces_picture = {.title = "explicit steps",
                             .x_label = "springs",
                             .y_label = "million springs a second",
                             .point = forces_point};
const plot step_picture = {.title = "one nonlinear step, k = 1000 N/m, h = 1/60 s",
                           .x_label = "relative error of the velocity",
                           .x_format = "%.0e",
                           .y_label = "ms",
                           .point = step_point};
const plot precision_picture = {.title = "run time against error",
                                .x_label = "relative error of the positions",
                                .x_format = "%.0e",
                                .y_label = "ms",
                                .panels = 1,
                                .point = precision_point};
