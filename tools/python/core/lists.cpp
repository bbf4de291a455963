// lists.cpp - what there is: statuses, options, integrators, solvers, recorders, importers
#include "common.hpp"

static nb::dict statuses() {
  nb::dict all;
#define ADD(name, value, text) all[#name] = nb::make_tuple(value, text);
  MSIM_STATUS_LIST(ADD)
#undef ADD
  return all;
}

static nb::list options() {
  nb::list all;
  for (int32_t i = 0; const msim_option_entry *e = msim_option_info(i); i++)
    all.append(nb::make_tuple(e->name, e->values, e->preset, e->doc));
  return all;
}

static nb::list integrators() {
  nb::list all;
  for (int32_t i = 0; const msim_integrator_entry *e = msim_integrator_info(i); i++)
    all.append(nb::make_tuple(e->name, e->order, e->implicit != 0, e->doc));
  return all;
}

using Info = int32_t(int32_t, const char *, msim_plugin_entry *, msim_error *);

static nb::list plugins(Info *info) {
  nb::list all;
  msim_error err;
  msim_plugin_entry e{};
  e.size = sizeof e;
  for (int32_t i = 0; info(i, nullptr, &e, &err); i++)
    all.append(nb::make_tuple(e.name, e.available != 0, e.library ? e.library : "",
                              e.license ? e.license : "", e.note ? e.note : ""));
  return all;
}

void bind_lists(nb::module_ &m) {
  m.def("statuses", statuses);
  m.def("options", options);
  m.def("integrators", integrators);
  m.def("solvers", [] { return plugins(msim_solver_info); });
  m.def("recorders", [] { return plugins(msim_recorder_info); });
  m.def("importers", [] { return plugins(msim_importer_info); });
}
