// sim.cpp - msim._core.Sim: steps without the GIL, live views, signals.
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <future>
#include <mutex>

#include "sim.hpp"

using Clock = std::chrono::steady_clock;
static constexpr auto between_signals = std::chrono::milliseconds(50);

/*------------------------------------- one user at a time ---------------------------------------*/

void refuse_other_threads(const Handle &h) {
  refuse_in_force();
  if ((h.busy || h.in_observer) && h.owner != std::this_thread::get_id()) {
    nb::object busy = nb::module_::import_("msim._errors").attr("BusyError");
    PyErr_SetString(busy.ptr(), "another thread is using this sim; give each thread its own one");
    throw nb::python_error();
  }
}

msim_sim *idle(const Sim &s) {
  refuse_other_threads(*s.h);
  return s.h->p;
}

// The sim for steps, which release the GIL: until the end of the scope other threads are refused.
class Stepping {
  Handle &h;

 public:
  explicit Stepping(Handle &handle) : h(handle) {
    refuse_other_threads(h);
    if (h.busy || h.in_observer)
      throw Failure{MSIM_ERR_ARG,
                    "an observer must not step the sim that it observes: the run "
                    "goes on when the observer has returned"};
    h.owner = std::this_thread::get_id();
    h.busy = true;
  }
  ~Stepping() { h.busy = false; }
};

/*------------------------------------- warnings, signals, stops ---------------------------------*/

static void keep_warning(const char *text, void *user) {
  static_cast<Handle *>(user)->warnings.emplace_back(text);
}

// Python's warnings, where the call that caused them is in `level`
static void show_warnings(Handle &h, int level) {
  raise_force_exception();
  if (h.warnings.empty()) return;
  const std::vector<std::string> texts = std::exchange(h.warnings, {});
  for (const std::string &text : texts)
    if (PyErr_WarnEx(PyExc_RuntimeWarning, text.c_str(), level)) throw nb::python_error();
}

static void check_signals() {
  if (PyErr_CheckSignals()) throw nb::python_error();
}

// Asks a run to stop every 50 ms, so that its caller can look for signals and run on.
class Alarm {
  std::mutex mutex;
  std::condition_variable ends;
  bool ended = false;
  std::thread thread;

  void watch(Handle &h) {
    std::unique_lock<std::mutex> lock(mutex);
    while (!ends.wait_for(lock, between_signals, [this] { return ended; })) msim_sim_stop(h.p);
  }

 public:
  explicit Alarm(Handle &h) : thread([this, &h] { watch(h); }) {}
  ~Alarm() {
    {
      std::lock_guard<std::mutex> lock(mutex);
      ended = true;
    }
    ends.notify_one();
    thread.join();
  }
};

// 1: a request to stop came from stop(), and counts as served now.
static bool take_stop(Handle &h) { return h.stopped.exchange(false); }

// False: it has not ended within the time between signals.
static bool wait_for(std::future<msim_status> &computation) {
  nb::gil_scoped_release release;
  return computation.wait_for(between_signals) == std::future_status::ready;
}

void compute(Sim &s, const std::function<msim_status(msim_sim *, msim_error *)> &function) {
  const std::shared_ptr<Handle> h = s.h;
  Stepping now(*h);
  msim_error err;
  msim_status status;
  std::exception_ptr signal, thrown;
  do { // an alarm may have left a request to stop
    std::future<msim_status> computation = std::async(std::launch::async, [&] {
      const msim_status result = function(h->p, &err);
      thrown = take_force_exception();
      return result;
    });
    while (!wait_for(computation))
      if (!signal && PyErr_CheckSignals()) {
        signal = std::make_exception_ptr(nb::python_error());
        msim_sim_stop(h->p);
      }
    status = computation.get();
  } while (status == MSIM_STOPPED && !signal && !take_stop(*h));
  if (signal) std::rethrow_exception(signal);
  if (thrown) std::rethrow_exception(thrown);
  check(status, err);
}

/*------------------------------------- creation -------------------------------------------------*/

static void set_options(const Scene &scene, const nb::list &options, msim_options &opt) {
  msim_error err;
  msim_options_init(&opt, sizeof opt);
  check(msim_options_from_scene(&opt, scene.p, &err), err);
  for (nb::handle pair : options)
    check(msim_options_set(&opt, nb::cast<const char *>(pair[0]), nb::cast<const char *>(pair[1]),
                           &err),
          err);
}

