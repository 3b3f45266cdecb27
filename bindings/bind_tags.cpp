// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

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
  py::native_enum<RigidFitStatus>(m, "RigidFitStatus", "enum.Enum", "How a rigid fit went.")
      .value("FITTED", RigidFitStatus::kFitted)
      .value("MIRRORED", RigidFitStatus::kMirrored,
             "A reflection fits better; `pose` is the rotation that fits best.")
      .value("NO_DIRECTION", RigidFitStatus::kNoDirection,
             "The points in world prefer no heading: they coincide, or are a reflection.")
      .value("NOT_CONVERGED", RigidFitStatus::kNotConverged)
      .finalize();
  py::class_<RigidFit>(m, "RigidFit", "The pose of a rigid body whose points were measured.")
      .def_readonly("status", &RigidFit::status)
      .def_readonly("pose", &RigidFit::pose, "T_world_body; NaN without a direction.")
      .def_readonly("covariance", &RigidFit::covariance, "Of (x, y, heading), shape (3, 3).")
      .def_readonly("nis", &RigidFit::nis, "How badly the points fit a rigid body.")
      .def_readonly("dof", &RigidFit::dof, "Of nis: 2 n - 3.")
      .def("__repr__", [](const RigidFit& f) {
        return "RigidFit(pose=(" + std::to_string(f.pose.x) + ", " + std::to_string(f.pose.y) +
               ", " + std::to_string(f.pose.heading) + "), nis=" + std::to_string(f.nis) + ")";
      });
  m.def("rigid_fit", &fit, py::arg("body"), py::arg("world"), py::arg("covariance"),
        R"(Return the pose that takes points of a body to where they were measured.

Least squares weighted with the covariance; docs/models/rigid_fit.md.

Parameters
----------
body : array, shape (n, 2)
    Metres, in body; at least two that differ.
world : array, shape (n, 2)
    Metres, in world.
covariance : array, shape (2 n, 2 n) or (n, 2, 2)
    Of `world` [m^2]: of (x0, y0, x1, y1, ...), or of each point where they share nothing.

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
>>> from locfuse import rigid_fit
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
                             "What wheels err by, which points of the body share, and what each "
                             "errs by itself.")
      .def(py::init<>())
      .def_readwrite("sigma_forward_mps", &VelocityConfig::sigma_forward_mps)
      .def_readwrite("sigma_lateral_mps", &VelocityConfig::sigma_lateral_mps)
      .def_readwrite("sigma_turn_rate_radps", &VelocityConfig::sigma_turn_rate_radps)
      .def_readwrite("sigma_point_mps", &VelocityConfig::sigma_point_mps,
                     "Each point, each axis; > 0.");
  using DistanceConfig = PointDistanceModel::Config;
  py::class_<DistanceConfig>(m, "PointDistanceConfig", "How well a distance is known.")
      .def(py::init<>())
      .def_readwrite("sigma_m", &DistanceConfig::sigma_m);

  py::class_<VelocityModel>(m, "VelocityModel",
                            "Velocities of points on a body as its wheels tell them; "
                            "docs/models/velocity.md.")
      .def(py::init<const VelocityConfig&>(), py::arg("config"))
      .def_static("predict", &VelocityModel::predict, py::arg("heading"), py::arg("twist"),
                  py::arg("point_in_body"),
                  "In world (2,) [m/s], of a body with `twist` (forward [m/s], left [m/s], turn "
                  "rate [rad/s]).")
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
                                 "A known distance between two points; "
                                 "docs/models/point_distance.md.")
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
          "Linearization (1 x 4) with respect to (a, b); None if they lie together.");
}

