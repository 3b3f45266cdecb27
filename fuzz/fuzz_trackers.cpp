// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "checks.hpp"
#include "health.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"
#include "support/scrubber.hpp"
#include "worlds.hpp"

namespace {

using namespace locfuse;

RecoveringEkf fresh_of(int kind) {
  RecoveringEkf::Config config;
  if (kind == 0) {
    LandmarkEkf::Config mapping;
    mapping.max_landmarks = 8;
    mapping.known = {{0, {4.0, 3.0}, {}}, {1, {-5.0, 6.0}, 0.01 * Matrix<2, 2>::Identity()}};
    config.tracker = mapping;
  } else if (kind == 1) {
    TagTriangleEkf::Config triangle;
    triangle.holds_sides = true;
    config.tracker = triangle;
    config.restart = false;
  } else {
    AirEkf::Config air;
    air.motion = AirMotion{static_cast<std::uint8_t>(kind - 2)};
    config.tracker = air;
  }
  RecoveringEkf robot(config, {testing::hall(),
                               kind == 1 ? testing::triangle() : testing::one_tag(),
                               {fuzz::poles(), {0.2, 0.0, 0.1}}});
  robot.start_at(fuzz::start());
  return robot;
}

/// What messages in the order of fusion make of an estimator, without a Timeline.
RecoveringEkf fused(RecoveringEkf robot, const std::vector<Message>& messages) {
  for (std::size_t i = 0; i < messages.size();) {
    std::vector<RangeBearing> seen;
    const auto is_seen_now = [&](const Message& m) {
      return std::holds_alternative<RangeBearing>(m) && stamp_of(m) == stamp_of(messages[i]);
    };
    std::size_t end = i;
    while (robot.fuses_jointly() && end < messages.size() && is_seen_now(messages[end])) {
      seen.push_back(std::get<RangeBearing>(messages[end++]));
    }
    fuzz::returns([&] {
      if (seen.empty()) {
        robot.on(messages[i]);
      } else {
        robot.on_joint(seen);
      }
    });
    i = std::max(end, i + 1);
  }
  return robot;
}

}  // namespace

/// Trackers of every kind in a Timeline, with messages in any order: beliefs and health stay sound,
/// and without clock jumps the belief equals bit for bit that of the messages in their order.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Reader io(data, size);
  std::uint8_t kind = 0;
  code(io, kind, 5);
  Stamp now = 0;
  Stamp history = 0;
  code(io, history, now);
  TimelineOptions options;
  code(io, options);
  const RecoveringEkf fresh = fresh_of(kind);
  std::optional<Timeline<RecoveringEkf>> timeline;
  if (!fuzz::returns([&] { timeline.emplace(fresh, history, options); })) {
    return 0;
  }
  now = 0;
  std::vector<Message> messages;
  std::vector<Verdict> verdicts;  // the last of each
  while (!io.empty() && messages.size() < 200) {
    messages.push_back(fuzz::read<Message>(io, now));
    verdicts.push_back(Verdict::kStale);
    bool is_confirmed = false;  // what was held as far ahead
    const auto sink = [&](std::size_t index, const Outcome& outcome) {
      is_confirmed =
          is_confirmed || (index + 1 < messages.size() && verdicts[index] == Verdict::kIgnored &&
                           outcome.verdict != Verdict::kIgnored);
      verdicts[index] = outcome.verdict;
    };
    const bool returned = fuzz::returns([&] { timeline->on(messages.back(), sink); });
    fuzz::require_sound(timeline->estimator().belief());
    fuzz::require_sound(timeline->estimator().health());
    if (!returned && is_confirmed) {
      return 0;  // which of them was refused is not known
    }
    if (!returned) {
      verdicts.back() = Verdict::kStale;
    }
  }
  if (timeline->jumps() > 0) {
    timeline->reset();
    fuzz::require(testing::same_bits(timeline->estimator().belief(), fresh.belief()),
                  "reset restores the initial state");
    return 0;
  }
  // What a search in space keeps is kIgnored, as what waits for others that confirm its stamp.
  if (fresh.is_in_space() && std::count(verdicts.begin(), verdicts.end(), Verdict::kIgnored) > 0) {
    return 0;
  }
  std::vector<Message> accepted;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    if (verdicts[i] != Verdict::kIgnored && verdicts[i] != Verdict::kStale) {
      accepted.push_back(messages[i]);
    }
  }
  fuzz::sort_for_fusion(accepted);
  fuzz::require(testing::same_bits(timeline->estimator().belief(), fused(fresh, accepted).belief()),
                "late messages are fused at their stamp");
  return 0;
}
