#include "sim/energy_monitor.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec3.h"
#include "integrate/method_state.h"
#include "sim/rank_scene.h"
#include "physics/external_force.h"
#include "physics/force_function.h"
#include "physics/signed_distance.h"
#include "physics/single.h"
#include "scene/angles.h"
#include "scene/laws.h"

/* The multiple of the bounds that is allowed, and the number of explicit steps between checks */
enum { ALLOWED = 100, INTERVAL = 160 };

static int monitor_is_on(const msim_sim *sim) { return sim->config.opt.watch == MSIM_WATCH_ON; }

msim_status ms_energy_monitor_create(const msim_sim *sim, const ms_model *model,
                                     ms_last_good_state *good, msim_error *err) {
  if (!monitor_is_on(sim)) return MSIM_OK;
  const int fits = MS_NEW_VECTORS(sim->scene, &model->unknowns, &good->x, &good->v) &&
                   MS_NEW(&sim->alloc, good->parts, ms_totals_count_parts(model));
  return fits ? MSIM_OK : ms_error_set_memory(err, "the last good state");
}

void ms_energy_monitor_destroy(const ms_model *model, ms_last_good_state *good) {
  if (!model->scene) return;
  MS_FREE(&model->scene->alloc, good->x, good->v, good->parts);
}

/*------------------------------------- measuring ------------------------------------------------*/

static double time_of(const msim_sim *sim) {
  return ms_sim_has_control(sim) ? sim->run.t : ms_sim_time(sim);
}

static ms_totals measure_island(const ms_island_sim *m) {
  return ms_totals_compute(&m->model, ms_single_get_x(&m->model, m->stepper.x),
                           ms_single_get_v(&m->model, m->stepper.v), m->last_good.parts);
}

/* Sum over all free particles in the present state. Islands that stay at rest have not changed. */
static ms_totals measure_totals(msim_sim *sim) {
  ms_totals sum = ms_totals_identity();
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    ms_last_good_state *g = &m->last_good;
    if (!(m->at_rest && g->at_rest)) g->totals = measure_island(m);
    ms_totals_add(&g->totals, &sum);
  }
  ms_totals_sum_ranks(sim->ranks, &sum);
  return sum;
}

static double extent_of(const ms_totals *t) {
  double extent = 0;
  for (int c = 0; c < 3; c++) extent = fmax(extent, t->high[c] - t->low[c]);
  return extent;
}

/* sum (m g + F).x (J) - the potential of the force function in the present state: minus the
 * potential energy of external forces */
static double external_work(const msim_sim *sim, const ms_totals *t) {
  double potential = 0;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++)
    potential += ms_force_function_compute_potential(&m->model, m->stepper.x);
  if (sim->scene->force_function.potential) ms_ranks_sum(sim->ranks, 1, &potential);
  return ms_external_work(&sim->scene->external, t->moment) + t->force_work - potential;
}

/* The bounds in the present state; `most` is kept if that state is good. */
typedef struct energy_bounds {
  double bound, extent;
  double most; /* the largest energy bound so far */
} energy_bounds;

static energy_bounds compute_energy_bounds(const msim_sim *sim, const ms_totals *now) {
  const ms_energy_monitor *w = &sim->monitor;
  const double work = external_work(sim, now) - w->start_external_work;
  const double bound = w->start_bound + fmax(0, work) + (sim->run.moved - w->start_moved),
               most = fmax(w->energy_bound, bound);
  const double speed = w->least_mass > 0 ? sqrt(2 * most / w->least_mass) : 0;
  return (energy_bounds){bound, w->extent + 2 * (time_of(sim) - w->t0) * speed, most};
}

static int is_within_bounds(const ms_totals *now, const energy_bounds *b) {
  return now->kinetic + now->elastic <= ALLOWED * b->bound &&
         !(extent_of(now) > ALLOWED * b->extent);
}

int ms_energy_monitor_is_due(const msim_sim *sim) {
  if (!monitor_is_on(sim)) return 0;
  if (sim->config.integrator->entry.implicit || sim->run.step % INTERVAL == 0) return 1;
  if (ms_sim_has_control(sim)) return sim->run.t == sim->config.plan.t_end;
  return sim->run.step - sim->run.step0 == sim->config.plan.steps;
}

/*------------------------------------- starting -------------------------------------------------*/

/* Properties of a scene in a state */
typedef struct scene_facts {
  double mass, least;  /* of all free particles and of the lightest one, kg */
  double force;        /* the sum of |F|, of constant forces, N */
  double most_force;   /* the largest |F|/m, m/s^2 */
  double farthest;     /* the largest |coordinate|, m */
  double height;       /* of the particle highest above a plane or collider, m */
  double depth;        /* of the particle farthest behind a plane or in a collider, m */
  double stiffness;    /* the sum of all k, of laws the sum of their largest |df/de|, of angular
                          springs that of the springs that bound them, N/m */
  double energy_depth; /* the sum of what elastic energies may be below 0, J */
} scene_facts;

