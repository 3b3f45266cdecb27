// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/start.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>

#include "locfuse/error.hpp"

namespace locfuse {

StartSearch::StartSearch(Initializer initializer, Stamp patience)
    : initializer_(std::move(initializer)), patience_(patience), state_(initializer_.state()) {
  if (patience < 0 || patience > kStampLimit) {
    throw std::invalid_argument("patience is " + std::to_string(patience) +
                                " ns, expected 0 to kStampLimit");
  }
}

void StartSearch::on(const Message& message) {
  validate_in_space(message);
  wait({effective_stamp(message), arrivals_++, message});
}

void StartSearch::on(const std::vector<MadeMotion>& motions) {
  const bool all_wait = covers_those_before(
      motions, [&](std::size_t origin) { return internal::motion_of(waiting_, origin); });
  if (!all_wait) {
    return;
  }
  for (const MadeMotion& motion : motions) {
    if (motion.again) {
      waiting_.erase(internal::find_origin(waiting_, motion.origin));
    }
  }
  for (const MadeMotion& motion : motions) {
    on(motion.message());
  }
}

bool StartSearch::is_late(const Message& message) const {
  return effective_stamp(message) <= used_until_;
}

void StartSearch::wait(Entry entry) {
  if (entry.stamp <= used_until_) {
    return;
  }
  newest_ = std::max(newest_, entry.stamp);
  internal::insert_in_order(waiting_, std::move(entry));
  use_until(newest_ - patience_ - 1);
  if (waiting_.size() > kMaxWaiting) {  // the clock stands still
    use_until(waiting_.front().stamp);
  }
}

void StartSearch::finish() { use_until(newest_); }

void StartSearch::use_until(Stamp stamp) {
  while (!is_ready() && !waiting_.empty() && waiting_.front().stamp <= stamp) {
    const auto end = std::find_if(waiting_.begin(), waiting_.end(), [&](const Entry& entry) {
      return entry.stamp != waiting_.front().stamp;
    });
    const std::vector<Entry> instant(std::make_move_iterator(waiting_.begin()),
                                     std::make_move_iterator(end));
    waiting_.erase(waiting_.begin(), end);
    use(instant);
  }
}

void StartSearch::use(const std::vector<Entry>& instant) {
  used_until_ = instant.front().stamp;
  bool has_measurement = false;
  for (const Entry& entry : instant) {
    try {
      initializer_.on(entry.message);
      // Odometry alone never makes a start ready, and reading the state costs time.
      has_measurement = has_measurement || source_of(entry.message) != Source::kOdometry;
    } catch (const std::invalid_argument&) {  // skipped: its caller has returned
    } catch (const NumericalError&) {
    }
  }
  if (has_measurement) {
    state_ = initializer_.state();
    asked_ = used_until_;
  }
}

std::vector<internal::TimelineEntry> StartSearch::waiting() const {
  std::vector<Entry> by_arrival;
  std::copy_if(waiting_.begin(), waiting_.end(), std::back_inserter(by_arrival),
               [](const Entry& e) { return source_of(e.message) != Source::kScans; });
  std::sort(by_arrival.begin(), by_arrival.end(),
            [](const Entry& a, const Entry& b) { return a.index < b.index; });
  return by_arrival;
}

StartRun find_start(Initializer& initializer, const MessageLog& log,
                    const std::vector<LaserScan>& scans) {
  const std::vector<MessageLog::Arrival>& arrivals = log.arrivals();
  const std::vector<bool> replaced = log.replaced();
  std::vector<std::size_t> messages;
  for (std::size_t i = 0; i < arrivals.size(); ++i) {
    if (replaced.empty() || !replaced[i]) {
      messages.push_back(i);
    }
  }
  std::stable_sort(messages.begin(), messages.end(), [&](std::size_t a, std::size_t b) {
    return effective_stamp(arrivals[a].message) < effective_stamp(arrivals[b].message);
  });
  StartSearch search(initializer, 0);
  StartRun run;
  Stamp seen = search.asked();
  const auto look = [&] {
    const Initializer::State& state = search.state();
    const bool is_new = run.steps.empty() || run.steps.back().state.status != state.status ||
                        run.steps.back().state.hypotheses.size() != state.hypotheses.size();
    if (search.asked() != std::exchange(seen, search.asked()) && is_new) {
      run.steps.push_back({seen, state});
    }
  };
  std::size_t message = 0;
  std::size_t scan = 0;
  while (!search.is_ready() && (message < messages.size() || scan < scans.size())) {
    const bool takes_message =
        scan == scans.size() ||
        (message < messages.size() &&
         effective_stamp(arrivals[messages[message]].message) <= scans[scan].stamp);
    if (takes_message) {
      search.on(arrivals[messages[message++]].message);
    } else {
      search.on(scans[scan++]);
    }
    look();
  }
  search.finish();
  look();
  initializer = search.initializer();
  run.used_until = search.used_until();
  return run;
}

}  // namespace locfuse
