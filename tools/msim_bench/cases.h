/* cases - what the benches of implicit steps share: scenes in motion and steps from their state,
 * the rows that describe them, and the summary keys of each case */
#ifndef BENCH_CASES_H
#define BENCH_CASES_H

#include "benches.h"
#include "timing.h"

#define MAIN_STEP (1.0 / 60)          /* s; the summary has the keys of this step and of SOFT */
enum { SOFT = 1000, STIFF = 100000 }; /* N/m */

/* A scene, its stiffness, and the steps that are made from its state; 0: none. */
typedef struct bench_case {
  const char *scene;
  double k, steps[2];
} bench_case;

typedef void case_function(void *bench, moving_scene *m, double h);

/* Puts each selected scene in motion, prints a heading for each step and measures it. Scenes that
 * cannot be made are rows of `measure`. threads: option of the sims. */
void measure_cases(const bench_run *b, int count, const bench_case *cases, int32_t threads,
                   const char *measure, case_function *function, void *bench);

/* Appends a row with the properties of a scene and its step. */
json_t *add_step_row(report *out, const char *measure, const moving_scene *m, double h,
                     const field *fields);

/* Writes and prints a row for a solver that was not run. */
void report_left_out(report *out, const char *measure, const moving_scene *m, double h,
                     const char *solver, const char *why);

/* The key of a ratio in a case; NULL: it is not in the summary. */
const char *case_key(const report *r, const char *ratio, const char *scene, double k, double h);

/* Sets the key of a ratio in a case, if it has one. */
void report_case_key(report *r, const char *ratio, const char *scene, double k, double h,
                     double value);

/* Sets all keys of a case that have no value yet to "no result". */
void init_case_keys(report *r, const char *scene, double k, double h);

#endif
