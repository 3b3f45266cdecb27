// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <vector>

#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/replay.hpp"
#include "locfuse/replay/timeline.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/scrubber.hpp"

namespace locfuse::test_timeline_joint {
namespace {

using testing::kSecond;
using testing::same_bits;

const std::vector<Vector<2>> kPosts{{4.0, 1.0}, {5.0, -1.0}, {8.0, 1.5}, {9.0, -2.0}, {12.0, 0.5}};
const PoseEstimate kStart{0, {}, 1e-4 * Matrix<3, 3>::Identity()};

RecoveringEkf mapping() {
  RecoveringEkf::Config config;
  config.tracker = LandmarkEkf::Config{};
  RecoveringEkf ekf(config, {});
  ekf.start_at(kStart);
  return ekf;
}

const LandmarkEkf& map_of(const RecoveringEkf& ekf) {
  return std::get<LandmarkEkf>(*ekf.tracker());
}

/// Straight on at 1 m/s among posts without names: five sightings an instant, ten instants a
/// second.
std::vector<Message> drive(std::uint64_t seed) {
  testing::Rng rng(seed);
  std::vector<Message> messages;
  for (int step = 0; step < 60; ++step) {
    const Stamp stamp = step * kSecond / 10;
    messages.emplace_back(Velocity{stamp, 1.0, 0.0});
    const Pose2 truth{0.1 * step, 0.0, 0.0};
    for (const Vector<2>& post : kPosts) {
      const Vector<2> d = inverse(truth).act(post);
      RangeBearing z;
      z.stamp = stamp;
      z.range = d.norm() + testing::normal(rng, 0.02);
      z.bearing = std::atan2(d.y(), d.x()) + testing::normal(rng, 0.01);
      messages.emplace_back(z);
    }
  }
  return messages;
}

using Outcomes = std::map<std::size_t, Outcome>;

Outcomes feed(Timeline<RecoveringEkf>& timeline, const std::vector<Message>& messages) {
  Outcomes outcomes;
  for (const Message& message : messages) {
    timeline.on(message, [&](std::size_t index, const Outcome& o) { outcomes[index] = o; });
  }
  return outcomes;
}

/// What `on_joint` makes of the same, an instant at a time.
LandmarkEkf directly(std::vector<Message> messages) {
  std::sort(messages.begin(), messages.end(), precedes);
  LandmarkEkf ekf({}, {}, kStart);
  for (std::size_t i = 0; i < messages.size();) {
    if (const auto* odometry = std::get_if<Velocity>(&messages[i])) {
      ekf.on(*odometry);
      ++i;
      continue;
    }
    std::vector<RangeBearing> seen;
    for (; i < messages.size() && std::holds_alternative<RangeBearing>(messages[i]); ++i) {
      seen.push_back(std::get<RangeBearing>(messages[i]));
    }
    ekf.on_joint(seen);
  }
  return ekf;
}

TEST(TimelineJoint, sightings_that_come_one_by_one_are_fused_as_one_measurement) {
  const std::vector<Message> messages = drive(1);
  Timeline<RecoveringEkf> timeline(mapping(), kSecond);
  const Outcomes outcomes = feed(timeline, messages);
  const LandmarkEkf expected = directly(messages);
  EXPECT_EQ(outcomes.size(), messages.size());
  EXPECT_EQ(expected.landmarks().size(), kPosts.size());
  EXPECT_TRUE(same_bits(map_of(timeline.estimator()).belief(), expected.belief()));
}

TEST(TimelineJoint, a_replay_gives_the_same_bits_and_outcomes) {
  const std::vector<Message> messages = drive(2);
  Timeline<RecoveringEkf> timeline(mapping(), kSecond);
  const Outcomes outcomes = feed(timeline, messages);
  MessageLog log;
  for (const Message& message : messages) {
    log.add(message);
  }
  log.sort();
  const RunLog run = replay(mapping(), log, {});
  ASSERT_EQ(run.outcomes.size(), messages.size());
  for (std::size_t i = 0; i < messages.size(); ++i) {
    EXPECT_EQ(run.outcomes[i].verdict, outcomes.at(i).verdict) << i;
  }
  EXPECT_EQ(run.landmarks.size(), kPosts.size());
  EXPECT_EQ(run.last.pose.x, timeline.estimator().estimate().pose.x);
  EXPECT_EQ(run.last.covariance, timeline.estimator().estimate().covariance);
}

TEST(TimelineJoint, late_sightings_and_late_odometry_leave_the_bits_of_the_sorted_log) {
  const std::vector<Message> messages = drive(3);
  const LandmarkEkf expected = directly(messages);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    testing::Rng rng(seed);
    std::vector<std::pair<Stamp, Message>> arrivals;
    for (const Message& message : messages) {
      const bool is_sighting = std::holds_alternative<RangeBearing>(message);
      const bool is_late = is_sighting && testing::uniform(rng, 0.0, 1.0) < 0.3;
      arrivals.emplace_back(effective_stamp(message) + (is_late ? kSecond / 2 : 0), message);
    }
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<Message> order;
    for (const auto& [arrival, message] : arrivals) {
      order.push_back(message);
    }
    Timeline<RecoveringEkf> timeline(mapping(), kSecond);
    const Outcomes outcomes = feed(timeline, order);
    EXPECT_EQ(outcomes.size(), messages.size());
    EXPECT_TRUE(same_bits(map_of(timeline.estimator()).belief(), expected.belief())) << seed;
  }
}

TEST(TimelineJoint, a_sighting_that_is_not_valid_is_forgotten_and_the_others_stay) {
  const std::vector<Message> messages = drive(4);
  Timeline<RecoveringEkf> timeline(mapping(), kSecond);
  RangeBearing bad;
  for (const Message& message : messages) {
    timeline.on(message, [](std::size_t, const Outcome&) {});
    if (const auto* seen = std::get_if<RangeBearing>(&message)) {
      bad.stamp = seen->stamp;
      bad.range = std::numeric_limits<double>::quiet_NaN();
      EXPECT_THROW(timeline.on(bad, [](std::size_t, const Outcome&) {}), std::invalid_argument);
    }
  }
  EXPECT_TRUE(same_bits(map_of(timeline.estimator()).belief(), directly(messages).belief()));
}

/// Odometry that takes effect with a measurement is fused before it, whichever comes first.
TEST(TimelineJoint, at_one_stamp_odometry_comes_first) {
  RecoveringEkf::Config config;
  config.tracker = TagTriangleEkf::Config{};
  RecoveringEkf ekf(config, {{}, testing::triangle()});
  ekf.start_at({0, {}, 0.01 * Matrix<3, 3>::Identity()});
  const Increment motion{0, kSecond, {0.3, 0.0, 0.1}};
  const PositionFix fix{0, {0.6, 0.1}, 0.01 * Matrix<2, 2>::Identity(), 10};
  Timeline<RecoveringEkf> first(ekf, kSecond);
  Timeline<RecoveringEkf> last(ekf, kSecond);
  feed(first, {motion, fix});
  feed(last, {fix, motion});
  EXPECT_TRUE(same_bits(first.estimator().belief(), last.estimator().belief()));
}

}  // namespace
}  // namespace locfuse::test_timeline_joint
