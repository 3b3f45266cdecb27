// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/estimators/tag_triangle_ekf.hpp"
#include "locfuse/frontends/tag_conditioner.hpp"
#include "locfuse/frontends/tag_order.hpp"
#include "locfuse/geometry/rigid_fit.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::Pose2;
using locfuse::PositionFix;
using locfuse::Stamp;
using locfuse::Tag;
using locfuse::Vector;

namespace {

Eigen::MatrixXd covariance_of(const Column<double>& given, py::ssize_t points) {
  const py::ssize_t rows = 2 * points;
  if (given.ndim() == 3) {
    if (given.shape(0) != points || given.shape(1) != 2 || given.shape(2) != 2) {
      throw std::invalid_argument("covariance has shape (" + std::to_string(given.shape(0)) + ", " +
                                  std::to_string(given.shape(1)) + ", " +
                                  std::to_string(given.shape(2)) + "), expected (" +
                                  std::to_string(points) + ", 2, 2)");
    }
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(rows, rows);
    for (py::ssize_t i = 0; i < points; ++i) {
      for (int k = 0; k < 4; ++k) {
        all(2 * i + k / 2, 2 * i + k % 2) = given.data()[4 * i + k];
      }
    }
    return all;
  }
  expect_shape("covariance", given, rows, rows);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(given.data(), rows, rows);
}

locfuse::RigidFit fit(const Column<double>& body, const Column<double>& world,
                      const Column<double>& covariance) {
  const py::ssize_t n = body.ndim() == 2 ? body.shape(0) : 0;
  expect_shape("body", body, n, 2);
  expect_shape("world", world, n, 2);
  using Points = Eigen::Map<const locfuse::Matrix<2, Eigen::Dynamic>>;
  return locfuse::rigid_fit<Eigen::Dynamic>(Points(body.data(), 2, n), Points(world.data(), 2, n),
                                            covariance_of(covariance, n));
}

void bind_rigid_fit(py::module_& m) {
  using locfuse::RigidFit;
  using locfuse::RigidFitStatus;
  py::native_enum<RigidFitStatus>(m, "RigidFitStatus", "enum.Enum", "Result of a rigid fit.")
      .value("FITTED", RigidFitStatus::kFitted)
      .value("MIRRORED", RigidFitStatus::kMirrored,
             "A reflection fits better; `pose` is the rotation that fits best.")
      .value("NO_DIRECTION", RigidFitStatus::kNoDirection,
             "The points in world do not determine a heading: they coincide, or are a reflection.")
      .value("NOT_CONVERGED", RigidFitStatus::kNotConverged)
      .finalize();
  py::class_<RigidFit>(m, "RigidFit", "Pose of a rigid body from measured points.")
      .def_readonly("status", &RigidFit::status)
      .def_readonly("pose", &RigidFit::pose, "T_world_body; NaN if NO_DIRECTION.")
      .def_readonly("covariance", &RigidFit::covariance,
                    "Covariance of (x, y, heading), shape (3, 3).")
      .def_readonly("nis", &RigidFit::nis, "Chi-square of the points against a rigid body.")
      .def_readonly("dof", &RigidFit::dof, "Degrees of freedom of `nis`: 2 n - 3.")
      .def("__repr__", [](const RigidFit& f) {
        return "RigidFit(pose=(" + std::to_string(f.pose.x) + ", " + std::to_string(f.pose.y) +
               ", " + std::to_string(f.pose.heading) + "), nis=" + std::to_string(f.nis) + ")";
      });
  m.def("rigid_fit", &fit, py::arg("body"), py::arg("world"), py::arg("covariance"),
        R"(Pose that maps points of a body to their measured positions.

Least squares weighted with the covariance; docs/models/poses.md.

Parameters
----------
body : array, shape (n, 2)
    Metres, in body; at least two that differ.
world : array, shape (n, 2)
    Metres, in world.
covariance : array, shape (2 n, 2 n) or (n, 2, 2)
    Covariance of `world` [m^2]: joint over (x0, y0, x1, y1, ...), or per point if independent.

Returns
-------
RigidFit

Raises
------
ValueError
    On fewer than two points, points that coincide in body, numbers that are not finite or a
    covariance that is not positive definite.

Examples
--------
>>> import numpy as np
>>> from locfuse.core import rigid_fit
>>> fit = rigid_fit([[1, 0], [-1, 0]], [[2, 4], [2, 2]], 0.01 * np.eye(4))
>>> round(fit.pose.x, 6), round(fit.pose.y, 6), round(fit.pose.heading, 6)
(2.0, 3.0, 1.570796)
)");
}

void bind_point_models(py::module_& m) {
  using locfuse::PointDistanceModel;
  using locfuse::PointMotion;
  using locfuse::VelocityModel;
  using MotionConfig = PointMotion::Config;
  py::class_<MotionConfig>(m, "PointMotionConfig", "White acceleration of a point.")
      .def(py::init<>())
      .def_readwrite("sigma_velocity_per_sqrt_s", &MotionConfig::sigma_velocity_per_sqrt_s,
                     "m/s / sqrt(s), of each axis.");
  using VelocityConfig = VelocityModel::Config;
  py::class_<VelocityConfig>(m, "VelocityConfig",
                             "Velocity noise: that of the wheels, common to all points of the "
                             "body, and that of each point.")
      .def(py::init<>())
      .def_readwrite("sigma_forward_mps", &VelocityConfig::sigma_forward_mps)
      .def_readwrite("sigma_lateral_mps", &VelocityConfig::sigma_lateral_mps)
      .def_readwrite("sigma_turn_rate_radps", &VelocityConfig::sigma_turn_rate_radps)
      .def_readwrite("sigma_point_mps", &VelocityConfig::sigma_point_mps,
                     "Independent per point and axis; > 0.")
      .def_readwrite("gate", &VelocityConfig::gate,
                     "Probability that a good velocity passes its gate; 1: no gate.");
  using DistanceConfig = PointDistanceModel::Config;
  py::class_<DistanceConfig>(m, "PointDistanceConfig", "Noise of a known distance.")
      .def(py::init<>())
      .def_readwrite("sigma_m", &DistanceConfig::sigma_m)
      .def_readwrite("gate", &DistanceConfig::gate,
                     "Probability that a good distance passes its gate; 1: no gate.");

  py::class_<VelocityModel>(
      m, "VelocityModel",
      "Velocities of points on a body from wheel odometry; docs/models/poses.md.")
      .def(py::init<const VelocityConfig&>(), py::arg("config"))
      .def_static("predict", &VelocityModel::predict, py::arg("heading"), py::arg("twist"),
                  py::arg("point_in_body"),
                  "Velocity (2,) in world [m/s] of a point on a body with `twist` (forward [m/s], "
                  "left [m/s], turn rate [rad/s]).")
      .def(
          "linearize",
          [](const VelocityModel& model, const Vector<6>& velocities, double heading,
             const Vector<3>& twist, const locfuse::Matrix<3, 2>& points_in_body) {
            return any_size(
                model.linearize<6>(velocities, heading, twist, points_in_body.transpose()));
          },
          py::arg("velocities"), py::arg("heading"), py::arg("twist"), py::arg("points_in_body"),
          "Linearization (6 x 6) of three points (3, 2) with velocities (6,) in world.");
  py::class_<PointDistanceModel>(m, "PointDistanceModel",
                                 "Known distance between two points; docs/models/poses.md.")
      .def(py::init<const DistanceConfig&>(), py::arg("config"))
      .def_static("predict", &PointDistanceModel::predict, py::arg("a"), py::arg("b"))
      .def(
          "linearize",
          [](const PointDistanceModel& model, const Vector<2>& a, const Vector<2>& b,
             double distance) -> std::optional<AnyLinearization> {
            const auto lin = model.linearize(a, b, distance);
            return lin ? std::optional(any_size(*lin)) : std::nullopt;
          },
          py::arg("a"), py::arg("b"), py::arg("distance"),
          "Linearization (1 x 4) with respect to (a, b); None if the points coincide.");
}

void bind_tag_order(py::module_& m) {
  using locfuse::TagOrder;
  using locfuse::TagOrderVerdict;
  py::native_enum<TagOrderVerdict>(m, "TagOrderVerdict", "enum.Enum",
                                   "Whether fixes of three tags match their triangle.")
      .value("FITS", TagOrderVerdict::kFits, "With the given ids.")
      .value("SWAPPED", TagOrderVerdict::kSwapped, "Only with other ids, uniquely.")
      .value("AMBIGUOUS", TagOrderVerdict::kAmbiguous, "Only with other ids, in several orders.")
      .value("NO_FIT", TagOrderVerdict::kNoFit, "In no order of ids.")
      .finalize();
  py::class_<TagOrder>(m, "TagOrder", "Assignment of ids to three tags from fixes of one epoch.")
      .def_readonly("verdict", &TagOrder::verdict)
      .def_readonly("given", &TagOrder::given, "The ids of the fixes.")
      .def_readonly("ids", &TagOrder::ids, "Ids that fit best, in the order of the fixes.")
      .def_readonly("nis", &TagOrder::nis, "NIS with the given ids, 3 degrees of freedom.")
      .def_readonly("limit", &TagOrder::limit, "Largest `nis` that passes.")
      .def_readonly("best", &TagOrder::best, "NIS with `ids`.")
      .def("__str__", [](const TagOrder& order) { return locfuse::to_string(order); })
      .def("__repr__",
           [](const TagOrder& order) { return "TagOrder(" + locfuse::to_string(order) + ")"; });
  m.def("tag_order", &locfuse::tag_order, py::arg("tags"), py::arg("fixes"),
        py::arg("probability") = 0.999,
        R"(Check the ids of three tag fixes of one epoch against their triangle.

Every order of the ids is tried.

Parameters
----------
tags : list of Tag
    Three.
fixes : list of PositionFix
    One per tag, all with the same stamp.
probability : float
    Probability that the correct order passes.

Returns
-------
TagOrder
    `str()` of it names the ids that would fit.

Raises
------
ValueError
    Unless there are three tags and one fix of each with one stamp.
)");
}

void bind_conditioner(py::module_& m) {
  using locfuse::ConditionedFix;
  using locfuse::TagConditioner;
  using locfuse::TagVerdict;
  using Config = TagConditioner::Config;
  py::native_enum<TagVerdict>(m, "TagVerdict", "enum.Enum", "Result of conditioning an RTLS fix.")
      .value("PASSED", TagVerdict::kPassed)
      .value("RESTARTED", TagVerdict::kRestarted,
             "Accepted after too many jumps in a row; the filter restarts here.")
      .value("JUMP", TagVerdict::kJump, "Farther than the machine can have moved.")
      .value("FROZEN", TagVerdict::kFrozen,
             "Bitwise equal to the previous fix although the tag moved according to the wheels.")
      .value("STALE", TagVerdict::kStale, "Older than the last fix that passed.")
      .value("UNKNOWN_TAG", TagVerdict::kUnknownTag,
             "Without a tag id, or of a tag that is not on the body.")
      .finalize();
  py::class_<ConditionedFix>(m, "ConditionedFix", "RTLS fix after conditioning.")
      .def_readonly("verdict", &ConditionedFix::verdict)
      .def_readonly("fix", &ConditionedFix::fix, "Bias removed, low-passed; None unless it passed.")
      .def_readonly("distance", &ConditionedFix::distance,
                    "Of JUMP, from the last that passed; of FROZEN, 0 [m]; else NaN.")
      .def_readonly("limit", &ConditionedFix::limit,
                    "What the distance had to be at most (JUMP), or the tag moved more than "
                    "(FROZEN) [m]; else NaN.")
      .def("__repr__", [](const ConditionedFix& c) {
        return std::string("ConditionedFix(") + (c.fix ? "passed" : "rejected") + ")";
      });
  py::class_<Config>(m, "TagConditionerConfig", "Properties of the RTLS and limits of the machine.")
      .def(py::init<>())
      .def_readwrite("cutoff_hz", &Config::cutoff_hz, "Cutoff of the low-pass [Hz]; 0: none.")
      .def_readwrite("bias_x_m", &Config::bias_x_m, "Bias subtracted from every fix, in world [m].")
      .def_readwrite("bias_y_m", &Config::bias_y_m)
      .def_readwrite("max_speed_mps", &Config::max_speed_mps, "Maximum speed of a tag [m/s].")
      .def_readwrite("jump_margin_m", &Config::jump_margin_m,
                     "Margin beyond the distance at that speed [m].")
      .def_readwrite("restart_after", &Config::restart_after,
                     "Number of jumps in a row after which it restarts.")
      .def_readwrite("frozen_motion_m", &Config::frozen_motion_m,
                     "A fix that stays equal over this motion is FROZEN [m].")
      .def_readwrite("hold_s", &Config::hold_s, "Timeout of a velocity [s].");
  py::class_<TagConditioner>(
      m, "TagConditioner",
      R"(Conditions the fixes of an RTLS, per tag, before they reach a filter.

Removes a constant bias, rejects jumps and frozen values, and low-passes the rest, whose lag at most
is added to the covariance; docs/models/poses.md. Feed it in order of effective stamps.

Parameters
----------
config : TagConditionerConfig
tags : list of Tag

Raises
------
ValueError
    If the config is out of range or the tags are not valid.
)")
      .def(py::init<const Config&, const std::vector<Tag>&>(), py::arg("config"), py::arg("tags"))
      .def("on", py::overload_cast<const locfuse::Velocity&>(&TagConditioner::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Increment&>(&TagConditioner::on),
           py::arg("message"),
           "Processes wheel odometry, from which the motion of each tag follows, or conditions a "
           "fix.")
      .def("on", py::overload_cast<const PositionFix&>(&TagConditioner::on), py::arg("message"))
      .def("__repr__", [](const TagConditioner&) { return "TagConditioner()"; });
}

void bind_ekf(py::module_& m) {
  using locfuse::AnchorMap;
  using locfuse::TagTriangleEkf;
  using Config = TagTriangleEkf::Config;
  py::class_<Config>(m, "TagTriangleEkfConfig", "Motion, noise and gates of a TagTriangleEkf.")
      .def(py::init<>())
      .def_readwrite("motion", &Config::motion)
      .def_readwrite("velocity", &Config::velocity)
      .def_readwrite("side", &Config::side)
      .def_readwrite("range", &Config::range)
      .def_readwrite("position", &Config::position)
      .def_readwrite("limits", &Config::limits)
      .def_readwrite("sides_m", &Config::sides_m,
                     "Measured sides (3,) [m] from tag 0 to 1, 1 to 2, 2 to 0, or None.")
      .def_readwrite("heading_is_known", &Config::heading_is_known,
                     "Whether the heading that rotates wheel velocities is taken as exact, as in "
                     "the paper; otherwise that of the tags is used, with its Jacobian.")
      .def_readwrite("holds_sides", &Config::holds_sides,
                     "Whether fixes and ranges are followed by the sides, once for all of a stamp, "
                     "where there has been no odometry for a second.")
      .def_readwrite("sigma_start_velocity_mps", &Config::sigma_start_velocity_mps)
      .def_readwrite("correlation_s", &Config::correlation_s, "As of PoseEkfConfig.");
  py::class_<TagTriangleEkf>(m, "TagTriangleEkf",
                             R"(Extended Kalman filter over positions and velocities of three tags.

The 12-state filter of celan2017, section III.D: fixes of the tags, their velocities from wheel
odometry, the sides of their triangle; docs/models/poses.md. Slots are
`tag0.position` to `tag2.position`, then `tag0.velocity` to `tag2.velocity`.

Parameters
----------
config : TagTriangleEkfConfig
world : World
    With three tags, not collinear.
start : PoseEstimate or list of PositionFix
    A pose, or one fix per tag with the same stamp.

Raises
------
ValueError
    If the config is out of range, the tags do not form a triangle, the start is not finite and
    positive definite, or fixes do not match the triangle; the text names the ids that would.

Examples
--------
>>> import numpy as np
>>> from locfuse.core import *
>>> tags = [Tag(1, [0.6, 0, 1]), Tag(2, [-0.3, 0.2, 1]), Tag(3, [-0.3, -0.2, 1])]
>>> start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.2, 0.2, 0.1]) ** 2)
>>> ekf = TagTriangleEkf(TagTriangleEkfConfig(), World(tags=tags), start)
>>> ekf.on(Velocity(100_000_000, 0.3, 0.0)).verdict.name
'FUSED'
>>> ekf.on(PositionFix(1_000_000_000, [3.9, 2.0], 0.04 * np.eye(2), tag=1)).verdict.name
'FUSED'
)")
      .def(py::init<const Config&, const locfuse::World&, const locfuse::PoseEstimate&>(),
           py::arg("config"), py::arg("world"), py::arg("start"))
      .def(py::init<const Config&, const locfuse::World&, const std::vector<PositionFix>&>(),
           py::arg("config"), py::arg("world"), py::arg("start"))
      .def("on", on_message<TagTriangleEkf>(), py::arg("message"),
           "Fuses one message; a message that is not fused leaves the estimator unchanged. After "
           "odometry the sides of the triangle are fused.")
      .def("hold_sides", &TagTriangleEkf::hold_sides,
           "Fuses the three sides at the current belief; for use without odometry and without "
           "`holds_sides`.")
      .def("advance_to", &TagTriangleEkf::advance_to, py::arg("stamp"))
      .def("fit", &TagTriangleEkf::fit,
           "RigidFit of the body to the tags; its `nis` measures their rigidity.")
      .def("pose", &TagTriangleEkf::pose)
      .def("current", &TagTriangleEkf::current, "PoseEstimate at the stamp of the belief.")
      .def("estimate", py::overload_cast<>(&TagTriangleEkf::estimate, py::const_),
           "PoseEstimate propagated to the end of the latest odometry.")
      .def("estimate", py::overload_cast<Stamp>(&TagTriangleEkf::estimate, py::const_),
           py::arg("stamp"),
           "PoseEstimate propagated to `stamp` [ns], which must not precede the belief.")
      .def_property_readonly("sides", &TagTriangleEkf::sides,
                             "Outcomes of the three sides that were fused last.")
      .def_property_readonly("tags", &TagTriangleEkf::tags)
      .def_property_readonly("belief", &TagTriangleEkf::belief, py::return_value_policy::copy)
      .def_property_readonly("interventions", &TagTriangleEkf::interventions,
                             "Number of times a variance was clamped to its bounds.")
      .def(
          "__copy__", [](const TagTriangleEkf& ekf) { return ekf; }, "Independent copy.")
      .def(
          "__deepcopy__", [](const TagTriangleEkf& ekf, const py::object& /*memo*/) { return ekf; },
          py::arg("memo"), "Independent copy.")
      .def("__repr__", [](const TagTriangleEkf& ekf) {
        return "TagTriangleEkf(at " + std::to_string(ekf.belief().stamp) + " ns)";
      });
}

}  // namespace

void bind_tags(py::module_& m) {
  bind_rigid_fit(m);
  bind_point_models(m);
  bind_tag_order(m);
  bind_conditioner(m);
  bind_ekf(m);
}
