// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/estimators/air_ekf.hpp"

namespace py = pybind11;
using locfuse::AirEkf;
using locfuse::AirEstimate;
using locfuse::AirMotion;
using locfuse::AltitudeModel;
using locfuse::ConstantVelocityMotion;

namespace {

void bind_air_models(py::module_& m) {
  using AltitudeConfig = AltitudeModel::Config;
  py::class_<AltitudeConfig>(m, "AltitudeConfig", "Noise and mounting of the altimeter.")
      .def(py::init<>())
      .def_readwrite("sigma_m", &AltitudeConfig::sigma_m,
                     "Sigma of an altitude without a sigma of its own [m].")
      .def_readwrite("altimeter_up_m", &AltitudeConfig::altimeter_up_m,
                     "Height of the altimeter above the body's origin [m].")
      .def_readwrite("gate", &AltitudeConfig::gate,
                     "Probability that a good altitude passes its gate; 1: no gate.");
  py::class_<AltitudeModel>(m, "AltitudeModel", "Altimeter height; docs/air.md.")
      .def(py::init<const AltitudeConfig&>(), py::arg("config"))
      .def("predict", &AltitudeModel::predict, py::arg("height"))
      .def(
          "linearize",
          [](const AltitudeModel& model, double height, const locfuse::Altitude& z) {
            return any_size(model.linearize(height, z));
          },
          py::arg("height"), py::arg("z"), "Linearization (1 x 1).");

  using VelocityConfig = ConstantVelocityMotion::Config;
  py::class_<VelocityConfig>(m, "ConstantVelocityConfig",
                             "Square roots of the spectral densities of white acceleration.")
      .def(py::init<>())
      .def_readwrite("sigma_velocity_per_sqrt_s", &VelocityConfig::sigma_velocity_per_sqrt_s,
                     "m/s / sqrt(s), each axis of the velocity.")
      .def_readwrite("sigma_climb_per_sqrt_s", &VelocityConfig::sigma_climb_per_sqrt_s,
                     "m/s / sqrt(s)")
      .def_readwrite("sigma_heading_per_sqrt_s", &VelocityConfig::sigma_heading_per_sqrt_s,
                     "rad / sqrt(s)");
  py::class_<ConstantVelocityMotion>(
      m, "ConstantVelocityMotion",
      "Constant-velocity motion without odometry; docs/models/motion.md.")
      .def(py::init<const VelocityConfig&>(), py::arg("config"))
      .def("propagate", &ConstantVelocityMotion::propagate, py::arg("state"), py::arg("seconds"),
           "State (7,) `seconds` later: x, y, heading, height, velocity x and y, climb rate.");
}

void bind_inertial(py::module_& m) {
  using Config = locfuse::InertialMotion::Config;
  py::class_<Config>(m, "InertialConfig", "Noise and mount of an inertial sensor; docs/air.md.")
      .def(py::init<>())
      .def_readwrite("sigma_turn_per_sqrt_s", &Config::sigma_turn_per_sqrt_s,
                     "White noise of the gyro [rad / sqrt(s)].")
      .def_readwrite("sigma_velocity_per_sqrt_s", &Config::sigma_velocity_per_sqrt_s,
                     "White noise of the accelerometer [m/s / sqrt(s)].")
      .def_readwrite("sigma_bias_radps", &Config::sigma_bias_radps,
                     "Sigma of the gyro's bias at the start [rad/s].")
      .def_readwrite("sigma_bias_mps2", &Config::sigma_bias_mps2,
                     "Sigma of the accelerometer's bias at the start [m/s^2].")
      .def_readwrite("sigma_bias_radps_per_sqrt_s", &Config::sigma_bias_radps_per_sqrt_s,
                     "Random walk of the gyro's bias [rad/s / sqrt(s)].")
      .def_readwrite("sigma_bias_mps2_per_sqrt_s", &Config::sigma_bias_mps2_per_sqrt_s,
                     "Random walk of the accelerometer's bias [m/s^2 / sqrt(s)].")
      .def_readwrite("sigma_scale", &Config::sigma_scale, "Of the gyro's scale.")
      .def_readwrite("mount", &Config::mount,
                     "Roll, pitch and yaw of the sensor's axes in the body [rad], shape (3,).");
}

void bind_config(py::module_& m) {
  using Config = AirEkf::Config;
  py::native_enum<AirMotion>(m, "AirMotion", "enum.Enum", "Motion model of an AirEkf.")
      .value("ODOMETRY", AirMotion::kOdometry, "Velocity or Increment messages with a climb rate.")
      .value("CONSTANT_VELOCITY", AirMotion::kConstantVelocity, "Constant velocity, no odometry.")
      .value("INERTIAL", AirMotion::kInertial, "Imu messages, over attitude and biases as well.")
      .finalize();
  py::class_<Config>(m, "AirEkfConfig", "Motion, noise, gates and behaviour of an AirEkf.")
      .def(py::init<>())
      .def_readwrite("motion", &Config::motion)
      .def_readwrite("odometry", &Config::odometry)
      .def_readwrite("sigma_height_per_sqrt_s", &Config::sigma_height_per_sqrt_s,
                     "Process noise of the height on top of the climb rate, m / sqrt(s).")
      .def_readwrite("constant_velocity", &Config::constant_velocity)
      .def_readwrite("sigma_start_velocity_mps", &Config::sigma_start_velocity_mps)
      .def_readwrite("sigma_start_climb_mps", &Config::sigma_start_climb_mps)
      .def_readwrite("inertial", &Config::inertial)
      .def_readwrite("range", &Config::range)
      .def_readwrite("position", &Config::position)
      .def_readwrite("pose", &Config::pose)
      .def_readwrite("limits", &Config::limits)
      .def_readwrite("min_height_m", &Config::min_height_m)
      .def_readwrite("max_height_m", &Config::max_height_m)
      .def_readwrite("altitude", &Config::altitude)
      .def_readwrite("landmark", &Config::landmark)
      .def_readwrite("landmark_in_space", &Config::landmark_in_space)
      .def_readwrite("robust_dof", &Config::robust_dof, "Degrees of freedom of STUDENT_T noise.")
      .def_readwrite("robust_late_share", &Config::robust_late_share,
                     "Fraction of ranges that read long under ONE_SIDED noise.")
      .def_readwrite("correlation_s", &Config::correlation_s, "As of PoseEkfConfig.")
      .def_readwrite("hold_s", &Config::hold_s,
                     "Timeout of odometry [s]: how long the last motion is extrapolated.")
      .def_readwrite("sigma_lost_xy_per_sqrt_s", &Config::sigma_lost_xy_per_sqrt_s)
      .def_readwrite("sigma_lost_heading_per_sqrt_s", &Config::sigma_lost_heading_per_sqrt_s)
      .def_readwrite("sigma_lost_height_per_sqrt_s", &Config::sigma_lost_height_per_sqrt_s);
}

}  // namespace

