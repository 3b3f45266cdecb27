// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "locfuse/frontends/constellation.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;
using testing::in_band;
using testing::normal;
using testing::Rng;
using testing::uniform;

constexpr double kSigma = 0.03;

SeenLandmark seen_from(const Pose2& pose, const Vector<2>& landmark, Rng* rng = nullptr) {
  const Vector<2> noise =
      rng != nullptr ? Vector<2>{normal(*rng, kSigma), normal(*rng, kSigma)} : Vector<2>(0.0, 0.0);
  const Pose2 to_body = inverse(pose);
  return {to_body.act(landmark) + noise, kSigma * kSigma * Matrix<2, 2>::Identity(), {}};
}

LandmarkMap map_of(const std::vector<Vector<2>>& positions) {
  std::vector<Landmark> landmarks;
  for (const Vector<2>& position : positions) {
    landmarks.push_back({static_cast<Id>(landmarks.size()), position, 0.1});
  }
  return LandmarkMap(landmarks);
}

const std::vector<Vector<2>> kScattered{{0.0, 0.0}, {4.0, 1.0}, {1.5, 6.0}, {7.0, 7.5}};

double distance(const Pose2& a, const Pose2& b) { return local(a, b).norm(); }

TEST(Constellation, two_landmarks_determine_the_pose_and_its_exchange) {
  const LandmarkMap map = map_of(kScattered);
  Rng rng(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Pose2 truth = testing::random_pose(rng);
    const auto matches = match_constellation(seen_from(truth, kScattered[0]),
                                             seen_from(truth, kScattered[1]), map, 0.999);
    ASSERT_EQ(matches.size(), 2U);  // no other distance fits; the pair itself can be exchanged
    EXPECT_LT(std::min(distance(matches[0].pose, truth), distance(matches[1].pose, truth)), 1e-9);
    EXPECT_GT(std::max(distance(matches[0].pose, truth), distance(matches[1].pose, truth)), 0.1);
    EXPECT_NEAR(matches[0].log_evidence, matches[1].log_evidence, 1e-6);
  }
}

TEST(Constellation, an_id_leaves_one_pose) {
  const LandmarkMap map = map_of(kScattered);
  const Pose2 truth{1.0, 2.0, 0.5};
  SeenLandmark a = seen_from(truth, kScattered[0]);
  const SeenLandmark b = seen_from(truth, kScattered[1]);
  a.id = 0;
  const auto matches = match_constellation(a, b, map, 0.999);
  ASSERT_EQ(matches.size(), 1U);
  EXPECT_LT(distance(matches[0].pose, truth), 1e-9);
  a.id = 2;
  EXPECT_TRUE(match_constellation(a, b, map, 0.999).empty());
  a.id = 77;  // not on the map
  EXPECT_TRUE(match_constellation(a, b, map, 0.999).empty());
}

TEST(Constellation, a_square_has_four_poses) {
  const LandmarkMap map = map_of({{0.0, 0.0}, {4.0, 0.0}, {4.0, 4.0}, {0.0, 4.0}});
  const Pose2 truth{1.0, 1.5, 0.3};
  const auto side =
      match_constellation(seen_from(truth, {0.0, 0.0}), seen_from(truth, {4.0, 0.0}), map, 0.999);
  EXPECT_EQ(side.size(), 8U);  // four sides in both directions
}

TEST(Constellation, errors_match_the_covariance_and_the_gate_its_probability) {
  const LandmarkMap map = map_of(kScattered);
  Rng rng(2);
  constexpr int kRuns = 4000;
  double nees = 0.0;
  int found = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Pose2 truth{uniform(rng, -1.0, 5.0), uniform(rng, -1.0, 5.0), uniform(rng, -kPi, kPi)};
    SeenLandmark a = seen_from(truth, kScattered[0], &rng);
    SeenLandmark b = seen_from(truth, kScattered[2], &rng);
    a.id = 0;
    b.id = 2;
    for (const ConstellationMatch& match : match_constellation(a, b, map, 0.95)) {
      const Vector<3> error = local(match.pose, truth);
      nees += error.dot(match.covariance.inverse() * error);
      ++found;
    }
  }
  EXPECT_TRUE(in_band(nees / found, 3, found)) << nees / found;
  EXPECT_NEAR(static_cast<double>(found) / kRuns, 0.95, 3.0 * std::sqrt(0.95 * 0.05 / kRuns));
}

