// force.cpp - forces that Python computes: calls of force functions with the GIL, and exceptions.
// Python, in src/msim/_force.py, has made results contiguous arrays of the right shape.
#include <cmath>
#include <cstring>
#include <exception>

#include "common.hpp"

static thread_local std::exception_ptr pending; // of the last call
static thread_local bool is_inside = false;     // a force function is being called

std::exception_ptr take_force_exception() { return std::exchange(pending, nullptr); }

void raise_force_exception() {
  if (pending) std::rethrow_exception(take_force_exception());
}

void refuse_in_force() {
  if (is_inside)
    throw Failure{MSIM_ERR_ARG,
                  "a force function must not use a sim; use its arguments t, particles, x and v"};
}

// Call `function` with the GIL; an exception is kept, and false returned.
template <class Function>
static bool call(Function function) {
  nb::gil_scoped_acquire gil;
  is_inside = true;
  try {
    function();
  } catch (...) {
    pending = std::current_exception();
  }
  is_inside = false;
  return !pending;
}

static void write(const nb::object &from, double *to, size_t n) {
  std::memcpy(to, nb::cast<Doubles>(from).data(), n * sizeof *to);
}

static int32_t evaluate(void *data, const msim_force_batch *b) {
  const Force &force = *static_cast<Force *>(data);
  const size_t n = static_cast<size_t>(b->n);
  return !call([&] {
    const nb::object particles = copy(b->particles, {n}), x = copy(b->x, {n, 3}),
                     v = b->v ? copy(b->v, {n, 3}) : nb::none();
    if (!b->dfdx) return write(force.forces(b->t, particles, x, v), b->f, 3 * n);
    const nb::object blocks = force.jacobian(b->t, particles, x, v);
    write(blocks[0], b->dfdx, 9 * n), write(blocks[1], b->dfdv, 9 * n);
  });
}

static double compute_potential(void *data, int32_t n, const int32_t *particles, const double *x) {
  const Force &force = *static_cast<Force *>(data);
  const size_t size = static_cast<size_t>(n);
  double energy = NAN;
  call([&] {
    energy = nb::cast<double>(force.potential(copy(particles, {size}), copy(x, {size, 3})));
  });
  return energy;
}

static void set_force(Scene &s, const char *name, uint32_t flags, nb::object forces,
                      nb::object jacobian, nb::object potential, double largest_stiffness,
                      double largest_damping) {
  msim_error err;
  auto force = std::make_shared<Force>(Force{forces, jacobian, potential});
  msim_force_function f{};
  f.size = sizeof f;
  f.flags = flags | (jacobian.is_none() ? 0u : static_cast<uint32_t>(MSIM_FORCE_JACOBIAN));
  f.name = name, f.evaluate = evaluate, f.data = force.get();
  f.potential = potential.is_none() ? nullptr : compute_potential;
  f.largest_stiffness = largest_stiffness, f.largest_damping = largest_damping;
  check(msim_scene_set_force_function(s.p, &f, &err), err);
  s.force = std::move(force);
}

static void remove_force(Scene &s) {
  msim_error err;
  check(msim_scene_set_force_function(s.p, nullptr, &err), err);
  s.force = nullptr;
}

void bind_force(nb::class_<Scene> &scene) {
  scene
      .def("set_force", set_force, nb::arg(), nb::arg(), nb::arg(), nb::arg().none(),
           nb::arg().none(), nb::arg(), nb::arg())
      .def("remove_force", remove_force);
}
