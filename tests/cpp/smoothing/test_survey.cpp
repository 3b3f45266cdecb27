// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <variant>
#include <vector>

#include "locfuse/geometry/uncertain_motion.hpp"
#include "locfuse/smoothing/survey.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::test_survey {
namespace {

using testing::in_band;
using testing::kSecond;

const Matrix<3, 3> kI3 = Matrix<3, 3>::Identity();

SurveyConfig well_informed() {
  SurveyConfig config;
  config.smoother.estimator.range.sigma_m = 0.1;
  config.smoother.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.smoother.estimator.correlation_s = 0.0;
  const std::shared_ptr<const AnchorMap> hall = testing::hall();
  for (const Anchor& anchor : hall->anchors()) {
    config.heights.push_back({anchor.id, anchor.position.z()});
  }
  return config;
}

/// What a robot measures that winds through the middle of the hall, 30 m a minute.
struct Drive {
  PoseEstimate start{0, {-3.0, -4.0, 0.4}, 1e-8 * kI3};
  std::vector<Message> messages;

  Drive(std::uint64_t seed, double seconds) {
    testing::Rng rng(seed);
    const std::shared_ptr<const AnchorMap> hall = testing::hall();
    Pose2 at = start.pose;
    const int steps = static_cast<int>(10.0 * seconds);
    for (int k = 0; k < steps; ++k) {
      const Stamp stamp = (k + 1) * kSecond / 10;
      const Pose2 step{0.05, 0.0, k % 160 < 80 ? 0.03 : -0.01};
      const double turn = std::abs(step.heading);
      const Pose2 noise{testing::normal(rng, 0.03 * std::sqrt(0.05)),
                        testing::normal(rng, 0.01 * std::sqrt(0.05)),
                        testing::normal(rng, std::sqrt(4e-4 * 0.05 + 9e-4 * turn))};
      messages.emplace_back(Increment{stamp - kSecond / 10, stamp, step});
      at = at * Pose2{step.x + noise.x, noise.y, step.heading + noise.heading};
      const Vector<2> tag = at.act({0.3, -0.2});
      for (const Anchor& anchor : hall->anchors()) {
        if (k % 2 == 1) {
          const double distance = (Vector<3>(tag.x(), tag.y(), 1.0) - anchor.position).norm();
          messages.emplace_back(
              Range{stamp, 0, anchor.id, distance + testing::normal(rng, 0.1), {}});
        }
      }
    }
  }
};

World without_anchors() { return {nullptr, testing::one_tag()}; }

/// How anchors 1, 2 and 3 lie to anchor 0 and the direction to anchor 1: a turn of the whole, which
/// is known least, is not in it.
Vector<5> layout_of(const Eigen::VectorXd& plane) {
  const Vector<2> base = plane.segment<2>(2) - plane.head<2>();
  const Pose2 origin{plane(0), plane(1), std::atan2(base.y(), base.x())};
  Vector<5> layout;
  layout << base.norm(), inverse(origin).act(plane.segment<2>(4)),
      inverse(origin).act(plane.segment<2>(6));
  return layout;
}

/// Squared error of a layout in sigmas.
double nees_of(const Survey& found) {
  const std::shared_ptr<const AnchorMap> hall = testing::hall();
  Eigen::VectorXd at(8);
  Eigen::VectorXd truth(8);
  Eigen::MatrixXd P(8, 8);
  for (Eigen::Index i = 0; i < 8; ++i) {
    const auto anchor = static_cast<std::size_t>(i / 2);
    at(i) = found.anchors[anchor].anchor.position(i % 2);
    truth(i) = hall->anchors()[anchor].position(i % 2);
    for (Eigen::Index j = 0; j < 8; ++j) {
      P(i, j) = found.smoothed.places_covariance(3 * (i / 2) + i % 2, 3 * (j / 2) + j % 2);
    }
  }
  Eigen::MatrixXd J(5, 8);
  for (Eigen::Index i = 0; i < 8; ++i) {
    const Eigen::VectorXd step = 1e-5 * Eigen::VectorXd::Unit(8, i);
    J.col(i) = (layout_of(at + step) - layout_of(at - step)) / 2e-5;
  }
  const Vector<5> error = layout_of(at) - layout_of(truth);
  return error.dot((J * P * J.transpose()).llt().solve(error));
}

TEST(Survey, anchors_are_as_sure_as_they_are_right) {
  constexpr int kRuns = 25;
  double nees = 0.0;
  double of_one = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const Drive run(seed, 60.0);
    const Survey found = survey(well_informed(), without_anchors(), run.start, run.messages);
    ASSERT_EQ(found.anchors.size(), 4U);
    for (const SurveyedAnchor& one : found.anchors) {
      EXPECT_EQ(one.status, SurveyStatus::kPlaced) << seed;
      EXPECT_EQ(one.ranges, 300) << seed;
      EXPECT_LT(std::sqrt(one.covariance.topLeftCorner<2, 2>().trace()), 1.0);
    }
    nees += nees_of(found) / kRuns;
    const Vector<3> truth = testing::hall()->find(2)->position;
    const Vector<2> off = (found.anchors[2].anchor.position - truth).head<2>();
    const Matrix<2, 2> P = found.anchors[2].covariance.topLeftCorner<2, 2>();
    of_one += off.dot(P.llt().solve(off)) / kRuns;
  }
  EXPECT_TRUE(in_band(nees, 5, kRuns, 0.99)) << nees;
  EXPECT_TRUE(in_band(of_one, 2, kRuns, 0.99)) << of_one;
}

