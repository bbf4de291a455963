/* method_choice_report - the part of msim_sim_explain that says which methods integrator = auto
 * considered, at which steps and costs, and why it chose one of them */
#include <stdio.h>

#include "choose/method_choice.h"
#include "choose/rejection_reasons.h"

/* "dop853", "dop853, tol" or "dop853, 50 tol" */
static void name_candidate(const ms_candidate *c, double tol, size_t size, char *name) {
  char relaxed[16] = "";
  if (c->control_tol > tol) snprintf(relaxed, sizeof relaxed, "%.3g ", c->control_tol / tol);
  if (c->control_tol > 0) snprintf(name, size, "%s, %stol", c->method->entry.name, relaxed);
  else snprintf(name, size, "%s", c->method->entry.name);
}

static void explain_candidate(const ms_candidate *c, double tol, int is_best, ms_text *out) {
  char name[48];
  name_candidate(c, tol, sizeof name, name);
  const char *located = c->collision == MSIM_COLLISION_EVENT ? ", impacts located" : "";
  ms_text_append(out, "              %-17s ", name);
  if (c->rejection) {
    ms_text_append(out, "rejected%s: %s\n", located, ms_rejection_reasons_text(c->rejection));
    return;
  }
  ms_text_append(out, "h = %-8.3g %5.4g evaluations per step, %s%8.4g per simulated second%s%s%s\n",
                 c->h, c->step_cost, c->tried || c->error > 0 ? "" : "at least ", c->cost_rate,
                 c->precision == MSIM_PRECISION_SINGLE ? ", half as expensive with floats" : "",
                 located,
                 !is_best             ? ""
                 : c->control_tol > 0 ? ": chosen, with error control"
                                      : ": chosen, with fixed steps");
}

static int has_left_respa(const ms_method_choice *s) {
  for (int i = 0; i < MS_CANDIDATES; i++)
    if (s->candidates[i].rejection == MS_REASON_RESONANCE) return 1;
  return 0;
}

void ms_method_choice_explain(const ms_method_choice *s, ms_text *out) {
  const ms_step_verification *v = &s->verification;
  ms_text_append(out, "auto          chosen for tol = %g ", s->tol);
  if (s->total_cost == 0) ms_text_append(out, "without a pilot run or trials\n");
  else if (s->pilot_time == 0) ms_text_append(out, "by trials");
  else ms_text_append(out, "by a pilot run of %.3g s and trials from its end", s->pilot_time);
  if (s->total_cost > 0)
    ms_text_append(out, ",\n              at the cost of %.0f evaluations of the forces\n",
                   s->total_cost);
  for (int i = 0; i < MS_CANDIDATES; i++)
    explain_candidate(&s->candidates[i], s->tol, i == s->best, out);
  if (ms_choice_best(s)->control_tol > s->tol)
    ms_text_append(out,
                   "              error control with %.3g keeps tol, as damping removes most of "
                   "the errors that it sees\n",
                   ms_choice_best(s)->control_tol);
  if (ms_choice_best(s)->control_tol > 0 && v->allowed > 0)
    ms_text_append(out,
                   "              in substeps: frames keep the steps with which the run began\n");
  else if (v->allowed > 0)
    ms_text_append(out,
                   "              steps are verified: a step and two half steps may differ by %.2g "
                   "of the scales\n",
                   v->allowed);
  if (v->planes_far)
    ms_text_append(out, "              the choice will be repeated when a plane is close\n");
  if (s->substeps > 1)
    ms_text_append(out, "              %lld substeps per step, since %s\n", (long long)s->substeps,
                   has_left_respa(s) ? "respa was left" : "a plane came close");
}
