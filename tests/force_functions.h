/* force_functions - forces of a program, with closed solutions, that several tests share */
#ifndef TEST_FORCE_FUNCTIONS_H
#define TEST_FORCE_FUNCTIONS_H

#include <math.h>

#include "scenes.h"

/* f = -k x - c (v - wind) + push sin(omega t) + B v x e_z, with what fails */
typedef struct field {
  double k, c, omega, magnet;
  double wind[3], push[3];
  int64_t calls,
      fails_at;        /* from this call on the result is `code`, or NaN if that is 0; 0: never */
  int32_t code, worst; /* worst: index of the particle that gets NaN */
} field;

static inline void field_jacobian(const field *of, int32_t i, const msim_force_batch *b) {
  for (int a = 0; a < 3; a++) b->dfdx[9 * i + 4 * a] = -of->k, b->dfdv[9 * i + 4 * a] = -of->c;
  b->dfdv[9 * i + 1] += of->magnet, b->dfdv[9 * i + 3] -= of->magnet;
}

static inline int32_t field_force(void *data, const msim_force_batch *b) {
  field *of = data;
  const int fails = of->fails_at > 0 && of->calls + 1 >= of->fails_at;
  of->calls++;
  for (int32_t i = 0; i < b->n; i++) {
    const double *x = b->x + 3 * (size_t)i, *v = b->v ? b->v + 3 * (size_t)i : NULL;
    double *f = b->f + 3 * (size_t)i;
    for (int a = 0; a < 3; a++) {
      f[a] += -of->k * x[a] + of->push[a] * sin(of->omega * b->t);
      if (v) f[a] -= of->c * (v[a] - of->wind[a]);
    }
    if (v) f[0] += of->magnet * v[1], f[1] -= of->magnet * v[0];
    if (b->dfdx) field_jacobian(of, i, b);
  }
  if (fails && !of->code) b->f[3 * (of->worst < b->n ? of->worst : 0) + 1] = NAN;
  return fails ? of->code : 0;
}

static inline double field_potential(void *data, int32_t n, const int32_t *particles,
                                     const double *x) {
  const field *of = data;
  double sum = 0;
  (void)particles;
  for (int32_t i = 0; i < 3 * n; i++) sum += of->k * x[i] * x[i] / 2;
  return sum;
}

static inline msim_force_function field_function(field *of, uint32_t flags) {
  return (msim_force_function){.size = sizeof(msim_force_function),
                               .flags = flags,
                               .name = "field",
                               .evaluate = field_force,
                               .data = of};
}

static inline void set_field(msim_scene *scene, field *of, uint32_t flags) {
  const msim_force_function is = field_function(of, flags);
  assert_ok(msim_scene_set_force_function(scene, &is, err));
}

static inline int takes_functions(const char *method) {
  return strcmp(method, "respa") != 0 && strcmp(method, "takahashi-imada") != 0 &&
         strcmp(method, "verlet") != 0;
}

static inline double energy_less_work(msim_sim *sim) {
  msim_energy e = {.size = sizeof e};
  assert_int_equal(msim_sim_energy(sim, &e), MSIM_OK);
  return e.total - e.work;
}

#endif
