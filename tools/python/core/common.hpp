// common.hpp - what the files of the binding share: errors, handles, arrays without copies.
// Conversions, defaults and messages about them are Python's part, in src/msim.
#ifndef MSIM_PYTHON_COMMON_HPP
#define MSIM_PYTHON_COMMON_HPP

#include <msim/msim.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <atomic>
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

// The exception of a force function in this thread is raised by the call that ran into it.
void raise_force_exception();

// Refuse the use of a sim within a force function.
void refuse_in_force();

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
void bind_scene(nb::module_ &m);
void bind_sim(nb::module_ &m);

#endif
