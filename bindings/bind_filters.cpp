// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "bindings.hpp"
#include "locfuse/filters/robust.hpp"

namespace py = pybind11;
using locfuse::Gate;
using locfuse::GaussianBelief;
using locfuse::NoiseKind;
using locfuse::NoiseShape;
using locfuse::Outcome;
using locfuse::Reason;
using locfuse::Slot;
using locfuse::SlotKind;
using locfuse::Verdict;

namespace {

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kFused:
      return "fused";
    case Verdict::kGated:
      return "gated";
    case Verdict::kNotModelled:
      return "not_modelled";
    case Verdict::kIgnored:
      return "ignored";
    case Verdict::kStale:
      return "stale";
    case Verdict::kImplausible:
      return "implausible";
  }
  return "";
}

}  // namespace

void bind_filters(py::module_& m) {
  py::native_enum<Verdict>(m, "Verdict", "enum.IntEnum", "Result of processing a message.")
      .value("FUSED", Verdict::kFused)
      .value("GATED", Verdict::kGated)
      .value("NOT_MODELLED", Verdict::kNotModelled)
      .value("IGNORED", Verdict::kIgnored)
      .value("STALE", Verdict::kStale)
      .value("IMPLAUSIBLE", Verdict::kImplausible)
      .finalize();
  py::native_enum<Reason>(m, "Reason", "enum.IntEnum", "Why a message was not fused.")
      .value("NONE", Reason::kNone)
      .value("UNLIKELY", Reason::kUnlikely)
      .value("SOURCE_EXCLUDED", Reason::kSourceExcluded)
      .value("AMBIGUOUS", Reason::kAmbiguous)
      .value("BEYOND_LIMITS", Reason::kBeyondLimits)
      .value("FROZEN", Reason::kFrozen)
      .value("JUMPED", Reason::kJumped)
      .value("BEFORE_ESTIMATE", Reason::kBeforeEstimate)
      .value("TOO_LATE", Reason::kTooLate)
      .value("TOO_FAR_AHEAD", Reason::kTooFarAhead)
      .value("SWITCHED_OFF", Reason::kSwitchedOff)
      .value("NOT_STARTED", Reason::kNotStarted)
      .value("WAITS", Reason::kWaits)
      .value("NOT_USED", Reason::kNotUsed)
      .value("UNKNOWN_ANCHOR", Reason::kUnknownAnchor)
      .value("UNKNOWN_TAG", Reason::kUnknownTag)
      .value("UNKNOWN_LANDMARK", Reason::kUnknownLandmark)
      .value("UNNAMED", Reason::kUnnamed)
      .value("NO_DIRECTION", Reason::kNoDirection)
      .value("NO_SIGMA", Reason::kNoSigma)
      .value("NO_DURATION", Reason::kNoDuration)
      .value("INCOMPLETE", Reason::kIncomplete)
      .value("MAP_FULL", Reason::kMapFull)
      .value("NO_NEWS", Reason::kNoNews)
      .value("NO_RETURNS", Reason::kNoReturns)
      .value("COVERED", Reason::kCovered)
      .value("NUMERICAL", Reason::kNumerical)
      .value("REPLACED", Reason::kReplaced)
      .value("WATCHED", Reason::kWatched)
      .finalize();
  py::class_<Outcome>(m, "Outcome", "Verdict on one message with its innovation statistics.")
      .def_readonly("verdict", &Outcome::verdict)
      .def_readonly("reason", &Outcome::reason, "Why it was not fused; NONE if it was.")
      .def_readonly("nis", &Outcome::nis,
                    "Normalized innovation squared r' S^-1 r; NaN if the message was not compared.")
      .def_readonly("dof", &Outcome::dof, "Rows of the innovation.")
      .def_readonly("residual", &Outcome::residual, "First row of the innovation.")
      .def_readonly("limit", &Outcome::limit, "Largest `nis` that the gate passes.")
      .def_property_readonly("log_likelihood", &Outcome::log_likelihood, "log N(r; 0, S).")
      .def_readonly("interventions", &Outcome::interventions,
                    "Number of variances clamped to their bounds.")
      .def("__repr__", [](const Outcome& outcome) {
        return "Outcome(" + std::string(name_of(outcome.verdict)) +
               ", nis=" + std::to_string(outcome.nis) + ", dof=" + std::to_string(outcome.dof) +
               ")";
      });
  py::class_<Gate>(m, "Gate",
                   "Chi-square gate; `probability` that an inlier passes, 1 for no gate.")
      .def(py::init<double>(), py::arg("probability"))
      .def("limit", &Gate::limit, py::arg("dof"), "Largest NIS that passes.")
      .def_property_readonly("probability", &Gate::probability);
  py::class_<NoiseShape>(m, "NoiseShape",
                         R"(Measurement noise as a mixture of Gaussians wider than R.

Parameters
----------
kind : NoiseKind
dof : float, optional
    Degrees of freedom of STUDENT_T, at least 1.
late_share : float, optional
    Fraction of measurements that read long under ONE_SIDED; between 0 and 1.

Raises
------
ValueError
    If a number is out of its range.
)")
      .def(py::init([](NoiseKind kind, double dof, double late_share) {
             return NoiseShape({kind, dof, late_share});
           }),
           py::arg("kind"), py::arg("dof") = 4.0, py::arg("late_share") = 0.05)
      .def_property_readonly("is_gaussian", &NoiseShape::is_gaussian)
      .def_property_readonly(
          "parts",
          [](const NoiseShape& shape) {
            Eigen::MatrixXd rows(shape.end() - shape.begin(), 3);
            for (Eigen::Index k = 0; k < rows.rows(); ++k) {
              const NoiseShape::Part& part = shape.begin()[k];
              rows.row(k) << std::exp(part.log_share), part.mean, part.variance;
            }
            if (rows.rows() > 0) {
              rows.col(0) /= rows.col(0).sum();
            }
            return rows;
          },
          "Weight, mean and variance of each component for R = 1, (n, 3); empty if Gaussian.");
  py::native_enum<SlotKind>(m, "SlotKind", "enum.Enum", "Type of variable in a slot.")
      .value("POSE2", SlotKind::kPose2)
      .value("POINT2", SlotKind::kPoint2)
      .value("POINT3", SlotKind::kPoint3)
      .value("SCALAR", SlotKind::kScalar)
      .finalize();
  py::class_<Slot>(m, "Slot", "Handle of a variable in a belief.").def_readonly("id", &Slot::id);
  py::class_<GaussianBelief>(m, "GaussianBelief", R"(Gaussian over named slots at one stamp.

Examples
--------
>>> import numpy as np
>>> from locfuse import GaussianBelief, SlotKind
>>> belief = GaussianBelief()
>>> body = belief.add("body", SlotKind.POSE2, [0, 0, 0], np.eye(3))
>>> lamp = belief.add("lamp", SlotKind.POINT2, [4, 3], np.eye(2))
>>> belief.dimension
5
)")
      .def(py::init<>())
      .def_readwrite("stamp", &GaussianBelief::stamp, "Nanoseconds.")
      .def_property_readonly(
          "x", [](const GaussianBelief& b) { return b.x; }, "Mean, (n,).")
      .def_property_readonly(
          "P", [](const GaussianBelief& b) { return Eigen::MatrixXd(b.P); }, "Covariance, (n, n).")
      .def_property_readonly("dimension", &GaussianBelief::dimension)
      .def("add", &GaussianBelief::add, py::arg("name"), py::arg("kind"), py::arg("mean"),
           py::arg("covariance"))
      .def("remove", &GaussianBelief::remove, py::arg("slot"))
      .def("consider", &GaussianBelief::consider, py::arg("slot"),
           "Marks a variable as considered: its uncertainty is accounted for, but measurements no "
           "longer change it (Schmidt-Kalman filter).")
      .def("slot", &GaussianBelief::slot, py::arg("name"))
      .def("pose", &GaussianBelief::pose, py::arg("slot"))
      .def(
          "mean",
          [](const GaussianBelief& b, const std::vector<Slot>& slots) { return b.mean(slots); },
          py::arg("slots"))
      .def(
          "marginal",
          [](const GaussianBelief& b, const std::vector<Slot>& slots) { return b.marginal(slots); },
          py::arg("slots"))
      .def("__repr__", [](const GaussianBelief& b) {
        return "GaussianBelief(stamp=" + std::to_string(b.stamp) + ", " +
               std::to_string(b.dimension()) + " states)";
      });
  m.def(
      "predict",
      [](GaussianBelief& belief, const locfuse::Propagation<locfuse::Pose2, 3>& step, Slot slot) {
        locfuse::predict(belief, step, slot);
      },
      py::arg("belief"), py::arg("step"), py::arg("slot"),
      "Predicts the pose in `slot`: P becomes F P F' + Q, cross-covariances included.");
  m.def(
      "predict",
      [](GaussianBelief& belief, const locfuse::Propagation<Eigen::VectorXd, Eigen::Dynamic>& step,
         const std::vector<Slot>& slots) { locfuse::predict(belief, step, slots); },
      py::arg("belief"), py::arg("step"), py::arg("slots"),
      R"(Predicts the leading variables of `slots` with a user-defined motion.

The motion may depend on all of them; P becomes F P F' + Q, cross-covariances included.

Raises
------
ValueError
    If the slots do not match the step.
NumericalError
    If a result is not finite or a variance not positive; the belief is unchanged.
)");
  m.def(
      "update",
      [](GaussianBelief& belief, const AnyLinearization& lin, const std::vector<Slot>& slots,
         const Gate& gate,
         const NoiseShape& noise) { return locfuse::update(belief, lin, slots, gate, noise); },
      py::arg("belief"), py::arg("linearization"), py::arg("slots"), py::arg("gate"),
      py::arg_v("noise", NoiseShape(), "NoiseShape(NoiseKind.GAUSSIAN)"),
      R"(Fuses a measurement into the belief, or gates it.

Parameters
----------
belief : GaussianBelief
    Updated completely or not at all.
linearization : Linearization
    From a model of the library or user-defined.
slots : list of Slot
    Variables of the Jacobian's columns, in order.
gate : Gate
noise : NoiseShape, optional
    Gaussian by default.

Raises
------
ValueError
    If the slots do not match the Jacobian, or one-sided noise has several rows.
NumericalError
    If the innovation covariance is not positive definite or a result not finite.
)");
}
