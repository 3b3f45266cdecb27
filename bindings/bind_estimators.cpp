// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/frontends/scan_matcher.hpp"
#include "locfuse/maps/occupancy_grid.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::AnchorMap;
using locfuse::Gate;
using locfuse::Outcome;
using locfuse::Pose2;
using locfuse::PoseEkf;
using locfuse::PoseEstimate;
using locfuse::Range;
using locfuse::Stamp;
using locfuse::Tag;
using locfuse::World;

namespace {

// Odometry since the last epoch, then every range of this epoch, in a single call.
std::vector<Outcome> on_epoch(PoseEkf& ekf, Stamp begin, Stamp stamp, const Pose2& motion,
                              const Integers<locfuse::Id>& anchor_ids, const Column<double>& ranges,
                              locfuse::Id tag) {
  const Column<locfuse::Id> anchors = checked("anchors", anchor_ids, "an id of 32 bits");
  expect_shape("anchors", anchors, anchors.size());
  expect_shape("ranges", ranges, anchors.size());
  std::vector<Range> epoch;
  epoch.reserve(static_cast<std::size_t>(anchors.size()));
  for (py::ssize_t i = 0; i < anchors.size(); ++i) {
    epoch.push_back({stamp, tag, anchors.data()[i], ranges.data()[i], {}});
    validate(epoch.back());  // all or nothing: before anything is fused
  }
  std::vector<Outcome> outcomes{ekf.on(locfuse::Increment{begin, stamp, motion})};
  for (const Range& z : epoch) {
    outcomes.push_back(ekf.on(z));
  }
  return outcomes;
}

template <class Map>
using Optional = std::optional<std::shared_ptr<Map>>;

void bind_world(py::module_& m) {
  py::class_<World>(m, "World", R"(What does not change while a robot drives.

The second argument of every estimator, which takes of it what it can use.

Parameters
----------
anchors : AnchorMap, optional
    To which ranges are measured.
tags : list of Tag, optional
    On the body.
landmarks : LandmarkSensor, optional
    Known landmarks, and the sensor that observes them.
grid : OccupancyGrid, optional
    Map of walls, of an Mcl.
matcher : ScanMatcher, optional
    Of scans on a map: gives the heading while a start is searched.

Examples
--------
>>> from locfuse import *
>>> world = World(AnchorMap([Anchor(1, [0, 0, 2])]), [Tag(0, [0, 0, 1.1])])
>>> ekf = RecoveringEkf(RecoveringEkfConfig(), world)
)")
      .def(py::init([](const Optional<AnchorMap>& anchors, std::vector<Tag> tags,
                       const std::optional<locfuse::LandmarkSensor>& landmarks,
                       const Optional<locfuse::OccupancyGrid>& grid,
                       const Optional<locfuse::ScanMatcher>& matcher) {
             return World{anchors.value_or(nullptr), std::move(tags),
                          landmarks.value_or(locfuse::LandmarkSensor{}), grid.value_or(nullptr),
                          matcher.value_or(nullptr)};
           }),
           py::arg("anchors") = py::none(), py::arg("tags") = std::vector<Tag>{},
           py::arg("landmarks") = py::none(), py::arg("grid") = py::none(),
           py::arg("matcher") = py::none())
      .def_readonly("tags", &World::tags)
      .def("__repr__", [](const World& world) {
        std::string has;
        const auto add = [&has](bool is_there, const char* what) {
          has += is_there ? (has.empty() ? "" : ", ") + std::string(what) : std::string();
        };
        add(world.anchors != nullptr, "anchors");
        add(!world.tags.empty(), "tags");
        add(world.landmarks.map != nullptr, "landmarks");
        add(world.grid != nullptr, "grid");
        add(world.matcher != nullptr, "matcher");
        return "World(" + has + ")";
      });
}

}  // namespace

