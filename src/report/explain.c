/* explain - describe the plan of a run as text: what will run, what is skipped and why, limits */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec3.h"
#include "methods/methods.h"
#include "integrate/multirate.h"
#include "linear/aggregates.h"
#include "choose/method_choice.h"
#include "choose/precision_choice.h"
#include "report/overview.h"
#include "scene/laws.h"
#include "sim/frames.h"
#include "sim/sim.h"
#include "sim/rank_sim.h"

/* 1: an island has this feature. */
static int has_feature(const msim_sim *sim, unsigned feature) {
  unsigned features = 0;
  for (int32_t i = 0; i < sim->nislands; i++) features |= sim->islands[i].model.features;
  return (features & feature) != 0;
}

static int32_t count_all_free(const msim_sim *sim) {
  int32_t count = 0;
  for (int32_t i = 0; i < sim->nislands; i++) count += sim->islands[i].model.unknowns.nfree;
  return count;
}

/* "; colliders: sphere, box (inside)"; "" without any, and only the number of many */
typedef struct collider_text {
  char text[256];
} collider_text;

static collider_text describe_colliders(const ms_scene *s) {
  enum { MOST = 6 };
  collider_text list = {""};
  size_t n = 0;
  if (s->ncolliders > MOST) snprintf(list.text, sizeof list, "; colliders %d", s->ncolliders);
  for (int32_t i = 0; i < s->ncolliders && s->ncolliders <= MOST; i++)
    n += (size_t)snprintf(
        list.text + n, sizeof list - n, "%s%s%s%s",
        i ? ", " : "; colliders: ", ms_colliders_get_type(s->colliders[i].type)->name,
        s->colliders[i].inside ? " (inside)" : "", s->collider_motions[i].x.nt ? " (moves)" : "");
  return list;
}

static void explain_function(const msim_force_function *f, ms_text *out) {
  ms_text_append(out, "              force function '%s' of x%s%s; %s; %s\n", f->name,
                 f->flags & MSIM_FORCE_TIME ? ", t" : "",
                 f->flags & MSIM_FORCE_VELOCITY ? ", v" : "",
                 f->flags & MSIM_FORCE_JACOBIAN ? "derivatives in the matrix"
                                                : "without derivatives, which count as 0",
                 f->potential ? "its potential is part of the energy" : "its work is integrated");
}

static void explain_scene(const msim_sim *sim, ms_text *out) {
  const ms_scene *s = sim->scene;
  ms_text_append(out, "scene         %s\n", *s->name ? s->name : "(no name)");
  ms_text_append(out, "              particles %d, of them pinned %d; springs %d; planes %d%s\n",
                 s->nparticles, s->nparticles - count_all_free(sim), s->nsprings, s->nplanes,
                 describe_colliders(s).text);
  int32_t pushed = 0, moved = 0;
  for (int32_t p = 0; p < s->nparticles && s->force; p++)
    pushed += ms_vec3_norm(s->force + 3 * (size_t)p) > 0;
  for (int32_t m = 0; m < s->nmotions; m++) moved += s->motions[m].n;
  if (moved) ms_text_append(out, "              %d pinned particles move\n", moved);
  if (pushed) ms_text_append(out, "              constant forces on %d particles\n", pushed);
  if (ms_scene_has_function(s)) explain_function(&s->force_function, out);
}

static void explain_angles(const msim_sim *sim, ms_text *out) {
  const int32_t n = sim->scene->angles.n;
  if (n) ms_text_append(out, "              angular springs %d, evaluated apart from springs\n", n);
}

/* The springs with a law other than the linear one, by law */
static void explain_laws(const msim_sim *sim, ms_text *out) {
  const ms_scene *s = sim->scene;
  for (int32_t law = 1; law <= s->nlaws && s->law; law++) {
    int32_t count = 0;
    for (int32_t e = 0; e < s->nsprings; e++) count += s->law[e] == law;
    if (count)
      ms_text_append(
          out, "              law %d, %s, of %d springs, evaluated apart from linear ones%s\n", law,
          ms_laws_kind_name(s->laws[law - 1].given.kind), count,
          ms_law_breaks(&s->laws[law - 1]) ? "; they break" : "");
  }
}

static const char *island_solver_name(const ms_island_sim *m) {
  return m->stepper.solver->linear->name;
}