// options: pairs of names and values as text
static void create(Sim *self, const Scene &scene, const nb::list &options) {
  Sim sim;
  msim_error err;
  msim_options opt;
  sim.h->force = scene.force;
  set_options(scene, options, opt);
  opt.warn = keep_warning;
  opt.warn_user = sim.h.get();
  const msim_status status = msim_sim_create(scene.p, &opt, &sim.h->p, &err);
  show_warnings(*sim.h, 2);
  check(status, err);
  new (self) Sim(std::move(sim));
}

static void copy_sim(Sim *self, const Sim &from) {
  Sim sim;
  msim_error err;
  sim.h->force = from.h->force;
  const msim_status status = msim_sim_clone(idle(from), &sim.h->p, &err);
  show_warnings(*sim.h, 2);
  check(status, err);
  msim_sim_set_warn(sim.h->p, keep_warning, sim.h.get());
  new (self) Sim(std::move(sim));
}

/*------------------------------------- steps ----------------------------------------------------*/

// As check(), for steps: a numerical event comes with advice.
static void check_steps(const Handle &h, msim_status status, const std::string &text) {
  char advice[1024] = "";
  if (status > 0) msim_sim_advice(h.p, advice, sizeof advice);
  if (status != MSIM_OK) throw Failure{status, text, advice};
}

static msim_status make_steps(Handle &h, int64_t n, msim_error *err) {
  nb::gil_scoped_release release;
  return msim_sim_step(h.p, n, err);
}

// Makes n steps by make_chunk(count), in chunks that take about 25 to 50 ms, and looks for signals
// after each. The first is one step, as an alarm may have left a request to stop.
template <class MakeChunk>
static void make_chunks(int64_t n, MakeChunk make_chunk) {
  if (n < 0) throw Failure{MSIM_ERR_ARG, "n must be >= 0"};
  for (int64_t chunk = 1; n > 0;) {
    const int64_t count = std::min(n, chunk);
    const auto start = n > 1 ? Clock::now() : Clock::time_point();
    make_chunk(count);
    n -= count;
    check_signals();
    if (n == 0) return;
    const auto taken = Clock::now() - start;
    chunk = taken < between_signals / 2 ? 2 * count : std::max<int64_t>(1, count / 2);
  }
}

// After a chunk of steps
static void check_chunk(Handle &h, msim_status status, const std::string &text) {
  show_warnings(h, 1);
  if (status != MSIM_STOPPED || take_stop(h)) check_steps(h, status, text);
}

static void step(Sim &s, int64_t n) {
  const std::shared_ptr<Handle> h = s.h;
  Stepping now(*h);
  make_chunks(n, [&](int64_t count) {
    msim_error err;
    const msim_status status = make_steps(*h, count, &err);
    check_chunk(*h, status, err.text);
  });
}

// Force functions of Python need the GIL, and their exceptions are those of this thread.
static void step_many(const nb::list &list, int64_t n, int32_t threads) {
  std::vector<std::shared_ptr<Handle>> handles;
  std::vector<std::unique_ptr<Stepping>> now;
  std::vector<msim_sim *> sims;
  std::vector<msim_error> errors(list.size());
  for (nb::handle item : list) {
    handles.push_back(nb::cast<Sim &>(item).h);
    Handle &h = *handles.back();
    now.push_back(std::make_unique<Stepping>(h));
    sims.push_back(h.p);
    if (h.force) threads = 1;
  }
  make_chunks(n, [&](int64_t count) {
    msim_error err;
    const auto size = static_cast<int32_t>(sims.size());
    const msim_status status = [&] {
      nb::gil_scoped_release release;
      return msim_sim_step_many(sims.data(), size, count, threads, errors.data(), &err);
    }();
    if (status == MSIM_ERR_ARG) check(status, err);
    for (size_t i = 0; i < sims.size(); i++) {
      const std::string text = "sims[" + std::to_string(i) + "]: " + errors[i].text;
      check_chunk(*handles[i], errors[i].status, text);
    }
  });
}

static int stop_at_frame(msim_sim *p, void *user) {
  Sim &s = *static_cast<Sim *>(user);
  msim_state state{};
  state.size = sizeof state;
  msim_sim_state(p, &state);
  if (state.step == s.shown_step && state.t == s.shown_t) return 0;
  s.shown_step = state.step, s.shown_t = state.t;
  return 1;
}

