// SPDX-License-Identifier: Apache-2.0
#include "bindings.hpp"
#include "locfuse/build_info.hpp"
#include "locfuse/error.hpp"

namespace py = pybind11;

namespace {

/// Pickling by protocol 0 or 1, which Python gives every class, would end the process in pybind11.
void refuse_pickling(const py::module_& m) {
  for (const auto& [name, value] : m.attr("__dict__").cast<py::dict>()) {
    if (!py::isinstance<py::type>(value) ||
        py::detail::get_type_info(reinterpret_cast<PyTypeObject*>(value.ptr())) == nullptr) {
      continue;  // enumerations and exceptions are Python's own
    }
    const auto refuse = [](const py::object& self, const py::args&) {
      throw py::type_error("cannot pickle '" +
                           py::str(py::type::of(self).attr("__name__")).cast<std::string>() +
                           "' object");
    };
    for (const char* method : {"__reduce__", "__reduce_ex__"}) {
      py::setattr(value, method, py::cpp_function(refuse, py::is_method(value)));
    }
  }
}

}  // namespace

PYBIND11_MODULE(_core_in_main_interpreter, m) {
  m.doc() = "The C++ core of locfuse; use it through `import locfuse`.";
  m.attr("__version__") = LOCFUSE_VERSION;
  py::register_exception<locfuse::NumericalError>(m, "NumericalError", PyExc_ArithmeticError)
      .doc() =
      "Numerical failure: an innovation covariance that is not positive definite, a result that is "
      "not finite. The belief is unchanged where it is raised.";
  m.def("compiler", &locfuse::compiler, "Compiler that built the core, such as 'GCC 12.2.0'.");
  m.def("kernels", &locfuse::kernels,
        "Vector kernels in use: 'avx2', with fused multiply-add, or 'portable'. Results differ "
        "only by rounding.");
  bind_math(m);
  bind_geometry(m);
  bind_messages(m);
  bind_maps(m);
  bind_scan_matching(m);
  bind_scan_odometry(m);
  bind_landmarks(m);
  bind_models(m);
  bind_multilateration(m);
  bind_filters(m);
  bind_estimators(m);
  bind_air_ekf(m);
  bind_gyro_odometry(m);
  bind_tags(m);
  bind_initializer(m);
  bind_landmark_ekf(m);
  bind_health(m);
  bind_pose_watch(m);
  bind_recovering_ekf(m);
  bind_mcl(m);
  bind_switching_mcl(m);
  bind_message_log(m);
  bind_odometry_timeline(m);
  bind_live(m);
  bind_replay(m);
  bind_smoothing(m);
  bind_mapping(m);
  bind_text(m);
  refuse_pickling(m);
}

/// Before pybind11 asks for its own state, which waits for ever in another interpreter.
extern "C" PYBIND11_EXPORT PyObject* PyInit__core() {
  if (PyInterpreterState_Get() != PyInterpreterState_Main()) {
    PyErr_SetString(PyExc_ImportError,
                    "locfuse works in the main interpreter only, not in a sub-interpreter");
    return nullptr;
  }
  return PyInit__core_in_main_interpreter();
}
