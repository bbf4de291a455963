#include "contact/pair_impulses.h"

/* y_c += w_c/m_c d. Returns the sum of -w_c d.y_c of pinned corners: of velocities, their work */
static double add_impulse(const ms_contact_surface *s, const ms_surface_pair *p, const double d[3],
                          double *y) {
  double work = 0;
  for (int k = 0; k < 4; k++) {
    double *at = y + 3 * (size_t)p->node[k];
    if (s->row[p->node[k]] < 0) work -= p->weight[k] * ms_vec3_dot(d, at);
    ms_vec3_axpy(p->weight[k] * s->inv_mass[p->node[k]], d, at);
  }
  return work;
}

/* Change the relative motion u = sum_c w_c y_c by `change` > 0 along the normal, and by at most
 * friction times that against its tangential part. mobility: sum_c w_c^2/m_c. Returns the work of
 * add_impulse(). */
static double push(const ms_surface_pairs *pairs, const ms_surface_pair *p, double friction,
                   double mobility, double change, const double u[3], double *y) {
  double tangential[3] = {u[0], u[1], u[2]}, impulse[3] = {0};
  ms_vec3_axpy(-ms_vec3_dot(p->normal, u), p->normal, tangential);
  const double speed = ms_vec3_norm(tangential);
  const double stop = speed > 0 ? fmin(1, friction * change / speed) : 0;
  ms_vec3_axpy(change / mobility, p->normal, impulse);
  ms_vec3_axpy(-stop / mobility, tangential, impulse);
  return add_impulse(&pairs->surface, p, impulse, y);
}

/* 0: the corners that are free cannot move the pair apart. */
static double find_mobility(const ms_contact_surface *s, const ms_surface_pair *p) {
  double sum = 0;
  if (!ms_surface_pair_is_mobile(s, p)) return 0;
  for (int k = 0; k < 4; k++) sum += p->weight[k] * p->weight[k] * s->inv_mass[p->node[k]];
  return sum;
}

int64_t ms_pair_impulses_push_positions(ms_surface_pairs *pairs, double friction, const double *x0,
                                        double *x1) {
  int64_t n = 0;
  for (ms_surface_pair *p = pairs->pair; p < pairs->pair + pairs->n; p++) {
    double displacement[3] = {0};
    const double mobility = p->is_active ? find_mobility(&pairs->surface, p) : 0;
    if (!(mobility > 0)) continue;
    ms_surface_pair_combine(p, 1, x1, displacement);
    const double missing = p->target - ms_vec3_dot(p->normal, displacement);
    if (!(missing > 1e-6 * p->target)) continue;
    ms_surface_pair_combine(p, -1, x0, displacement);
    push(pairs, p, friction, mobility, missing, displacement, x1);
    p->is_pushed = 1;
    n++;
  }
  return n;
}

int64_t ms_pair_impulses_push_velocities(ms_surface_pairs *pairs, double friction, double *v,
                                         double *work) {
  int64_t n = 0;
  for (const ms_surface_pair *p = pairs->pair; p < pairs->pair + pairs->n; p++) {
    double u[3] = {0};
    if (!p->is_pushed) continue;
    ms_surface_pair_combine(p, 1, v, u);
    const double inwards = -ms_vec3_dot(p->normal, u);
    if (!(inwards > 0)) continue;
    const double mobility = find_mobility(&pairs->surface, p);
    if (mobility > 0) *work += push(pairs, p, friction, mobility, inwards, u, v);
    n++;
  }
  return n;
}

int64_t ms_pair_impulses_count(const ms_surface_pairs *pairs) {
  int64_t n = 0;
  for (const ms_surface_pair *p = pairs->pair; p < pairs->pair + pairs->n; p++) n += p->is_pushed;
  return n;
}
