#include "physics/impacts.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"

static const double nothing[MS_MOST_TOUCHED] = {0};

double ms_distance(const msim_plane *p, const double x[3]) {
  return ms_dot3(p->normal, x) - p->offset;
}

double ms_distance_noise(const ms_walls *walls, const double x[3]) {
  return 8 * DBL_EPSILON * fmax(walls->reach, ms_norm3(x)) + walls->merge;
}

double ms_speed_noise(const double v[3]) { return 16 * DBL_EPSILON * ms_norm3(v); }

ms_touch ms_touched(const ms_walls *walls, const double x[3]) {
  const double noise = ms_distance_noise(walls, x);
  ms_touch touch = {0};
  for (const msim_plane *p = walls->plane; p < walls->plane + walls->n; p++)
    if (ms_distance(p, x) <= noise && touch.n < MS_MOST_TOUCHED) touch.plane[touch.n++] = p;
  return touch;
}

ms_touch ms_touch_approached(const ms_touch *touch, const double v[3], double limit) {
  ms_touch hit = {0};
  for (int i = 0; i < touch->n; i++)
    if (ms_dot3(touch->plane[i]->normal, v) < limit) hit.plane[hit.n++] = touch->plane[i];
  return hit;
}

ms_touch ms_touch_pushing(const ms_touch *touch, const double *J, double noise, double *pull) {
  ms_touch pushing = {0};
  *pull = 0;
  for (int i = 0; i < touch->n; i++) {
    if (!(J[i] > noise)) continue;
    pushing.plane[pushing.n++] = touch->plane[i];
    *pull += touch->plane[i]->friction * J[i];
  }
  return pushing;
}

/*------------------------------------- small systems --------------------------------------------*/

/* The number of planes used where they must be independent, the first ones */
static int count_holding(const ms_touch *touch) {
  return touch->n < MS_MOST_HOLDING ? touch->n : MS_MOST_HOLDING;
}

/* Solve sum_j (n_i.n_j) c_j = b_i over the first k normals, by elimination. c: in b, out c. Returns
 * 0 if they are linearly dependent. */