/* The number of islands that have the same solver as island i; 0: an earlier island has it, too. */
static int32_t count_solvers(const msim_sim *sim, int32_t i) {
  int32_t count = 0;
  for (int32_t k = 0; k < sim->nislands; k++) {
    const int same =
        strcmp(island_solver_name(&sim->islands[k]), island_solver_name(&sim->islands[i])) == 0;
    if (same && k < i) return 0;
    count += same;
  }
  return count;
}

static void explain_sizes(const msim_sim *sim, ms_text *out) {
  const int32_t most = ms_sim_largest_island(sim)->model.unknowns.nfree;
  int32_t least = most;
  for (int32_t i = 0; i < sim->nislands; i++)
    if (sim->islands[i].model.unknowns.nfree < least) least = sim->islands[i].model.unknowns.nfree;
  ms_text_append(out, "islands       %d, not connected by springs, with ", sim->nislands);
  if (least < most) ms_text_append(out, "%d to ", least);
  ms_text_append(out, "%d free particles\n", most);
}

static void explain_islands(const msim_sim *sim, ms_text *out) {
  if (sim->nislands == 1) return;
  explain_sizes(sim, out);
  const char *separator = "              solvers: ";
  for (int32_t i = 0; i < sim->nislands && sim->config.integrator->entry.implicit; i++) {
    const int32_t count = count_solvers(sim, i);
    if (!count) continue;
    ms_text_append(out, "%s%d %s", separator, count, island_solver_name(&sim->islands[i]));
    separator = ", ";
  }
  if (sim->config.integrator->entry.implicit)
    ms_text_append(out, "; below, the solver of the largest island\n");
}

static void explain_unknowns(const ms_unknowns *rows, ms_text *out) {
  const char *label = "unknowns";
  if (rows->distance_reduction > 0) {
    ms_text_append(out,
                   "%-13s renumbered breadth first: neighbours are %.3g times closer in memory\n",
                   label, rows->distance_reduction);
    label = "";
  }
  if (rows->sorted_by_degree)
    ms_text_append(out, "%-13s sorted by number of springs in windows of 64, to fill SIMD lanes\n",
                   label);
}

/* Error scales of the connected component, or of the smallest and the largest ones */
static void explain_scales(const msim_sim *sim, ms_text *out) {
  double least[2] = {INFINITY, INFINITY}, most[2] = {0, 0};
  int32_t parts = 0;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    for (int32_t i = 0; i < m->norm.n; i++, parts++) {
      const double scale[2] = {m->norm.body[i].extent, m->norm.body[i].speed};
      for (int k = 0; k < 2; k++)
        least[k] = fmin(least[k], scale[k]), most[k] = fmax(most[k], scale[k]);
    }
  if (parts == 1)
    ms_text_append(
        out, "              errors are relative to the extent, %.4g m, and the speed, %.4g m/s\n",
        most[0], most[1]);
  if (parts > 1)
    ms_text_append(out,
                   "              errors are relative to the extent, %.4g to %.4g m, and the "
                   "speed, %.4g to %.4g m/s, of each of\n"
                   "              %d connected components; the largest error determines the step\n",
                   least[0], most[0], least[1], most[1], parts);
}

static void explain_control(const msim_sim *sim, ms_text *out) {
  ms_text_append(out, "step          chosen by error control; the first h to try is %.3g s\n",
                 sim->run.h);
  ms_text_append(out,
                 "              each step may add tol = %g times h/T to the relative error, T the "
                 "length of the run\n",
                 sim->config.opt.tol);
  explain_scales(sim, out);
  ms_error_growth_explain(sim, out);
  if (sim->config.plan.t_end < 0)
    ms_text_append(out, "              tol refers to one second, as the run has no t_end\n");
  else if (ms_options_have_frame_times(&sim->config.opt))
    ms_text_append(out, "              to t = %.10g s; %lld frames if the run is recorded\n",
                   sim->config.plan.t_end,
                   (long long)ms_frames_count(&sim->config.plan, &sim->config.opt, MS_FRAMES_MAX));
  else
    ms_text_append(
        out, "              to t = %.10g s; one frame per %lld steps if the run is recorded\n",
        sim->config.plan.t_end, (long long)sim->config.opt.every);
}

