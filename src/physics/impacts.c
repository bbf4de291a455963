#include "physics/impacts.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"

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

/*------------------------------------- small systems --------------------------------------------*/

/* sum_j (n_i.n_j) c_j = b_i over k normals, by elimination; 0: they are not independent. */
static int solve(int k, const double *const *n, const double *b, double *c) {
  const double DEPENDENT = 1e-12; /* of the squared sine between a normal and those before it */
  double g[MS_MOST_HOLDING][MS_MOST_HOLDING];
  for (int i = 0; i < k; i++) {
    c[i] = b[i];
    for (int j = 0; j < k; j++) g[i][j] = ms_dot3(n[i], n[j]);
  }
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

/* u' = u + sum J_i n_i with n_i.u' = to_i over k normals; 0: they are not independent. */
static int meet(int k, const double *const *n, const double *to, double u[3], double *J) {
  double b[MS_MOST_HOLDING] = {0};
  for (int i = 0; i < k; i++) b[i] = to[i] - ms_dot3(n[i], u);
  if (!solve(k, n, b, J)) return 0;
  for (int i = 0; i < k; i++) ms_axpy3(J[i], n[i], u);
  return 1;
}

/*------------------------------------- projection -----------------------------------------------*/

/* The planes of a set act: what comes of it, and by how much that breaks a condition, J_i >= 0 or
 * n_i.u >= least_i. */
typedef struct attempt {
  double u[3], J[MS_MOST_TOUCHED], broken;
} attempt;

static int try_set(const ms_touch *touch, unsigned set, const double *least, attempt *a) {
  const double *n[MS_MOST_HOLDING];
  double to[MS_MOST_HOLDING], J[MS_MOST_HOLDING];
  int k = 0, at[MS_MOST_HOLDING];
  for (int i = 0; i < touch->n; i++) {
    if (!(set >> i & 1)) continue;
    if (k == MS_MOST_HOLDING) return 0;
    n[k] = touch->plane[i]->normal, to[k] = least[i], at[k++] = i;
  }
  if (!meet(k, n, to, a->u, J)) return 0;
  for (int i = 0; i < touch->n; i++) a->J[i] = 0;
  for (int i = 0; i < k; i++) a->J[at[i]] = J[i];
  a->broken = 0;
  for (int i = 0; i < touch->n; i++) {
    a->broken = fmax(a->broken, -a->J[i]);
    if (!(set >> i & 1))
      a->broken = fmax(a->broken, least[i] - ms_dot3(touch->plane[i]->normal, a->u));
  }
  return 1;
}

/* Of all sets of planes one breaks nothing; rounding aside, it is the first that breaks least. */
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

/* Those that v runs into. */
static ms_touch approached(const ms_touch *touch, const double v[3]) {
  const double noise = ms_speed_noise(v);
  ms_touch hit = {0};
  for (int i = 0; i < touch->n; i++)
    if (ms_dot3(touch->plane[i]->normal, v) < -noise) hit.plane[hit.n++] = touch->plane[i];
  return hit;
}

/* Coulomb's, in proportion to the impulses */
static void rub(const ms_touch *hit, const double *J, double v[3]) {
  ms_touch acting = {0};
  double pull = 0, along[3] = {v[0], v[1], v[2]}, least;
  for (int i = 0; i < hit->n; i++) {
    if (!(J[i] > 0)) continue;
    acting.plane[acting.n++] = hit->plane[i];
    pull += hit->plane[i]->friction * J[i];
  }
  if (pull == 0) return;
  ms_keep_along(&acting, along, &least);
  const double speed = ms_norm3(along);
  ms_axpy3(speed > pull ? -pull / speed : -1, along, v);
}

int ms_bounce(const ms_touch *touch, double v[3]) {
  enum { MOST = 32 }; /* from wall to wall of a wedge, without a flight between */
  double least[MS_MOST_TOUCHED] = {0}, J[MS_MOST_TOUCHED] = {0};
  const double noise = ms_speed_noise(v);
  for (int round = 0; round < MOST; round++) {
    const ms_touch hit = approached(touch, v);
    if (!hit.n && round > 0 && ms_norm3(v) <= noise) memset(v, 0, 3 * sizeof *v);
    if (!hit.n) return round > 0;
    for (int i = 0; i < hit.n; i++)
      least[i] = -hit.plane[i]->restitution * ms_dot3(hit.plane[i]->normal, v);
    ms_project(&hit, least, v, J);
    rub(&hit, J, v);
  }
  memset(least, 0, sizeof least);
  ms_project(touch, least, v, J);
  return 1;
}

/*------------------------------------- rest -----------------------------------------------------*/

static const double nothing[MS_MOST_HOLDING] = {0};

/* The normals of the first three planes; how many there are. */
static int normals(const ms_touch *touch, const double *n[MS_MOST_HOLDING]) {
  const int k = touch->n < MS_MOST_HOLDING ? touch->n : MS_MOST_HOLDING;
  for (int i = 0; i < MS_MOST_HOLDING; i++) n[i] = i < k ? touch->plane[i]->normal : NULL;
  return k;
}

int ms_meet(const ms_touch *touch, const double *to, double u[3], double *J) {
  const double *n[MS_MOST_HOLDING];
  const int k = normals(touch, n);
  return meet(k, n, to, u, J);
}

void ms_put_on(const ms_touch *touch, double x[3]) {
  double to[MS_MOST_TOUCHED] = {0}, c[MS_MOST_HOLDING];
  for (int i = 0; i < touch->n; i++) to[i] = touch->plane[i]->offset;
  ms_meet(touch, to, x, c);
}

double ms_keep_along(const ms_touch *touch, double u[3], double *least) {
  double J[MS_MOST_HOLDING], pull = 0;
  *least = INFINITY;
  if (!ms_meet(touch, nothing, u, J)) return 0;
  for (int i = 0; i < touch->n && i < MS_MOST_HOLDING; i++) {
    *least = fmin(*least, J[i]);
    pull += touch->plane[i]->friction * fmax(0, J[i]);
  }
  return pull;
}
