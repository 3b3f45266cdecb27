// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "locfuse/estimators/recovering_ekf.hpp"
#include "worlds.hpp"

/// A RecoveringEkf starts by itself, tracks, is lost and starts anew, whatever it is told.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  static const auto matcher = std::make_shared<const ScanMatcher>(fuzz::small_room());
  fuzz::Reader io(data, size);
  RecoveringEkf::Config config;
  config.start.headings = 12;
  code(io, config.measurements_per_false_alarm, 2.0, 100.0);
  std::optional<RecoveringEkf> made;
  if (!fuzz::returns([&] {
        made.emplace(config, testing::hall(), testing::one_tag(), matcher,
                     LandmarkSight{fuzz::poles(), {0.2, 0.0, 0.1}});
      })) {
    return 0;
  }
  RecoveringEkf& robot = *made;
  bool starts = false;
  code(io, starts);
  Stamp now = 0;
  if (starts) {
    fuzz::returns([&] { robot.start_at(fuzz::read_start(io)); });
    now = robot.is_lost() ? 0 : robot.estimator()->belief().stamp;
  }
  while (!io.empty()) {
    std::uint8_t call = 0;
    code(io, call, 8);
    fuzz::returns([&] {
      if (call == 0) {
        robot.on(fuzz::read<LaserScan>(io, now));
      } else if (call == 1) {
        std::vector<RangeBearing> sightings;
        for (int i = 0; i < 3; ++i) {
          sightings.push_back(fuzz::read<RangeBearing>(io, now));
          sightings.back().stamp = sightings.front().stamp;
        }
        robot.on_joint(sightings);
      } else {
        robot.on(fuzz::read<Message>(io, now));
      }
    });
    if (!robot.is_lost()) {
      fuzz::require_sound(io, robot.estimator()->belief());
    }
    double total = 0.0;
    const Initializer::State state = robot.state();
    for (const PoseHypothesis& hypothesis : state.hypotheses) {
      fuzz::require_covariance(io, hypothesis.estimate.covariance);
      fuzz::require(hypothesis.probability >= 0.0, "a probability is not negative");
      total += hypothesis.probability;
    }
    fuzz::require(total <= 1.0 + 1e-9, "probabilities of hypotheses are at most 1 together");
  }
  return 0;
}
