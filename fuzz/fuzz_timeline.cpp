// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "checks.hpp"
#include "worlds.hpp"

/// A Timeline takes messages in any order: what it believes is, bit for bit, what the sorted ones
/// make of it, less those that were refused or older than the history; as long as no clock jumps.
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
  std::vector<Message> taken;
  Stamp newest = -kStampLimit;
  while (!io.empty() && taken.size() < 400) {
    const auto message = fuzz::read<Message>(io, now);
    const Stamp stamp = effective_stamp(message);
    const bool returned =
        fuzz::returns([&] { timeline->on(message, [](std::size_t, const Outcome&) {}); });
    fuzz::require_sound(timeline->estimator().belief());
    if (returned &&
        (taken.empty() || stamp >= newest || (stamp > -kStampLimit && newest - stamp <= history))) {
      taken.push_back(message);
      newest = std::max(newest, stamp);
    }
  }
  if (timeline->jumps() > 0) {
    timeline->reset();
    fuzz::require(testing::same_bits(timeline->estimator().belief(), fresh.belief()),
                  "one that was reset is as it was made");
    return 0;
  }
  std::stable_sort(taken.begin(), taken.end(), [](const Message& a, const Message& b) {
    return effective_stamp(a) < effective_stamp(b);
  });
  PoseEkf sorted = fresh;
  for (const Message& message : taken) {
    sorted.on(message);
  }
  fuzz::require(testing::same_bits(timeline->estimator().belief(), sorted.belief()),
                "late messages are fused where they belong");
  return 0;
}