static int solve(int k, const ms_touch *touch, double *c) {
  const double DEPENDENT = 1e-12; /* squared sine of the angle from a normal to those before it */
  double g[MS_MOST_HOLDING][MS_MOST_HOLDING];
  for (int i = 0; i < k; i++)
    for (int j = 0; j < k; j++) g[i][j] = ms_dot3(touch->plane[i]->normal, touch->plane[j]->normal);
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

int ms_meet(const ms_touch *touch, const double *to, double u[3], double *J) {
  const int k = count_holding(touch);
  for (int i = 0; i < k; i++) J[i] = to[i] - ms_dot3(touch->plane[i]->normal, u);
  if (!solve(k, touch, J)) return 0;
  for (int i = 0; i < k; i++) ms_axpy3(J[i], touch->plane[i]->normal, u);
  return 1;
}

/*------------------------------------- projection -----------------------------------------------*/

/* The result with an active set of planes, and its largest violation of J_i >= 0 or
 * n_i.u >= least_i */
typedef struct attempt {
  double u[3], J[MS_MOST_TOUCHED], broken;
} attempt;

static int try_set(const ms_touch *touch, unsigned set, const double *least, attempt *a) {
  ms_touch acting = {0};
  double to[MS_MOST_HOLDING], J[MS_MOST_HOLDING];
  int at[MS_MOST_HOLDING];
  for (int i = 0; i < touch->n; i++) {
    if (!(set >> i & 1)) continue;
    if (acting.n == MS_MOST_HOLDING) return 0;
    to[acting.n] = least[i], at[acting.n] = i;
    acting.plane[acting.n++] = touch->plane[i];
  }
  if (!ms_meet(&acting, to, a->u, J)) return 0;
  for (int i = 0; i < touch->n; i++) a->J[i] = 0;
  for (int i = 0; i < acting.n; i++) a->J[at[i]] = J[i];
  a->broken = 0;
  for (int i = 0; i < touch->n; i++) {
    a->broken = fmax(a->broken, -a->J[i]);
    if (!(set >> i & 1))
      a->broken = fmax(a->broken, least[i] - ms_dot3(touch->plane[i]->normal, a->u));
  }
  return 1;
}

/* Enumerates all active sets: some set violates no condition. With rounding errors: the first set
 * within the tolerance, else that of least violation. */
void ms_project(const ms_touch *touch, const double *least, double u[3], double *J) {
  double noise = ms_norm3(u), broken = INFINITY;
  const double from[3] = {u[0], u[1], u[2]};
  for (int i = 0; i < touch->n; i++) noise += fabs(least[i]);
  noise *= 64 * DBL_EPSILON;
  for (unsigned set = 0; set < 1u << touch->n && broken > noise; set++) {
    attempt a = {.u = {from[0], from[1], from[2]}};
    if (!try_set(touch, set, least, &a) || !(a.broken < broken)) continue;
    broken = a.broken;
    for (int c = 0; c < 3; c++) u[c] = a.u[c];
    for (int i = 0; i < touch->n; i++) J[i] = a.J[i];
  }
}

/*------------------------------------- impacts --------------------------------------------------*/

/* Coulomb friction in an impact: v_t *= max(0, 1 - sum mu_i J_i/|v_t|) */
static void rub(const ms_touch *hit, const double *J, double v[3]) {
  double pull, along[3] = {v[0], v[1], v[2]};
  const ms_touch acting = ms_touch_pushing(hit, J, 0, &pull);
  if (pull == 0) return;
  ms_keep_along(&acting, along, NULL);
  const double speed = ms_norm3(along);
  ms_axpy3(speed > pull ? -pull / speed : -1, along, v);
}

int ms_bounce(const ms_touch *touch, double v[3]) {
  enum { MOST = 32 }; /* impacts in turn on the planes of a wedge, without time between them */
  double least[MS_MOST_TOUCHED] = {0}, J[MS_MOST_TOUCHED] = {0};
  const double noise = ms_speed_noise(v);
  for (int round = 0; round < MOST; round++) {
    const ms_touch hit = ms_touch_approached(touch, v, -noise);
    if (!hit.n && round > 0 && ms_norm3(v) <= noise) memset(v, 0, 3 * sizeof *v);
    if (!hit.n) return round > 0;
    for (int i = 0; i < hit.n; i++)
      least[i] = -hit.plane[i]->restitution * ms_dot3(hit.plane[i]->normal, v);
    ms_project(&hit, least, v, J);
    rub(&hit, J, v);
  }
  ms_project(touch, nothing, v, J);
  return 1;
}

/*------------------------------------- constraints ----------------------------------------------*/

void ms_put_at(const ms_touch *touch, const double *distance, double x[3]) {
  double to[MS_MOST_TOUCHED] = {0}, c[MS_MOST_HOLDING];
  for (int i = 0; i < touch->n; i++) to[i] = touch->plane[i]->offset + distance[i];
  ms_meet(touch, to, x, c);
}

void ms_put_on(const ms_touch *touch, double x[3]) { ms_put_at(touch, nothing, x); }

double ms_keep_along(const ms_touch *touch, double u[3], double *least) {
  double J[MS_MOST_HOLDING], pull = 0, smallest = INFINITY;
  const int there = ms_meet(touch, nothing, u, J);
  for (int i = 0; i < count_holding(touch) && there; i++) {
    smallest = fmin(smallest, J[i]);
    pull += touch->plane[i]->friction * fmax(0, J[i]);
  }
  if (least) *least = smallest;
  return pull;
}

ms_touch ms_touch_pressed(const ms_touch *touch, double noise, double a[3], double *pull) {
  double J[MS_MOST_TOUCHED] = {0};
  ms_project(touch, nothing, a, J);
  return ms_touch_pushing(touch, J, noise, pull);
}
