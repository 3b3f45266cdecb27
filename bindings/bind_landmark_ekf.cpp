// SPDX-License-Identifier: Apache-2.0
#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/estimators/landmark_ekf.hpp"

namespace py = pybind11;
using locfuse::KnownLandmark;
using locfuse::LandmarkEkf;
using locfuse::LandmarkEstimate;

void bind_landmark_ekf(py::module_& m) {
  using Covariance2 = locfuse::Matrix<2, 2>;
  using Config = LandmarkEkf::Config;
  py::class_<KnownLandmark>(m, "KnownLandmark",
                            "Landmark known to a LandmarkEkf before the first message. Without a "
                            "covariance (2, 2) [m^2] its position (2,) [m] is exact.")
      .def(py::init([](locfuse::Id id, const locfuse::Vector<2>& position,
                       const std::optional<Covariance2>& covariance) {
             return KnownLandmark{id, position, covariance};
           }),
           py::arg("id"), py::arg("position"), py::arg("covariance") = py::none())
      .def_readonly("id", &KnownLandmark::id)
      .def_readonly("position", &KnownLandmark::position, "Shape (2,), in world [m].")
      .def_readonly("covariance", &KnownLandmark::covariance, "Shape (2, 2) [m^2], or None.")
      .def("__repr__", [](const KnownLandmark& landmark) {
        return "KnownLandmark(" + std::to_string(landmark.id) + ")";
      });
  py::class_<LandmarkEstimate>(m, "LandmarkEstimate", "Estimate of one landmark by a LandmarkEkf.")
      .def_readonly("id", &LandmarkEstimate::id, "Negative if no observation carried an id.")
      .def_readonly("position", &LandmarkEstimate::position, "Shape (2,), in world [m].")
      .def_readonly("covariance", &LandmarkEstimate::covariance,
                    "Shape (2, 2) [m^2]; zero if exact.")
      .def_readonly("sightings", &LandmarkEstimate::sightings)
      .def_readonly("confirmed", &LandmarkEstimate::confirmed,
                    "Whether it is used to update the pose.")
      .def("__repr__", [](const LandmarkEstimate& landmark) {
        return "LandmarkEstimate(" + std::to_string(landmark.id) + ", " +
               std::to_string(landmark.sightings) + " sightings)";
      });
  py::class_<Config>(m, "LandmarkEkfConfig", "Noise, gates and behaviour of a LandmarkEkf.")
      .def(py::init<>())
      .def_readwrite("odometry", &Config::odometry)
      .def_readwrite("landmark", &Config::landmark)
      .def_readwrite("position", &Config::position)
      .def_readwrite("limits", &Config::limits)
      .def_readwrite("gate_new", &Config::gate_new,
                     "An observation outside this wider gate of every landmark starts a new one.")
      .def_readwrite("min_sightings", &Config::min_sightings,
                     "Number of observations that confirms a tentative landmark.")
      .def_readwrite("confirm_within_s", &Config::confirm_within_s,
                     "A tentative landmark is dropped this long after its first observation [s].")
      .def_readwrite("max_landmarks", &Config::max_landmarks)
      .def_readwrite("correlation_s", &Config::correlation_s, "As of PoseEkfConfig.")
      .def_readwrite("hold_s", &Config::hold_s,
                     "Timeout of odometry [s]: how long the last motion is extrapolated.")
      .def_readwrite("sigma_lost_xy_per_sqrt_s", &Config::sigma_lost_xy_per_sqrt_s)
      .def_readwrite("sigma_lost_heading_per_sqrt_s", &Config::sigma_lost_heading_per_sqrt_s)
      .def_readwrite("known", &Config::known, "List of KnownLandmark that it begins with.");
  py::class_<LandmarkEkf>(m, "LandmarkEkf",
                          R"(Extended Kalman filter over the pose and the observed landmarks (SLAM).

An observation that matches no landmark adds a new one to the state.

Parameters
----------
config : LandmarkEkfConfig
world : World
    Of which it takes where the landmark sensor sits.
start : PoseEstimate

Raises
------
ValueError
    If the config is out of range, the start is not finite or not positive definite, or a landmark
    id is duplicate.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> start = PoseEstimate(0, Pose2(0, 0, 0), np.diag([0.01, 0.01, 0.01]) ** 2)
>>> ekf = LandmarkEkf(LandmarkEkfConfig(), World(), start)
>>> ekf.on(RangeBearing(0, landmark=7, range=2.0, bearing=0.0)).verdict.name
'FUSED'
>>> tree = ekf.landmarks()[0]
>>> tree.id, tree.position.round(3).tolist()
(7, [2.0, 0.0])
)")
      .def(py::init<const Config&, const locfuse::World&, const locfuse::PoseEstimate&>(),
           py::arg("config"), py::arg("world"), py::arg("start"))
      .def("on", on_message<LandmarkEkf>(), py::arg("message"),
           "Fuses one message; a message that is not fused leaves the estimator unchanged.")
      .def("on_joint", &LandmarkEkf::on_joint, py::arg("sightings"),
           py::arg_v("association", locfuse::Association::kJoint, "Association.JOINT"),
           "Fuses landmark observations of one stamp. One that matches no landmark starts a new "
           "one, or is gated if that is uncertain. Returns one Outcome each, NOT_MODELLED if the "
           "result would not be finite.")
      .def("advance_to", &LandmarkEkf::advance_to, py::arg("stamp"))
      .def("current", &LandmarkEkf::current, "PoseEstimate at the stamp of the belief.")
      .def("estimate", py::overload_cast<>(&LandmarkEkf::estimate, py::const_),
           "PoseEstimate propagated to the end of the latest odometry.")
      .def("estimate", py::overload_cast<locfuse::Stamp>(&LandmarkEkf::estimate, py::const_),
           py::arg("stamp"),
           "PoseEstimate propagated to `stamp` [ns], which must not precede the belief.")
      .def("landmarks", &LandmarkEkf::landmarks, "All landmarks, in the order of their creation.")
      .def_property_readonly("belief", &LandmarkEkf::belief, py::return_value_policy::copy)
      .def_property_readonly("interventions", &LandmarkEkf::interventions,
                             "Number of times a variance was clamped to its bounds.")
      .def(
          "__copy__", [](const LandmarkEkf& ekf) { return ekf; }, "Independent copy.")
      .def(
          "__deepcopy__", [](const LandmarkEkf& ekf, const py::object& /*memo*/) { return ekf; },
          py::arg("memo"), "Independent copy.")
      .def("__repr__", [](const LandmarkEkf& ekf) {
        return "LandmarkEkf(at " + std::to_string(ekf.belief().stamp) + " ns, " +
               std::to_string(ekf.landmarks().size()) + " landmarks)";
      });
}