/// Compares the density of the two positions with a sum over poses on a grid.
TEST(Constellation, evidence_is_the_integral_over_poses) {
  const std::vector<Vector<2>> pair{{0.0, 0.0}, {3.0, 0.0}};
  const LandmarkMap map = map_of(pair);
  const Pose2 truth{1.0, -2.0, 0.4};
  SeenLandmark a = seen_from(truth, pair[0]);
  SeenLandmark b = seen_from(truth, pair[1]);
  a.position.x() += 0.02;
  a.covariance << 2e-3, 5e-4, 5e-4, 1e-3;
  a.id = 0;
  b.id = 1;
  const auto matches = match_constellation(a, b, map, 0.999);
  ASSERT_EQ(matches.size(), 1U);
  const auto density = [](const SeenLandmark& seen, const Vector<2>& expected) {
    const Vector<2> r = seen.position - expected;
    return std::exp(-0.5 * r.dot(seen.covariance.inverse() * r)) /
           (2.0 * kPi * std::sqrt(seen.covariance.determinant()));
  };
  constexpr int kSide = 60;
  constexpr double kSpan = 6.0;  // standard deviations to both sides
  const Vector<3> sigma = matches[0].covariance.diagonal().cwiseSqrt();
  const Vector<3> step = sigma * (2.0 * kSpan / kSide);
  double sum = 0.0;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      for (int k = 0; k < kSide; ++k) {
        const Vector<3> off = Vector<3>(i + 0.5, j + 0.5, k + 0.5).cwiseProduct(step);
        const Pose2 to_body = inverse(retract(matches[0].pose, off - kSpan * sigma));
        sum += density(a, to_body.act(pair[0])) * density(b, to_body.act(pair[1]));
      }
    }
  }
  EXPECT_NEAR(matches[0].log_evidence, std::log(sum * step.prod()), 0.02);
}

TEST(Constellation, landmarks_in_one_place_give_no_heading) {
  const Pose2 truth{0.0, 0.0, 0.0};
  const LandmarkMap twins = map_of({{2.0, 0.0}, {2.0, 0.0}});
  EXPECT_TRUE(
      match_constellation(seen_from(truth, {2.0, 0.0}), seen_from(truth, {2.0, 0.0}), twins, 0.999)
          .empty());
  EXPECT_TRUE(
      match_constellation(seen_from(truth, {2.0, 0.0}), seen_from(truth, {2.0, 0.05}), twins, 0.999)
          .empty());
  EXPECT_TRUE(match_constellation(seen_from(truth, {2.0, 0.0}), seen_from(truth, {0.0, 2.0}),
                                  LandmarkMap{}, 0.999)
                  .empty());
  expect_refused(
      [&] {
        (void)match_constellation(seen_from(truth, {2.0, 0.0}), seen_from(truth, {0.0, 2.0}), twins,
                                  1.5);
      },
      "1.5");
}

TEST(Constellation, returns_no_pose_without_a_covariance) {
  const LandmarkMap map = map_of({{0.0, 0.0}, {1.0, 0.0}});
  for (const double variance : {1e-12, 1e-60, 1e-110, 1e-150}) {
    const Matrix<2, 2> R = variance * Matrix<2, 2>::Identity();
    for (const auto& match : match_constellation({{0, 0}, R, {}}, {{1, 0}, R, {}}, map, 0.99)) {
      EXPECT_GT(match.covariance.diagonal().minCoeff(), 0.0) << variance;
      EXPECT_TRUE(std::isfinite(match.log_evidence)) << variance;
    }
  }
}

}  // namespace
}  // namespace locfuse