/* Take a particle into account; of a pinned one only the position counts. */
static void add_particle_facts(const ms_scene *s, double t, int32_t p, const double x[3],
                               scene_facts *f) {
  for (int c = 0; c < 3; c++) f->farthest = fmax(f->farthest, fabs(x[c]));
  if (s->pinned[p]) return;
  f->mass += s->mass[p];
  f->least = f->least > 0 ? fmin(f->least, s->mass[p]) : s->mass[p];
  const double force = s->force ? ms_vec3_norm(s->force + 3 * (size_t)p) : 0;
  f->force += force, f->most_force = fmax(f->most_force, force / s->mass[p]);
  for (int32_t i = 0; i < s->nplanes; i++) {
    const double above = ms_vec3_dot(s->planes[i].normal, x) - s->planes[i].offset;
    f->height = fmax(f->height, above), f->depth = fmax(f->depth, -above);
  }
  for (int32_t i = 0; i < s->ncolliders; i++) {
    double unused[3];
    ms_solid room;
    const ms_solid *solid = ms_collider_motion_place(s, i, (ms_instant){.t = t}, &room);
    const double above = ms_signed_distance(solid, x, unused);
    f->height = fmax(f->height, above), f->depth = fmax(f->depth, -above);
  }
}

/* The facts of the particles of all ranks */
static void share_facts(ms_ranks *ranks, scene_facts *f) {
  double sums[] = {f->mass, f->force};
  double most[] = {f->least > 0 ? -f->least : -INFINITY, f->most_force, f->farthest, f->height,
                   f->depth};
  if (!ranks) return;
  ms_ranks_sum(ranks, 2, sums);
  ms_ranks_maximum(ranks, 5, most);
  *f = (scene_facts){.mass = sums[0],
                     .force = sums[1],
                     .least = most[0] > -INFINITY ? -most[0] : 0,
                     .most_force = most[1],
                     .farthest = most[2],
                     .height = most[3],
                     .depth = most[4]};
}

/* The scene, or the slice of one rank, takes its pinned particles and springs into account. */
static void add_scene_facts(const ms_scene *s, double t, scene_facts *f, ms_totals *box) {
  for (int32_t p = 0; p < s->nparticles; p++) {
    const double *x = s->x + 3 * (size_t)p;
    ms_totals one = {.low = {x[0], x[1], x[2]}, .high = {x[0], x[1], x[2]}};
    if (!s->pinned[p]) continue;
    add_particle_facts(s, t, p, x, f);
    ms_totals_add(&one, box);
  }
  for (int32_t e = 0; e < s->nsprings; e++) {
    f->stiffness += ms_scene_stiffness(s, e);
    f->energy_depth += ms_scene_energy_depth(s, e);
  }
  for (int32_t e = 0; e < s->angles.n; e++) {
    double weight[2];
    ms_scene_angles_weigh(s, e, weight);
    f->stiffness += s->angles.k[e] * (weight[0] + weight[1]);
  }
}

/* The sums pass from rank to rank, so that they have the bits of one process. */
static void add_slice_facts(const msim_sim *sim, scene_facts *f, ms_totals *box) {
  struct {
    scene_facts facts;
    ms_totals box;
  } sum = {*f, *box};
  for (int32_t r = 0; r < sim->ranks->n; r++) {
    if (r == sim->ranks->rank)
      add_scene_facts(sim->kept->slice, time_of(sim), &sum.facts, &sum.box);
    ms_ranks_broadcast(sim->ranks, r, sizeof sum, &sum);
  }
  *f = sum.facts, *box = sum.box;
}

/* box: that of the free particles; on return it contains pinned ones, too */
static scene_facts collect_facts(const msim_sim *sim, ms_totals *box) {
  const ms_scene *s = sim->scene;
  scene_facts f = {0};
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    const double *all = ms_single_get_x(&m->model, m->stepper.x);
    for (int32_t r = 0; r < m->model.unknowns.nfree; r++) {
      double x[3];
      ms_unknowns_get(&m->model.unknowns, all, r, x);
      add_particle_facts(s, time_of(sim), m->model.unknowns.particle[r], x, &f);
    }
  }
  share_facts(sim->ranks, &f);
  if (sim->kept) add_slice_facts(sim, &f, box);
  else add_scene_facts(s, time_of(sim), &f, box);
  return f;
}

static int carries_other_variables(const ms_integrator *method) {
  return method->convert_state || method->sync;
}

/* The tag `cached_stage` that may be restored with a kept state. Methods with other variables than
 * x and v set 1 in the state that a run started from, for work vectors that no step overwrites.
 * Other tags, and those of other methods, refer to vectors that steps overwrite. */