static msim_status run(Sim &s, Handle &h, msim_error *err) {
  nb::gil_scoped_release release;
  Alarm alarm(h);
  return msim_sim_run(h.p, stop_at_frame, &s, err);
}

// Run to the next frame of the options. False: there is none, or stop() was called.
static bool next_frame(Sim &s) {
  const std::shared_ptr<Handle> h = s.h;
  Stepping now(*h);
  while (!take_stop(*h)) {
    msim_error err;
    const int64_t step_before = s.shown_step;
    const double t_before = s.shown_t;
    const msim_status status = run(s, *h, &err);
    show_warnings(*h, 2);
    check_signals();
    if (s.shown_step != step_before || s.shown_t != t_before) return true;
    if (status == MSIM_OK) return false;
    if (status != MSIM_STOPPED) check_steps(*h, status, err.text);
  }
  return false;
}

// The next run shows its first frame even if a former one has shown it.
static void forget_frame(Sim &s) { s.shown_step = -1; }

static void stop(Sim &s) {
  s.h->stopped = true;
  msim_sim_stop(s.h->p);
}

static void set_in_observer(Sim &s, bool is_in) {
  idle(s);
  s.h->owner = std::this_thread::get_id();
  s.h->in_observer = is_in;
}

/*------------------------------------- state ----------------------------------------------------*/

msim_state state_of(const Sim &s) {
  msim_state state{};
  state.size = sizeof state;
  msim_sim_state(idle(s), &state);
  raise_force_exception();
  return state;
}

// The view of one array of the state, which has kept its address since the view was made
static nb::object show(Sim &s, nb::object &shown, const double *data, int32_t n) {
  if (!shown.is_valid()) {
    nb::capsule owner(new std::shared_ptr<Handle>(s.h),
                      [](void *p) noexcept { delete static_cast<std::shared_ptr<Handle> *>(p); });
    shown = view(data, {static_cast<size_t>(n), 3}, owner);
  }
  return shown;
}

// The present state, whose arrays the views show. Edits and checkpoints may change their size; the
// library keeps the memory of older views.
static msim_state shown_state(Sim &s) {
  const msim_state state = state_of(s);
  if (state.x != s.shown || state.n != s.shown_n)
    s.x = s.v = s.v_half = nb::object(), s.shown = state.x, s.shown_n = state.n;
  return state;
}

static nb::object get_x(Sim &s) {
  const msim_state state = shown_state(s);
  return show(s, s.x, state.x, state.n);
}

static nb::object get_v(Sim &s) {
  const msim_state state = shown_state(s);
  return show(s, s.v, state.v, state.n);
}

static nb::object get_v_half(Sim &s) {
  const msim_state state = shown_state(s);
  return state.v_half ? show(s, s.v_half, state.v_half, state.n) : nb::none();
}

static void set_state(Sim &s, Doubles x, Doubles v, nb::object v_half, double t, int64_t at) {
  msim_error err;
  msim_state state = state_of(s);
  state.x = x.data(), state.v = v.data(), state.v_half = data_or_null(v_half);
  state.t = t, state.step = at;
  const msim_status status = msim_sim_set_state(s.h->p, &state, &err);
  show_warnings(*s.h, 2);
  check(status, err);
  forget_frame(s);
}

