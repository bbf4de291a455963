/* Tests of the nonlinearity of the elastic energy in a step (the change beyond its linear part)
 * against a reference sum. */
#include <math.h>
#include <string.h>

#include "physics/nonlinearity.h"
#include "scenes.h"
#include "sim/sim.h"

enum { SIDE = 12 };

/* The same sum from energy and force of each spring, in long double */
static long double textbook(const ms_model *m, const double *x, double h, const double *d,
                            double lambda) {
  const size_t stride = (size_t)m->unknowns.stride;
  long double sum = 0;
  for (int32_t e = 0; e < m->springs.n; e++) {
    const size_t i = (size_t)m->springs.i[e], j = (size_t)m->springs.j[e];
    long double l2 = 0, next2 = 0, along = 0;
    for (size_t c = 0; c < (size_t)m->unknowns.dims; c++) {
      const long double u = (long double)x[c * stride + j] - x[c * stride + i];
      const long double q =
          (long double)lambda * h * ((long double)d[c * stride + j] - d[c * stride + i]);
      l2 += u * u, next2 += (u + q) * (u + q), along += u * q;
    }
    const long double l = sqrtl(l2), next = sqrtl(next2),
                      rest = m->scene->rest[ms_springs_number(&m->springs, e)];
    const long double k = m->scene->k[ms_springs_number(&m->springs, e)], a = l > 0 ? along / l : 0;
    sum += k / 2 * ((next - rest) * (next - rest) - (l - rest) * (l - rest)) - k * (l - rest) * a;
  }
  return sum;
}

/* Random states; the last spring has length 0, and one particle has very many springs. */
static msim_sim *crumpled(msim_scene *scene, double *d) {
  const double k = 10, zero = 0;
  const int32_t twins[2] = {SIDE + 1, SIDE + 2};
  for (int32_t i = 0; i < 3 * SIDE; i++)
    assert_ok(msim_scene_add_springs(scene, 1, (int32_t[2]){SIDE + 5, 4 * SIDE + i}, &k, NULL, NULL,
                                     err));
  assert_ok(msim_scene_add_springs(scene, 1, twins, &k, &zero, &zero, err));
  const msim_options opt = options("implicit-euler", 0.01);
  msim_sim *sim = make_sim(scene, &opt);
  const msim_state s = state_of(sim);
  double x[3 * SIDE * SIDE], v[3 * SIDE * SIDE] = {0};
  unsigned seed = 4;
  for (int i = 0; i < 3 * SIDE * SIDE; i++) x[i] = s.x[i] + 0.3 * (uniform(&seed) - 0.5);
  for (int c = 0; c < 3; c++) {
    x[c] = s.x[c], x[3 * (SIDE - 1) + c] = s.x[3 * (SIDE - 1) + c];
    x[3 * twins[1] + c] = x[3 * twins[0] + c];
  }
  assert_ok(msim_sim_set_state(
      sim, &(msim_state){.size = sizeof s, .n = SIDE * SIDE, .x = x, .v = v}, err));
  const ms_shape shape = sim->islands->model.shape;
  for (int32_t c = 0; c < shape.dims; c++)
    for (int32_t r = 0; r < shape.n; r++) d[c * shape.stride + r] = uniform(&seed) - 0.5;
  return sim;
}

static void nonlinearity_agrees_with_the_energies(void **state) {
  (void)state;
  static const double sizes[] = {1e3, 1, 1e-3, 1e-6};
  {
    msim_scene *scene = hanging_cloth(SIDE, 1000, 0);
    double d[3 * (SIDE * SIDE + 64)] = {0};
    msim_sim *sim = crumpled(scene, d);
    ms_stepper *s = &sim->islands->stepper;
    assert_true(s->model->shape.stride <= SIDE * SIDE + 64);
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
      const double want = (double)textbook(s->model, s->x, 0.01, d, sizes[i]);
      assert_close(ms_nonlinearity_compute(s->model, s->x, 0.01, d, sizes[i], s->scratch) / want, 1,
                   1e-9);
    }
    msim_sim_destroy(sim);
    msim_scene_destroy(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(nonlinearity_agrees_with_the_energies)};
  return cmocka_run_group_tests_name("nonlinearity", tests, NULL, NULL);
}
