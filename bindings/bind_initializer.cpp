// SPDX-License-Identifier: Apache-2.0
#include <pybind11/native_enum.h>

#include "alone.hpp"
#include "bindings.hpp"
#include "locfuse/recovery/initializer.hpp"

namespace py = pybind11;
using locfuse::Initializer;
using locfuse::StartStatus;

void bind_initializer(py::module_& m) {
  py::native_enum<StartStatus>(m, "StartStatus", "enum.Enum", "Progress of the initialization.")
      .value("WAITING", StartStatus::kWaiting)
      .value("AMBIGUOUS", StartStatus::kAmbiguous)
      .value("READY", StartStatus::kReady)
      .finalize();
  using locfuse::StartMethod;
  py::native_enum<StartMethod>(m, "StartMethod", "enum.Enum", "Search of an initialization.")
      .value("GAUSSIAN_SUM", StartMethod::kGaussianSum, "Hypotheses weighted by all messages.")
      .value("SRLS_HEADINGS", StartMethod::kSrlsHeadings,
             "ekim2020: SR-LS on the ranges of an instant, then 36 headings of one scan.")
      .finalize();
  using State = Initializer::State;
  py::class_<State>(m, "StartState", "State of an Initializer.")
      .def_readonly("status", &State::status)
      .def_readonly("reason", &State::reason, "Why it is not ready; empty if ready.")
      .def_readonly("hypotheses", &State::hypotheses, "Pose hypotheses, likeliest first.")
      .def_readonly("headings", &State::headings,
                    "HeadingSearch of the last scan with SRLS_HEADINGS, else None.")
      .def("__repr__", [](const State& s) {
        return "StartState(" + std::to_string(s.hypotheses.size()) + " hypotheses)";
      });
  using Config = Initializer::Config;
  py::class_<Config>(m, "InitializerConfig",
                     "Settings of an Initializer: readiness thresholds and outlier model.")
      .def(py::init<>())
      .def_readwrite("estimator", &Config::estimator,
                     "PoseEkfConfig of the hypotheses, and of the filter to continue with.")
      .def_readwrite("tag_conditioner", &Config::tag_conditioner,
                     "TagConditionerConfig of the fixes of tags before they are used, or None.")
      .def_readwrite("method", &Config::method)
      .def_readwrite("epoch_s", &Config::epoch_s)
      .def_readwrite("headings", &Config::headings)
      .def_readwrite("wrong_share", &Config::wrong_share)
      .def_readwrite("wrong_span_m", &Config::wrong_span_m)
      .def_readwrite("spacing_m", &Config::spacing_m)
      .def_readwrite("spacing_heading_rad", &Config::spacing_heading_rad)
      .def_readwrite("sigma_map_m", &Config::sigma_map_m)
      .def_readwrite("sigma_map_rad", &Config::sigma_map_rad)
      .def_readwrite("standing_ranges", &Config::standing_ranges)
      .def_readwrite("probability_ready", &Config::probability_ready)
      .def_readwrite("sigma_xy_ready_m", &Config::sigma_xy_ready_m)
      .def_readwrite("sigma_heading_ready_rad", &Config::sigma_heading_ready_rad)
      .def_readwrite("watch_poses", &Config::watch_poses,
                     "Whether poses are judged by a PoseWatch, and not used.");
  py::class_<Initializer>(m, "Initializer",
                          R"(Estimates the initial pose without a prior.

Gaussian sum: one PoseEkf per position that the first ranges allow and per heading, weighted by the
likelihood of the messages that follow (docs/start.md; ekim2020, section 2.2).

Parameters
----------
config : InitializerConfig
world : World
    Without a matcher the heading follows from motion.

Raises
------
ValueError
    If a config is out of range.

Examples
--------
>>> from locfuse import *
>>> anchors = AnchorMap([Anchor(1, [0, 0, 1]), Anchor(2, [8, 0, 1]), Anchor(3, [4, 6, 1])])
>>> start = Initializer(InitializerConfig(), World(anchors, [Tag(0, [0, 0, 1])]))
>>> start.state().status.name
'WAITING'
)")
      .def(py::init<const Config&, const locfuse::World&>(), py::arg("config"), py::arg("world"))
      .def("on", on_message<Initializer, locfuse::LaserScan>(), py::arg("message"),
           "Processes one message.")
      .def("state", &Initializer::state)
      .def("estimator", &Initializer::estimator,
           "The PoseEkf to continue with.\n\nRaises\n------\nValueError\n    If the state is not "
           "READY.")
      .def("__repr__", [](const Initializer& i) {
        return "Initializer(" + std::to_string(i.state().hypotheses.size()) + " hypotheses)";
      });
}
