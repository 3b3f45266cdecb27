// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "bindings.hpp"
#include "locfuse/math/angle.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "locfuse/math/noise_kind.hpp"
#include "locfuse/math/symmetric.hpp"

namespace py = pybind11;
using locfuse::NoiseKind;

namespace {

AnyLinearization make(const Eigen::VectorXd& residual, const Eigen::MatrixXd& jacobian,
                      const Eigen::MatrixXd& noise) {
  const Eigen::Index m = residual.size();
  if (m == 0 || jacobian.rows() != m || noise.rows() != m || noise.cols() != m) {
    throw std::invalid_argument(
        "Linearization needs residual (m,), jacobian (m, n) and noise (m, m), got (" +
        std::to_string(m) + ",), (" + std::to_string(jacobian.rows()) + ", " +
        std::to_string(jacobian.cols()) + ") and (" + std::to_string(noise.rows()) + ", " +
        std::to_string(noise.cols()) + ")");
  }
  if (!residual.allFinite() || !jacobian.allFinite() || !noise.allFinite()) {
    throw std::invalid_argument("Linearization holds a number that is not finite");
  }
  if (!locfuse::is_covariance(noise)) {
    throw std::invalid_argument("Linearization.noise is not symmetric positive definite");
  }
  return {residual, jacobian, noise};
}

}  // namespace

void bind_math(py::module_& m) {
  m.def("wrap_angle", &locfuse::wrap_angle, py::arg("angle"), "Angle wrapped to [-pi, pi) [rad].");
  m.def("chi_squared_quantile", &locfuse::chi_squared_quantile, py::arg("dof"),
        py::arg("probability"),
        "Quantile of the chi-squared distribution with `dof` degrees of freedom at "
        "`probability`.\n\nRaises\n------\nValueError\n    Unless dof >= 1 and 0 <= probability <= "
        "1.");
  py::native_enum<NoiseKind>(m, "NoiseKind", "enum.Enum", "Shape of the measurement noise.")
      .value("GAUSSIAN", NoiseKind::kGaussian, "Gaussian with the given sigma.")
      .value("ONE_SIDED", NoiseKind::kOneSided,
             "A fraction of the measurements reads long; scalar measurements only.")
      .value("STUDENT_T", NoiseKind::kStudentT, "Student's t with heavy tails on both sides.")
      .value("CAUCHY", NoiseKind::kCauchy, "Student's t with one degree of freedom.")
      .finalize();
  py::class_<AnyLinearization>(m, "Linearization",
                               R"(Linearized measurement: residual, Jacobian and noise.

Parameters
----------
residual : float64 array, shape (m,)
    z minus h(x), angle rows wrapped to [-pi, pi).
jacobian : float64 array, shape (m, n)
    d h / d(error state of the n local variables).
noise : float64 array, shape (m, m)
    R, symmetric positive definite, in the squared unit of the measurement.

Raises
------
ValueError
    If the shapes do not fit, a number is not finite or the noise not positive definite.

Examples
--------
>>> import locfuse
>>> compass = locfuse.Linearization(residual=[0.02], jacobian=[[0, 0, 1]], noise=[[0.01]])
>>> compass.jacobian.shape
(1, 3)
)")
      .def(py::init(&make), py::arg("residual"), py::arg("jacobian"), py::arg("noise"))
      .def_readonly("residual", &AnyLinearization::residual, "z - h(x), shape (m,).")
      .def_readonly("jacobian", &AnyLinearization::jacobian, "Shape (m, n).")
      .def_readonly("noise", &AnyLinearization::noise, "R, shape (m, m).")
      .def(
          "log_likelihood", [](const AnyLinearization& lin) { return log_likelihood(lin); },
          "log N(residual; 0, noise): the log weight of a particle.")
      .def("__repr__", [](const AnyLinearization& lin) {
        return "Linearization(" + std::to_string(lin.residual.size()) + " x " +
               std::to_string(lin.jacobian.cols()) + ")";
      });
}
