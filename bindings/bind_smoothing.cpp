// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "columns.hpp"
#include "locfuse/replay/replay.hpp"
#include "locfuse/smoothing/smoother.hpp"
#include "locfuse/smoothing/survey.hpp"
#include "progress.hpp"
#include "shared_log.hpp"

namespace py = pybind11;
using locfuse::Smoothed;

namespace {

/// One more than the place of the last odometry that takes effect up to a stamp; 0 without any.
std::size_t odometry_at(const locfuse::MessageLog& log, const std::vector<bool>& replaced,
                        locfuse::Stamp stamp) {
  std::size_t found = 0;
  locfuse::Stamp latest = std::numeric_limits<locfuse::Stamp>::min();
  for (std::size_t i = 0; i < log.arrivals().size(); ++i) {
    const locfuse::Message& message = log.arrivals()[i].message;
    const bool counts = replaced.empty() || !replaced[i];
    if (counts && source_of(message) == locfuse::Source::kOdometry &&
        effective_stamp(message) <= stamp && effective_stamp(message) >= latest) {
      latest = effective_stamp(message);
      found = i + 1;
    }
  }
  return found;
}

Smoothed smooth(const locfuse::PoseEkf::Config& config, const locfuse::World& world,
                const locfuse::PoseEstimate& start, SharedLog& log,
                std::optional<locfuse::Stamp> used_until, double keyframe_s, int max_iterations,
                std::vector<locfuse::UncertainPlace> anchors,
                std::vector<locfuse::UncertainPlace> landmarks,
                std::vector<locfuse::UncertainPlace> tags) {
  const Use use(log, Use::Kind::kRead);
  const locfuse::SmootherConfig settings{
      config,         keyframe_s, max_iterations, std::move(anchors), std::move(landmarks),
      std::move(tags)};
  const py::gil_scoped_release release;
  std::vector<locfuse::Message> messages;
  std::vector<std::size_t> places;  // of them in the log
  messages.reserve(log.log.arrivals().size());
  const std::vector<bool> replaced = log.log.replaced();
  const std::size_t under_way = used_until ? odometry_at(log.log, replaced, *used_until) : 0;
  for (std::size_t i = 0; i < log.log.arrivals().size(); ++i) {
    if (!replaced.empty() && replaced[i]) {
      continue;
    }
    locfuse::Message message = log.log.arrivals()[i].message;
    if (used_until && i + 1 == under_way) {
      if (auto* velocity = std::get_if<locfuse::Velocity>(&message)) {
        velocity->stamp = std::max(velocity->stamp, start.stamp);
      }
      messages.push_back(message);
      places.push_back(i);
    } else if (!used_until || effective_stamp(message) > *used_until) {
      messages.push_back(message);
      places.push_back(i);
    }
  }
  Smoothed found = locfuse::smooth(settings, world, start, messages);
  std::vector<locfuse::Outcome> outcomes(log.log.arrivals().size());  // kIgnored
  for (std::size_t i = 0; i < replaced.size(); ++i) {
    outcomes[i].reason = replaced[i] ? locfuse::Reason::kReplaced : locfuse::Reason::kNone;
  }
  for (std::size_t k = 0; k < places.size(); ++k) {
    outcomes[places[k]] = found.outcomes[k];
  }
  found.outcomes = std::move(outcomes);
  return found;
}

locfuse::Survey survey(const locfuse::PoseEkf::Config& config, const locfuse::World& world,
                       const locfuse::PoseEstimate& start, SharedLog& log,
                       std::vector<locfuse::KnownHeight> heights,
                       std::vector<locfuse::UncertainPlace> tags,
                       const std::optional<locfuse::SurveyProgress>& progress) {
  const Use use(log, Use::Kind::kRead);
  locfuse::SurveyConfig settings;
  settings.smoother.estimator = config;
  settings.smoother.tags = std::move(tags);
  settings.heights = std::move(heights);
  const py::gil_scoped_release release;
  return locfuse::survey(settings, world, start, messages_of(log.log), with_gil(progress));
}

/// The run of a filter with what the smoother says in place of its estimates and outcomes.
locfuse::RunLog in_place_of(const Smoothed& smoothed, locfuse::RunLog run) {
  run.outcomes = smoothed.outcomes;
  run.estimates = smoothed.poses;
  run.last = smoothed.poses.back();
  run.errors = smoothed.errors;
  return run;
}

void bind_places(py::module_& m) {
  using locfuse::UncertainPlace;
  py::class_<UncertainPlace>(
      m, "UncertainPlace",
      "A place that is found together with the poses; the world has the guess to start from.")
      .def(py::init([](locfuse::Id id, const locfuse::Vector<3>& mean,
                       const locfuse::Vector<3>& sigma_m, double guess_sigma_m) {
             return UncertainPlace{id, mean, sigma_m, guess_sigma_m};
           }),
           py::arg("id"), py::arg("mean"), py::arg("sigma_m"), py::arg("guess_sigma_m") = 0.0,
           R"(Create the place of an anchor, a landmark or a tag.

Parameters
----------
id : int
    Of the anchor, landmark or tag, as in the world.
mean : array_like, shape (3,)
    What is known of it before anything is measured: in world [m], of a tag in body.
sigma_m : array_like, shape (3,)
    Standard deviation of that, per axis; 0: the world is right. Of landmarks and tags the third is
    not used.
guess_sigma_m : float
    How far off the world's place may be, for the first guess of the poses.
)")
      .def_readonly("id", &UncertainPlace::id)
      .def_readonly("mean", &UncertainPlace::mean)
      .def_readonly("sigma_m", &UncertainPlace::sigma_m)
      .def_readonly("guess_sigma_m", &UncertainPlace::guess_sigma_m);
}

void bind_survey(py::module_& m) {
  using locfuse::KnownHeight;
  using locfuse::Survey;
  using locfuse::SurveyedAnchor;
  using locfuse::SurveyStatus;
  py::enum_<SurveyStatus>(m, "SurveyStatus", "How well the place of a surveyed anchor is known.")
      .value("PLACED", SurveyStatus::kPlaced, "one place fits")
      .value("TWO_PLACES", SurveyStatus::kTwoPlaces, "its mirror image fits as well")
      .value("NOT_PLACED", SurveyStatus::kNotPlaced,
             "its ranges leave a whole curve, or most are rejected");
  py::class_<KnownHeight>(m, "KnownHeight", "The height of an anchor, where it is known.")
      .def(py::init([](locfuse::Id anchor, double height_m, double sigma_m) {
             return KnownHeight{anchor, height_m, sigma_m};
           }),
           py::arg("anchor"), py::arg("height_m"), py::arg("sigma_m") = 0.0,
           "Height in world [m]; a sigma of 0: it is exact.")
      .def_readonly("anchor", &KnownHeight::anchor)
      .def_readonly("height_m", &KnownHeight::height_m)
      .def_readonly("sigma_m", &KnownHeight::sigma_m);
  py::class_<SurveyedAnchor>(m, "SurveyedAnchor", "An anchor that ranges name.")
      .def_readonly("anchor", &SurveyedAnchor::anchor,
                    "In the frame of the start; its place means nothing if it is NOT_PLACED.")
      .def_readonly("covariance", &SurveyedAnchor::covariance, "Of its place, 3x3 [m^2].")
      .def_readonly("status", &SurveyedAnchor::status)
      .def_readonly("ranges", &SurveyedAnchor::ranges, "To it, from the start on.")
      .def_readonly("rejected", &SurveyedAnchor::rejected, "Of those, that are judged wrong.")
      .def_readonly("other", &SurveyedAnchor::other, "Of TWO_PLACES the other one.");
  py::class_<Survey>(m, "Survey", "Where anchors and landmarks are.")
      .def_readonly("smoothed", &Survey::smoothed, "The drive, among what is placed.")
      .def_readonly("anchors", &Survey::anchors, "A SurveyedAnchor each, by id.")
      .def("__repr__", [](const Survey& s) {
        return "Survey(" + std::to_string(s.anchors.size()) + " anchors)";
      });
  m.def("survey", &survey, py::arg("config"), py::arg("world"), py::arg("start"), py::arg("log"),
        py::arg("heights") = std::vector<KnownHeight>{},
        py::arg("tags") = std::vector<locfuse::UncertainPlace>{}, py::arg("progress") = py::none(),
        R"(Find where anchors and landmarks are from one drive among them (docs/survey.md).

Parameters
----------
config : PoseEkfConfig
    Models, gates and noise; its calibration says how large offsets and scales of anchors may be.
world : World
    Tags; of the anchors that it has offset and scale are used, not the places.
start : PoseEstimate
    The frame of the result.
log : MessageLog
    Ranges and odometry; sightings by name, positions and poses as far as there are.
heights : list of KnownHeight
    Anchors without one are found in space, above the tags.
tags : list of UncertainPlace
    Of the world's those whose places on the body are found, too.
progress : callable, optional
    Called with the share that is done, 0 to 1.

Returns
-------
Survey

Raises
------
ValueError
    If the config is out of range, or no range and no sighting names anything.
NumericalError
    If the solver fails.

Examples
--------
>>> import numpy as np
>>> from locfuse.core import *
>>> log, angle = MessageLog(), np.linspace(0.0, 6.0, 61)
>>> stamp = (angle * 1e9).astype(np.int64)
>>> at = np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])  # a circle from the origin
>>> log.add_velocities(stamp, np.ones(61), np.ones(61))
>>> log.add_ranges(stamp, np.zeros(61, np.int32), np.zeros(61, np.int32),
...                np.hypot(*(at - [4.0, 3.0]).T), np.full(61, 0.1))
>>> start = PoseEstimate(0, Pose2(0, 0, 0), 1e-6 * np.eye(3))
>>> world = World(tags=[Tag(0, [0.0, 0.0, 0.0])])
>>> found = survey(PoseEkfConfig(), world, start, log, [KnownHeight(0, 0.0)])
>>> found.anchors[0].status.name, np.round(found.anchors[0].anchor.position, 1).tolist()
('PLACED', [4.0, 3.0, 0.0])
)");
}

}  // namespace

