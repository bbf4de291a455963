#include "precision_cells.h"

#include <math.h>
#include <stdio.h>

double ratio_of_results(double a, double b) {
  if (isfinite(a) && isfinite(b)) return a / b;
  if (isfinite(b)) return INFINITY;
  return isfinite(a) ? 0 : NAN;
}

static double over_sundials(const cell *here, double seconds) {
  return here->compared ? ratio_of_results(seconds, here->sundials) : NAN;
}

/*------------------------------------- the cells of a scene -------------------------------------*/

static const column columns[] = {{"error", "error", -6, "%.0e", 0},
                                 {"best of msim", "best", -24, NULL, 0},
                                 {"ms", "best_ms", 9, "%.4g", 0},
                                 {"auto, ms", "auto_ms", 9, "%.4g", 0},
                                 {"auto/best", "auto_over_best", 9, "%.4g", 0},
                                 {"best of SUNDIALS", "sundials", -24, NULL, 0},
                                 {"ms", "sundials_ms", 9, "%.4g", 0},
                                 {"best/SUN.", "best_over_sundials", 9, "%.4g", 0},
                                 {"auto/SUN.", "auto_over_sundials", 9, "%.4g", 0},
                                 {.key = NULL}};

static void report_cell(report *out, const cell *here, const precision_method *best,
                        const precision_method *sundials) {
  const json_t *row = report_add_row(
      out, "cell",
      FIELDS(TEXT("scene", here->scene->name), REAL("error", levels[here->level]),
             TEXT("best", best ? best->name : NULL),
             TEXT("sundials", sundials ? sundials->name : NULL), REAL("best_ms", 1e3 * here->best),
             REAL("auto_ms", 1e3 * here->chosen), REAL("sundials_ms", 1e3 * here->sundials),
             REAL("auto_over_best", ratio_of_results(here->chosen, here->best)),
             REAL("best_over_sundials", over_sundials(here, here->best)),
             REAL("auto_over_sundials", over_sundials(here, here->chosen))));
  print_row(columns, row);
}

void cells_add(const setting_sweep *c, report *out, cells *list) {
  const reference_solution *t = c->context.reference;
  const precision_method *chosen = precision_methods_find(&c->methods, AUTO_BY_TOL);
  print_titles(columns);
  for (int l = 0; l < ERROR_LEVELS && list->count < MAX_CELLS; l++) {
    if (!reference_solution_supports(t, levels[l])) continue;
    const precision_method *best = fastest_method(c, DOUBLE, levels[l]),
                           *sundials = fastest_method(c, LIBRARY, levels[l]);
    cell *here = &list->all[list->count++];
    *here = (cell){.scene = c->context.kind,
                   .level = l,
                   .compared = c->context.ode && !t->impacts,
                   .best = cost_at_error(c, best, levels[l]).seconds,
                   .chosen = cost_at_error(c, chosen, levels[l]).seconds,
                   .sundials = cost_at_error(c, sundials, levels[l]).seconds};
    report_cell(out, here, best, sundials);
  }
  if (t->impacts) puts(" SUNDIALS is not compared in this scene: it has no impacts with planes");
}

/*------------------------------------- keys -----------------------------------------------------*/

/* `auto` over the best method of msim, over all cells. */
static void report_auto_over_best(const cells *list, report *out) {
  double ratios[MAX_CELLS];
  int count = 0, missing = 0, empty = 0;
  for (const cell *here = list->all; here < list->all + list->count; here++) {
    const double ratio = ratio_of_results(here->chosen, here->best);
    missing += isinf(ratio) != 0;
    empty += isnan(ratio) != 0;
    if (!isnan(ratio)) ratios[count++] = ratio;
  }
  printf(
      "time of auto over the best method of msim: %d cells; auto has no result in %d of them; %d "
      "more cells have no result at all\n",
      count, missing, empty);
  report_key(out, "auto_over_best_cells", count);
  report_key(out, "auto_over_best_missing", missing);
  report_key(out, "auto_over_best_empty", empty);
  report_key(out, "auto_over_best_p80", count ? quantile(count, ratios, 0.8) : NAN);
  report_key(out, "auto_over_best_worst", count ? quantile(count, ratios, 1) : NAN);
}

/* Keys of the largest ratio at each error: of `auto`, else of the best method; over which scenes */
static const struct over_sundials_key {
  const char *name; /* without the error */
  int of_auto, undamped, damped;
} keys[] = {{"best_over_sundials_", 0, 1, 1},
            {"damped_over_sundials_", 0, 0, 1},
            {"auto_over_sundials_", 1, 1, 0},
            {"auto_over_sundials_damped_", 1, 0, 1}};

static void report_over_sundials(const cells *list, int level, const struct over_sundials_key *of,
                                 report *out) {
  static const char *const names[ERROR_LEVELS] = {NULL, "1e4", "1e6", "1e8", NULL};
  const cell *worst = NULL;
  double most = NAN;
  int scenes = 0, missing = 0;
  char key[64];
  if (!names[level]) return;
  for (const cell *here = list->all; here < list->all + list->count; here++) {
    const int counts = here->scene->damped ? of->damped : of->undamped;
    if (here->level != level || !here->compared || !counts) continue;
    const double ratio = over_sundials(here, of->of_auto ? here->chosen : here->best);
    scenes++;
    missing += isnan(here->sundials) != 0;
    if (isnan(ratio) || most >= ratio) continue;
    worst = here;
    most = ratio;
  }
  snprintf(key, sizeof key, "%s%s", of->name, names[level]);
  report_add_row(
      out, "worst",
      FIELDS(TEXT("name", key), INTEGER("scenes", scenes), INTEGER("without_sundials", missing),
             TEXT("scene", worst ? worst->scene->name : NULL), REAL("ratio", most)));
  printf("%-30s %9.3g  maximum over %d scenes (SUNDIALS has no result in %d), in: %s\n", key, most,
         scenes, missing, worst ? worst->scene->name : "none");
  report_key(out, key, most);
}

void report_cell_keys(const cells *list, int with_sundials, report *out) {
  putchar('\n');
  report_auto_over_best(list, out);
  for (size_t k = 0; k < sizeof keys / sizeof *keys && with_sundials; k++)
    for (int l = 0; l < ERROR_LEVELS; l++) report_over_sundials(list, l, &keys[k], out);
}
