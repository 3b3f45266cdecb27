// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>

#include "bindings.hpp"
#include "locfuse/math/symmetric.hpp"
#include "locfuse/models/measurement/heading.hpp"
#include "locfuse/models/measurement/pose.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/ackermann.hpp"
#include "locfuse/models/motion/odometry.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::AckermannVehicle;
using locfuse::AnchorMap;
using locfuse::HeadingModel;
using locfuse::OdometryMotion;
using locfuse::Pose2;
using locfuse::PoseModel;
using locfuse::PositionModel;
using locfuse::RangeBearingModel;
using locfuse::RangeModel;
using locfuse::Tag;
using BodyStep = locfuse::Propagation<Eigen::VectorXd, Eigen::Dynamic>;
using Step = locfuse::Propagation<Pose2, 3>;

namespace {

/// Forward speed and turn rate (n, 2) for readings (n,).
py::array_t<double> velocities(const AckermannVehicle& vehicle, const Column<double>& wheel_speed,
                               const Column<double>& steering) {
  const py::ssize_t n = wheel_speed.ndim() == 1 ? wheel_speed.shape(0) : 0;
  expect_shape("wheel_speed", wheel_speed, n);
  expect_shape("steering", steering, n);
  const double* const speeds = wheel_speed.data();
  const double* const angles = steering.data();
  std::vector<double> found(2 * static_cast<std::size_t>(n));
  {
    const py::gil_scoped_release unlocked;
    for (std::size_t i = 0; i < found.size() / 2; ++i) {
      const locfuse::Velocity u = vehicle.velocity(0, speeds[i], angles[i]);
      found[2 * i] = u.forward;
      found[2 * i + 1] = u.turn_rate;
    }
  }
  return to_numpy(std::move(found), {n, 2});
}

/// Whether a finite matrix is symmetric and, up to rounding, positive semidefinite: positive
/// definite with each variance enlarged by 1e-9, and without covariance where the variance is zero.
bool is_noise(Eigen::MatrixXd Q) {
  if (!locfuse::is_symmetric(Q)) {
    return false;
  }
  for (Eigen::Index i = 0; i < Q.rows(); ++i) {
    if (Q(i, i) == 0.0 && !Q.row(i).isZero(0.0)) {
      return false;
    }
    Q(i, i) = Q(i, i) == 0.0 ? 1.0 : (1.0 + 1e-9) * Q(i, i);
  }
  return Q.llt().info() == Eigen::Success;
}

void bind_body_step(py::module_& m) {
  py::class_<BodyStep>(m, "BodyPropagation",
                       R"(One prediction step of several variables by a motion model.

Parameters
----------
moved : float64 array, shape (n,)
    f(x) of the predicted variables.
jacobian : float64 array, shape (n, m)
    d f / d(all m variables that f depends on), the predicted ones first.
noise : float64 array, shape (n, n)
    Q of this step, symmetric positive semidefinite.

Raises
------
ValueError
    If the shapes do not fit, a number is not finite or the noise not symmetric positive
    semidefinite.

Examples
--------
>>> import numpy as np
>>> import locfuse.core as lf
>>> belief = lf.GaussianBelief()
>>> rate = belief.add("rate", lf.SlotKind.SCALAR, [1.0], [[0.04]])
>>> lf.predict(belief, lf.BodyPropagation([0.5], [[0.5]], [[0.03]]), [rate])
>>> belief.x.tolist(), belief.P.round(9).tolist()
([0.5], [[0.04]])
)")
      .def(py::init([](const Eigen::VectorXd& moved, const Eigen::MatrixXd& jacobian,
                       const Eigen::MatrixXd& noise) {
             const Eigen::Index n = moved.size();
             if (n == 0 || jacobian.rows() != n || jacobian.cols() < n || noise.rows() != n ||
                 noise.cols() != n) {
               throw std::invalid_argument(
                   "BodyPropagation of " + std::to_string(n) + " variables has a jacobian of " +
                   std::to_string(jacobian.rows()) + " x " + std::to_string(jacobian.cols()) +
                   " and noise of " + std::to_string(noise.rows()) + " x " +
                   std::to_string(noise.cols()) + ", expected n x m with m >= n >= 1, and n x n");
             }
             if (!moved.allFinite() || !jacobian.allFinite() || !noise.allFinite()) {
               throw std::invalid_argument("BodyPropagation holds a number that is not finite");
             }
             if (!is_noise(noise)) {
               throw std::invalid_argument(
                   "BodyPropagation.noise is not symmetric positive semidefinite");
             }
             return BodyStep{moved, jacobian, noise};
           }),
           py::arg("moved"), py::arg("jacobian"), py::arg("noise"))
      .def_readonly("moved", &BodyStep::moved, "f(x), shape (n,).")
      .def_readonly("jacobian", &BodyStep::jacobian, "F, shape (n, m).")
      .def_readonly("noise", &BodyStep::noise, "Q of this step, shape (n, n).");
}

void bind_ackermann(py::module_& m) {
  using Config = AckermannVehicle::Config;
  const Config d;
  py::class_<Config>(m, "AckermannConfig",
                     R"(Geometry and noise of a vehicle with steered front wheels.

Parameters
----------
wheel_base_m : float
    Distance from the rear to the front axle.
encoder_left_m : float
    Lateral offset of the rear wheel with the encoder from the middle of the axle, positive to the
    left.
sigma_speed_mps, sigma_steering_rad : float
    Noise of that wheel's speed and of the steering angle.
)")
      .def(py::init([](double wheel_base_m, double encoder_left_m, double sigma_speed_mps,
                       double sigma_steering_rad) {
             return Config{wheel_base_m, encoder_left_m, sigma_speed_mps, sigma_steering_rad};
           }),
           py::kw_only(), py::arg("wheel_base_m"), py::arg("encoder_left_m") = d.encoder_left_m,
           py::arg("sigma_speed_mps") = d.sigma_speed_mps,
           py::arg("sigma_steering_rad") = d.sigma_steering_rad)
      .def_readonly("wheel_base_m", &Config::wheel_base_m)
      .def_readonly("encoder_left_m", &Config::encoder_left_m)
      .def_readonly("sigma_speed_mps", &Config::sigma_speed_mps)
      .def_readonly("sigma_steering_rad", &Config::sigma_steering_rad);
  py::class_<AckermannVehicle>(
      m, "AckermannVehicle",
      R"(Body velocity of an Ackermann vehicle from wheel speed and steering angle.

The body origin is the middle of the rear axle; docs/models/motion.md. The steering angle [rad]
is that of a virtual wheel in the middle of the front axle, positive to the left; the wheel speed
[m/s] is negative backwards. Every method raises ValueError for a value that is not finite and where
the speed is not observable: steering angles of 90 degrees and more, or a turning centre that does
not lie beyond the wheel.

Raises
------
ValueError
    If the wheel base is not positive, a sigma is negative, or a value is not finite.

Examples
--------
>>> import math
>>> from locfuse.core import AckermannConfig, AckermannVehicle
>>> vehicle = AckermannVehicle(AckermannConfig(wheel_base_m=2.0, encoder_left_m=1.0))
>>> u = vehicle.velocity(0, wheel_speed=1.5, steering=math.atan(0.5))
>>> round(u.forward, 9), round(u.turn_rate, 9)
(2.0, 0.5)
)")
      .def(py::init<const Config&>(), py::arg("config"))
      .def_property_readonly("config", &AckermannVehicle::config)
      .def("velocity", &AckermannVehicle::velocity, py::arg("stamp"), py::arg("wheel_speed"),
           py::arg("steering"), "A Velocity at `stamp` [ns].")
      .def("velocities", &velocities, py::arg("wheel_speed"), py::arg("steering"),
           "Forward speed [m/s] and turn rate [rad/s], shape (n, 2), of readings of shape (n,).")
      .def(
          "jacobian", &AckermannVehicle::jacobian, py::arg("wheel_speed"), py::arg("steering"),
          "Jacobian of (forward, turn rate) with respect to (wheel speed, steering), shape (2, 2).")
      .def("covariance", &AckermannVehicle::covariance, py::arg("wheel_speed"), py::arg("steering"),
           "Covariance of (forward, turn rate) from the sigmas, shape (2, 2).");
}

}  // namespace

