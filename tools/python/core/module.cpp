// module.cpp - the extension module msim._core
#include "common.hpp"

static void translate(const std::exception_ptr &p, void *) {
  try {
    std::rethrow_exception(p);
  } catch (const Failure &failure) {
    const nb::object error = nb::module_::import_("msim._errors")
                                 .attr("from_status")(failure.status, failure.text, failure.advice);
    PyErr_SetObject(reinterpret_cast<PyObject *>(Py_TYPE(error.ptr())), error.ptr());
  }
}

NB_MODULE(_core, m) {
  nb::register_exception_translator(translate);
  m.def("version", msim_version);
  bind_lists(m);
  bind_scene(m);
  bind_sim(m);
  bind_recorder(m);
}
