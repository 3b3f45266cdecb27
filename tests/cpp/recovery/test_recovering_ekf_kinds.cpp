// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/live.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/scrubber.hpp"

namespace locfuse::test_recovering_ekf_kinds {
namespace {

using testing::expect_refused;
using testing::kSecond;
using testing::same_bits;

const Matrix<2, 2> kR = 0.01 * Matrix<2, 2>::Identity();

RecoveringEkf::Config triangle_config() {
  RecoveringEkf::Config config;
  TagTriangleEkf::Config tracker;
  tracker.holds_sides = true;
  config.tracker = tracker;
  return config;
}

RecoveringEkf three_tags() { return {triangle_config(), {{}, testing::triangle()}}; }

/// Fixes of all tags of a body that stands.
std::vector<PositionFix> fixes_at(const Pose2& pose, Stamp stamp, testing::Rng& rng) {
  std::vector<PositionFix> fixes;
  for (int tag = 0; tag < 3; ++tag) {
    const Vector<2> at = pose.act({testing::Scrubber::kTagX[tag], testing::Scrubber::kTagY[tag]});
    fixes.push_back({stamp, at + Vector<2>(testing::normal(rng, 0.1), testing::normal(rng, 0.1)),
                     kR, 10 + tag});
  }
  return fixes;
}

TEST(RecoveringEkfKinds, three_tags_are_found_from_nothing_and_tracked) {
  testing::Rng rng(3);
  const Pose2 truth{4.0, -2.0, 1.0};
  Live live(three_tags());
  for (int step = 0; step < 60 && !live.is_tracking(); ++step) {
    for (const PositionFix& z : fixes_at(truth, step * kSecond / 5, rng)) {
      (void)live.on(z);
    }
  }
  ASSERT_TRUE(live.is_tracking());
  ASSERT_TRUE(std::holds_alternative<TagTriangleEkf>(*live.estimator().tracker()));
  EXPECT_EQ(live.estimator().estimator(), nullptr);
  EXPECT_EQ(live.estimator().belief().dimension(), 12);
  const Vector<3> off = local(live.estimator().estimate().pose, truth);
  EXPECT_LT(off.head<2>().norm(), 0.2);
  EXPECT_LT(std::abs(off.z()), 0.3);
}

RecoveringEkf::Config conditioned() {
  RecoveringEkf::Config config = triangle_config();
  config.start.tag_conditioner.emplace();
  config.start.tag_conditioner->cutoff_hz = 0.0;
  config.start.tag_conditioner->bias_x_m = 0.5;
  return config;
}

RecoveringEkf conditioned_tags(const RecoveringEkf::Config& config = conditioned()) {
  return {config, {{}, testing::triangle()}};
}

TEST(RecoveringEkfKinds, conditions_fixes_of_tags_while_it_searches_and_while_it_tracks) {
  testing::Rng rng(3);
  const Pose2 truth{4.0, -2.0, 1.0};
  Live live(conditioned_tags());
  for (int step = 0; step < 200; ++step) {
    for (PositionFix z : fixes_at(truth, step * kSecond / 5, rng)) {
      z.position.x() += 0.5;  // bias of the RTLS
      (void)live.on(z);
      if (live.is_tracking()) {  // from the first estimate on
        EXPECT_LT(local(live.estimator().current().pose, truth).head<2>().norm(), 0.3);
      }
    }
  }
  EXPECT_TRUE(live.is_tracking());
}

TEST(RecoveringEkfKinds, a_fix_that_the_conditioner_rejects_says_by_how_much) {
  testing::Rng rng(5);
  const Pose2 truth{1.0, 1.0, 0.3};
  RecoveringEkf ekf = conditioned_tags();
  ekf.start_at({0, truth, 0.04 * Matrix<3, 3>::Identity()});
  PositionFix first = fixes_at(truth, kSecond, rng).front();
  first.position.x() += 0.5;
  ASSERT_EQ(ekf.on(first).verdict, Verdict::kFused);
  ekf.on(Increment{kSecond, 2 * kSecond, {0.2, 0.0, 0.0}});
  first.stamp = 2 * kSecond;
  const Outcome frozen = ekf.on(first);
  EXPECT_EQ(frozen.verdict, Verdict::kImplausible);
  EXPECT_EQ(frozen.residual, 0.0);
  EXPECT_EQ(frozen.limit, 0.1);
  const GaussianBelief before = ekf.belief();
  PositionFix z = first;
  z.stamp = 2 * kSecond;
  z.position += Vector<2>(3.0, 4.0);
  const Outcome jump = ekf.on(z);
  EXPECT_EQ(jump.verdict, Verdict::kImplausible);
  EXPECT_NEAR(jump.residual, 5.0, 1e-12);
  EXPECT_NEAR(jump.limit, 1.4 + 0.8, 1e-12);
  EXPECT_EQ(jump.dof, 0);
  EXPECT_TRUE(same_bits(ekf.belief(), before));
  z.position = {1e9, 0.0};  // beyond the limits: the conditioner does not see it
  const Outcome far = ekf.on(z);
  EXPECT_EQ(far.verdict, Verdict::kImplausible);
  EXPECT_TRUE(std::isnan(far.limit));
  EXPECT_EQ(ekf.on(PositionFix{2 * kSecond, {1.0, 1.0}, kR}).verdict, Verdict::kNotModelled);
}

TEST(RecoveringEkfKinds, odometry_beyond_the_limits_does_not_reach_the_conditioner) {
  RecoveringEkf ekf = conditioned_tags();
  ekf.start_at({0, {1.0, 1.0, 0.3}, 0.04 * Matrix<3, 3>::Identity()});
  testing::Rng rng(5);
  PositionFix z = fixes_at({1.5, 1.0, 0.3}, kSecond, rng).front();
  ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
  ASSERT_EQ(ekf.on(Velocity{kSecond, 1e4, 0.0}).verdict, Verdict::kImplausible);
  z.stamp = 2 * kSecond;  // the same value, which is frozen only if the tag moved
  EXPECT_EQ(ekf.on(z).verdict, Verdict::kFused);
}

TEST(RecoveringEkfKinds, a_clock_that_goes_back_is_a_new_time_for_the_conditioner) {
  RecoveringEkf ekf = conditioned_tags();
  const PoseEstimate start{100 * kSecond, {1.0, 1.0, 0.3}, 0.04 * Matrix<3, 3>::Identity()};
  ekf.start_at(start);
  testing::Rng rng(5);
  PositionFix z = fixes_at({1.5, 1.0, 0.3}, 101 * kSecond, rng).front();
  ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
  z.stamp = 2 * kSecond;
  EXPECT_EQ(ekf.on(z).verdict, Verdict::kStale);
  RecoveringEkf again = ekf.restarted({kSecond, start.pose, start.covariance});
  EXPECT_EQ(again.on(z).verdict, Verdict::kFused);
}

TEST(RecoveringEkfKinds, a_late_fix_is_conditioned_where_it_belongs) {
  RecoveringEkf::Config config = conditioned();
  config.start.tag_conditioner->cutoff_hz = 0.3;
  RecoveringEkf start = conditioned_tags(config);
  start.start_at({0, {1.0, 1.0, 0.3}, 0.04 * Matrix<3, 3>::Identity()});
  testing::Rng rng(7);
  std::vector<PositionFix> fixes;
  for (int step = 1; step < 40; ++step) {
    for (PositionFix z : fixes_at({1.0, 1.0, 0.3}, step * kSecond / 5, rng)) {
      z.position.x() += 0.5;
      fixes.push_back(z);
    }
  }
  const auto end_of = [&](const std::vector<PositionFix>& in_order_of_arrival) {
    Timeline<RecoveringEkf> timeline(start, 2 * kSecond);
    for (const PositionFix& z : in_order_of_arrival) {
      timeline.on(z, [](std::size_t, const Outcome&) {});
    }
    return timeline.estimator().belief();
  };
  std::vector<PositionFix> late = fixes;
  std::rotate(late.begin() + 50, late.begin() + 51, late.begin() + 65);  // a second late
  EXPECT_TRUE(same_bits(end_of(late), end_of(fixes)));
  late.erase(late.begin() + 64);
  EXPECT_FALSE(same_bits(end_of(late), end_of(fixes)));
}

TEST(RecoveringEkfKinds, refuses_a_conditioner_out_of_range) {
  RecoveringEkf::Config config = conditioned();
  config.start.tag_conditioner->jump_margin_m = 0.0;
  expect_refused([&] { (void)conditioned_tags(config); }, "jump_margin_m");
}

TEST(RecoveringEkfKinds, three_tags_carried_away_are_lost_and_found) {
  testing::Rng rng(4);
  RecoveringEkf ekf = three_tags();
  Pose2 truth{4.0, -2.0, 1.0};
  ekf.start_at({0, truth, 0.01 * Matrix<3, 3>::Identity()});
  for (int step = 1; step < 200; ++step) {
    if (step == 50) {
      truth = {-8.0, 6.0, -2.0};
    }
    for (const PositionFix& z : fixes_at(truth, step * kSecond / 5, rng)) {
      (void)ekf.on(z);
    }
  }
  EXPECT_EQ(ekf.alarms(), 1);
  EXPECT_EQ(ekf.restarts(), 1);
  EXPECT_LT(local(ekf.current().pose, truth).head<2>().norm(), 0.3);
  EXPECT_FALSE(ekf.is_lost());
}

TEST(RecoveringEkfKinds, a_map_is_not_thrown_away_by_a_filter_that_is_lost) {
  RecoveringEkf::Config config;
  LandmarkEkf::Config mapping;
  mapping.known = {{0, {2.0, 0.0}, {}}, {1, {0.0, 2.0}, {}}, {2, {-2.0, 0.0}, {}}};
  config.tracker = mapping;
  RecoveringEkf ekf(config, {});
  ekf.start_at({0, {}, 1e-4 * Matrix<3, 3>::Identity()});
  ASSERT_TRUE(ekf.fuses_jointly());
  for (int step = 1; step < 300; ++step) {  // ranges that no pose explains
    for (Id id = 0; id < 3; ++id) {
      RangeBearing z;
      z.stamp = step * kSecond / 10;
      z.landmark = id;
      z.range = 30.0 + id;
      z.bearing = 0.0;
      (void)ekf.on(z);
    }
  }
  EXPECT_GE(ekf.alarms(), 1);
  EXPECT_EQ(ekf.restarts(), 0);
  EXPECT_EQ(std::get<LandmarkEkf>(*ekf.tracker()).landmarks().size(), 3U);
}

TEST(RecoveringEkfKinds, a_flight_has_its_height_and_is_found_where_it_was_carried) {
  RecoveringEkf::Config config;
  AirEkf::Config air;
  air.motion = AirMotion::kConstantVelocity;
  config.tracker = air;
  config.start_height = 1.0;
  config.sigma_start_height = 0.5;
  const std::vector<Vector<3>> corners{{0, 0, 0.2}, {8, 0, 4.0}, {8, 8, 0.3}, {0, 8, 3.5}};
  std::vector<Anchor> anchors;
  for (const Vector<3>& corner : corners) {
    anchors.push_back({static_cast<Id>(anchors.size()), corner});
  }
  RecoveringEkf ekf(config, {std::make_shared<const AnchorMap>(anchors), {{0, {0, 0, 0}}}});
  EXPECT_THROW((void)ekf.current_in_space(), std::logic_error);
  ekf.start_at({0, {3.0, 4.0, 0.0}, 0.09 * Matrix<3, 3>::Identity()});
  testing::Rng rng(7);
  const Vector<3> truth(3.2, 3.9, 1.4);
  const auto range_to = [&](int anchor, const Vector<3>& from, int step) {
    const double distance = (from - corners[static_cast<std::size_t>(anchor)]).norm();
    return Range{step * kSecond / 10, 0, anchor, distance + testing::normal(rng, 0.05), 0.05};
  };
  for (int step = 1; step <= 50; ++step) {
    for (int anchor = 0; anchor < 4; ++anchor) {
      (void)ekf.on(range_to(anchor, truth, step));
    }
  }
  ASSERT_TRUE(ekf.current_in_space());
  EXPECT_NEAR(ekf.current_in_space()->height, truth.z(), 0.2);
  EXPECT_EQ(ekf.current_in_space()->pose.x, ekf.current().pose.x);
  EXPECT_EQ(ekf.estimate_in_space()->covariance.topLeftCorner(3, 3), ekf.estimate().covariance);
  PoseEstimate other = ekf.estimate();
  other.stamp = 2 * kSecond;
  EXPECT_EQ(ekf.restarted(other).current_in_space()->height, ekf.estimate_in_space()->height);
  for (int step = 51; step <= 200; ++step) {  // carried away
    for (int anchor = 0; anchor < 4; ++anchor) {
      (void)ekf.on(range_to(anchor, {60.0, 60.0, 1.0}, step));
    }
  }
  EXPECT_EQ(ekf.alarms(), 1);
  EXPECT_EQ(ekf.restarts(), 1);
  EXPECT_FALSE(ekf.is_lost());
  EXPECT_NEAR(ekf.current_in_space()->pose.x, 60.0, 1.0);
  EXPECT_NEAR(ekf.current_in_space()->pose.y, 60.0, 1.0);
  EXPECT_FALSE(three_tags().has_started());
}

TEST(RecoveringEkfKinds, another_clock_keeps_the_map_and_the_pose) {
  RecoveringEkf::Config config;
  config.tracker = LandmarkEkf::Config{};
  RecoveringEkf ekf(config, {});
  ekf.start_at({10 * kSecond, {1.0, 2.0, 0.5}, 1e-4 * Matrix<3, 3>::Identity()});
  RangeBearing z;
  z.stamp = 10 * kSecond;
  z.landmark = 7;
  z.range = 3.0;
  z.bearing = 0.1;
  ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
  PoseEstimate now = ekf.estimate();
  now.stamp = 2 * kSecond;
  const RecoveringEkf other = ekf.restarted(now);
  EXPECT_EQ(other.belief().stamp, 2 * kSecond);
  EXPECT_EQ(other.belief().x, ekf.belief().x);
  EXPECT_EQ(Eigen::MatrixXd(other.belief().P), Eigen::MatrixXd(ekf.belief().P));

  RecoveringEkf tags = three_tags();
  tags.start_at({10 * kSecond, {1.0, 2.0, 0.5}, 0.01 * Matrix<3, 3>::Identity()});
  PoseEstimate there = tags.estimate();
  there.stamp = 2 * kSecond;
  EXPECT_EQ(tags.restarted(there).current().stamp, 2 * kSecond);
}

TEST(RecoveringEkfKinds, three_tags_whose_triangle_is_lost_have_a_pose_that_says_so) {
  testing::Rng rng(9);
  RecoveringEkf ekf = three_tags();
  const Pose2 truth{4.0, -2.0, 1.0};
  ekf.start_at({0, truth, 0.01 * Matrix<3, 3>::Identity()});
  for (int hours = 1; hours < 1000; hours *= 2) {  // no message in between
    RecoveringEkf silent = ekf;
    (void)silent.on(Velocity{hours * 3600 * kSecond, 0.0, 0.0});
    const PoseEstimate now = silent.current();
    EXPECT_TRUE(testing::is_covariance(now.covariance)) << hours;
    EXPECT_GT(now.sigma_position(), 10.0) << hours;
    EXPECT_TRUE(std::isfinite(silent.health().wrong)) << hours;
  }
}

TEST(RecoveringEkfKinds, a_tracker_that_cannot_be_is_refused_at_once) {
  expect_refused([] { RecoveringEkf(triangle_config(), {}); }, "expected 3");
}

TEST(TagTriangleEkf, sides_are_fused_by_themselves_where_there_is_no_odometry) {
  testing::Rng rng(5);
  const Pose2 truth{1.0, 1.0, 0.3};
  const PoseEstimate start{0, truth, 0.04 * Matrix<3, 3>::Identity()};
  TagTriangleEkf::Config config;
  config.holds_sides = true;
  TagTriangleEkf by_itself(config, {{}, testing::triangle()}, start);
  TagTriangleEkf by_hand = by_itself;
  for (int step = 1; step < 20; ++step) {
    for (const PositionFix& z : fixes_at(truth, step * kSecond / 5, rng)) {
      ASSERT_EQ(by_itself.on(z).verdict, by_hand.on(z).verdict);
    }
    const PoseEstimate now = by_itself.current();
    (void)by_hand.hold_sides();
    EXPECT_EQ(now.pose.x, by_hand.current().pose.x);
    EXPECT_EQ(now.covariance, by_hand.current().covariance);
  }
  by_itself.advance_to(10 * kSecond);
  by_hand.advance_to(10 * kSecond);
  EXPECT_TRUE(same_bits(by_itself.belief(), by_hand.belief()));
}

TEST(TagTriangleEkf, a_message_that_is_not_fused_leaves_sides_that_are_due) {
  testing::Rng rng(6);
  const Pose2 truth{1.0, 1.0, 0.3};
  TagTriangleEkf::Config config;
  config.holds_sides = true;
  TagTriangleEkf ekf(config, {{}, testing::triangle()},
                     PoseEstimate{0, truth, 0.04 * Matrix<3, 3>::Identity()});
  for (const PositionFix& z : fixes_at(truth, kSecond, rng)) {
    ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
  }
  const TagTriangleEkf before = ekf;
  ASSERT_EQ(ekf.on(PositionFix{2 * kSecond, {90.0, 90.0}, kR, 10}).verdict, Verdict::kGated);
  EXPECT_TRUE(same_bits(ekf.belief(), before.belief()));
  EXPECT_EQ(ekf.current().covariance, before.current().covariance);
}

}  // namespace
}  // namespace locfuse::test_recovering_ekf_kinds
