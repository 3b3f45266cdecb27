// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/estimators/switching_mcl.hpp"

namespace py = pybind11;
using locfuse::SwitchingMcl;

void bind_switching_mcl(py::module_& m) {
  using Config = SwitchingMcl::Config;
  using Doubt = SwitchingMcl::Doubt;
  using Injection = SwitchingMcl::Injection;
  py::native_enum<Doubt>(m, "Doubt", "enum.Enum", "Why scans are in doubt.")
      .value("NONE", Doubt::kNone, "They are not.")
      .value("UNCERTAIN", Doubt::kUncertain, "The particles have spread.")
      .value("ELSEWHERE", Doubt::kElsewhere, "They are beside where UWB says.")
      .finalize();
  py::class_<Config>(m, "SwitchingMclConfig", "When UWB takes over from scans.")
      .def(py::init<>())
      .def_readwrite("sigma_unsure_m", &Config::sigma_unsure_m,
                     "Of the particles, in their worst direction: in doubt [m].")
      .def_readwrite("sigma_sure_m", &Config::sigma_sure_m, "Below it no longer [m].")
      .def_readwrite("sigma_unsure_rad", &Config::sigma_unsure_rad, "Likewise of the heading.")
      .def_readwrite("sigma_sure_rad", &Config::sigma_sure_rad)
      .def_readwrite("elsewhere_m", &Config::elsewhere_m,
                     "Off UWB by more than this and three sigmas: in doubt [m].")
      .def_readwrite("elsewhere_rad", &Config::elsewhere_rad, "Likewise turned [rad].")
      .def_readwrite("doubt_s", &Config::doubt_s, "That doubt must last [s].")
      .def_readwrite("uwb_sigma_m", &Config::uwb_sigma_m,
                     "Of the pose by UWB, at most, to be of use [m].")
      .def_readwrite("uwb_sigma_rad", &Config::uwb_sigma_rad, "Likewise [rad].")
      .def_readwrite("uwb_age_s", &Config::uwb_age_s,
                     "Since the last range or fix that was fused, likewise [s].")
      .def_readwrite("uwb_nis", &Config::uwb_nis,
                     "NIS of the last ranges or fixes per row, on average, at most, likewise.")
      .def_readwrite("share", &Config::share, "Of the particles that are replaced.");
  py::class_<Injection>(m, "Injection", "UWB took over from scans.")
      .def_readonly("stamp", &Injection::stamp)
      .def_readonly("doubt", &Injection::doubt)
      .def_readonly("before", &Injection::before, "With the covariance of all particles.")
      .def_readonly("after", &Injection::after, "By UWB.")
      .def("__repr__",
           [](const Injection& i) { return "Injection(stamp=" + std::to_string(i.stamp) + ")"; });
  py::class_<SwitchingMcl>(m, "SwitchingMcl",
                           R"(An Mcl that UWB rescues (celan2017, sections III.C and V.B).

Scans alone tell of the pose while they leave no doubt; where they do, the pose by UWB and odometry
becomes the particles' belief (docs/models/switching_mcl.md). Ranges and fixes go to a
RecoveringEkf beside the particles, which starts by itself and knows when it is lost.

Parameters
----------
config : SwitchingMclConfig
mcl : Mcl
    Is copied, as is `uwb`.
uwb : RecoveringEkf

Raises
------
ValueError
    If the config is out of range, or a threshold could fire for ever: `sure` must lie below
    `unsure`, and a pose by UWB that is of use must be sure.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> cells = np.full((60, 80), 0, dtype=np.int8)
>>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
>>> mcl = Mcl(MclConfig(), OccupancyGrid(cells, resolution=0.05))  # anywhere in a room of 4 x 3 m
>>> uwb = RecoveringEkf(RecoveringEkfConfig())
>>> uwb.start_at(PoseEstimate(0, Pose2(1.0, 1.0, 0.0), np.diag([0.1, 0.1, 0.1]) ** 2))
>>> switching = SwitchingMcl(SwitchingMclConfig(), mcl, uwb)
>>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
>>> for second in range(4):
...     _ = switching.on(Velocity(second * 10**9, 0.0, 0.0))
...     _ = switching.on(PositionFix(second * 10**9, [1.0, 1.0], 0.01 * np.eye(2)))
...     _ = switching.on(LaserScan(second * 10**9, around, [2.95, 1.95, 0.95, 0.95]))
>>> [(i.doubt.name, i.stamp // 10**9) for i in switching.injections]
[('UNCERTAIN', 2)]
)")
      .def(py::init<const Config&, locfuse::Mcl, locfuse::RecoveringEkf>(), py::arg("config"),
           py::arg("mcl"), py::arg("uwb"))
      .def("on", py::overload_cast<const locfuse::Velocity&>(&SwitchingMcl::on), py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Increment&>(&SwitchingMcl::on),
           py::arg("message"))
      .def("on", py::overload_cast<const locfuse::Range&>(&SwitchingMcl::on), py::arg("message"))
      .def("on", py::overload_cast<const locfuse::PositionFix&>(&SwitchingMcl::on),
           py::arg("message"))
      .def("on", unlocked_on<SwitchingMcl, locfuse::PoseObservation>(), py::arg("message"))
      .def("on", unlocked_on<SwitchingMcl, locfuse::RangeBearing>(), py::arg("message"))
      .def("on", unlocked_on<SwitchingMcl, locfuse::LaserScan>(), py::arg("message"),
           "Takes one message. Ranges and fixes go to UWB's filter, all else weighs particles.")
      .def("estimate", &SwitchingMcl::estimate,
           "Of the particles, carried to the end of what odometry has told.")
      .def("health", &SwitchingMcl::health,
           "How far that may be trusted, by what particles were weighed with.")
      .def_property_readonly(
          "sources", [](const SwitchingMcl& s) { return s.mcl().sources(); },
          "A SourceStatus for each that weighs particles.")
      .def_property_readonly(
          "mcl", [](const SwitchingMcl& s) { return s.mcl(); }, "A snapshot of the particles.")
      .def_property_readonly(
          "uwb", [](const SwitchingMcl& s) { return s.uwb(); }, "A snapshot of UWB's filter.")
      .def_property_readonly("uwb_nis", &SwitchingMcl::uwb_nis,
                             "NIS of the last ranges or fixes per row, on average: 1 where UWB's "
                             "filter is right.")
      .def_property_readonly("injections", &SwitchingMcl::injections,
                             "When UWB took over, a list of Injection.")
      .def_property_readonly(
          "hypotheses", [](const SwitchingMcl& s) { return s.mcl().hypotheses(); },
          "Clusters of particles, a list of PoseHypothesis, the likeliest first.")
      .def_property_readonly(
          "ready", [](const SwitchingMcl& s) { return s.mcl().ready(); },
          "Whether one cluster of particles is all but certain.")
      .def(
          "__copy__", [](const SwitchingMcl& s) { return s; }, "A snapshot.")
      .def(
          "__deepcopy__", [](const SwitchingMcl& s, const py::object& /*memo*/) { return s; },
          py::arg("memo"))
      .def("__repr__", [](const SwitchingMcl& s) {
        return "SwitchingMcl(" + std::to_string(s.mcl().belief().size) + " particles, " +
               std::to_string(s.injections().size()) + " injections)";
      });
}
