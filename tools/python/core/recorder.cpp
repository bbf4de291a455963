// recorder.cpp - msim._core.Recorder
#include "sim.hpp"

struct Recorder {
  std::shared_ptr<Handle> h;
  msim_recorder *p = nullptr;
  Recorder() = default;
  Recorder(const Recorder &) = delete;
  Recorder &operator=(const Recorder &) = delete;
  ~Recorder() { msim_recorder_close(p, nullptr); }
};

using Open = msim_status(msim_sim *, const char *, msim_recorder **, msim_error *);

// mode: "new", "replace" or "resume"
static void open_recorder(Recorder *self, const Sim &s, const char *path, const std::string &mode) {
  msim_error err;
  Open *open = mode == "resume"    ? msim_recorder_resume
               : mode == "replace" ? msim_recorder_replace
                                   : msim_recorder_open;
  msim_recorder *p = nullptr;
  check(open(idle(s), path, &p, &err), err);
  new (self) Recorder();
  self->h = s.h, self->p = p;
}

static void write_frame(Recorder &r) {
  msim_error err;
  if (!r.p) throw Failure{MSIM_ERR_ARG, "the recorder is closed"};
  refuse_other_threads(*r.h);
  check(msim_recorder_write(r.p, &err), err);
}

static void close_recorder(Recorder &r) {
  msim_error err;
  refuse_other_threads(*r.h);
  check(msim_recorder_close(std::exchange(r.p, nullptr), &err), err);
}

void bind_recorder(nb::module_ &m) {
  nb::class_<Recorder>(m, "Recorder")
      .def("__init__", open_recorder)
      .def("write", write_frame)
      .def("close", close_recorder);
}