TEST(Survey, an_unknown_height_is_found_above_the_tags) {
  const Drive run(3, 60.0);
  SurveyConfig config = well_informed();
  config.heights.clear();
  const Survey found = survey(config, without_anchors(), run.start, run.messages);
  for (const SurveyedAnchor& one : found.anchors) {
    const Vector<3> off = one.anchor.position - testing::hall()->find(one.anchor.id)->position;
    EXPECT_GE(one.anchor.position.z(), 1.0);
    EXPECT_LT(off.head<2>().norm(), 0.6);
    EXPECT_LT(std::abs(off.z()), 3.0 * std::sqrt(one.covariance(2, 2)));
  }
}

TEST(Survey, gross_errors_do_no_harm) {
  Drive run(5, 60.0);
  testing::Rng rng(99);
  for (Message& message : run.messages) {
    if (auto* z = std::get_if<Range>(&message); z && testing::uniform(rng, 0.0, 1.0) < 0.2) {
      z->range += testing::uniform(rng, 1.0, 6.0);
    }
  }
  const Survey found = survey(well_informed(), without_anchors(), run.start, run.messages);
  for (const SurveyedAnchor& one : found.anchors) {
    EXPECT_NEAR(one.rejected, 60, 25);
  }
  EXPECT_LT(nees_of(found), chi_squared_quantile(5, 0.999));
}

/// Odometry and ranges of a body without errors along a line, which may be bent.
std::vector<Message> along(double turn, const std::vector<Vector<3>>& anchors) {
  std::vector<Message> messages;
  Pose2 at;
  for (int k = 0; k < 400; ++k) {
    const Stamp stamp = k * kSecond / 10;
    const Pose2 step{0.05, 0.0, k < 200 ? 0.0 : turn};
    messages.emplace_back(Increment{stamp, stamp + kSecond / 10, step});
    at = at * step;
    for (std::size_t a = 0; a < anchors.size(); ++a) {
      messages.emplace_back(Range{stamp + kSecond / 10,
                                  0,
                                  static_cast<Id>(a),
                                  (Vector<3>(at.x, at.y, 0.0) - anchors[a]).norm(),
                                  {}});
    }
  }
  return messages;
}

TEST(Survey, a_mirror_image_is_never_a_silent_choice) {
  const std::vector<Vector<3>> anchors{{4.0, 5.0, 0.0}, {12.0, -6.0, 0.0}, {18.0, 4.0, 0.0}};
  SurveyConfig config = well_informed();
  for (KnownHeight& height : config.heights) {
    height.height_m = 0.0;
  }
  const World world{nullptr, {{0, Vector<3>::Zero()}}};
  const PoseEstimate start{0, {}, 1e-8 * kI3};
  const Survey straight = survey(config, world, start, along(0.0, anchors));
  for (const SurveyedAnchor& one : straight.anchors) {
    const Vector<3>& truth = anchors[static_cast<std::size_t>(one.anchor.id)];
    ASSERT_EQ(one.status, SurveyStatus::kTwoPlaces) << one.anchor.id;
    EXPECT_NEAR(one.anchor.position.x(), truth.x(), 0.2);
    EXPECT_NEAR(std::abs(one.anchor.position.y()), std::abs(truth.y()), 0.2);
    EXPECT_NEAR(one.other->y(), -one.anchor.position.y(), 0.2);
  }
  const Survey bent = survey(config, world, start, along(0.02, anchors));
  for (const SurveyedAnchor& one : bent.anchors) {
    EXPECT_EQ(one.status, SurveyStatus::kPlaced) << one.anchor.id;
    EXPECT_LT((one.anchor.position - anchors[static_cast<std::size_t>(one.anchor.id)]).norm(), 0.1);
  }
}