static int restorable_tag(const msim_sim *sim, const ms_stepper *s) {
  return carries_other_variables(sim->config.integrator) && s->cached_stage == 1;
}

static void copy_present_state(ms_island_sim *m) {
  ms_vector_copy(m->model.state_shape, m->stepper.x, m->last_good.x);
  ms_vector_copy(m->model.state_shape, m->stepper.v, m->last_good.v);
}

static void keep_good_state(msim_sim *sim) {
  ms_energy_monitor *w = &sim->monitor;
  w->good = sim->run;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    ms_last_good_state *g = &m->last_good;
    if (m->at_rest && g->at_rest) continue;
    copy_present_state(m);
    g->h_before = m->stepper.h_before;
    g->tag = restorable_tag(sim, &m->stepper);
    g->at_rest = m->at_rest;
  }
}

void ms_energy_monitor_start(msim_sim *sim) {
  if (!monitor_is_on(sim)) return;
  ms_energy_monitor *w = &sim->monitor;
  const double g = ms_external_acceleration(&sim->scene->external), h = sim->run.h;
  for (int32_t i = 0; i < sim->nislands; i++) sim->islands[i].last_good.at_rest = 0;
  ms_totals now = measure_totals(sim);
  const scene_facts f = collect_facts(sim, &now);
  const double d = sqrt(DBL_EPSILON) * f.farthest + 2 * f.depth;
  const double weight = f.mass * g + f.force, fall = (g + f.most_force) * h * h;
  w->extent = extent_of(&now);
  w->least_mass = f.least;
  w->t0 = time_of(sim);
  w->start_external_work = external_work(sim, &now);
  w->start_moved = sim->run.moved;
  w->start_bound = now.kinetic + now.elastic + weight * (fmax(w->extent, f.height) + fall) +
                   f.stiffness * d * d / 2 + f.energy_depth;
  w->energy_bound = w->start_bound;
  keep_good_state(sim);
}

/*------------------------------------- returning ------------------------------------------------*/

static void restore_good_state(msim_sim *sim) {
  const int64_t frame = sim->run.frame; /* frames that were shown are not shown again */
  sim->run = sim->monitor.good;
  sim->run.t_shown = sim->run.t, sim->run.frame = frame;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    ms_vector_copy(m->model.state_shape, m->last_good.x, m->stepper.x);
    ms_vector_copy(m->model.state_shape, m->last_good.v, m->stepper.v);
    m->stepper.h_before = m->last_good.h_before;
    m->stepper.cached_stage = m->last_good.tag;
    if (m->stepper.solver) ms_solver_discard_factors(m->stepper.solver);
    m->at_rest = m->last_good.at_rest;
  }
  sim->state_is_current = 0;
  sim->contacts_known = 0;
  ms_sim_set_pins(sim);
}

/* The free particle farthest from `from`, or, with `fastest` and from = 0, the fastest one; *most:
 * its distance or speed. */
static int32_t find_extreme_particle(const msim_sim *sim, int fastest, const double from[3],
                                     double *most) {
  int32_t first = -1;
  *most = -1;
  for (const ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    const double *of = fastest ? ms_single_get_v(&m->model, m->stepper.v)
                               : ms_single_get_x(&m->model, m->stepper.x);
    for (int32_t r = 0; r < m->model.unknowns.nfree; r++) {
      double d[3];
      ms_unknowns_get(&m->model.unknowns, of, r, d);
      for (int c = 0; c < 3; c++) d[c] -= from[c];
      const double size = hypot(hypot(d[0], d[1]), d[2]);
      if (size > *most) *most = size, first = m->model.unknowns.particle[r];
    }
  }
  return ms_rank_scene_get_particle(sim, first);
}

static msim_status write_unstable(const msim_sim *sim, const ms_totals *now, const energy_bounds *b,
                                  double *most, msim_error *err) {
  const double energy = now->kinetic + now->elastic;
  const int fast = !(energy <= ALLOWED * b->bound);
  double from[3] = {0};
  for (int c = 0; c < 3 && !fast; c++) from[c] = 0.5 * (now->low[c] + now->high[c]);
  const int32_t particle = find_extreme_particle(sim, fast, from, most);
  const long long step = sim->run.step, kept = sim->monitor.good.step;
  if (fast)
    return ms_error_set(
        err, MSIM_UNSTABLE,
        "step %lld, t = %g s, particle %d: the run is unstable: kinetic and elastic energy are "
        "%.3g J, more than %d times the bound of %.3g J from initial energy and gravity, and this "
        "particle is the fastest, with %.3g m/s; the state of step %lld was restored; use a "
        "smaller h or tol, or another integrator",
        step, time_of(sim), particle, energy, ALLOWED, b->bound, *most, kept);
  return ms_error_set(
      err, MSIM_UNSTABLE,
      "step %lld, t = %g s, particle %d: the run is unstable: the extent of the scene is %.3g m, "
      "more than %d times the bound of %.3g m from its speed, and this particle is farthest out; "
      "the state of step %lld was restored; use a smaller h or tol, or another integrator",
      step, time_of(sim), particle, extent_of(now), ALLOWED, b->extent, kept);
}

