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

static void print_method_name(const precision_method *method) {
  printf(" %-24.24s", method ? method->name : "no result");
}

static void print_cell_number(double value) {
  if (isnan(value)) printf(" %9s", "-");
  else printf(" %9.4g", value);
}

static void print_titles(void) {
  printf(" %-6s %-24s %9s %9s %9s %-24s %9s %9s %9s\n", "error", "best of msim", "ms", "auto, ms",
         "auto/best", "best of SUNDIALS", "ms", "best/SUN.", "auto/SUN.");
}

static void print_cell(const cell *here, const precision_method *best,
                       const precision_method *sundials) {
  printf(" %-6.0e", levels[here->level]);
  print_method_name(best);
  print_cell_number(1e3 * here->best);
  print_cell_number(1e3 * here->chosen);
  print_cell_number(ratio_of_results(here->chosen, here->best));
  print_method_name(sundials);
  print_cell_number(1e3 * here->sundials);
  print_cell_number(over_sundials(here, here->best));
  print_cell_number(over_sundials(here, here->chosen));
  putchar('\n');
}

/* A NAN has no key in the row, an infinite number is null. */
static void report_cell(report *out, const cell *here, const precision_method *best,
                        const precision_method *sundials) {
  json_t *row = report_add_row(out, "cell");
  put_text(row, "scene", here->scene->name);
  put_real(row, "error", levels[here->level]);
  if (best) put_text(row, "best", best->name);
  if (sundials) put_text(row, "sundials", sundials->name);
  put_real(row, "best_ms", 1e3 * here->best);
  put_real(row, "auto_ms", 1e3 * here->chosen);
  put_real(row, "sundials_ms", 1e3 * here->sundials);
  put_real(row, "auto_over_best", ratio_of_results(here->chosen, here->best));
  put_real(row, "best_over_sundials", over_sundials(here, here->best));
  put_real(row, "auto_over_sundials", over_sundials(here, here->chosen));
}

void cells_add(const setting_sweep *c, report *out, cells *list) {
  const reference_solution *t = c->arena.truth;
  const precision_method *chosen = precision_methods_find(&c->entrants, AUTO_BY_TOL);
  print_titles();
  for (int l = 0; l < ERROR_LEVELS && list->count < MAX_CELLS; l++) {
    if (!reference_solution_supports(t, levels[l])) continue;
    const precision_method *best = fastest_method(c, 1, levels[l]),
                           *sundials = fastest_method(c, 0, levels[l]);
    cell *here = &list->all[list->count++];
    *here = (cell){.scene = t->kind,
                   .level = l,
                   .compared = c->arena.ode && !t->kind->impacts,
                   .best = cost_at_error(c, best, levels[l]).seconds,
                   .chosen = cost_at_error(c, chosen, levels[l]).seconds,
                   .sundials = cost_at_error(c, sundials, levels[l]).seconds};
    print_cell(here, best, sundials);
    report_cell(out, here, best, sundials);
  }
  if (t->kind->impacts) puts(" SUNDIALS takes no part: it reflects nothing");
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
      "auto over the best of msim: %d cells, in %d of them only the others have a result; in %d "
      "more there is no result at all\n",
      count, missing, empty);
  report_key(out, "auto_over_best_cells", count);
  report_key(out, "auto_over_best_missing", missing);
  report_key(out, "auto_over_best_empty", empty);
  report_key(out, "auto_over_best_p80", count ? quantile(count, ratios, 0.8) : NAN);
  report_key(out, "auto_over_best_worst", count ? quantile(count, ratios, 1) : NAN);
}

/* The largest ratio at one error, over scenes with or without damping; of_auto: of `auto`, else of
 * the best method. */
static void report_over_sundials(const cells *list, int level, int damped, int of_auto,
                                 report *out) {
  static const char *const names[ERROR_LEVELS] = {NULL, "1e4", "1e6", "1e8", NULL};
  const cell *worst = NULL;
  double most = NAN;
  int scenes = 0, missing = 0;
  char key[64];
  if (!names[level]) return;
  for (const cell *here = list->all; here < list->all + list->count; here++) {
    if (here->level != level || !here->compared || here->scene->damped != damped) continue;
    const double ratio = over_sundials(here, of_auto ? here->chosen : here->best);
    scenes++;
    missing += isnan(here->sundials) != 0;
    if (isnan(ratio) || most >= ratio) continue;
    worst = here;
    most = ratio;
  }
  snprintf(key, sizeof key, "%s_over_sundials_%s%s", of_auto ? "auto" : "best",
           damped ? "damped_" : "", names[level]);
  json_t *row = report_add_row(out, "worst");
  put_text(row, "name", key);
  put_integer(row, "scenes", scenes);
  put_integer(row, "without_sundials", missing);
  if (worst) put_text(row, "scene", worst->scene->name);
  put_real(row, "ratio", most);
  printf("%-30s %9.3g  worst of %d scenes, %d of them without a result of SUNDIALS: %s\n", key,
         most, scenes, missing, worst ? worst->scene->name : "none");
  report_key(out, key, most);
}

void report_cell_keys(const cells *list, int with_sundials, report *out) {
  putchar('\n');
  report_auto_over_best(list, out);
  for (int damped = 0; damped < 2 && with_sundials; damped++)
    for (int of_auto = 0; of_auto < 2; of_auto++)
      for (int l = 0; l < ERROR_LEVELS; l++) report_over_sundials(list, l, damped, of_auto, out);
}
