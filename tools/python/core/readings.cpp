// readings.cpp - what can be read from msim._core.Sim besides its state: energy, counts, forces
#include "sim.hpp"

static nb::tuple energy(const Sim &s) {
  msim_energy e{};
  e.size = sizeof e;
  msim_sim_energy(idle(s), &e);
  raise_force_exception();
  return nb::make_tuple(e.kinetic, e.elastic, e.gravitational, e.total, copy(e.momentum, {3}),
                        copy(e.angular_momentum, {3}), e.work);
}

static nb::tuple islands(Sim &s) {
  msim_islands all{};
  all.size = sizeof all;
  if (const msim_status status = msim_sim_islands(idle(s), &all))
    throw Failure{status, "out of memory for the islands"};
  raise_force_exception();
  const size_t n = static_cast<size_t>(all.n);
  return nb::make_tuple(copy(all.of, {static_cast<size_t>(state_of(s).n)}), copy(all.kinetic, {n}),
                        copy(all.elastic, {n}), copy(all.gravitational, {n}));
}

static nb::dict stats(const Sim &s) {
  msim_stats t{};
  t.size = sizeof t;
  msim_sim_stats(idle(s), &t);
  nb::dict d;
#define ADD(name) d[#name] = t.name;
  ADD(steps)
  ADD(force_evaluations)
  ADD(assemblies)
  ADD(analyses)
  ADD(factorizations)
  ADD(solves)
  ADD(iterations) ADD(newton_iterations) ADD(contacts) ADD(indefinite_steps) ADD(coarse_factors)
      ADD(kept_factors) ADD(refinements) ADD(fallbacks) ADD(total_s) ADD(force_s) ADD(assemble_s)
          ADD(factor_s) ADD(solve_s) ADD(collide_s) ADD(output_s) ADD(steps_at_rest)
              ADD(islands_at_rest) ADD(spring_evaluations) ADD(rejected_steps) ADD(incomplete_steps)
                  ADD(broken)
#undef ADD
                      return d;
}

static nb::tuple plan(const Sim &s) {
  msim_plan p{};
  p.size = sizeof p;
  msim_sim_plan(idle(s), &p);
  return nb::make_tuple(p.h, p.steps, p.integrator, p.solver, p.threads, p.tol, p.t_end);
}

static nb::object force(Sim &s, Doubles x, Doubles v) {
  const msim_state state = state_of(s);
  std::vector<double> f(3 * static_cast<size_t>(state.n));
  msim_sim_force(s.h->p, x.data(), v.data(), f.data());
  raise_force_exception();
  return copy(f.data(), {static_cast<size_t>(state.n), 3});
}

static nb::object reactions(Sim &s) {
  const msim_state state = state_of(s);
  std::vector<double> r(3 * static_cast<size_t>(state.n));
  msim_sim_reactions(s.h->p, r.data());
  return copy(r.data(), {static_cast<size_t>(state.n), 3});
}

static nb::tuple springs(Sim &s) {
  const size_t size = static_cast<size_t>(state_of(s).nsprings);
  std::vector<double> tension(size), elongation(size), strain(size);
  msim_sim_springs(idle(s), tension.data(), elongation.data(), strain.data());
  return nb::make_tuple(copy(tension.data(), {size}), copy(elongation.data(), {size}),
                        copy(strain.data(), {size}));
}

// The bytes of an array of msim_contact
static nb::bytes contacts(Sim &s) {
  int32_t n;
  const msim_contact *all;
  const msim_status status = msim_sim_contacts(idle(s), &n, &all);
  if (status == MSIM_ERR_ARG)
    throw Failure{status, "contacts are not recorded; create the sim with contacts=\"on\""};
  if (status) throw Failure{status, "there are more contacts than can be recorded"};
  return nb::bytes(reinterpret_cast<const char *>(all), static_cast<size_t>(n) * sizeof *all);
}

// The arrays of scipy.sparse.csr_array
static nb::tuple matrix(const Sim &s) {
  msim_error err;
  msim_csr a{};
  a.size = sizeof a;
  const msim_status status = msim_sim_matrix(idle(s), &a, &err);
  raise_force_exception();
  check(status, err);
  const size_t n = static_cast<size_t>(a.n), entries = static_cast<size_t>(a.rowptr[n]);
  return nb::make_tuple(copy(a.val, {entries}), copy(a.colind, {entries}), copy(a.rowptr, {n + 1}));
}

static nb::tuple estimate(const Sim &s) {
  msim_error err;
  msim_estimate e{};
  e.size = sizeof e;
  check(msim_sim_estimate(idle(s), &e, &err), err);
  return nb::make_tuple(e.tried, e.steps, e.force_evaluations, e.solves, e.iterations,
                        e.factorizations, e.work);
}

static nb::tuple equilibrium(Sim &s, double ftol, int32_t max_iterations) {
  msim_equilibrium e{};
  e.size = sizeof e;
  compute(s, [&](msim_sim *sim, msim_error *err) {
    return msim_sim_equilibrium(sim, ftol, max_iterations, &e, err);
  });
  return nb::make_tuple(e.force, e.particle, e.iterations, e.saddles, e.is_minimum != 0);
}

static nb::tuple modes(Sim &s, int32_t n) {
  const size_t particles = static_cast<size_t>(state_of(s).n), count = static_cast<size_t>(n);
  std::vector<double> frequency(count), shape(count * 3 * particles);
  compute(s, [&](msim_sim *sim, msim_error *err) {
    return msim_sim_modes(sim, n, frequency.data(), shape.data(), err);
  });
  return nb::make_tuple(copy(frequency.data(), {count}),
                        copy(shape.data(), {count, particles, 3}));
}

static nb::str explain(const Sim &s) {
  msim_error err;
  const char *text;
  check(msim_sim_explain(idle(s), &text, &err), err);
  return nb::str(text);
}

void bind_readings(nb::class_<Sim> &sim) {
  sim.def("_energy", energy)
      .def("_islands", islands)
      .def("_stats", stats)
      .def("_plan", plan)
      .def("_estimate", estimate)
      .def("_equilibrium", equilibrium)
      .def("_modes", modes)
      .def("_force", force)
      .def("_reactions", reactions)
      .def("_contacts", contacts)
      .def("_springs", springs)
      .def("_matrix", matrix)
      .def("explain", explain);
}