static void explain_method(const msim_sim *sim, ms_text *out) {
  ms_text_append(out, "integrator    %s, order %d\n              %s\n",
                 sim->config.integrator->entry.name, sim->config.integrator->entry.order,
                 sim->config.integrator->entry.doc);
  if (ms_sim_selects(sim)) ms_method_choice_explain(&sim->config.choice, out);
  if (ms_sim_has_control(sim)) {
    explain_control(sim, out);
    return;
  }
  ms_text_append(out, "step          h = %.10g s", sim->run.h);
  if (sim->config.step_limit.from_auto) ms_text_append(out, ", 0.9 of the stability limit below");
  if (sim->run.h != sim->config.plan.h_asked)
    ms_text_append(out, ", lowered from %.10g s so that the run ends at t_end",
                   sim->config.plan.h_asked);
  ms_text_append(out, "\n");
  if (sim->config.plan.steps >= 0)
    ms_text_append(out,
                   "              %lld steps, to t = %.10g s; %lld frames if the run is recorded\n",
                   (long long)sim->config.plan.steps,
                   sim->config.plan.t0 + (double)sim->config.plan.steps * sim->run.h,
                   (long long)ms_frames_count(&sim->config.plan, &sim->config.opt, MS_FRAMES_MAX));
  ms_error_growth_explain(sim, out);
}

/* h over the longest stable step of velocity Verlet */
static double step_over_limit(const msim_sim *sim, const ms_model *model) {
  const ms_bounds bounds = ms_bounds_compute_island(model);
  return sim->run.h / ms_bounds_verlet_limit(&bounds);
}

static void explain_split(const msim_sim *sim, ms_text *out) {
  const ms_island_sim *m = ms_sim_largest_island(sim);
  const ms_multirate *split = m->stepper.split;
  const int32_t n = m->model.springs.n;
  if (!sim->config.integrator->is_multirate) return;
  if (!split) {
    ms_text_append(
        out, "springs       all take the same step, as with velocity-verlet: %s\n",
        step_over_limit(sim, &m->model) < 1
            ? "h is short enough for all"
            : "there is no small group\n"
              "              of much stiffer ones for which separate steps are cost-effective");
    return;
  }
  const int32_t stiff = split->stiff.springs.n;
  ms_text_append(
      out, "springs       the %d stiffest of %d take %d substeps in each step of the others\n",
      stiff, n, split->inner);
  ms_text_append(
      out,
      "              a step costs %.2g times as much as the steps of velocity-verlet that it "
      "replaces\n",
      ((double)n + (double)split->inner * stiff) / (n * ceil(step_over_limit(sim, &m->model))));
  ms_text_append(out,
                 "              resonance occurs where h is a multiple of half the period of a "
                 "stiff vibration;\n"
                 "              here h is at most %.3g times the shortest half period\n",
                 sim->run.h * ms_bounds_compute_island(&split->stiff).omega / 3.141592653589793);
}

static void explain_collisions(const msim_sim *sim, ms_text *out) {
  if (!has_feature(sim, MS_HAS_PLANES)) return;
  if (!sim->scene->nplanes && !sim->scene->ncolliders) return;
  if (sim->config.opt.collision == MSIM_COLLISION_EVENT)
    ms_text_append(
        out,
        "collisions    event: impacts are located inside the step, and resting contact is exact\n");
  else if (sim->config.integrator->entry.implicit &&
           ms_scene_constrains(sim->scene, MSIM_COLLISION_REFLECT))
    ms_text_append(out,
                   "collisions    reflect: the matrix holds particles in contact if h omega > 2, "
                   "else they are reflected at the end of a step\n");
  else
    ms_text_append(out,
                   "collisions    reflect: particles are reflected at the end of a step, of order "
                   "1 at each impact\n");
}

static void explain_threads(const msim_sim *sim, ms_text *out) {
  const int32_t threads = ms_pool_thread_count(sim->pool), planned = sim->threads_planned;
  ms_text_append(out, "threads       %d: ", threads);
  if (threads < planned)
    ms_text_append(out, "%d were planned, but no more could be started\n", planned);
  else if (sim->config.opt.threads) ms_text_append(out, "as requested\n");
  else if (ms_pool_usable_cores() == 1) ms_text_append(out, "there is one core\n");
  else if (threads == 1)
    ms_text_append(out, "a second one is not cost-effective with so few springs\n");
  else ms_text_append(out, "by size, on %d cores\n", ms_pool_usable_cores());
}