void bind_air_ekf(py::module_& m) {
  bind_air_models(m);
  bind_inertial(m);
  bind_config(m);
  using locfuse::Attitude;
  py::class_<Attitude>(m, "Attitude", "How a body is turned in space.")
      .def_readonly("quaternion", &Attitude::quaternion,
                    "(w, x, y, z) of the rotation from body to world, w >= 0, shape (4,).")
      .def_readonly("covariance", &Attitude::covariance,
                    "Of its error, a rotation about the axes of the world [rad^2], shape (3, 3).");
  py::class_<AirEstimate>(m, "AirEstimate",
                          "Pose and height of a flying body at one stamp [ns], with the covariance "
                          "(4, 4) of (x, y, heading, height).")
      .def(py::init([](locfuse::Stamp stamp, const locfuse::Pose2& pose, double height,
                       const locfuse::Matrix<4, 4>& covariance) {
             return AirEstimate{stamp, pose, height, covariance};
           }),
           py::arg("stamp"), py::arg("pose"), py::arg("height"), py::arg("covariance"))
      .def_readonly("stamp", &AirEstimate::stamp)
      .def_readonly("pose", &AirEstimate::pose)
      .def_readonly("height", &AirEstimate::height, "Above z = 0 of the world frame [m].")
      .def_readonly("covariance", &AirEstimate::covariance, "Shape (4, 4).")
      .def_readonly("attitude", &AirEstimate::attitude,
                    "Attitude of an inertial body; None where it is taken as level.")
      .def("__repr__", [](const AirEstimate& e) {
        return "AirEstimate(stamp=" + std::to_string(e.stamp) + ", pose=(" +
               std::to_string(e.pose.x) + ", " + std::to_string(e.pose.y) + ", " +
               std::to_string(e.pose.heading) + "), height=" + std::to_string(e.height) + ")";
      });
  py::class_<AirEkf>(m, "AirEkf",
                     R"(Extended Kalman filter over (x, y, heading, height) of a flying body.

The motion is odometry with a climb rate, an estimated constant velocity, or what an inertial sensor
measures. With that the attitude is estimated, too; without it the body is taken as level.

Parameters
----------
config : AirEkfConfig
world : World
start : AirEstimate

Raises
------
ValueError
    If the config is out of range or the start not finite and positive definite.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> anchors = AnchorMap([Anchor(1, [0, 0, 2]), Anchor(2, [8, 0, 0]), Anchor(3, [4, 6, 3])])
>>> start = AirEstimate(0, Pose2(3, 2, 0), 1.0, np.diag([0.5, 0.5, 0.1, 0.5]) ** 2)
>>> ekf = AirEkf(AirEkfConfig(), World(anchors, [Tag(0, [0, 0, 0])]), start)
>>> ekf.on(Velocity(0, 0.5, 0.0), climb_rate=0.2).verdict.name
'FUSED'
>>> ekf.on(Range(1_000_000_000, tag=0, anchor=1, range=4.1)).verdict.name
'FUSED'
>>> ekf.on(Altitude(1_000_000_000, height=1.2, sigma=0.1)).verdict.name
'FUSED'
)")
      .def(py::init<const AirEkf::Config&, const locfuse::World&, const AirEstimate&>(),
           py::arg("config"), py::arg("world"), py::arg("start"))
      .def("on", on_message<AirEkf>(), py::arg("message"),
           "Fuses one message; a message that is not fused leaves the estimator unchanged.")
      .def("on", py::overload_cast<const locfuse::Velocity&, double>(&AirEkf::on),
           py::arg("message"), py::arg("climb_rate"))
      .def("on", py::overload_cast<const locfuse::Increment&, double>(&AirEkf::on),
           py::arg("message"), py::arg("climb_rate"),
           "The same with a climb rate [m/s], which applies as long as the odometry message.")
      .def("advance_to", &AirEkf::advance_to, py::arg("stamp"))
      .def("estimate", py::overload_cast<>(&AirEkf::estimate, py::const_),
           "AirEstimate propagated to the end of the latest odometry.")
      .def("estimate", py::overload_cast<locfuse::Stamp>(&AirEkf::estimate, py::const_),
           py::arg("stamp"),
           "AirEstimate propagated to `stamp` [ns], which must not precede the belief.")
      .def_property_readonly("belief", &AirEkf::belief, py::return_value_policy::copy)
      .def("attitude", &AirEkf::attitude,
           "Rotation (3, 3) from body to world at the belief's stamp; of a level body by its "
           "heading.")
      .def_property_readonly("interventions", &AirEkf::interventions,
                             "Number of times a variance was clamped to its bounds.")
      .def(
          "__copy__", [](const AirEkf& ekf) { return ekf; }, "Independent copy.")
      .def(
          "__deepcopy__", [](const AirEkf& ekf, const py::object& /*memo*/) { return ekf; },
          py::arg("memo"), "Independent copy.")
      .def("__repr__", [](const AirEkf& ekf) {
        return "AirEkf(at " + std::to_string(ekf.belief().stamp) + " ns)";
      });
}
