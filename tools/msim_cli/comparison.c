#include "comparison.h"

#include <stdio.h>
#include <string.h>

#include "../common/message.h"

typedef enum method { EXPLICIT, IMPLICIT, CONTROLLED, AUTOMATIC, NMETHODS } method;

/* h and tol, unless the options give tol; tol 0: fixed steps */
static const struct {
  const char *name;
  double h, tol;
  const char *why;
} methods[NMETHODS] = {
    [EXPLICIT] = {"velocity-verlet", MSIM_H_AUTO, 0,
                  "explicit, h just below the limit of stability; energy stays bounded"},
    [IMPLICIT] = {"linearly-implicit-euler", 1. / 60, 0,
                  "implicit, 60 steps a second: for pictures, as it damps vibrations"},
    [CONTROLLED] = {"dop853", 1e-3, 1e-6, "explicit, error control: close to the exact motion"},
    [AUTOMATIC] = {"auto", 1e-3, 1e-4, "the least expensive method for this tol"},
};

/* What a method would do in the scene */
typedef struct row {
  msim_status status;
  msim_error error;
  char name[64];
  double h, tol; /* h: mean step, s */
  msim_estimate cost;
} row;

/*------------------------------------- one method -----------------------------------------------*/

static msim_options method_options(const setup *made, method which) {
  msim_options options = made->options;
  const double h = methods[which].h, tol = methods[which].tol;
  if (options.steps >= 0 && options.h > 0) options.t_end = (double)options.steps * options.h;
  options.steps = -1;
  if (options.t_end < 0) options.t_end = 1;
  options.integrator = methods[which].name;
  options.h = options.t_end > 0 && h > options.t_end ? options.t_end : h;
  options.tol = tol > 0 && made->options.tol > 0 ? made->options.tol : tol;
  return options;
}

static row measure_method(const setup *made, method which) {
  const msim_options options = method_options(made, which);
  row r = {.tol = options.tol, .cost.size = sizeof r.cost};
  msim_plan plan = {.size = sizeof plan};
  msim_sim *sim;
  snprintf(r.name, sizeof r.name, "%s", options.integrator);
  r.status = msim_sim_create(made->scene, &options, &sim, &r.error);
  if (r.status) return r;
  msim_sim_plan(sim, &plan);
  if (which == AUTOMATIC) snprintf(r.name, sizeof r.name, "auto (%s)", plan.integrator);
  r.status = msim_sim_estimate(sim, &r.cost, &r.error);
  r.h = r.cost.steps > 0 ? options.t_end / r.cost.steps : plan.h;
  msim_sim_destroy(sim);
  return r;
}

/*------------------------------------- the table ------------------------------------------------*/

enum { WHY_COLUMN = 4 };

static void print_row(const row *r, const char *why) {
  char error[32] = "not known";
  if (r->tol > 0) snprintf(error, sizeof error, "%.3g", r->tol);
  if (r->status) printf("%-26s %10s %10s %12s %10s   -\n", r->name, "-", "-", "-", "-");
  else
    printf("%-26s %10.4g %10.0f %12.0f %10.0f   %s\n", r->name, r->h, r->cost.steps,
           r->cost.force_evaluations, r->cost.solves, error);
  printf("%*s", WHY_COLUMN, "");
  print_wrapped(WHY_COLUMN, r->status ? r->error.text : why);
}

/* The method whose error is known and lowest in cost for its tol; without any the less expensive
 * one of the fixed steps, where the implicit method has to save half, as it damps. */
static method recommend(const row *rows) {
  if (!rows[AUTOMATIC].status) return AUTOMATIC;
  if (!rows[CONTROLLED].status) return CONTROLLED;
  if (rows[IMPLICIT].status) return EXPLICIT;
  return !rows[EXPLICIT].status && rows[EXPLICIT].cost.work < 2 * rows[IMPLICIT].cost.work
             ? EXPLICIT
             : IMPLICIT;
}

static void print_options(const row *rows, method which) {
  printf("--integrator %s", methods[which].name);
  if (rows[which].tol > 0) printf(" --tol %g", rows[which].tol);
  else if (which == EXPLICIT) printf(" --h auto");
  else printf(" --h %.6g", rows[which].h);
}

static void print_recommendation(const row *rows) {
  const method best = recommend(rows);
  const double work = rows[best].cost.work;
  printf("\nrecommended   ");
  print_options(rows, best);
  puts(rows[best].tol > 0 ? ": its error is known" : ": the least expensive one that runs");
  if (best != IMPLICIT && !rows[IMPLICIT].status && 2 * rows[IMPLICIT].cost.work < work) {
    printf("for pictures  ");
    print_options(rows, IMPLICIT);
    printf(": at %.2g of the cost\n", rows[IMPLICIT].cost.work / work);
  }
  puts("details       'msim_cli explain' with these options");
}

int comparison_print(const setup *made) {
  row rows[NMETHODS];
  int refused = 0;
  printf("no integrator is given; to t = %g s, by the first steps of each method:\n\n",
         method_options(made, EXPLICIT).t_end);
  printf("%-26s %10s %10s %12s %10s   %s\n", "method", "h, s", "steps", "evaluations", "solves",
         "error");
  for (int i = 0; i < NMETHODS; i++) {
    rows[i] = measure_method(made, (method)i);
    refused += rows[i].status != MSIM_OK;
    print_row(&rows[i], methods[i].why);
  }
  if (refused == NMETHODS) return report_error("none of these methods can run this scene");
  print_recommendation(rows);
  return EXIT_OK;
}