TEST(Survey, a_robot_that_stands_places_nothing) {
  std::vector<Message> messages;
  for (int k = 0; k < 600; ++k) {
    messages.emplace_back(Velocity{k * kSecond / 10, 0.0, 0.0});
    messages.emplace_back(Range{k * kSecond / 10, 0, 2, 5.0 + 0.05 * std::sin(k), {}});
  }
  const Survey found = survey(well_informed(), without_anchors(), {0, {}, 1e-8 * kI3}, messages);
  ASSERT_EQ(found.anchors.size(), 1U);
  EXPECT_EQ(found.anchors[0].status, SurveyStatus::kNotPlaced);
  EXPECT_EQ(found.anchors[0].ranges, 600);
  EXPECT_FALSE(found.smoothed.poses.empty());
}

TEST(Survey, landmarks_are_found_with_their_covariance) {
  constexpr int kRuns = 25;
  const std::vector<Vector<2>> posts{{3.0, 2.0}, {-2.0, 3.0}, {1.0, -5.0}};
  double nees = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    testing::Rng rng(seed);
    std::vector<Message> messages;
    Pose2 at;
    for (int k = 0; k < 300; ++k) {
      const Stamp stamp = k * kSecond / 10;
      const Pose2 step{0.05 + testing::normal(rng, 0.03 * std::sqrt(0.05)),
                       testing::normal(rng, 0.01 * std::sqrt(0.05)),
                       0.02 + testing::normal(rng, std::sqrt(4e-4 * 0.05 + 9e-4 * 0.02))};
      messages.emplace_back(Increment{stamp, stamp + kSecond / 10, {0.05, 0.0, 0.02}});
      at = at * step;
      const auto post = static_cast<std::size_t>(k) % posts.size();
      const Vector<2> seen = inverse(at).act(posts[post]);
      RangeBearing z;
      z.stamp = stamp + kSecond / 10;
      z.landmark = static_cast<Id>(post);
      z.range = seen.norm() + testing::normal(rng, 0.1);
      z.bearing = std::atan2(seen.y(), seen.x()) + testing::normal(rng, 0.02);
      messages.emplace_back(z);
    }
    SurveyConfig config = well_informed();
    config.smoother.estimator.landmark.sigma_range_m = 0.1;
    config.smoother.estimator.landmark.sigma_bearing_rad = 0.02;
    const Survey found = survey(config, {}, {0, {}, 1e-8 * kI3}, messages);
    ASSERT_EQ(found.smoothed.landmarks.size(), 3U);
    Eigen::VectorXd error(6);
    for (std::size_t k = 0; k < 3; ++k) {
      error.segment<2>(2 * static_cast<Eigen::Index>(k)) =
          found.smoothed.landmarks[k].position - posts[k];
    }
    nees += error.dot(found.smoothed.places_covariance.llt().solve(error)) / kRuns;
  }
  EXPECT_TRUE(in_band(nees, 6, kRuns, 0.99)) << nees;
}

TEST(Survey, refuses_what_it_cannot_do_in_a_sentence) {
  testing::expect_refused(
      [] {
        (void)survey({}, {}, {0, {}, kI3},
                     {PositionFix{0, {0.0, 0.0}, Matrix<2, 2>::Identity(), {}}});
      },
      "nothing to survey");
  SmootherConfig config;
  config.anchors.push_back({7, Vector<3>::Zero(), Vector<3>::Ones()});
  testing::expect_refused(
      [&] {
        (void)smooth(config, {testing::hall()}, {0, {}, kI3}, {});
      },
      "anchor 7");
}

}  // namespace
}  // namespace locfuse::test_survey
