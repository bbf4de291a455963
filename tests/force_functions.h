/* force_functions - forces of a program, with closed solutions, that several tests share */
#ifndef TEST_FORCE_FUNCTIONS_H
#define TEST_FORCE_FUNCTIONS_H

#include <math.h>

#include "scenes.h"

/* f = -k x - c (v - wind) + push sin(omega t) + B v x e_z, with what fails */
typedef struct field {
  double k, c, omega, magnet;
  double wind[3], push[3];
  int64_t calls, fails_at;  /* from this call on, or in this call alone if `once`; 0: never */
  int32_t code, worst;      /* what it returns; 0: it computes NaN for the particle of this index */
  int once, bad_derivative; /* bad_derivative: the NaN is in dfdv */
} field;

static inline void field_jacobian(const field *of, int32_t i, const msim_force_batch *b) {
  for (int a = 0; a < 3; a++) b->dfdx[9 * i + 4 * a] = -of->k, b->dfdv[9 * i + 4 * a] = -of->c;
  b->dfdv[9 * i + 1] += of->magnet, b->dfdv[9 * i + 3] -= of->magnet;
}

static inline int32_t field_force(void *data, const msim_force_batch *b) {
  field *of = data;
  of->calls++;
  const int fails =
      of->fails_at > 0 && (of->once ? of->calls == of->fails_at : of->calls >= of->fails_at);
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
  const int worst = of->worst < b->n ? of->worst : 0;
  if (fails && !of->code && !of->bad_derivative) b->f[3 * worst + 1] = NAN;
  if (fails && of->bad_derivative && b->dfdv) b->dfdv[9 * worst + 8] = NAN;
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

static const field gusts = {
    .k = 3, .c = 0.2, .omega = 9, .magnet = 0.5, .wind = {1, 2, 0}, .push = {0.2, -0.1, 0.3}};

/* The flags of gusts for a method */
static inline uint32_t flags_for(const char *method) {
  return takes_positions_only(method) ? MSIM_FORCE_TIME | MSIM_FORCE_JACOBIAN
                                      : MSIM_FORCE_TIME | MSIM_FORCE_VELOCITY | MSIM_FORCE_JACOBIAN;
}

static inline int takes_functions(const char *method) {
  return strcmp(method, "respa") != 0 && strcmp(method, "takahashi-imada") != 0 &&
         strcmp(method, "verlet") != 0;
}

#endif