void bind_estimators(py::module_& m) {
  py::class_<PoseEstimate>(
      m, "PoseEstimate",
      "Pose T_world_body at one stamp [ns], with the covariance (3, 3) of (x, y, heading).")
      .def(py::init([](Stamp stamp, const Pose2& pose, const locfuse::Matrix<3, 3>& covariance) {
             return PoseEstimate{stamp, pose, covariance};
           }),
           py::arg("stamp"), py::arg("pose"), py::arg("covariance"))
      .def_readonly("stamp", &PoseEstimate::stamp)
      .def_readonly("pose", &PoseEstimate::pose)
      .def_readonly("covariance", &PoseEstimate::covariance, "Shape (3, 3).")
      .def_property_readonly("sigma_position", &PoseEstimate::sigma_position,
                             "Semi-major axis of the 1-sigma position ellipse [m].")
      .def_property_readonly("sigma_heading", &PoseEstimate::sigma_heading, "[rad].")
      .def("__repr__", [](const PoseEstimate& e) {
        return "PoseEstimate(stamp=" + std::to_string(e.stamp) + ", pose=(" +
               std::to_string(e.pose.x) + ", " + std::to_string(e.pose.y) + ", " +
               std::to_string(e.pose.heading) + "))";
      });
  using Config = PoseEkf::Config;
  using locfuse::PoseHypothesis;
  py::class_<PoseHypothesis>(m, "PoseHypothesis", "One of several pose hypotheses.")
      .def(py::init([](const PoseEstimate& estimate, double probability) {
             return PoseHypothesis{estimate, probability};
           }),
           py::arg("estimate"), py::arg("probability") = 1.0)
      .def_readonly("estimate", &PoseHypothesis::estimate)
      .def_readonly("probability", &PoseHypothesis::probability,
                    "Relative to the other hypotheses, 0 to 1.")
      .def("__repr__", [](const PoseHypothesis& h) {
        return "PoseHypothesis(probability=" + std::to_string(h.probability) + ")";
      });
  using locfuse::CalibratedError;
  py::class_<CalibratedError>(m, "CalibratedError", "Estimate of a systematic sensor error.")
      .def_readonly("name", &CalibratedError::name)
      .def_readonly("anchor", &CalibratedError::anchor,
                    "Id of the anchor whose error it is, or None.")
      .def_readonly("value", &CalibratedError::value)
      .def_readonly("sigma", &CalibratedError::sigma)
      .def_readonly("sigma_start", &CalibratedError::sigma_start, "Prior standard deviation.")
      .def("__repr__", [](const CalibratedError& e) {
        const std::string anchor = e.anchor ? " " + std::to_string(*e.anchor) : "";
        return "CalibratedError(" + e.name + anchor + ": " + std::to_string(e.value) + " +- " +
               std::to_string(e.sigma) + ")";
      });
  using Calibration = locfuse::Calibration::Config;
  py::class_<Calibration>(
      m, "CalibrationConfig",
      "Prior standard deviations of the systematic errors of odometry, landmark sensor and ranges "
      "that a PoseEkf estimates. An error with sigma 0 is not a state.")
      .def(py::init<>())
      .def_readwrite("sigma_scale", &Calibration::sigma_scale,
                     "Scale error of the odometry distance.")
      .def_readwrite("sigma_direction_rad", &Calibration::sigma_direction_rad,
                     "Direction of travel relative to the heading.")
      .def_readwrite("sigma_turn_scale", &Calibration::sigma_turn_scale,
                     "Scale error of the odometry turn.")
      .def_readwrite("sigma_turn_bias_radps", &Calibration::sigma_turn_bias_radps,
                     "Turn rate bias, as of a gyro.")
      .def_readwrite("sigma_turn_bias_radps_per_sqrt_s",
                     &Calibration::sigma_turn_bias_radps_per_sqrt_s, "Random walk of that bias.")
      .def_readwrite("sigma_sensor_m", &Calibration::sigma_sensor_m,
                     "Position of the sensor in the body frame, x and y.")
      .def_readwrite("sigma_sensor_rad", &Calibration::sigma_sensor_rad,
                     "Heading of the sensor in the body frame.")
      .def_readwrite("sigma_range_offset_m", &Calibration::sigma_range_offset_m,
                     "Offset of ranges to landmarks.")
      .def_readwrite("sigma_range_scale", &Calibration::sigma_range_scale)
      .def_readwrite("sigma_delay_s", &Calibration::sigma_delay_s,
                     "Latency of landmark observations.")
      .def_readwrite("sigma_anchor_offset_m", &Calibration::sigma_anchor_offset_m,
                     "Range offset of each anchor of the map.")
      .def_readwrite("anchor_offset_correlation_s", &Calibration::anchor_offset_correlation_s,
                     "Correlation time of the anchor offsets; 0: constant.")
      .def_readwrite("sigma_anchor_scale", &Calibration::sigma_anchor_scale,
                     "Range scale error of each anchor, added to the scale in the map.")
      .def_readwrite("sigma_range_delay_s", &Calibration::sigma_range_delay_s,
                     "Latency of all ranges.")
      .def_readwrite("sigma_heading_offset_rad", &Calibration::sigma_heading_offset_rad,
                     "Offset of headings, beyond that of HeadingConfig.")
      .def_readwrite("sigma_heading_offset_rad_per_sqrt_s",
                     &Calibration::sigma_heading_offset_rad_per_sqrt_s,
                     "Random walk of that offset.")
      .def_readwrite("consider", &Calibration::consider,
                     "Account for the errors without estimating them (Schmidt-Kalman filter).");
  using Adaptive = locfuse::AdaptiveNoise::Config;
  py::class_<Adaptive>(m, "AdaptiveNoiseConfig",
                       "Adaptation of measurement variances to their innovations, as a factor on "
                       "the reported variance.")
      .def(py::init<>())
      .def_readwrite("messages", &Adaptive::messages,
                     "Window length per kind of message; 0: no adaptation.")
      .def_readwrite("least", &Adaptive::least, "Minimum factor.")
      .def_readwrite("most", &Adaptive::most, "Maximum factor.");
  py::class_<Config>(m, "PoseEkfConfig", "Noise, gates and behaviour of a PoseEkf.")
      .def(py::init<>())
      .def_readwrite("odometry", &Config::odometry)
      .def_readwrite("range", &Config::range)
      .def_readwrite("position", &Config::position)
      .def_readwrite("pose", &Config::pose)
      .def_readwrite("heading", &Config::heading)
      .def_readwrite("landmark", &Config::landmark)
      .def_readwrite("calibration", &Config::calibration)
      .def_readwrite("limits", &Config::limits)
      .def_readwrite("adaptive", &Config::adaptive)
      .def_readwrite("robust_dof", &Config::robust_dof, "Degrees of freedom of STUDENT_T noise.")
      .def_readwrite("robust_late_share", &Config::robust_late_share,
                     "Fraction of ranges that read long under ONE_SIDED noise.")
      .def_readwrite(
          "correlation_s", &Config::correlation_s,
          "Correlation time of the errors of each source, of which it is learnt how much "
          "is correlated; 0: errors are independent.")
      .def_readwrite("hold_s", &Config::hold_s,
                     "Timeout of odometry [s]: how long the last motion is extrapolated.")
      .def_readwrite("sigma_lost_xy_per_sqrt_s", &Config::sigma_lost_xy_per_sqrt_s)
      .def_readwrite("sigma_lost_heading_per_sqrt_s", &Config::sigma_lost_heading_per_sqrt_s);
  py::class_<locfuse::LandmarkSensor>(
      m, "LandmarkSensor",
      "Known landmarks and the pose T_body_sensor of the sensor that observes them.")
      .def(py::init([](const Optional<locfuse::LandmarkMap>& map, const Pose2& T_body_sensor) {
             return locfuse::LandmarkSensor{map.value_or(nullptr), T_body_sensor};
           }),
           py::arg("map") = py::none(), py::arg("T_body_sensor") = Pose2{})
      .def_readonly("T_body_sensor", &locfuse::LandmarkSensor::T_body_sensor);
  bind_world(m);
  py::native_enum<locfuse::Association>(m, "Association", "enum.Enum",
                                        "Data association of landmark observations without an id.")
      .value("NEAREST", locfuse::Association::kNearest,
             "Nearest neighbour, each observation by itself.")
      .value("GLOBAL", locfuse::Association::kGlobal,
             "Global nearest neighbour: minimum total cost over all observations.")
      .value("JOINT", locfuse::Association::kJoint,
             "Joint compatibility: the largest set of pairings that passes the joint gate.")
      .finalize();
  py::class_<PoseEkf>(m, "PoseEkf", R"(Extended Kalman filter over (x, y, heading) in world.

Odometry predicts; ranges, positions, poses and landmarks update (ekim2020, section 2.1).

Parameters
----------
config : PoseEkfConfig
world : World
start : PoseEstimate

Raises
------
ValueError
    If the config is out of range, or the start is not finite or not positive definite.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> anchors = AnchorMap([Anchor(1, [0, 0, 2]), Anchor(2, [8, 0, 2]), Anchor(3, [4, 6, 2])])
>>> start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.5, 0.5, 0.1]) ** 2)
>>> ekf = PoseEkf(PoseEkfConfig(), World(anchors, [Tag(0, [0, 0, 1.1])]), start)
>>> ekf.on(Increment(0, 100_000_000, Pose2(0.05, 0, 0))).verdict.name
'FUSED'
>>> ekf.on(Range(100_000_000, tag=0, anchor=2, range=5.4)).verdict.name
'FUSED'
)")
      .def(py::init<const Config&, const World&, const PoseEstimate&>(), py::arg("config"),
           py::arg("world"), py::arg("start"))
      .def("on", on_message<PoseEkf>(), py::arg("message"),
           "Fuses one message; a message that is not fused leaves the estimator unchanged.")
      .def("on_joint", py::overload_cast<const std::vector<Range>&>(&PoseEkf::on_joint),
           py::arg("epoch"),
           "Fuses ranges of one stamp as one measurement: one linearization, one gate.")
      .def("on_joint",
           py::overload_cast<const std::vector<locfuse::RangeBearing>&, locfuse::Association>(
               &PoseEkf::on_joint),
           py::arg("sightings"),
           py::arg_v("association", locfuse::Association::kJoint, "Association.JOINT"),
           "Fuses landmark observations of one stamp. Those without an id are associated before "
           "any is fused. Returns one Outcome each: GATED if no landmark matches, NOT_MODELLED if "
           "the result would not be finite.")
      .def("on_epoch", &on_epoch, py::arg("begin"), py::arg("stamp"), py::arg("motion"),
           py::arg("anchors"), py::arg("ranges"), py::arg("tag") = 0,
           "Fuses the motion from `begin` to `stamp` [ns], then the ranges (n,) [m] to the anchors "
           "(n,) at `stamp`. Returns n + 1 outcomes.")
      .def(
          "fuse",
          [](PoseEkf& ekf, Stamp stamp, const AnyLinearization& lin, const Gate& gate) {
            if (lin.jacobian.cols() != 3) {
              throw std::invalid_argument("the Jacobian has " +
                                          std::to_string(lin.jacobian.cols()) +
                                          " columns, expected 3: x, y, heading");
            }
            return ekf.fuse(stamp, {lin.residual, lin.jacobian, lin.noise}, gate);
          },
          py::arg("stamp"), py::arg("linearization"), py::arg("gate"),
          "Fuses a user-defined measurement of the pose at `stamp` [ns] with a Jacobian (m, 3). "
          "Linearize at `estimate(stamp).pose`.")
      .def("advance_to", &PoseEkf::advance_to, py::arg("stamp"))
      .def("estimate", py::overload_cast<>(&PoseEkf::estimate, py::const_),
           "PoseEstimate propagated to the end of the latest odometry.")
      .def("estimate", py::overload_cast<Stamp>(&PoseEkf::estimate, py::const_), py::arg("stamp"),
           "PoseEstimate propagated to `stamp` [ns], which must not precede the belief.")
      .def_property_readonly("errors", &PoseEkf::errors,
                             "A CalibratedError for each error that is a state.")
      .def_property_readonly("belief", &PoseEkf::belief, py::return_value_policy::copy)
      .def_property_readonly("interventions", &PoseEkf::interventions,
                             "Number of times a variance was clamped to its bounds.")
      .def_property_readonly("range_model", &PoseEkf::range_model, py::return_value_policy::copy)
      .def_property_readonly("motion_model", &PoseEkf::motion_model, py::return_value_policy::copy)
      .def(
          "__copy__", [](const PoseEkf& ekf) { return ekf; }, "Independent copy.")
      .def(
          "__deepcopy__", [](const PoseEkf& ekf, const py::object& /*memo*/) { return ekf; },
          py::arg("memo"), "Independent copy.")
      .def("__repr__", [](const PoseEkf& ekf) {
        return "PoseEkf(at " + std::to_string(ekf.belief().stamp) + " ns)";
      });
}
