// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "checks.hpp"
#include "worlds.hpp"

/// Timeline with messages in any order: without clock jumps its belief equals bit for bit that
/// after the sorted messages, except those rejected, older than the history or far ahead.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  const PoseEkf fresh({}, {testing::hall(), testing::one_tag(), {fuzz::poles(), {}}},
                      fuzz::start());
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
  std::vector<Message> messages;
  std::vector<Verdict> verdicts;  // the last of each
  while (!io.empty() && messages.size() < internal::MessageHistory<PoseEkf>::kMaxOfInstant) {
    messages.push_back(fuzz::read<Message>(io, now));
    verdicts.push_back(Verdict::kIgnored);
    bool is_confirmed = false;  // what was held as far ahead
    const auto sink = [&](std::size_t index, const Outcome& outcome) {
      is_confirmed =
          is_confirmed || (index + 1 < messages.size() && verdicts[index] == Verdict::kIgnored &&
                           outcome.verdict != Verdict::kIgnored);
      verdicts[index] = outcome.verdict;
    };
    const bool returned = fuzz::returns([&] { timeline->on(messages.back(), sink); });
    fuzz::require_sound(timeline->estimator().belief());
    if (!returned && is_confirmed) {
      return 0;  // which of them was refused is not known
    }
    if (!returned) {
      verdicts.back() = Verdict::kIgnored;
    }
  }
  if (timeline->jumps() > 0) {
    timeline->reset();
    fuzz::require(testing::same_bits(timeline->estimator().belief(), fresh.belief()),
                  "reset restores the initial state");
    return 0;
  }
  std::vector<Message> accepted;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    if (verdicts[i] != Verdict::kIgnored && verdicts[i] != Verdict::kStale) {
      accepted.push_back(messages[i]);
    }
  }
  fuzz::sort_for_fusion(accepted);
  PoseEkf sorted = fresh;
  for (const Message& message : accepted) {
    sorted.on(message);
  }
  fuzz::require(testing::same_bits(timeline->estimator().belief(), sorted.belief()),
                "late messages are fused at their stamp");
  return 0;
}