void bind_smoothing(py::module_& m) {
  bind_places(m);
  py::class_<Smoothed> bound(m, "Smoothed", "What all messages of a log together say.");
  bind_outcome_columns(bound);
  bind_estimate_columns(
      bound, [](const Smoothed& s) -> const auto& { return s.poses; });
  bound.def_readonly("errors", &Smoothed::errors, "A CalibratedError per offset, per scale.")
      .def_readonly("anchors", &Smoothed::anchors, "Those of the world, where they were found.")
      .def_readonly("landmarks", &Smoothed::landmarks, "The same of landmarks.")
      .def_readonly("tags", &Smoothed::tags, "The same of tags.")
      .def_readonly("places_covariance", &Smoothed::places_covariance,
                    "Of (x, y, z) of each anchor, (x, y) of each landmark and (forward, left) of "
                    "each tag [m^2].")
      .def_readonly("initial_cost", &Smoothed::initial_cost)
      .def_readonly("cost", &Smoothed::cost, "Half the sum of squared residuals in sigmas.")
      .def_readonly("iterations", &Smoothed::iterations)
      .def_readonly("converged", &Smoothed::converged)
      .def_readonly("termination", &Smoothed::termination, "What the solver said last.")
      .def("in_place_of", &in_place_of, py::arg("run"),
           "RunLog of a filter with these estimates and outcomes instead of its own.")
      .def("__repr__", [](const Smoothed& s) {
        return "Smoothed(" + std::to_string(s.poses.size()) + " poses, cost " +
               std::to_string(s.cost) + ")";
      });
  m.def("smooth", &smooth, py::arg("config"), py::arg("world"), py::arg("start"), py::arg("log"),
        py::arg("used_until") = py::none(),
        py::arg("keyframe_s") = locfuse::SmootherConfig{}.keyframe_s,
        py::arg("max_iterations") = locfuse::SmootherConfig{}.max_iterations,
        py::arg("anchors") = std::vector<locfuse::UncertainPlace>{},
        py::arg("landmarks") = std::vector<locfuse::UncertainPlace>{},
        py::arg("tags") = std::vector<locfuse::UncertainPlace>{},
        R"(Find all poses of a log at once, by all of its messages (docs/smoothing.md).

Parameters
----------
config : PoseEkfConfig
    Models, gates and noise.
world : World
start : PoseEstimate
log : MessageLog
used_until : int, optional
    Messages that take effect up to this stamp were used for the start and stay IGNORED [ns].
keyframe_s : float
    Without measurements there is a pose at least so often [s].
max_iterations : int
    Of the solver, each time it is called.
anchors, landmarks, tags : list of UncertainPlace
    Of the world's those whose places are found, too.

Returns
-------
Smoothed
    Poses at the stamps of measurements, and between.

Raises
------
ValueError
    If the config is out of range, or nothing was measured after the start.
NumericalError
    If the solver fails.

Examples
--------
>>> import numpy as np
>>> from locfuse.core import *
>>> log = MessageLog()
>>> log.add_velocities([0], [1.0], [0.0])
>>> log.add_positions([2 * 10**9], [[2.2, 0.0]], [0.1])
>>> start = PoseEstimate(0, Pose2(0, 0, 0), 0.01 * np.eye(3))
>>> batch = smooth(PoseEkfConfig(), World(), start, log)
>>> bool(batch.poses[0, 0] > 0.0 and batch.poses[-1, 0] > 2.0)
True
)");
  bind_survey(m);
}
