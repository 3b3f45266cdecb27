// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "checks.hpp"
#include "worlds.hpp"

/// Timeline with messages in any order: without clock jumps its belief equals bit for bit that
/// after the sorted messages, except those rejected or older than the history.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  const PoseEkf fresh({}, testing::hall(), testing::one_tag(), fuzz::start(),
                      {fuzz::poles(), Pose2{}});
  fuzz::Reader io(data, size);
  Stamp now = 0;
  Stamp history = 0;
  code(io, history, now);
  TimelineOptions options;
  code(io, options);
  std::optional<Timeline<PoseEkf>> timeline;
  if (!fuzz::returns([&] { timeline.emplace(fresh, history, options); })) {
    return 0;
  }
  now = 0;
  std::vector<Message> accepted;
  Stamp newest = -kStampLimit;
  while (!io.empty() && accepted.size() < 400) {
    const auto message = fuzz::read<Message>(io, now);
    const Stamp stamp = effective_stamp(message);
    const bool returned =
        fuzz::returns([&] { timeline->on(message, [](std::size_t, const Outcome&) {}); });
    fuzz::require_sound(timeline->estimator().belief());
    if (returned && (accepted.empty() || stamp >= newest ||
                     (stamp > -kStampLimit && newest - stamp <= history))) {
      accepted.push_back(message);
      newest = std::max(newest, stamp);
    }
  }
  if (timeline->jumps() > 0) {
    timeline->reset();
    fuzz::require(testing::same_bits(timeline->estimator().belief(), fresh.belief()),
                  "reset restores the initial state");
    return 0;
  }
  std::stable_sort(accepted.begin(), accepted.end(), [](const Message& a, const Message& b) {
    return effective_stamp(a) < effective_stamp(b);
  });
  PoseEkf sorted = fresh;
  for (const Message& message : accepted) {
    sorted.on(message);
  }
  fuzz::require(testing::same_bits(timeline->estimator().belief(), sorted.belief()),
                "late messages are fused at their stamp");
  return 0;
}