/* All ranks report the extreme particle, which one of them has. */
static msim_status report_unstable(const msim_sim *sim, const ms_totals *now,
                                   const energy_bounds *b, msim_error *err) {
  double own, most;
  const msim_status status = write_unstable(sim, now, b, &own, err);
  most = own;
  ms_ranks_maximum(sim->ranks, 1, &most);
  return ms_ranks_agree(sim->ranks, own == most ? status : MSIM_OK, err);
}

msim_status ms_energy_monitor_check(msim_sim *sim, msim_error *err) {
  if (!monitor_is_on(sim) || sim->monitor.good.step == sim->run.step) return MSIM_OK;
  const ms_totals now = measure_totals(sim);
  const energy_bounds b = compute_energy_bounds(sim, &now);
  if (is_within_bounds(&now, &b)) {
    sim->monitor.energy_bound = b.most;
    keep_good_state(sim);
    return MSIM_OK;
  }
  const msim_status status = report_unstable(sim, &now, &b, err);
  restore_good_state(sim);
  return sim->last_status = status;
}

void ms_energy_monitor_restore(msim_sim *sim, msim_error *err) {
  if (!monitor_is_on(sim) || sim->monitor.good.step == sim->run.step) return;
  const ms_totals now = measure_totals(sim);
  const energy_bounds b = compute_energy_bounds(sim, &now);
  if (is_within_bounds(&now, &b)) return;
  restore_good_state(sim);
  if (!err) return;
  const size_t used = strlen(err->text);
  snprintf(err->text + used, MS_ERROR_LENGTH - used,
           "; the motion had exceeded the energy bound before: the state of step %lld was restored",
           (long long)sim->run.step);
}

/*------------------------------------- checkpoints ----------------------------------------------*/

void ms_energy_monitor_archive(ms_archive *b, const msim_sim *sim, const ms_run_state *run,
                               ms_energy_monitor *w) {
  double *bounds[] = {
      &w->energy_bound, &w->start_bound, &w->start_external_work, &w->start_moved, &w->extent,
      &w->least_mass,   &w->t0};
  double *numbers[] = {&w->good.t, &w->good.t_rounding, &w->good.work, &w->good.pin_energy,
                       &w->good.moved};
  if (b->direction == MS_ARCHIVE_READ) w->good = *run;
  if (!monitor_is_on(sim)) return;
  ms_archive_transfer_count(b, &w->good.step);
  for (size_t i = 0; i < sizeof bounds / sizeof *bounds; i++) MS_ARCHIVE_TRANSFER(b, *bounds[i]);
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    MS_ARCHIVE_TRANSFER(b, *numbers[i]);
    ms_archive_check(b, isfinite(*numbers[i]), "the time or work of the last good state");
  }
  ms_archive_check_rounding(b, w->good.t, w->good.t_rounding,
                            "the time or work of the last good state");
  ms_control_archive(b, &w->good.control);
}

void ms_energy_monitor_finish_reading(msim_sim *sim, int is_present) {
  if (!monitor_is_on(sim)) return;
  for (ms_island_sim *m = sim->islands; m < sim->islands + sim->nislands; m++) {
    ms_last_good_state *g = &m->last_good;
    g->totals = measure_island(m);
    if (is_present) copy_present_state(m);
  }
}

/* After implicit steps the last good state is the present one, as all are checked. */
void ms_energy_monitor_archive_island(ms_archive *b, const msim_sim *sim, int is_present,
                                      const ms_stepper *s, ms_last_good_state *g) {
  const ms_shape shape = s->model->state_shape;
  if (!monitor_is_on(sim)) return;
  MS_ARCHIVE_TRANSFER(b, g->h_before);
  MS_ARCHIVE_TRANSFER(b, g->at_rest);
  ms_archive_check(b, isfinite(g->h_before) && (g->at_rest | 1) == 1, "the last good state");
  if (b->direction == MS_ARCHIVE_READ) g->tag = restorable_tag(sim, s);
  if (b->direction == MS_ARCHIVE_COUNT ? sim->config.integrator->entry.implicit : is_present)
    return;
  ms_archive_transfer_vector(b, shape, g->x);
  ms_archive_transfer_vector(b, shape, g->v);
  if (!carries_other_variables(sim->config.integrator)) return;
  MS_ARCHIVE_TRANSFER(b, g->tag);
  ms_method_state_archive_carried(b, sim->config.integrator, s, g->tag);
}
