// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "health.hpp"
#include "locfuse/replay/live.hpp"
#include "settings.hpp"

namespace {

using namespace locfuse;

void require_sound(const fuzz::Reader& io, const RecoveringEkf& robot) {
  fuzz::require_sound(robot.health());
  fuzz::require_sound(robot.sources());
  if (robot.estimator() != nullptr) {
    fuzz::require_sound(robot.estimator()->belief());
  } else {
    fuzz::require(robot.is_lost(), "an estimator that has not started is lost");
  }
  double total = 0.0;
  const Initializer::State state = robot.state();
  for (const PoseHypothesis& hypothesis : state.hypotheses) {
    fuzz::require_covariance(io, hypothesis.estimate.covariance);
    fuzz::require(hypothesis.probability >= 0.0, "a probability is not negative");
    total += hypothesis.probability;
  }
  fuzz::require(total <= 1.0 + 1e-9, "probabilities of hypotheses sum to at most 1");
}

/// Sends arbitrary input to the estimator alone.
void send(fuzz::Reader& io, RecoveringEkf& robot, std::uint8_t call, Stamp& now) {
  if (call == 1) {
    std::vector<RangeBearing> sightings;
    for (int i = 0; i < 3; ++i) {
      sightings.push_back(fuzz::read<RangeBearing>(io, now));
      sightings.back().stamp = sightings.front().stamp;
    }
    robot.on_joint(sightings);
  } else if (call == 3 && robot.estimator() != nullptr) {
    robot = robot.restarted(fuzz::read_start(io));
    now = robot.current().stamp;
  } else {
    robot.on(fuzz::read<Message>(io, now));
  }
}

/// Sends arbitrary input to the estimator inside a Live.
void send(fuzz::Reader& io, Live& robot, std::uint8_t call, Stamp& now) {
  if (call == 1) {
    std::uint8_t source = 0;
    code(io, source, static_cast<int>(kSources));
    bool enabled = false;
    code(io, enabled);
    robot.enable(static_cast<Source>(source), enabled);
  } else if (call == 3) {
    bool is_all = false;
    code(io, is_all);
    is_all ? robot.reset() : robot.relocalize();
  } else {
    robot.on(fuzz::read<Message>(io, now));
  }
}

const RecoveringEkf& estimator_of(const RecoveringEkf& robot) { return robot; }
const RecoveringEkf& estimator_of(const Live& robot) { return robot.estimator(); }

/// Numbers of all hypotheses, for comparison.
std::vector<double> hypotheses_of(const RecoveringEkf& robot) {
  std::vector<double> numbers;
  for (const PoseHypothesis& hypothesis : robot.state().hypotheses) {
    const auto& [stamp, pose, covariance] = hypothesis.estimate;
    numbers.insert(numbers.end(), {static_cast<double>(stamp), pose.x, pose.y, pose.heading,
                                   covariance(0, 0), hypothesis.probability});
  }
  return numbers;
}

/// No anchors, the corners of a hall, or a line of anchors, which leaves a mirror ambiguity.
std::shared_ptr<const AnchorMap> anchors_of(int which) {
  static const auto none = std::make_shared<const AnchorMap>();
  static const auto line = std::make_shared<const AnchorMap>(std::vector<Anchor>{
      {0, {-4.0, 0.0, 1.0}}, {1, {0.0, 0.0, 1.0}}, {2, {4.0, 0.0, 1.0}}, {3, {8.0, 0.0, 1.0}}});
  return which == 1 ? none : which == 2 ? line : testing::hall();
}

template <class Robot>
void run(fuzz::Reader& io, Robot& robot) {
  Stamp now = 0;
  for (int calls = 0; !io.empty() && calls < 100; ++calls) {
    std::uint8_t call = 0;
    code(io, call, 10);
    const std::vector<double> before = hypotheses_of(estimator_of(robot));
    const bool returned = fuzz::returns([&] {
      if (call == 0) {
        robot.on(fuzz::read<LaserScan>(io, now));
      } else if (call == 2) {
        const PoseEstimate start = fuzz::read_start(io);
        robot.start_at(start);
        now = start.stamp;
      } else {
        send(io, robot, call, now);
      }
    });
    require_sound(io, estimator_of(robot));
    if constexpr (std::is_same_v<Robot, RecoveringEkf>) {
      fuzz::require(returned || before == hypotheses_of(robot), "rejected input changes nothing");
    }
  }
}

}  // namespace

/// RecoveringEkf with arbitrary settings and messages, alone or inside a Live: it initializes or is
/// started, tracks, gets lost, relocalizes, and reports its health.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto matcher = std::make_shared<const ScanMatcher>(fuzz::small_room());
  fuzz::Reader io(data, size);
  RecoveringEkf::Config config;
  config.start.headings = 12;
  fuzz::read_if_unusual(io, config.start.estimator);
  std::uint8_t world = 0;
  code(io, world, 8);
  const bool live = world % 2 == 1;
  code(io, config.restart);
  code(io, config.health);
  code(io, config.start.estimator);
  fuzz::returns([&] {
    RecoveringEkf robot(
        config,
        {anchors_of(world / 2), testing::one_tag(), {fuzz::poles(), {0.2, 0.0, 0.1}}, {}, matcher});
    if (live) {
      Live::Options options;
      Stamp zero = 0;
      code(io, options.history, zero);
      zero = 0;
      code(io, options.patience, zero);
      code(io, options.timeline);
      Live running(std::move(robot), options);
      run(io, running);
    } else {
      run(io, robot);
    }
  });
  return 0;
}