void bind_tag_order(py::module_& m) {
  using locfuse::TagOrder;
  using locfuse::TagOrderVerdict;
  py::native_enum<TagOrderVerdict>(m, "TagOrderVerdict", "enum.Enum",
                                   "Whether fixes of three tags fit their triangle.")
      .value("FITS", TagOrderVerdict::kFits, "With the ids they bear.")
      .value("SWAPPED", TagOrderVerdict::kSwapped, "Only with other ids, and only these.")
      .value("AMBIGUOUS", TagOrderVerdict::kAmbiguous, "Only with other ids, several of them.")
      .value("NO_FIT", TagOrderVerdict::kNoFit, "With no ids.")
      .finalize();
  py::class_<TagOrder>(m, "TagOrder", "Which tag is which, as fixes of one epoch tell.")
      .def_readonly("verdict", &TagOrder::verdict)
      .def_readonly("given", &TagOrder::given, "The ids of the fixes.")
      .def_readonly("ids", &TagOrder::ids, "Those that fit best, in the order of the fixes.")
      .def_readonly("nis", &TagOrder::nis, "Of the ids given, 3 degrees of freedom.")
      .def_readonly("limit", &TagOrder::limit, "What that may be.")
      .def_readonly("best", &TagOrder::best, "nis of `ids`.")
      .def("__str__", [](const TagOrder& order) { return locfuse::to_string(order); })
      .def("__repr__",
           [](const TagOrder& order) { return "TagOrder(" + locfuse::to_string(order) + ")"; });
  m.def("tag_order", &locfuse::tag_order, py::arg("tags"), py::arg("fixes"),
        py::arg("probability") = 0.999,
        R"(Try the fixes of three tags of one epoch on their triangle in every order.

Parameters
----------
tags : list of Tag
    Three.
fixes : list of PositionFix
    One of each, of one stamp.
probability : float
    Of a right order to pass.

Returns
-------
TagOrder
    Its text names the ids that would fit.

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
  py::native_enum<TagVerdict>(m, "TagVerdict", "enum.Enum", "What became of a fix of an RTLS.")
      .value("PASSED", TagVerdict::kPassed)
      .value("RESTARTED", TagVerdict::kRestarted, "So many were jumps that it starts anew here.")
      .value("JUMP", TagVerdict::kJump, "Further than the machine can have gone.")
      .value("FROZEN", TagVerdict::kFrozen,
             "Bit for bit the fix before, though the wheels say that the tag moved.")
      .value("STALE", TagVerdict::kStale, "Before the one that passed last.")
      .value("UNKNOWN_TAG", TagVerdict::kUnknownTag, "Of no tag, or one that is not on the body.")
      .finalize();
  py::class_<ConditionedFix>(m, "ConditionedFix", "A fix of an RTLS and what became of it.")
      .def_readonly("verdict", &ConditionedFix::verdict)
      .def_readonly("fix", &ConditionedFix::fix, "Bias removed, low-passed; None unless it passed.")
      .def("__repr__", [](const ConditionedFix& c) {
        return std::string("ConditionedFix(") + (c.fix ? "passed" : "rejected") + ")";
      });
  py::class_<Config>(m, "TagConditionerConfig", "What an RTLS does, and what the machine can do.")
      .def(py::init<>())
      .def_readwrite("cutoff_hz", &Config::cutoff_hz, "Of the low-pass; 0 is none.")
      .def_readwrite("bias_x_m", &Config::bias_x_m, "Taken from every fix, in world.")
      .def_readwrite("bias_y_m", &Config::bias_y_m)
      .def_readwrite("max_speed_mps", &Config::max_speed_mps, "Of a tag.")
      .def_readwrite("jump_margin_m", &Config::jump_margin_m, "Beyond what that speed allows.")
      .def_readwrite("restart_after", &Config::restart_after, "Jumps in a row.")
      .def_readwrite("frozen_motion_m", &Config::frozen_motion_m,
                     "A tag that went further has another fix.")
      .def_readwrite("hold_s", &Config::hold_s,
                     "How long a velocity is believed without a new one.");
  py::class_<TagConditioner>(
      m, "TagConditioner",
      R"(Conditions the fixes of an RTLS, tag by tag, before a filter sees them.

Takes a constant bias off, rejects jumps and values that are stuck, and low-passes the rest;
docs/models/tag_triangle_ekf.md.

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
           py::arg("message"), "Wheel odometry, which tells how far each tag went.")
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
                     "None, or (3,) from tag 0 to 1, 1 to 2, 2 to 0 as a tape tells.")
      .def_readwrite("heading_is_known", &Config::heading_is_known,
                     "Whether wheels turn to velocities by a heading without error, as in the "
                     "paper; else by that of the tags, with its Jacobian.")
      .def_readwrite("sigma_start_velocity_mps", &Config::sigma_start_velocity_mps)
      .def_readwrite("gate_position", &Config::gate_position, "Probability that a good fix passes.")
      .def_readwrite("gate_velocity", &Config::gate_velocity)
      .def_readwrite("gate_side", &Config::gate_side)
      .def_readwrite("gate_range", &Config::gate_range);
  py::class_<TagTriangleEkf>(m, "TagTriangleEkf",
                             R"(Extended Kalman filter over positions and velocities of three tags.

The 12-state filter of celan2017, section III.D: fixes of the tags, the velocities that wheel
odometry gives them, the sides of their triangle; docs/models/tag_triangle_ekf.md. Slots are
`tag0.position` to `tag2.position`, then `tag0.velocity` to `tag2.velocity`.

Parameters
----------
config : TagTriangleEkfConfig
tags : list of Tag
    Three that make a triangle.
start : PoseEstimate or list of PositionFix
    A pose, or a fix of each tag with one stamp.
anchors : AnchorMap, optional
    For ranges.

Raises
------
ValueError
    If the config is out of range, the tags make no triangle, the start is not finite and positive
    definite, or fixes do not fit the triangle; the text names the order of ids that would.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> tags = [Tag(1, [0.6, 0, 1]), Tag(2, [-0.3, 0.2, 1]), Tag(3, [-0.3, -0.2, 1])]
>>> start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.2, 0.2, 0.1]) ** 2)
>>> ekf = TagTriangleEkf(TagTriangleEkfConfig(), tags, start)
>>> ekf.on(Velocity(100_000_000, 0.3, 0.0)).verdict.name
'FUSED'
>>> ekf.on(PositionFix(1_000_000_000, [3.9, 2.0], 0.04 * np.eye(2), tag=1)).verdict.name
'FUSED'
)")
      .def(py::init([](const Config& config, const std::vector<Tag>& tags,
                       const locfuse::PoseEstimate& start,
                       const std::optional<std::shared_ptr<AnchorMap>>& anchors) {
             return TagTriangleEkf(config, tags, start, anchors.value_or(nullptr));
           }),
           py::arg("config"), py::arg("tags"), py::arg("start"), py::arg("anchors") = py::none())
      .def(py::init([](const Config& config, const std::vector<Tag>& tags,
                       const std::vector<PositionFix>& start,
                       const std::optional<std::shared_ptr<AnchorMap>>& anchors) {
             return TagTriangleEkf(config, tags, start, anchors.value_or(nullptr));
           }),
           py::arg("config"), py::arg("tags"), py::arg("start"), py::arg("anchors") = py::none())
      .def("on", py::overload_cast<const PositionFix&>(&TagTriangleEkf::on), py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Velocity&>(&TagTriangleEkf::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Increment&>(&TagTriangleEkf::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Range&>(&TagTriangleEkf::on), py::arg("message"),
           "Fuses one message. One that is not fused changes no bit of the estimator. Odometry is "
           "followed by the sides of the triangle.")
      .def("hold_sides", &TagTriangleEkf::hold_sides,
           "Fuses the three sides where the belief is: for who has no odometry.")
      .def("advance_to", &TagTriangleEkf::advance_to, py::arg("stamp"))
      .def("fit", &TagTriangleEkf::fit, "The body on the tags; its nis tells how rigid they are.")
      .def("pose", &TagTriangleEkf::pose)
      .def("estimate", py::overload_cast<>(&TagTriangleEkf::estimate, py::const_),
           "The belief at its own stamp.")
      .def("estimate", py::overload_cast<Stamp>(&TagTriangleEkf::estimate, py::const_),
           py::arg("stamp"), "The belief carried to `stamp` [ns], which must not lie before it.")
      .def_property_readonly("sides", &TagTriangleEkf::sides,
                             "What became of the three sides that were fused last.")
      .def_property_readonly("tags", &TagTriangleEkf::tags)
      .def_property_readonly("belief", &TagTriangleEkf::belief, py::return_value_policy::copy)
      .def_property_readonly("interventions", &TagTriangleEkf::interventions,
                             "How often a variance left its bounds and was put back.")
      .def(
          "__copy__", [](const TagTriangleEkf& ekf) { return ekf; }, "A snapshot.")
      .def(
          "__deepcopy__", [](const TagTriangleEkf& ekf, const py::object& /*memo*/) { return ekf; },
          py::arg("memo"), "A snapshot.")
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
