// SPDX-License-Identifier: Apache-2.0
#include "bindings.hpp"
#include "locfuse/build_info.hpp"
#include "locfuse/error.hpp"

namespace py = pybind11;

PYBIND11_MODULE(_core, m) {
  m.doc() = "The C++ core of locfuse; use it through `import locfuse`.";
  m.attr("__version__") = LOCFUSE_VERSION;
  py::register_exception<locfuse::NumericalError>(m, "NumericalError", PyExc_ArithmeticError);
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
  bind_initializer(m);
  bind_landmark_ekf(m);
  bind_health(m);
  bind_recovering_ekf(m);
  bind_mcl(m);
  bind_switching_mcl(m);
  bind_tags(m);
  bind_message_log(m);
  bind_replay(m);
  bind_live(m);
  bind_text(m);
}
