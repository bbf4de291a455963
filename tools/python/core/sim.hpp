// sim.hpp - what the files of msim._core.Sim share
#ifndef MSIM_PYTHON_SIM_HPP
#define MSIM_PYTHON_SIM_HPP

#include <functional>

#include "common.hpp"

struct Sim {
  std::shared_ptr<Handle> h = std::make_shared<Handle>();
  nb::object x, v, v_half;       // views, made once, and again where arrays have other sizes
  const double *shown = nullptr; // of these views: x
  int32_t shown_n = 0;
  int64_t shown_step = -1; // the frame that next_frame has returned last
  double shown_t = 0;
};

void refuse_other_threads(const Handle &h);

// The sim for reading, and for changes between steps
msim_sim *idle(const Sim &s);

msim_state state_of(const Sim &s);

// Compute `function` in a thread of its own, without the GIL; a signal that raises an exception, as
// Ctrl-C does, and stop() end it.
void compute(Sim &s, const std::function<msim_status(msim_sim *, msim_error *)> &function);

void bind_readings(nb::class_<Sim> &sim);

#endif
