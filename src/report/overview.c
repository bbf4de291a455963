#include "report/overview.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "methods/methods.h"
#include "sim/frames.h"

static const double PI = 3.141592653589793;

/* 1: explicit steps of fixed length, whose limit of stability is known */
static int has_limit(const msim_sim *sim) {
  return !ms_sim_has_control(sim) && !ms_sim_selects(sim) && sim->config.integrator->limit &&
         sim->config.step_limit.limit < INFINITY;
}

/*------------------------------------- advice ---------------------------------------------------*/

/* How the error of fixed steps would be known; motions and colliders exclude `auto` */
static const char *find_error_remedy(const msim_sim *sim) {
  const ms_scene *scene = sim->scene;
  if (scene->ncolliders == 0 && scene->nmotions == 0) return "integrator = auto with tol finds it";
  if (scene->ncolliders == 0 && ms_control_is_supported(sim->config.integrator))
    return "tol in place of h bounds it";
  return "a run with h/2 shows it";
}

static void advise_explicit(const msim_sim *sim, ms_text *out) {
  const double h = sim->run.h, limit = sim->config.step_limit.limit;
  const char *name = sim->config.integrator->entry.name;
  if (ms_step_limit_is_beyond_range(&sim->config.step_limit))
    ms_text_append(out,
                   "use smaller k, or larger masses: springs vibrate faster than double precision "
                   "can say\n");
  else if (limit == 0)
    ms_text_append(out, "use velocity-verlet: with %s undamped vibrations grow at any h\n", name);
  else if (h > limit)
    ms_text_append(out,
                   "use h = %.3g, or an implicit integrator: h is %.3g times the stability limit\n",
                   MS_STABLE_FRACTION * limit, h / limit);
  else
    ms_text_append(out,
                   "run it: h is %.3g of the stability limit; its error is not estimated: %s\n",
                   h / limit, find_error_remedy(sim));
}

/* Fixed steps of a method without a limit of stability, or in a scene without one */
static void advise_fixed(const msim_sim *sim, ms_text *out) {
  const int implicit = sim->config.integrator->entry.implicit;
  if (implicit && sim->scene->nplanes > 0 && sim->scene->nmotions == 0 &&
      !ms_scene_constrains(sim->scene, sim->config.opt.collision))
    ms_text_append(out,
                   "use collision = event: particles that are mirrored behind a plane may gain "
                   "energy\n");
  else if (implicit && sim->run.h * sim->config.step_limit.bounds.omega > 1)
    ms_text_append(out,
                   "run it for pictures: it is stable, but distorts vibrations shorter than %.3g "
                   "s; for their error: %s\n",
                   2 * PI * sim->run.h, find_error_remedy(sim));
  else ms_text_append(out, "run it; its error is not estimated: %s\n", find_error_remedy(sim));
}

/* failed: why the first steps of the run fail; NULL: they do not */
static void explain_advice(const msim_sim *sim, const msim_error *failed, ms_text *out) {
  ms_text_append(out, "%-13s ", "advice");
  if (failed) ms_text_append(out, "change the run, as it fails: %s\n", failed->text);
  else if (ms_sim_has_control(sim) || ms_sim_selects(sim))
    ms_text_append(out, "run it: the error at the end is about tol = %g of extent and speed\n",
                   ms_sim_selects(sim) ? sim->config.choice.tol : sim->config.opt.tol);
  else if (has_limit(sim)) advise_explicit(sim, out);
  else advise_fixed(sim, out);
}

/*------------------------------------- method and cost ------------------------------------------*/

static void explain_steps(const msim_sim *sim, ms_text *out) {
  ms_text_append(out, "%-13s %s%s, ", "method", sim->config.integrator->entry.name,
                 ms_sim_selects(sim) ? ", chosen by auto" : "");
  if (ms_sim_has_control(sim))
    ms_text_append(out, "steps chosen by error control with tol = %g\n", sim->config.opt.tol);
  else ms_text_append(out, "fixed steps of h = %.6g s\n", sim->run.h);
}

/* To three digits, as a whole number */
static double round_count(double count) {
  if (!(count >= 1000)) return round(count);
  const double unit = pow(10, floor(log10(count)) - 2);
  return round(count / unit) * unit;
}

static void explain_cost(const msim_sim *sim, const msim_estimate *e, ms_text *out) {
  const int exact = !ms_sim_has_control(sim);
  ms_text_append(out, "%-13s %s%.0f steps%s, about %.0f evaluations of the forces", "cost",
                 exact ? "" : "about ", exact ? e->steps : round_count(e->steps),
                 sim->config.plan.t_end < 0 ? " for each second" : "",
                 round_count(e->force_evaluations));
  if (e->solves > 0) ms_text_append(out, ", %.0f solves", round_count(e->solves));
  if (e->iterations > 0) ms_text_append(out, " with %.0f iterations", round_count(e->iterations));
  if (e->factorizations > 0)
    ms_text_append(out, ", %.0f factorizations", round_count(e->factorizations));
  ms_text_append(out, ", by the first %lld\n", (long long)e->tried);
}

/*------------------------------------- limit ----------------------------------------------------*/

/* The particle with the largest Gershgorin disc of stiffness over mass, and its stiffest spring */
typedef struct fastest {
  int32_t particle, spring; /* -1: no spring acts on a free particle */
  double omega2, k;         /* 1/s^2; N/m, of that spring */
} fastest;