void bind_models(py::module_& m) {
  bind_ackermann(m);
  py::class_<Tag>(m, "Tag",
                  "Radio on the robot at `position` (3,) in the body frame: forward, left, up [m].")
      .def(py::init([](locfuse::Id id, const locfuse::Vector<3>& position) {
             return Tag{id, position};
           }),
           py::arg("id"), py::arg("position"))
      .def_readonly("id", &Tag::id)
      .def_readonly("position", &Tag::position)
      .def("__repr__", [](const Tag& t) { return "Tag(id=" + std::to_string(t.id) + ")"; });
  py::class_<Step>(m, "Propagation", "One prediction step of a pose by a motion model.")
      .def_readonly("moved", &Step::moved, "f(x, u).")
      .def_readonly("jacobian", &Step::jacobian, "F, shape (3, 3).")
      .def_readonly("noise", &Step::noise, "Q of this step, shape (3, 3).");
  bind_body_step(m);

  using OdometryConfig = OdometryMotion::Config;
  py::class_<OdometryConfig>(m, "OdometryConfig",
                             "Noise of wheel odometry: a random walk over distance and turn.")
      .def(py::init<>())
      .def_readwrite("sigma_longitudinal_per_sqrt_m",
                     &OdometryConfig::sigma_longitudinal_per_sqrt_m, "m / sqrt(m)")
      .def_readwrite("sigma_lateral_per_sqrt_m", &OdometryConfig::sigma_lateral_per_sqrt_m,
                     "m / sqrt(m)")
      .def_readwrite("sigma_heading_per_sqrt_m", &OdometryConfig::sigma_heading_per_sqrt_m,
                     "rad / sqrt(m)")
      .def_readwrite("sigma_heading_per_sqrt_rad", &OdometryConfig::sigma_heading_per_sqrt_rad,
                     "rad / sqrt(rad)")
      .def_readwrite("sigma_xy_per_sqrt_s", &OdometryConfig::sigma_xy_per_sqrt_s, "m / sqrt(s)")
      .def_readwrite("sigma_heading_per_sqrt_s", &OdometryConfig::sigma_heading_per_sqrt_s,
                     "rad / sqrt(s)")
      .def_readwrite("sigma_longitudinal_per_sqrt_s",
                     &OdometryConfig::sigma_longitudinal_per_sqrt_s, "m / sqrt(s)");
  py::class_<OdometryMotion>(m, "OdometryMotion", "Wheel odometry; docs/models/motion.md.")
      .def(py::init<const OdometryConfig&>(), py::arg("config"))
      .def("propagate",
           py::overload_cast<const Pose2&, const Pose2&, double,
                             const std::optional<locfuse::Vector<3>>&>(&OdometryMotion::propagate,
                                                                       py::const_),
           py::arg("T_world_body"), py::arg("motion"), py::arg("seconds"),
           py::arg("variance") = py::none(),
           "Pose after `motion` (a Pose2 in the previous body frame), which took `seconds`. "
           "`variance` of its dx, dy and dheading replaces that of the model.");

  using RangeConfig = RangeModel::Config;
  py::class_<RangeConfig>(
      m, "RangeConfig",
      "Noise of ranges without a sigma: R = sigma_m^2 + (sigma_relative * distance)^2.")
      .def(py::init<>())
      .def_readwrite("sigma_m", &RangeConfig::sigma_m, "m")
      .def_readwrite("sigma_relative", &RangeConfig::sigma_relative, "fraction of the distance")
      .def_readwrite("gate", &RangeConfig::gate,
                     "Probability that a good range passes its gate; 1: no gate.")
      .def_readwrite("noise", &RangeConfig::noise, "Distribution of the noise of ranges.");
  py::class_<RangeModel>(
      m, "RangeModel",
      "Range from a body-fixed tag to an anchor, both in 3D; docs/models/ranges.md.")
      .def(py::init<const RangeConfig&, std::shared_ptr<AnchorMap>, std::vector<Tag>>(),
           py::arg("config"), py::arg("anchors"), py::arg("tags"))
      .def("predict",
           py::overload_cast<const Pose2&, const locfuse::Range&>(&RangeModel::predict, py::const_),
           py::arg("T_world_body"), py::arg("z"),
           "Expected range [m]; None if anchor or tag is unknown.")
      .def("predict",
           py::overload_cast<const Pose2&, double, const locfuse::Range&>(&RangeModel::predict,
                                                                          py::const_),
           py::arg("T_world_body"), py::arg("height"), py::arg("z"),
           "Expected range [m] with the body at `height` [m] above z = 0; None if anchor or tag is "
           "unknown.")
      .def(
          "linearize",
          [](const RangeModel& model, const Pose2& pose,
             const locfuse::Range& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(pose, z);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("T_world_body"), py::arg("z"),
          "Linearization (1 x 3); None if anchor or tag is unknown or their positions coincide.")
      .def(
          "linearize",
          [](const RangeModel& model, const Pose2& pose, double height,
             const locfuse::Range& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(pose, height, z);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("T_world_body"), py::arg("height"), py::arg("z"),
          "Linearization (1 x 4), the last column that of the height [m].")
      .def(
          "linearize_point",
          [](const RangeModel& model, const locfuse::Vector<2>& tag_in_world,
             const locfuse::Range& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize_point(tag_in_world, z);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("tag_in_world"), py::arg("z"),
          "Linearization (1 x 2) with respect to the position of the tag (2,) in world.");

  using RangeBearingConfig = RangeBearingModel::Config;
  using RangeBearingInSpace = RangeBearingModel::InSpace;
  py::class_<RangeBearingConfig>(m, "RangeBearingConfig",
                                 "Noise of landmark observations without a covariance.")
      .def(py::init<>())
      .def_readwrite("sigma_range_m", &RangeBearingConfig::sigma_range_m, "m")
      .def_readwrite("sigma_bearing_rad", &RangeBearingConfig::sigma_bearing_rad, "rad")
      .def_readwrite("sigma_range_relative", &RangeBearingConfig::sigma_range_relative,
                     "fraction of the range, in addition to sigma_range_m")
      .def_readwrite("gate", &RangeBearingConfig::gate,
                     "Probability that a good observation passes its gate; 1: no gate.");
  py::class_<RangeBearingInSpace>(m, "RangeBearingInSpace",
                                  "Additional settings of range and bearing on a flying body.")
      .def(py::init<>())
      .def_readwrite("sensor_up_m", &RangeBearingInSpace::sensor_up_m,
                     "Height of the sensor above the body's origin [m].")
      .def_readwrite("sigma_elevation_rad", &RangeBearingInSpace::sigma_elevation_rad,
                     "Sigma of an elevation without its own [rad].");
  py::class_<RangeBearingModel>(m, "RangeBearingModel",
                                "Range and bearing from a sensor on the body to a landmark at (2,) "
                                "in world; docs/models/landmarks.md.")
      .def(py::init<const RangeBearingConfig&, const Pose2&>(), py::arg("config"),
           py::arg("T_body_sensor") = Pose2{})
      .def(py::init<const RangeBearingConfig&, const Pose2&, const RangeBearingInSpace&>(),
           py::arg("config"), py::arg("T_body_sensor"), py::arg("in_space"))
      .def("predict",
           py::overload_cast<const Pose2&, const locfuse::Vector<2>&>(&RangeBearingModel::predict,
                                                                      py::const_),
           py::arg("T_world_body"), py::arg("landmark"),
           "Expected range [m] and bearing [rad], (2,).")
      .def("predict",
           py::overload_cast<const Pose2&, double, const locfuse::Vector<3>&>(
               &RangeBearingModel::predict, py::const_),
           py::arg("T_world_body"), py::arg("height"), py::arg("landmark"),
           "Expected range [m], bearing and elevation [rad], (3,), of a landmark at (3,) from a "
           "height of the body over z = 0 [m].")
      .def(
          "linearize",
          [](const RangeBearingModel& model, const Pose2& pose, double height,
             const locfuse::Vector<3>& landmark,
             const locfuse::RangeBearing& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(pose, height, landmark, z);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("T_world_body"), py::arg("height"), py::arg("landmark"), py::arg("z"),
          "Linearization (1 to 3 x 4), the last column that of the height; None if the landmark is "
          "straight above or below the sensor.")
      .def(
          "linearize",
          [](const RangeBearingModel& model, const Pose2& pose, const locfuse::Vector<2>& landmark,
             const locfuse::RangeBearing& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(pose, landmark, z);
            return lin ? std::optional(AnyLinearization{lin->residual, lin->jacobian, lin->noise})
                       : std::nullopt;
          },
          py::arg("T_world_body"), py::arg("landmark"), py::arg("z"),
          "Linearization (1 or 2 x 3); None if landmark and sensor coincide.");

  using PositionConfig = PositionModel::Config;
  py::class_<PositionConfig>(m, "PositionConfig",
                             "Lever arm of the antenna and noise of position fixes.")
      .def(py::init<>())
      .def_readwrite("antenna_forward_m", &PositionConfig::antenna_forward_m)
      .def_readwrite("antenna_left_m", &PositionConfig::antenna_left_m)
      .def_readwrite("sigma_m", &PositionConfig::sigma_m,
                     "Sigma of a fix without a covariance; 0: not modelled.")
      .def_readwrite("least_sigma_m", &PositionConfig::least_sigma_m, "Minimum sigma of any fix.")
      .def_readwrite("gate", &PositionConfig::gate,
                     "Probability that a good fix passes its gate; 1: no gate.")
      .def_readwrite("noise", &PositionConfig::noise, "Distribution of the noise of fixes.");
  py::class_<PositionModel>(
      m, "PositionModel",
      "Position of an antenna on the body, or of one of its tags; docs/models/poses.md.")
      .def(py::init<const PositionConfig&, std::vector<locfuse::Tag>>(), py::arg("config"),
           py::arg("tags") = std::vector<locfuse::Tag>{})
      .def("predict", py::overload_cast<const Pose2&>(&PositionModel::predict, py::const_),
           py::arg("T_world_body"), "Position of the antenna (2,) in world [m].")
      .def("predict",
           py::overload_cast<const Pose2&, locfuse::Id>(&PositionModel::predict, py::const_),
           py::arg("T_world_body"), py::arg("tag"),
           "Position of a tag (2,) in world [m]; None if the tag is unknown.")
      .def(
          "linearize",
          [](const PositionModel& model, const Pose2& pose,
             const locfuse::PositionFix& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(pose, z);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("T_world_body"), py::arg("z"),
          "Linearization (2 x 3, or 1 x 3 where an axis is not measured); None if the tag is "
          "unknown or nothing is measured.")
      .def(
          "linearize_point",
          [](const PositionModel& model, const locfuse::Vector<2>& point,
             const locfuse::PositionFix& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize_point(point, z);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("point"), py::arg("z"),
          "Linearization (2 x 2) with respect to the point (2,) in world.");
  using PoseConfig = PoseModel::Config;
  py::class_<PoseConfig>(
      m, "PoseConfig",
      "Sigmas of poses without a covariance (0: not modelled) and minimum sigmas of any pose.")
      .def(py::init<>())
      .def_readwrite("sigma_m", &PoseConfig::sigma_m)
      .def_readwrite("sigma_heading_rad", &PoseConfig::sigma_heading_rad)
      .def_readwrite("least_sigma_m", &PoseConfig::least_sigma_m)
      .def_readwrite("least_sigma_heading_rad", &PoseConfig::least_sigma_heading_rad)
      .def_readwrite("shares_odometry", &PoseConfig::shares_odometry)
      .def_readwrite("gate", &PoseConfig::gate,
                     "Probability that a good pose passes its gate; 1: no gate.")
      .def_readwrite("noise", &PoseConfig::noise, "Distribution of the noise of poses.");
  py::class_<PoseModel>(m, "PoseModel", "Pose from another localizer; docs/models/poses.md.")
      .def(py::init<>())
      .def(py::init<const PoseConfig&>(), py::arg("config"))
      .def("predict", &PoseModel::predict, py::arg("T_world_body"))
      .def(
          "linearize",
          [](const PoseModel& model, const Pose2& pose,
             const locfuse::PoseObservation& z) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(pose, z);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("T_world_body"), py::arg("z"),
          "Linearization (3 x 3, fewer rows if an axis is not measured); None if none is.");
  using HeadingConfig = HeadingModel::Config;
  py::class_<HeadingConfig>(m, "HeadingConfig", "Noise and mounting of what measures headings.")
      .def(py::init<>())
      .def_readwrite("offset_rad", &HeadingConfig::offset_rad,
                     "What it reads more than the heading [rad]: its mount, the declination.")
      .def_readwrite("sigma_rad", &HeadingConfig::sigma_rad,
                     "Sigma of a heading without a sigma of its own [rad].")
      .def_readwrite("least_sigma_rad", &HeadingConfig::least_sigma_rad,
                     "Minimum sigma of a heading [rad].")
      .def_readwrite("min_speed_mps", &HeadingConfig::min_speed_mps,
                     "Minimum speed of the antenna at which a course is fused [m/s].")
      .def_readwrite("antenna_forward_m", &HeadingConfig::antenna_forward_m,
                     "Place of the antenna of courses in body [m].")
      .def_readwrite("antenna_left_m", &HeadingConfig::antenna_left_m)
      .def_readwrite("gate", &HeadingConfig::gate,
                     "Probability that a good heading passes its gate; 1: no gate.");
  py::class_<HeadingModel>(m, "HeadingModel",
                           "Heading of the body or course of its antenna; docs/models/poses.md.")
      .def(py::init<>())
      .def(py::init<const HeadingConfig&>(), py::arg("config"))
      .def("direction", &HeadingModel::direction, py::arg("rate"),
           "Direction [rad] in which the antenna travels in body, for a body that moves at `rate` "
           "(Pose2: m/s, m/s, rad/s); None below the minimum speed.")
      .def(
          "linearize",
          [](const HeadingModel& model, const Pose2& pose, const locfuse::Heading& z,
             const Pose2& rate) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(pose, z, rate);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("T_world_body"), py::arg("z"), py::arg_v("rate", Pose2{}, "Pose2()"),
          "Linearization (1 x 3); None of a course below the minimum speed.");
}
