// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/particles/mcl.hpp"
#include "numpy.hpp"
#include "particles.hpp"

namespace py = pybind11;
using locfuse::BeamModel;
using locfuse::LikelihoodField;
using locfuse::Mcl;

void bind_mcl(py::module_& m) {
  using FieldConfig = LikelihoodField::Config;
  py::class_<FieldConfig>(m, "LikelihoodFieldConfig",
                          "Likelihood field of beam end points; docs/models/particles.md.")
      .def(py::init<>())
      .def_readwrite("sigma_hit_m", &FieldConfig::sigma_hit_m)
      .def_readwrite("random_share", &FieldConfig::random_share)
      .def_readwrite("max_range_m", &FieldConfig::max_range_m)
      .def_readwrite("clutter_per_m", &FieldConfig::clutter_per_m)
      .def_readwrite("unknown_per_m", &FieldConfig::unknown_per_m);
  using BeamConfig = BeamModel::Config;
  py::class_<BeamConfig>(m, "BeamModelConfig",
                         "Beam model: weights of a mixture over the range; docs/models/scans.md.")
      .def(py::init<>())
      .def_static("gaussian_and_no_return", &BeamModel::gaussian_and_no_return,
                  "Mixture of a Gaussian and beams without return (zhang).")
      .def_readwrite("hit", &BeamConfig::hit)
      .def_readwrite("shorter", &BeamConfig::shorter)
      .def_readwrite("maximum", &BeamConfig::maximum)
      .def_readwrite("random", &BeamConfig::random)
      .def_readwrite("sigma_hit_m", &BeamConfig::sigma_hit_m)
      .def_readwrite("shorter_per_m", &BeamConfig::shorter_per_m)
      .def_readwrite("max_range_m", &BeamConfig::max_range_m);
  py::native_enum<Mcl::Likelihood>(m, "ScanLikelihood", "enum.Enum",
                                   "Model of a scan's likelihood.")
      .value("FIELD", Mcl::Likelihood::kField, "Likelihood field of the end points.")
      .value("BEAMS", Mcl::Likelihood::kBeams, "Beam model of the ranges.")
      .finalize();
  py::native_enum<Mcl::Proposal>(m, "ScanProposal", "enum.Enum",
                                 "What particles are drawn from before a scan weighs them.")
      .value("ODOMETRY", Mcl::Proposal::kOdometry, "The motion model alone.")
      .value("SCAN_MATCH", Mcl::Proposal::kScanMatch, "Motion model and one match of the scan.")
      .value("LINE_EKF", Mcl::Proposal::kLineEkf,
             "Motion model, corrected in each particle by the lines of scan and map.")
      .value("LINE_EKF_PAPER", Mcl::Proposal::kLineEkfPaper,
             "The same with the paper's weight (zhang).")
      .finalize();
  using Config = Mcl::Config;
  py::class_<Config>(m, "MclConfig", "Noise and behaviour of an Mcl.")
      .def(py::init<>())
      .def_readwrite("min_particles", &Config::min_particles)
      .def_readwrite("max_particles", &Config::max_particles)
      .def_readwrite("kld_error", &Config::kld_error)
      .def_readwrite("kld_quantile", &Config::kld_quantile)
      .def_readwrite("beams", &Config::beams)
      .def_readwrite("independent_beams", &Config::independent_beams)
      .def_readwrite("independent_beams_searching", &Config::independent_beams_searching)
      .def_readwrite("sigma_map_m", &Config::sigma_map_m)
      .def_readwrite("sigma_map_rad", &Config::sigma_map_rad)
      .def_readwrite("effective_share", &Config::effective_share)
      .def_readwrite("outlier_share", &Config::outlier_share)
      .def_readwrite("resample_below", &Config::resample_below)
      .def_readwrite("proposal", &Config::proposal)
      .def_readwrite("spacing_m", &Config::spacing_m)
      .def_readwrite("spacing_heading_rad", &Config::spacing_heading_rad)
      .def_readwrite("most_gain", &Config::most_gain)
      .def_readwrite("most_drop", &Config::most_drop)
      .def_readwrite("min_explained", &Config::min_explained)
      .def_readwrite("health", &Config::health)
      .def_readwrite("watch_poses", &Config::watch_poses,
                     "Whether poses are judged by a PoseWatch, and do not weigh particles.")
      .def_readwrite("scouts", &Config::scouts)
      .def_readwrite("scout_draws", &Config::scout_draws)
      .def_readwrite("kidnapping_probability", &Config::kidnapping_probability)
      .def_readwrite("hold_s", &Config::hold_s)
      .def_readwrite("sigma_lost_xy_per_sqrt_s", &Config::sigma_lost_xy_per_sqrt_s)
      .def_readwrite("sigma_lost_heading_per_sqrt_s", &Config::sigma_lost_heading_per_sqrt_s)
      .def_readwrite("probability_ready", &Config::probability_ready)
      .def_readwrite("sigma_xy_ready_m", &Config::sigma_xy_ready_m)
      .def_readwrite("sigma_heading_ready_rad", &Config::sigma_heading_ready_rad)
      .def_readwrite("bin_m", &Config::bin_m)
      .def_readwrite("bin_headings", &Config::bin_headings)
      .def_readwrite("seed", &Config::seed)
      .def_readwrite("threads", &Config::threads)
      .def_readwrite("odometry", &Config::odometry)
      .def_readwrite("field", &Config::field)
      .def_readwrite("sigma_widest_m", &Config::sigma_widest_m)
      .def_readwrite("likelihood", &Config::likelihood)
      .def_readwrite("beam_model", &Config::beam_model)
      .def_readwrite("range", &Config::range)
      .def_readwrite("position", &Config::position)
      .def_readwrite("pose", &Config::pose)
      .def_readwrite("limits", &Config::limits)
      .def_readwrite("landmark", &Config::landmark);
  py::class_<Mcl> bound(m, "Mcl", R"(Monte Carlo localization on a grid map.

Scans weight particles by the likelihood field or the beam model; ranges, positions, poses and
landmarks can weight them, too (docs/models/particles.md). Initially they cover all free cells.

Parameters
----------
config : MclConfig
world : World
    With a grid.
start : int
    Stamp [ns].

Raises
------
ValueError
    If the config is out of range, or the grid is missing or has no free or no occupied cell.

Examples
--------
>>> import numpy as np
>>> from locfuse import LaserGeometry, LaserScan, Mcl, MclConfig, OccupancyGrid, Pose2, World
>>> cells = np.full((60, 80), 0, dtype=np.int8)  # a room of 4 x 3 m with a box in a corner
>>> cells[[0, -1], :] = cells[:, [0, -1]] = cells[:20, :30] = 100
>>> mcl = Mcl(MclConfig(), World(grid=OccupancyGrid(cells, resolution=0.05)))
>>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
>>> mcl.on(LaserScan(0, around, [0.9, 0.9, 2.9, 0.9])).verdict.name
'FUSED'
>>> mcl.ready
False
)");
  bind_state(bound, [](const Mcl& mcl) -> const Mcl& { return mcl; });
  bound
      .def(py::init<const Config&, const locfuse::World&, locfuse::Stamp>(), py::arg("config"),
           py::arg("world"), py::arg("start") = 0, py::call_guard<py::gil_scoped_release>())
      .def("start_anywhere", &Mcl::start_anywhere, py::arg("stamp"),
           "Reinitializes the particles uniformly over free space.")
      .def("start_at", &Mcl::start_at, py::arg("hypotheses"),
           "Reinitializes the particles around a list of PoseHypothesis, such as those of an "
           "Initializer.\n\nRaises\n------\nValueError\n    On an empty list or numbers that are "
           "not finite.")
      .def(
          "start_with",
          [](Mcl& mcl, locfuse::Stamp stamp, const Column<double>& particles) {
            expect_shape("particles", particles, particles.ndim() > 0 ? particles.shape(0) : 0, 4);
            const Eigen::Map<const locfuse::Matrix<4, Eigen::Dynamic>> columns(particles.data(), 4,
                                                                               particles.shape(0));
            mcl.start_with(stamp, columns);
          },
          py::arg("stamp"), py::arg("particles"),
          "Reinitializes with particles, float64 (n, 4) as in `particles`; the weights need not "
          "sum to 1.\n\nRaises\n------\nValueError\n    On another shape, on numbers that are not "
          "finite, on weights that are negative or all 0.")
      .def("inject", &Mcl::inject, py::arg("pose"), py::arg("share") = 1.0,
           "Replaces a fraction of the particles, evenly spread, by draws from a PoseEstimate of "
           "another localizer, whose stamp must not precede the last "
           "message.\n\nRaises\n------\nValueError\n    If the covariance is not positive "
           "definite, the stamp is too early, or not 0 < share <= 1.")
      .def("on",
           on_message<Mcl, locfuse::Range, locfuse::PositionFix, locfuse::PoseObservation,
                      locfuse::RangeBearing, locfuse::LaserScan>(),
           py::arg("message"), "Processes one message.")
      .def("overall_estimate", &Mcl::overall_estimate,
           "PoseEstimate with the covariance of all particles about their mean, over all clusters.")
      .def_property_readonly("explained", &Mcl::explained,
                             "Fraction of the last scan's returns that end at a wall.")
      .def_property_readonly(
          "sigma_hit", &Mcl::sigma_hit,
          "Distance of end points from walls, estimated from scans (standard deviation) [m].")
      .def_property_readonly("used_share", &Mcl::used_share,
                             "Fraction of the last measurement's information that was used.")
      .def(
          "__copy__", [](const Mcl& mcl) { return mcl; }, "Independent copy.")
      .def(
          "__deepcopy__", [](const Mcl& mcl, const py::object& /*memo*/) { return mcl; },
          py::arg("memo"))
      .def("__repr__", [](const Mcl& mcl) {
        return "Mcl(" + std::to_string(mcl.belief().size) + " particles)";
      });
}
