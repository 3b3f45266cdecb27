// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "locfuse/estimators/air_ekf.hpp"
#include "locfuse/estimators/landmark_ekf.hpp"
#include "locfuse/estimators/tag_triangle_ekf.hpp"
#include "locfuse/recovery/initializer.hpp"
#include "support/expect.hpp"
#include "support/robot.hpp"
#include "support/scrubber.hpp"

/// What every estimator does with messages that no robot can mean, and with covariances that are
/// none: one edge for all of them.
namespace locfuse::test_edge {
namespace {

using testing::kSecond;

constexpr double kMax = std::numeric_limits<double>::max();
const Pose2 kStart{1.0, 2.0, 0.5};
const Matrix<3, 3> kP = 0.01 * Matrix<3, 3>::Identity();

AirEkf air() {
  return {
      {}, {testing::hall(), testing::one_tag()}, {0, kStart, 1.0, 0.01 * Matrix<4, 4>::Identity()}};
}

LandmarkEkf landmarks() { return {{}, {}, {0, kStart, kP}}; }

TagTriangleEkf triangle(const TagTriangleEkf::Config& config = {}) {
  return {config, {testing::hall(), testing::triangle()}, PoseEstimate{0, kStart, kP}};
}

/// Of the first tag of the triangle, or of the antenna.
template <class Estimator>
PositionFix fix(const Vector<2>& position, const Matrix<2, 2>& covariance) {
  PositionFix z{kSecond, position, covariance, {}};
  if (std::is_same_v<Estimator, TagTriangleEkf>) {
    z.tag = 10;
  }
  return z;
}

template <class Estimator>
void expect_no_trace(const Estimator& before, const Outcome& outcome, const Estimator& after,
                     Verdict verdict) {
  EXPECT_EQ(outcome.verdict, verdict);
  EXPECT_TRUE(testing::same_bits(before.belief(), after.belief()));
}

template <class Estimator>
void expect_an_edge(const Estimator& start) {
  const auto expect = [&](const auto& message, Verdict verdict) {
    Estimator ekf = start;
    const Outcome outcome = ekf.on(message);
    expect_no_trace(start, outcome, ekf, verdict);
  };
  const Matrix<2, 2> R = 0.04 * Matrix<2, 2>::Identity();
  expect(Velocity{kSecond, 101.0, 0.0}, Verdict::kImplausible);
  expect(Velocity{kSecond, 0.0, -51.0}, Verdict::kImplausible);
  expect(Increment{0, kSecond, {0.0, 120.0, 0.0}}, Verdict::kImplausible);
  expect(fix<Estimator>({2e7, 1e7}, R), Verdict::kImplausible);
  expect(fix<Estimator>({1.0, 2.0}, Matrix<2, 2>::Zero()), Verdict::kNotModelled);
  expect(fix<Estimator>({1.0, 2.0}, -Matrix<2, 2>::Identity()), Verdict::kNotModelled);
  expect(fix<Estimator>({1.0, 2.0}, kMax * Matrix<2, 2>::Identity()), Verdict::kNotModelled);

  Estimator ekf = start;
  const Matrix<2, 2> along = Vector<2>(0.04, kMax).asDiagonal();
  const Outcome one = ekf.on(fix<Estimator>({1.1, 900.0}, along));
  EXPECT_EQ(one.verdict, Verdict::kFused) << "what is not measured is gated by nothing";
  EXPECT_EQ(one.dof, 1);
}

TEST(Edge, of_a_pose_ekf) { expect_an_edge(testing::ekf_at(kStart)); }
TEST(Edge, of_an_air_ekf) { expect_an_edge(air()); }
TEST(Edge, of_a_landmark_ekf) { expect_an_edge(landmarks()); }
TEST(Edge, of_a_tag_triangle_ekf) { expect_an_edge(triangle()); }

TEST(Edge, ranges_beyond_the_limit_are_implausible_alone_and_left_out_of_an_epoch) {
  PoseEkf ekf = testing::ekf_at(kStart);
  const Range far{0, 0, 0, 1.1e4, {}};
  EXPECT_EQ(ekf.on(far).verdict, Verdict::kImplausible);
  EXPECT_EQ(air().on(far).verdict, Verdict::kImplausible);
  EXPECT_EQ(triangle().on(Range{0, 10, 0, 1.1e4, {}}).verdict, Verdict::kImplausible);
  const Outcome both = ekf.on_joint({far, testing::range_to(1, kStart, 0)});
  EXPECT_EQ(both.verdict, Verdict::kFused);
  EXPECT_EQ(both.dof, 1);
}

TEST(Edge, sightings_beyond_the_limit_leave_the_others_of_their_instant_alone) {
  LandmarkEkf with = landmarks();
  LandmarkEkf without = landmarks();
  const RangeBearing far{0, 2, 1.1e4, 0.1, {}};
  const RangeBearing near{0, 1, 3.0, 0.1, {}};
  const std::vector<Outcome> outcomes = with.on_joint({far, near});
  without.on_joint({near});
  EXPECT_EQ(outcomes[0].verdict, Verdict::kImplausible);
  EXPECT_EQ(outcomes[1].verdict, Verdict::kFused);
  EXPECT_TRUE(testing::same_bits(with.belief(), without.belief()));
}

TEST(Edge, a_covariance_that_is_not_known_has_the_sigma_of_the_config) {
  PoseEkf::Config config;
  config.position.sigma_m = 0.3;
  config.pose.sigma_m = 0.3;
  config.pose.sigma_heading_rad = 0.2;
  PoseEkf ekf = testing::ekf_at(kStart, config);
  PoseEkf informed = testing::ekf_at(kStart);
  ekf.on(PositionFix{0, {1.1, 2.1}, Matrix<2, 2>::Zero(), {}});
  informed.on(PositionFix{0, {1.1, 2.1}, 0.3 * 0.3 * Matrix<2, 2>::Identity(), {}});
  EXPECT_TRUE(testing::same_bits(ekf.belief(), informed.belief()));
  ekf.on(PoseObservation{0, {1.1, 2.1, 0.4}, -Matrix<3, 3>::Identity()});
  const Vector<3> variances(0.3 * 0.3, 0.3 * 0.3, 0.2 * 0.2);
  informed.on(PoseObservation{0, {1.1, 2.1, 0.4}, variances.asDiagonal()});
  EXPECT_TRUE(testing::same_bits(ekf.belief(), informed.belief()));
}

TEST(Edge, a_pose_of_no_spread_at_all_is_believed_to_a_millimetre) {
  PoseEkf ekf = testing::ekf_at(kStart);
  const Matrix<3, 3> R = 1e-30 * Matrix<3, 3>::Identity();
  EXPECT_EQ(ekf.on(PoseObservation{0, kStart, R}).verdict, Verdict::kFused);
  EXPECT_NEAR(std::sqrt(ekf.belief().P(0, 0)), 1e-3, 1e-6);
  EXPECT_NEAR(std::sqrt(ekf.belief().P(2, 2)), 1e-4, 1e-6);
}

TEST(Edge, an_initializer_starts_from_nothing_that_tells_nothing) {
  const auto is_used = [](const auto& message) {
    Initializer start({}, {testing::hall(), testing::one_tag()});
    start.on(message);
    return !start.state().hypotheses.empty();
  };
  const Matrix<2, 2> R = 0.04 * Matrix<2, 2>::Identity();
  EXPECT_TRUE(is_used(PositionFix{0, {1.0, 2.0}, R, {}}));
  EXPECT_FALSE(is_used(PositionFix{0, {1.0, 3e7}, R, {}}));
  EXPECT_FALSE(is_used(PositionFix{0, {1.0, 2.0}, Matrix<2, 2>::Zero(), {}}));
  EXPECT_FALSE(is_used(PoseObservation{0, kStart, Matrix<3, 3>::Zero()}));
  EXPECT_FALSE(is_used(PoseObservation{0, kStart, kMax * Matrix<3, 3>::Identity()}));
  EXPECT_TRUE(is_used(PoseObservation{0, kStart, kP}));
}

}  // namespace
}  // namespace locfuse::test_edge