static void explain_matrix(const ms_solver *solver, const ms_unknowns *rows, ms_text *out) {
  const ms_linear *linear = solver->linear;
  if (solver->system.a.block == 1)
    ms_text_append(out,
                   "matrix        %d unknowns, one per free particle, and %d right-hand sides\n",
                   rows->nfree, rows->dims);
  else
    ms_text_append(out, "matrix        %d unknowns, %d per free particle\n",
                   rows->dims * rows->nfree, rows->dims);
  if (linear->aggregates)
    ms_text_append(out, "              coarse space of %d aggregates with %d unknowns each\n",
                   linear->aggregates, MS_MODES * rows->dims);
  if (linear->fill > 0)
    ms_text_append(out, "              factor with %.3g nonzeros, %.3g flops\n", linear->fill,
                   linear->flops);
  if (solver->amortization.allowed)
    ms_text_append(out,
                   "              once pcg has spent the cost of a factorization on a matrix that "
                   "hardly changes,\n"
                   "              cholmod (if available) factors it as a preconditioner\n");
}

/* Whether the matrix is constant or positive definite, and what happens where it is neither */
static void explain_definiteness(const msim_sim *sim, const ms_solver *solver, ms_text *out) {
  static const char *const answer[] = {"the step is repeated with the clamped matrix",
                                       "it is solved as it is", "the run ends"};
  const int is_constant = solver->system.a.block == 1;
  if (sim->config.integrator->nonlinear)
    ms_text_append(out, "newton        to a relative tolerance of %.3g in the velocity%s\n",
                   sim->config.opt.newton_rtol,
                   is_constant ? "; the matrix is the same in every step"
                   : ms_solver_supports_damping_derivative(solver)
                       ? "; the matrix is clamped\n"
                         "              until the residual has dropped, and has the non-symmetric "
                         "damping term if strong dampers need it"
                       : "; the matrix is clamped\n"
                         "              until the residual has dropped");
  else if (is_constant)
    ms_text_append(out, "              positive definite, and the same in every step\n");
  else if (sim->config.opt.jacobian == MSIM_JACOBIAN_CLAMP)
    ms_text_append(out, "              clamped, and so always positive definite\n");
  else
    ms_text_append(out, "              if it is not positive definite, %s\n",
                   answer[sim->config.opt.indefinite]);
}

static void explain_solver(const msim_sim *sim, ms_text *out) {
  const ms_island_sim *m = ms_sim_largest_island(sim);
  const ms_solver *solver = m->stepper.solver;
  if (!solver) {
    ms_text_append(out, "solver        none: the method is explicit\n");
    return;
  }
  ms_text_append(out, "solver        %s (%s)\n", solver->linear->name, solver->reason);
  ms_text_append(out, "              relative residual %.3g, checked after every solve\n",
                 sim->config.opt.solver_rtol);
  explain_matrix(solver, &m->model.unknowns, out);
  explain_definiteness(sim, solver, out);
}

static const char *axis_name(const msim_sim *sim) {
  static const char *const names[] = {"component x", "component y", "component z"};
  const int32_t axis = sim->islands->model.unknowns.dropped_axis;
  return names[axis < 0 ? 0 : axis];
}

static void explain_skips(const msim_sim *sim, ms_text *out) {
  const ms_island_sim *m = ms_sim_largest_island(sim);
  const ms_solver *solver = m->stepper.solver;
  const struct {
    int skipped;
    const char *what, *why;
  } skips[] = {
      {!solver, "assembly, factorization, solver libraries", "the method needs no solver"},
      {solver && solver->lagged_factor.factorizer, "factorization",
       "in steps for which the last one is a good preconditioner"},
      {solver && solver->linear->aggregates && !(sim->config.opt.skip_off & MSIM_SKIP_KEPT_FACTOR),
       "coarse factorization", "in steps whose matrix has hardly changed since the last one"},
      {!has_feature(sim, MS_HAS_SPRINGS), "spring forces", "no spring acts on a free particle"},
      {has_feature(sim, MS_HAS_SPRINGS) && !has_feature(sim, MS_HAS_DIRECTIONS),
       "direction of springs",
       "all rest lengths and dampings are 0, so forces are linear and the matrix is constant"},
      {!has_feature(sim, MS_HAS_DAMPING), "damping of springs", "no spring is damped"},
      {!has_feature(sim, MS_HAS_DRAG), "drag", "it is 0"},
      {!has_feature(sim, MS_HAS_PLANES), "collision detection",
       sim->config.choice.verification.planes_far ? "no plane is close yet"
                                                  : "there are no planes or colliders"},
      {m->model.unknowns.dropped_axis >= 0, axis_name(sim),
       "no velocity and no force has this component"},
      {count_all_free(sim) < sim->scene->nparticles, "pinned particles", "they are not unknowns"},
      {sim->nislands > 1, "a common system",
       "each island has its own, and is skipped while at rest"},
      {!(sim->config.opt.skip_off & MSIM_SKIP_AT_REST), "steps at exact rest",
       "without velocities and forces they change nothing"},
      {1, "conversion to particle order, energies", "computed only on request"}};
  const char *label = "skipped";
  for (size_t i = 0; i < sizeof skips / sizeof *skips; i++) {
    if (!skips[i].skipped) continue;
    ms_text_append(out, "%-13s %s: %s\n", label, skips[i].what, skips[i].why);
    label = "";
  }
}