static void find_stiffest_spring(const ms_model *model, int32_t row, fastest *f) {
  const ms_half_edges *h = &model->half_edges;
  const ms_half_edge_span span = ms_half_edges_of_row(h, row);
  f->k = -1;
  for (int32_t at = span.begin; at < span.end; at += span.step) {
    const double k = h->stiffness[ms_half_edges_value(h, at)];
    if (h->spring[at] < 0 || k <= f->k) continue;
    f->k = k, f->spring = ms_springs_number(&model->springs, h->spring[at]);
  }
}

static fastest find_fastest(const msim_sim *sim) {
  fastest f = {-1, -1, 0, 0};
  for (int32_t i = 0; i < sim->nislands; i++) {
    const ms_model *model = &sim->islands[i].model;
    for (int32_t r = 0; r < model->unknowns.nfree; r++) {
      const double omega2 = ms_bounds_sum_stiffness(model, r) * model->inv_mass[r];
      if (!(omega2 > f.omega2)) continue;
      f.omega2 = omega2, f.particle = model->unknowns.particle[r];
      find_stiffest_spring(model, r, &f);
    }
  }
  return f;
}

/* Of h^2 omega^2 + 2 h rate <= 4 (bounds.h), which term is larger at the limit */
static int is_limited_by_damping(const ms_bounds *b) {
  const double h = ms_bounds_verlet_limit(b);
  return b->rate > 0 && 2 * h * b->rate > h * h * b->omega * b->omega;
}

static const char *limiting_reason(const msim_sim *sim) {
  if (sim->config.integrator->entry.implicit) return "accuracy, as any h is stable";
  if (ms_sim_has_control(sim) || ms_sim_selects(sim)) return "accuracy, then stability";
  return is_limited_by_damping(&sim->config.step_limit.bounds) ? "stability of damping"
                                                               : "stability";
}

static void explain_limiting(const msim_sim *sim, ms_text *out) {
  const fastest f = find_fastest(sim);
  const double limit = sim->config.step_limit.limit;
  ms_text_append(out, "%-13s ", "limit");
  if (f.particle < 0) ms_text_append(out, "accuracy: no spring moves a particle");
  else {
    ms_text_append(out, "%s", limiting_reason(sim));
    if (limit > 0 && limit < INFINITY) ms_text_append(out, ", h < %.4g s", limit);
    ms_text_append(out, "; vibrations take %.3g s or more, at particle %d, spring %d, k = %.4g N/m",
                   2 * PI / sim->config.step_limit.bounds.omega, f.particle, f.spring, f.k);
  }
  if (sim->scene->nplanes + sim->scene->ncolliders > 0 &&
      sim->config.opt.collision == MSIM_COLLISION_REFLECT)
    ms_text_append(out, "; impacts are of order 1 in h");
  ms_text_append(out, "\n");
}

/*------------------------------------- output ---------------------------------------------------*/

/* "1.2 MB" */
typedef struct size_text {
  char text[32];
} size_text;

static size_text format_size(double bytes) {
  static const char *const units[] = {"bytes", "kB", "MB", "GB", "TB"};
  size_text s;
  int unit = 0;
  for (; bytes >= 1000 && unit < 4; unit++) bytes /= 1000;
  snprintf(s.text, sizeof s.text, "%.3g %s", bytes, units[unit]);
  return s;
}

/* x and v in double precision, strain and tension of each spring and face, reactions, beside
 * what an HDF5 file holds without frames; as text a line of nine numbers for each particle. */
static void explain_output(const msim_sim *sim, ms_text *out) {
  const double LINE = 150, EMPTY = 2e5, n = sim->scene->nparticles;
  const double cells = (double)sim->scene->nsprings + sim->scene->nfaces;
  const int64_t frames = ms_frames_count(&sim->config.plan, &sim->config.opt, MS_FRAMES_MAX);
  int pinned = 0;
  for (int32_t p = 0; p < sim->scene->nparticles && !pinned; p++) pinned = sim->scene->pinned[p];
  const double frame = 48 * n + 8 * cells + (pinned ? 12 * n : 0), text = LINE * n;
  ms_text_append(out, "%-13s ", "output");
  if (sim->config.plan.t_end < 0 || frames < 0)
    ms_text_append(out, "about %s a frame as .vtkhdf, %s as .csv\n", format_size(frame).text,
                   format_size(text).text);
  else
    ms_text_append(out, "%lld frames, about %s as .vtkhdf, %s as .csv\n", (long long)frames,
                   format_size(EMPTY + (double)frames * frame).text,
                   format_size((double)frames * text).text);
}

msim_status ms_overview_explain(msim_sim *sim, ms_text *out, msim_error *err) {
  msim_estimate estimate = {.size = sizeof estimate};
  msim_error why;
  const msim_status status = msim_sim_estimate(sim, &estimate, &why);
  if (status < 0) return ms_error_set(err, status, "%s", why.text);
  explain_advice(sim, status ? &why : NULL, out);
  explain_steps(sim, out);
  if (status) ms_text_append(out, "%-13s not estimated, as the first steps fail\n", "cost");
  else explain_cost(sim, &estimate, out);
  explain_limiting(sim, out);
  explain_output(sim, out);
  return MSIM_OK;
}
