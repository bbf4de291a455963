#include "contact/impacts.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"

static const double zero_targets[MS_MAX_TOUCHED_PLANES] = {0};

double ms_impacts_distance(const msim_plane *p, const double x[3]) {
  return ms_vec3_dot(p->normal, x) - p->offset;
}

double ms_impacts_distance_tolerance(const ms_collision_planes *planes, const double x[3]) {
  return 8 * DBL_EPSILON * fmax(planes->scene_size, ms_vec3_norm(x)) + planes->contact_distance;
}

double ms_impacts_speed_tolerance(const double v[3]) { return 16 * DBL_EPSILON * ms_vec3_norm(v); }

ms_plane_set ms_impacts_find_touched(const ms_collision_planes *planes, const double x[3]) {
  const double tolerance = ms_impacts_distance_tolerance(planes, x);
  ms_plane_set touch = {0};
  for (const msim_plane *p = planes->plane; p < planes->plane + planes->n; p++)
    if (ms_impacts_distance(p, x) <= tolerance && touch.n < MS_MAX_TOUCHED_PLANES)
      touch.plane[touch.n++] = p;
  return touch;
}

ms_plane_set ms_impacts_select_approached(const ms_plane_set *touch, const double v[3],
                                          double limit) {
  ms_plane_set hit = {0};
  for (int i = 0; i < touch->n; i++)
    if (ms_vec3_dot(touch->plane[i]->normal, v) < limit) hit.plane[hit.n++] = touch->plane[i];
  return hit;
}

ms_plane_set ms_impacts_select_pushing(const ms_plane_set *touch, const double *J, double tolerance,
                                       double *friction_limit) {
  ms_plane_set pushing = {0};
  *friction_limit = 0;
  for (int i = 0; i < touch->n; i++) {
    if (!(J[i] > tolerance)) continue;
    pushing.plane[pushing.n++] = touch->plane[i];
    *friction_limit += touch->plane[i]->friction * J[i];
  }
  return pushing;
}

/*------------------------------------- small systems --------------------------------------------*/

/* The number of planes used where they must be independent, the first ones */
static int count_independent(const ms_plane_set *touch) {
  return touch->n < MS_MAX_INDEPENDENT_PLANES ? touch->n : MS_MAX_INDEPENDENT_PLANES;
}

/* Solve sum_j (n_i.n_j) c_j = b_i over the first k normals, by elimination. c: in b, out c. Returns
 * 0 if they are linearly dependent. */
static int solve_normal_equations(int k, const ms_plane_set *touch, double *c) {
  const double DEPENDENT = 1e-12; /* squared sine of the angle from a normal to those before it */
  double g[MS_MAX_INDEPENDENT_PLANES][MS_MAX_INDEPENDENT_PLANES];
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++)
      g[i][j] = ms_vec3_dot(touch->plane[i]->normal, touch->plane[j]->normal);
  for (int i = 0; i < k; i++) {
    if (!(g[i][i] > DEPENDENT)) return 0;
    for (int r = i + 1; r < k; r++) {
      const double f = g[r][i] / g[i][i];
      for (int j = i; j < k; j++) g[r][j] -= f * g[i][j];
      c[r] -= f * c[i];
    }
  }
  for (int i = k - 1; i >= 0; i--) {
    for (int j = i + 1; j < k; j++) c[i] -= g[i][j] * c[j];
    c[i] /= g[i][i];
  }
  return 1;
}

int ms_impacts_set_normal_components(const ms_plane_set *touch, const double *to, double u[3],
                                     double *J) {
  const int k = count_independent(touch);
  for (int i = 0; i < k; i++) J[i] = to[i] - ms_vec3_dot(touch->plane[i]->normal, u);
  if (!solve_normal_equations(k, touch, J)) return 0;
  for (int i = 0; i < k; i++) ms_vec3_axpy(J[i], touch->plane[i]->normal, u);
  return 1;
}

/*------------------------------------- projection -----------------------------------------------*/

/* The result with an active set of planes, and its largest violation of J_i >= 0 or
 * n_i.u >= least_i */
typedef struct active_set_result {
  double u[3], J[MS_MAX_TOUCHED_PLANES], violation;
} active_set_result;

static int try_active_set(const ms_plane_set *touch, unsigned set, const double *least,
                          active_set_result *a) {
  ms_plane_set acting = {0};
  double to[MS_MAX_INDEPENDENT_PLANES], J[MS_MAX_INDEPENDENT_PLANES];
  int at[MS_MAX_INDEPENDENT_PLANES];
  for (int i = 0; i < touch->n; i++) {
    if (!(set >> i & 1)) continue;
    if (acting.n == MS_MAX_INDEPENDENT_PLANES) return 0;
    to[acting.n] = least[i], at[acting.n] = i;
    acting.plane[acting.n++] = touch->plane[i];
  }
  if (!ms_impacts_set_normal_components(&acting, to, a->u, J)) return 0;
  for (int i = 0; i < touch->n; i++) a->J[i] = 0;
  for (int i = 0; i < acting.n; i++) a->J[at[i]] = J[i];
  a->violation = 0;
  for (int i = 0; i < touch->n; i++) {
    a->violation = fmax(a->violation, -a->J[i]);
    if (!(set >> i & 1))
      a->violation = fmax(a->violation, least[i] - ms_vec3_dot(touch->plane[i]->normal, a->u));
  }
  return 1;
}