/* Bounds by Gershgorin's discs alone, which steps use, too: of all springs, or, for a multirate
 * method, of the soft ones, which take the longest steps. */
static ms_bounds find_rough_bounds(const msim_sim *sim) {
  ms_bounds most = {0};
  for (int32_t i = 0; i < sim->nislands; i++) {
    const ms_island_sim *m = &sim->islands[i];
    const ms_bounds b =
        ms_bounds_compute_island(m->stepper.split ? &m->stepper.split->soft : &m->model);
    most.omega = fmax(most.omega, b.omega), most.rate = fmax(most.rate, b.rate);
  }
  return most;
}

static void explain_limits(const msim_sim *sim, ms_text *out) {
  const int splits = sim->config.integrator->is_multirate;
  const ms_bounds bounds = splits ? find_rough_bounds(sim) : sim->config.step_limit.bounds,
                  *b = &bounds;
  const double limit = splits ? ms_bounds_verlet_limit(b) : sim->config.step_limit.limit,
               h = sim->run.h;
  const char *name = sim->config.integrator->entry.name;
  ms_text_append(
      out, "stability     angular frequencies <= %.6g rad/s, damping rates <= %.6g 1/s %s%s\n",
      b->omega, b->rate,
      sim->scene->angles.n ? "while edges of angles are as long as at the start" : "in every state",
      splits ? ", for springs with long steps" : "");
  if (sim->config.integrator->stages && ms_sim_has_control(sim))
    ms_text_append(out,
                   "              the stages of a step follow its length, and the damping rate of "
                   "the state it starts from\n");
  else if (sim->config.integrator->stages)
    ms_text_append(out, "              %d stages per step, chosen for that damping rate\n",
                   sim->config.integrator->stages(h, find_rough_bounds(sim)));
  if (sim->config.integrator->entry.implicit)
    ms_text_append(out, "              stable for every h if the system is linear\n");
  else if (isinf(limit))
    ms_text_append(out, "              stable for every h: nothing vibrates\n");
  else if (limit == 0)
    ms_text_append(out, "              with %s undamped vibrations grow at any h\n", name);
  else if (ms_sim_has_control(sim))
    ms_text_append(
        out, "              %s is stable for h < %.6g s; error control keeps h short enough\n",
        name, limit);
  else
    ms_text_append(out, "              %s is stable for h < %.6g s; h is %.3g times that%s\n", name,
                   limit, h / limit, h < limit ? "" : ": the run may become unstable");
}

msim_status msim_sim_explain(msim_sim *sim, const char **text, msim_error *err) {
  if (!sim || !text) return ms_error_set(err, MSIM_ERR_ARG, "sim or text is NULL");
  const msim_status refused = ms_rank_sim_refuse(sim, "msim_sim_explain", err);
  if (refused) return refused;
  msim_status status = ms_step_limit_compute(sim, err);
  if (status) return status;
  ms_text *out = &sim->explanation;
  ms_text_free(out);
  status = ms_overview_explain(sim, out, err);
  if (status) return status;
  explain_scene(sim, out);
  explain_laws(sim, out);
  explain_angles(sim, out);
  explain_islands(sim, out);
  explain_unknowns(&ms_sim_largest_island(sim)->model.unknowns, out);
  explain_method(sim, out);
  explain_split(sim, out);
  explain_collisions(sim, out);
  ms_precision_choice_explain(sim, out);
  explain_threads(sim, out);
  explain_solver(sim, out);
  explain_skips(sim, out);
  explain_limits(sim, out);
  if (out->failed) return ms_error_set_memory(err, "the explanation");
  *text = out->data;
  return ms_error_clear(err);
}
