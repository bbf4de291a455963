// common.hpp - what the files of the binding share: errors, handles, arrays without copies.
// Conversions, defaults and messages about them are Python's part, in src/msim.
#ifndef MSIM_PYTHON_COMMON_HPP
#define MSIM_PYTHON_COMMON_HPP

#include <msim/msim.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <atomic>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace nb = nanobind;

using Doubles = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Ints = nb::ndarray<const int32_t, nb::c_contig, nb::device::cpu>;

// Becomes the exception class of its status (src/msim/_errors.py).
struct Failure {
  msim_status status;
  std::string text, advice;
};

inline void check(msim_status status, const msim_error &err) {
  if (status != MSIM_OK) throw Failure{status, err.text, {}};
}

// Data of an array that may be None
inline const double *data_or_null(const nb::object &array) {
  return array.is_none() ? nullptr : nb::cast<Doubles>(array).data();
}

// A read-only array of the library's data, which `owner` keeps alive
inline nb::object view(const double *data, std::vector<size_t> shape, nb::handle owner) {
  return nb::cast(
      nb::ndarray<nb::numpy, const double>(data, shape.size(), shape.data(), nb::borrow(owner)));
}

template <class T>
nb::object copy(const T *data, std::vector<size_t> shape) {
  size_t n = 1;
  for (size_t extent : shape) n *= extent;
  auto *values = new std::vector<T>(data, data + n);
  nb::capsule owner(values, [](void *p) noexcept { delete static_cast<std::vector<T> *>(p); });
  return nb::cast(nb::ndarray<nb::numpy, T>(values->data(), shape.size(), shape.data(), owner));
}

// A force function of Python, as msim_force_function.data; scenes and their sims share it.
struct Force {
  nb::object forces;    // (t, particles, x, v) to forces, (n, 3)
  nb::object jacobian;  // the same to dfdx and dfdv, (n, 3, 3) each, or None
  nb::object potential; // (particles, x) to a number, or None
};

// The exception of a force function in this thread is raised by the call that ran into it; take: it
// is handed to another thread, null if there is none.
void raise_force_exception();
std::exception_ptr take_force_exception();

// Refuse the use of a sim within a force function.
void refuse_in_force();

// Particles and springs to remove and to add; arrays may be None
inline msim_edit make_edit(const Ints &removed_particles, const Ints &removed_springs,
                           const nb::object &x, const nb::object &v, const nb::object &mass,
                           const Ints &ij, const nb::object &k, const nb::object &rest,
                           const nb::object &damping, const nb::object &law) {
  msim_edit e{};
  e.size = sizeof e;
  e.nremoved_particles = static_cast<int32_t>(removed_particles.size());
  e.removed_particles = removed_particles.data();
  e.nremoved_springs = static_cast<int32_t>(removed_springs.size());
  e.removed_springs = removed_springs.data();
  e.nparticles = mass.is_none() ? 0 : static_cast<int32_t>(nb::cast<Doubles>(mass).size());
  e.x = data_or_null(x), e.v = data_or_null(v), e.mass = data_or_null(mass);
  e.nsprings = static_cast<int32_t>(ij.size() / 2);
  e.ij = ij.data(), e.k = data_or_null(k), e.rest = data_or_null(rest);
  e.damping = data_or_null(damping);
  e.law = law.is_none() ? nullptr : nb::cast<Ints>(law).data();
  return e;
}

struct Scene {
  std::shared_ptr<Force> force;
  msim_scene *p = nullptr;
  Scene() = default;
  Scene(const Scene &) = delete;
  Scene &operator=(const Scene &) = delete;
  ~Scene() { msim_scene_destroy(p); }
};

// A sim, which lives as long as the last of the Sim, its views and its recorders. It knows none of
// them, so that there are no reference cycles.
struct Handle {
  std::shared_ptr<Force> force; // outlives the sim
  msim_sim *p = nullptr;
  bool busy = false;                // a thread is inside step or run, without the GIL
  bool in_observer = false;         // Python calls an observer of this sim
  std::thread::id owner;            // of `busy` or `in_observer`
  std::atomic<bool> stopped{false}; // stop() was called
  std::vector<std::string> warnings;
  Handle() = default;
  Handle(const Handle &) = delete;
  Handle &operator=(const Handle &) = delete;
  ~Handle() { msim_sim_destroy(p); }
};

void bind_force(nb::class_<Scene> &scene);
void bind_lists(nb::module_ &m);
void bind_recorder(nb::module_ &m);
void bind_scene(nb::module_ &m);
void bind_sim(nb::module_ &m);

#endif