static void set_step(Sim &s, double h) {
  msim_error err;
  const msim_status status = msim_sim_set_step(idle(s), h, &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void set_springs(Sim &s, nb::object k, nb::object rest, nb::object damping) {
  msim_error err;
  const msim_status status = msim_sim_set_springs(idle(s), data_or_null(k), data_or_null(rest),
                                                  data_or_null(damping), &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void set_gravity(Sim &s, Doubles g) {
  msim_error err;
  const msim_status status = msim_sim_set_gravity(idle(s), g.data(), &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void set_drag(Sim &s, double drag) {
  msim_error err;
  const msim_status status = msim_sim_set_drag(idle(s), drag, &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void set_forces(Sim &s, nb::object force) {
  msim_error err;
  const msim_status status = msim_sim_set_forces(idle(s), data_or_null(force), &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void move_pinned(Sim &s, Ints particles, Doubles x, double duration) {
  msim_error err;
  const msim_status status = msim_sim_move_pinned(idle(s), static_cast<int32_t>(particles.size()),
                                                  particles.data(), x.data(), duration, &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void move_collider(Sim &s, int32_t collider, Doubles x, nb::object rotation,
                          double duration) {
  msim_error err;
  const msim_status status =
      msim_sim_move_collider(idle(s), collider, x.data(), data_or_null(rotation), duration, &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void set_pinned(Sim &s, Ints particles, bool pinned) {
  msim_error err;
  const msim_status status = msim_sim_set_pinned(idle(s), static_cast<int32_t>(particles.size()),
                                                 particles.data(), pinned, &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void edit(Sim &s, Ints removed_particles, Ints removed_springs, nb::object x, nb::object v,
                 nb::object mass, Ints ij, nb::object k, nb::object rest, nb::object damping,
                 nb::object law, Ints ijk, nb::object angle_k, nb::object angle_rest,
                 nb::object angle_damping) {
  msim_error err;
  msim_edit e =
      make_edit(removed_particles, removed_springs, x, v, mass, ij, k, rest, damping, law);
  e.nangles = static_cast<int32_t>(ijk.size() / 3);
  e.ijk = ijk.data(), e.angle_k = data_or_null(angle_k), e.angle_rest = data_or_null(angle_rest);
  e.angle_damping = data_or_null(angle_damping);
  const msim_status status = msim_sim_edit(idle(s), &e, &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static void break_springs(Sim &s, Ints springs) {
  msim_error err;
  const msim_status status =
      msim_sim_break(idle(s), static_cast<int32_t>(springs.size()), springs.data(), &err);
  show_warnings(*s.h, 2);
  check(status, err);
}

static nb::object broken(const Sim &s) {
  const size_t n = static_cast<size_t>(state_of(s).nsprings);
  std::vector<uint8_t> flags(n);
  msim_sim_broken(s.h->p, flags.data());
  return copy(flags.data(), {n});
}

static nb::bytes save(Sim &s) {
  msim_error err;
  std::vector<char> data(msim_sim_save_size(idle(s)));
  size_t length = 0;
  check(msim_sim_save(s.h->p, data.data(), data.size(), &length, &err), err);
  return nb::bytes(data.data(), length);
}

static void load(Sim &s, nb::bytes data) {
  msim_error err;
  const msim_status status = msim_sim_load(idle(s), data.c_str(), data.size(), &err);
  show_warnings(*s.h, 2);
  check(status, err);
  forget_frame(s);
}

void bind_sim(nb::module_ &m) {
  nb::class_<Sim> sim(m, "Sim");
  sim.def("__init__", create)
      .def("__init__", copy_sim)
      .def("step", step, nb::arg("n") = 1)
      .def("stop", stop)
      .def("_next_frame", next_frame)
      .def("_forget_frame", forget_frame)
      .def("_set_in_observer", set_in_observer)
      .def_prop_ro("x", get_x)
      .def_prop_ro("v", get_v)
      .def_prop_ro("v_half", get_v_half)
      .def("__len__", [](const Sim &s) { return state_of(s).n; })
      .def_prop_ro("t", [](const Sim &s) { return state_of(s).t; })
      .def_prop_ro("nsprings", [](const Sim &s) { return state_of(s).nsprings; })
      .def_prop_ro("nsteps", [](const Sim &s) { return state_of(s).step; })
      .def("_set_state", set_state, nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg())
      .def("_set_step", set_step)
      .def("_set_springs", set_springs, nb::arg().none(), nb::arg().none(), nb::arg().none())
      .def("_set_gravity", set_gravity)
      .def("_set_drag", set_drag)
      .def("_set_forces", set_forces, nb::arg().none())
      .def("_move_pinned", move_pinned)
      .def("_move_collider", move_collider, nb::arg(), nb::arg(), nb::arg().none(), nb::arg())
      .def("_set_pinned", set_pinned)
      .def("_edit", edit, nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(),
           nb::arg().none(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg().none(),
           nb::arg().none(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg().none())
      .def("_break_springs", break_springs)
      .def("_broken", broken)
      .def("dumps", save)
      .def("loads", load, nb::arg("data"));
  bind_readings(sim);
  m.def("step_many", step_many);
}