/* J = max(0, least - n.u)/n.n, with rounding errors */
static void project_on_plane(const double *n, double least, double tolerance, double u[3],
                             double *J) {
  const double behind = least - ms_vec3_dot(n, u);
  *J = behind <= tolerance ? 0 : behind / ms_vec3_dot(n, n);
  if (*J > 0) ms_vec3_axpy(*J, n, u);
}

/* Enumerates all active sets: some set violates no condition. With rounding errors: the first set
 * within the tolerance, else that of least violation. */
void ms_impacts_project(const ms_plane_set *touch, const double *least, double u[3], double *J) {
  double tolerance = ms_vec3_norm(u), broken = INFINITY;
  const double from[3] = {u[0], u[1], u[2]};
  for (int i = 0; i < touch->n; i++) tolerance += fabs(least[i]);
  tolerance *= 64 * DBL_EPSILON;
  if (touch->n == 1) {
    project_on_plane(touch->plane[0]->normal, least[0], tolerance, u, J);
    return;
  }
  for (unsigned set = 0; set < 1u << touch->n && broken > tolerance; set++) {
    active_set_result a = {.u = {from[0], from[1], from[2]}};
    if (!try_active_set(touch, set, least, &a) || !(a.violation < broken)) continue;
    broken = a.violation;
    for (int c = 0; c < 3; c++) u[c] = a.u[c];
    for (int i = 0; i < touch->n; i++) J[i] = a.J[i];
  }
}

/*------------------------------------- impacts --------------------------------------------------*/

/* Coulomb friction in an impact: v_t *= max(0, 1 - sum mu_i J_i/|v_t|) */
static void apply_impact_friction(const ms_plane_set *hit, const double *J, double v[3]) {
  double friction_limit, along[3] = {v[0], v[1], v[2]};
  const ms_plane_set acting = ms_impacts_select_pushing(hit, J, 0, &friction_limit);
  if (friction_limit == 0) return;
  ms_impacts_remove_normal(&acting, along, NULL);
  const double speed = ms_vec3_norm(along);
  ms_vec3_axpy(speed > friction_limit ? -friction_limit / speed : -1, along, v);
}

int ms_impacts_bounce(const ms_plane_set *touch, double v[3]) {
  enum { MOST = 32 }; /* impacts in turn on the planes of a wedge, without time between them */
  double least[MS_MAX_TOUCHED_PLANES] = {0}, J[MS_MAX_TOUCHED_PLANES] = {0};
  const double tolerance = ms_impacts_speed_tolerance(v);
  for (int round = 0; round < MOST; round++) {
    const int hits = ms_impacts_select_approached(touch, v, -tolerance).n;
    if (!hits && round > 0 && ms_vec3_norm(v) <= tolerance) memset(v, 0, 3 * sizeof *v);
    if (!hits) return round > 0;
    const ms_plane_set on = ms_impacts_select_approached(touch, v, tolerance);
    for (int i = 0; i < on.n; i++)
      least[i] = fmax(0, -on.plane[i]->restitution * ms_vec3_dot(on.plane[i]->normal, v));
    ms_impacts_project(&on, least, v, J);
    apply_impact_friction(&on, J, v);
  }
  ms_impacts_project(touch, zero_targets, v, J);
  return 1;
}

/*------------------------------------- constraints ----------------------------------------------*/

void ms_impacts_move_to_distance(const ms_plane_set *touch, const double *distance, double x[3]) {
  double to[MS_MAX_TOUCHED_PLANES] = {0}, c[MS_MAX_INDEPENDENT_PLANES];
  for (int i = 0; i < touch->n; i++) to[i] = touch->plane[i]->offset + distance[i];
  ms_impacts_set_normal_components(touch, to, x, c);
}

void ms_impacts_move_onto(const ms_plane_set *touch, double x[3]) {
  ms_impacts_move_to_distance(touch, zero_targets, x);
}

double ms_impacts_remove_normal(const ms_plane_set *touch, double u[3], double *least) {
  double J[MS_MAX_INDEPENDENT_PLANES], friction_limit = 0, smallest = INFINITY;
  const int there = ms_impacts_set_normal_components(touch, zero_targets, u, J);
  for (int i = 0; i < count_independent(touch) && there; i++) {
    smallest = fmin(smallest, J[i]);
    friction_limit += touch->plane[i]->friction * fmax(0, J[i]);
  }
  if (least) *least = smallest;
  return friction_limit;
}

ms_plane_set ms_impacts_raise_pressing(const ms_plane_set *touch, const double *least,
                                       double tolerance, double a[3], double *friction_limit) {
  double J[MS_MAX_TOUCHED_PLANES] = {0};
  ms_impacts_project(touch, least, a, J);
  return ms_impacts_select_pushing(touch, J, tolerance, friction_limit);
}

ms_plane_set ms_impacts_remove_pressing(const ms_plane_set *touch, double tolerance, double a[3],
                                        double *friction_limit) {
  return ms_impacts_raise_pressing(touch, zero_targets, tolerance, a, friction_limit);
}
