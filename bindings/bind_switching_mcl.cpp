// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/particles/switching_mcl.hpp"
#include "particles.hpp"

namespace py = pybind11;
using locfuse::SwitchingMcl;

void bind_switching_mcl(py::module_& m) {
  using Config = SwitchingMcl::Config;
  using InjectionReason = SwitchingMcl::InjectionReason;
  using Injection = SwitchingMcl::Injection;
  py::native_enum<InjectionReason>(m, "InjectionReason", "enum.Enum", "Reason to distrust scans.")
      .value("NONE", InjectionReason::kNone, "Scans are trusted.")
      .value("UNCERTAIN", InjectionReason::kUncertain, "The particles have spread out.")
      .value("ELSEWHERE", InjectionReason::kElsewhere, "The particles disagree with the UWB pose.")
      .finalize();
  py::class_<Config>(m, "SwitchingMclConfig", "Thresholds at which UWB takes over from scans.")
      .def(py::init<>())
      .def_readwrite(
          "sigma_unsure_m", &Config::sigma_unsure_m,
          "Particle spread along the worst direction above which scans are distrusted [m].")
      .def_readwrite("sigma_sure_m", &Config::sigma_sure_m,
                     "Particle spread below which scans are trusted again [m].")
      .def_readwrite("sigma_unsure_rad", &Config::sigma_unsure_rad,
                     "The same for the heading [rad].")
      .def_readwrite("sigma_sure_rad", &Config::sigma_sure_rad)
      .def_readwrite(
          "elsewhere_m", &Config::elsewhere_m,
          "Distance from the UWB pose, beyond three sigmas, above which scans are distrusted [m].")
      .def_readwrite("elsewhere_rad", &Config::elsewhere_rad, "The same for the heading [rad].")
      .def_readwrite("doubt_s", &Config::doubt_s,
                     "Minimum duration of distrust before UWB takes over [s].")
      .def_readwrite("uwb_sigma_m", &Config::uwb_sigma_m,
                     "Maximum position sigma of a usable UWB pose [m].")
      .def_readwrite("uwb_sigma_rad", &Config::uwb_sigma_rad,
                     "Maximum heading sigma of a usable UWB pose [rad].")
      .def_readwrite("uwb_age_s", &Config::uwb_age_s,
                     "Maximum time since the last fused range or fix [s].")
      .def_readwrite("uwb_nis", &Config::uwb_nis,
                     "Maximum mean NIS per row of the last ranges or fixes.")
      .def_readwrite("share", &Config::share, "Fraction of the particles that is replaced.");
  py::class_<Injection>(m, "Injection", "Event at which UWB took over from scans.")
      .def_readonly("stamp", &Injection::stamp)
      .def_readonly("reason", &Injection::reason)
      .def_readonly("before", &Injection::before,
                    "PoseEstimate before, with the covariance of all particles.")
      .def_readonly("after", &Injection::after, "PoseEstimate after, from UWB.")
      .def("__repr__",
           [](const Injection& i) { return "Injection(stamp=" + std::to_string(i.stamp) + ")"; });
  py::class_<SwitchingMcl> bound(m, "SwitchingMcl",
                                 R"(Mcl that UWB relocalizes (celan2017, sections III.C and V.B).

Scans alone determine the pose while they are trusted; otherwise the pose from UWB and odometry
becomes the particles' belief (docs/models/particles.md). Ranges and fixes go to a
RecoveringEkf that runs in parallel, initializes itself and detects when it is lost.

Parameters
----------
config : SwitchingMclConfig
mcl : Mcl
    Copied, as is `uwb`.
uwb : RecoveringEkf

Raises
------
ValueError
    If the config is out of range, or UWB could take over endlessly: `sigma_sure_*` must be below
    `sigma_unsure_*`, and a usable UWB pose must satisfy `sigma_sure_*`.

Examples
--------
>>> import numpy as np
>>> from locfuse import *
>>> cells = np.full((60, 80), 0, dtype=np.int8)
>>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
>>> grid = OccupancyGrid(cells, resolution=0.05)  # a room of 4 x 3 m
>>> mcl = Mcl(MclConfig(), World(grid=grid))  # anywhere in it
>>> uwb = RecoveringEkf(RecoveringEkfConfig(), World())
>>> uwb.start_at(PoseEstimate(0, Pose2(1.0, 1.0, 0.0), np.diag([0.1, 0.1, 0.1]) ** 2))
>>> switching = SwitchingMcl(SwitchingMclConfig(), mcl, uwb)
>>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
>>> for second in range(4):
...     _ = switching.on(Velocity(second * 10**9, 0.0, 0.0))
...     _ = switching.on(PositionFix(second * 10**9, [1.0, 1.0], 0.01 * np.eye(2)))
...     _ = switching.on(LaserScan(second * 10**9, around, [2.95, 1.95, 0.95, 0.95]))
>>> [(i.reason.name, i.stamp // 10**9) for i in switching.injections]
[('UNCERTAIN', 2)]
)");
  bind_state(bound, [](const SwitchingMcl& s) -> const locfuse::Mcl& { return s.mcl(); });
  bound
      .def(py::init<const Config&, locfuse::Mcl, locfuse::RecoveringEkf>(), py::arg("config"),
           py::arg("mcl"), py::arg("uwb"))
      .def("on",
           on_message<SwitchingMcl, locfuse::PoseObservation, locfuse::RangeBearing,
                      locfuse::LaserScan>(),
           py::arg("message"),
           "Processes one message. Ranges and fixes go to the UWB filter, all others weight "
           "particles.")
      .def_property_readonly(
          "mcl", [](const SwitchingMcl& s) { return s.mcl(); }, "Copy of the Mcl.")
      .def_property_readonly(
          "uwb", [](const SwitchingMcl& s) { return s.uwb(); }, "Copy of the UWB filter.")
      .def_property_readonly(
          "uwb_nis", &SwitchingMcl::uwb_nis,
          "Mean NIS per row of the last ranges or fixes: 1 if the UWB filter is consistent.")
      .def_property_readonly("injections", &SwitchingMcl::injections,
                             "List of Injection, one per takeover by UWB.")
      .def(
          "__copy__", [](const SwitchingMcl& s) { return s; }, "Independent copy.")
      .def(
          "__deepcopy__", [](const SwitchingMcl& s, const py::object& /*memo*/) { return s; },
          py::arg("memo"))
      .def("__repr__", [](const SwitchingMcl& s) {
        return "SwitchingMcl(" + std::to_string(s.mcl().belief().size) + " particles, " +
               std::to_string(s.injections().size()) + " injections)";
      });
}
