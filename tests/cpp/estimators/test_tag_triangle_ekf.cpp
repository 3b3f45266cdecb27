// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/estimators/tag_triangle_ekf.hpp"
#include "support/expect.hpp"
#include "support/linear_kalman.hpp"
#include "support/scrubber.hpp"

namespace locfuse::test_tag_triangle_ekf {
namespace {

using testing::expect_near;
using testing::expect_pose_near;
using testing::expect_refused;
using testing::kSecond;
using testing::linear_kalman;
using testing::same_bits;
using testing::triangle;

const Pose2 kPose{3.0, 4.0, 0.3};
const Matrix<3, 3> kP = Vector<3>(0.01, 0.02, 0.005).asDiagonal();
const Matrix<2, 2> kR = 0.0225 * Matrix<2, 2>::Identity();

TagTriangleEkf ekf_at(const Pose2& pose, const TagTriangleEkf::Config& config = {},
                      std::shared_ptr<const AnchorMap> anchors = nullptr) {
  return {config, {std::move(anchors), triangle()}, PoseEstimate{0, pose, kP}};
}

Vector<2> tag_at(const Pose2& pose, int tag) {
  return pose.act({testing::Scrubber::kTagX[tag], testing::Scrubber::kTagY[tag]});
}

PositionFix fix_of(int tag, const Pose2& pose, Stamp stamp = 0) {
  return {stamp, tag_at(pose, tag), kR, 10 + tag};
}

std::vector<PositionFix> epoch_at(const Pose2& pose, Stamp stamp = 0) {
  return {fix_of(0, pose, stamp), fix_of(1, pose, stamp), fix_of(2, pose, stamp)};
}

TagTriangleEkf::Config independent() {
  TagTriangleEkf::Config config;
  config.correlation_s = 0.0;
  return config;
}

Eigen::MatrixXd P_of(const TagTriangleEkf& ekf) { return ekf.belief().P; }

TEST(TagTriangleEkf, starts_from_a_pose_with_the_tags_where_it_has_them) {
  const TagTriangleEkf ekf = ekf_at(kPose);
  expect_pose_near(ekf.pose(), kPose, 1e-12);
  expect_near(ekf.estimate().covariance, kP, 1e-4);  // the sides have 5 mm
  for (int i = 0; i < 3; ++i) {
    const std::string tag = "tag" + std::to_string(i);
    expect_near(ekf.belief().mean(ekf.belief().slot(tag + ".position")), tag_at(kPose, i), 1e-12);
    expect_near(ekf.belief().mean(ekf.belief().slot(tag + ".velocity")), Vector<2>(0.0, 0.0), 0.0);
  }
  EXPECT_EQ(ekf.belief().dimension(), 12);
}

TEST(TagTriangleEkf, starts_from_three_fixes_in_any_order_and_fuses_the_sides) {
  std::vector<PositionFix> fixes = epoch_at(kPose, 7);
  std::swap(fixes[0], fixes[2]);
  const TagTriangleEkf ekf({}, {{}, triangle()}, fixes);
  EXPECT_EQ(ekf.belief().stamp, 7);
  EXPECT_EQ(ekf.sides().verdict, Verdict::kFused);
  EXPECT_EQ(ekf.sides().dof, 3);
  expect_pose_near(ekf.pose(), kPose, 1e-9);
  // What the sides do not measure keeps the sigma of the fixes: the mean of the three.
  const Matrix<2, 2> middle = (ekf.belief().P.block<2, 2>(0, 0) + ekf.belief().P.block<2, 2>(0, 2) +
                               ekf.belief().P.block<2, 2>(0, 4) + ekf.belief().P.block<2, 2>(2, 0) +
                               ekf.belief().P.block<2, 2>(2, 2) + ekf.belief().P.block<2, 2>(2, 4) +
                               ekf.belief().P.block<2, 2>(4, 0) + ekf.belief().P.block<2, 2>(4, 2) +
                               ekf.belief().P.block<2, 2>(4, 4)) /
                              9.0;
  expect_near(middle, kR / 3.0, 1e-12);
}

TEST(TagTriangleEkf, equals_the_textbook_with_the_matrices_of_the_paper) {
  TagTriangleEkf::Config config;
  config.motion.sigma_velocity_per_sqrt_s = 0.4;
  config.velocity = {0.03, 0.01, 0.05, 0.02};
  config.side.sigma_m = 0.01;
  config.heading_is_known = true;
  TagTriangleEkf ekf = ekf_at(kPose, config);
  Eigen::VectorXd x = ekf.belief().x;
  Eigen::MatrixXd P = P_of(ekf);
  const double T = 2.0 / 15.0;  // celan2017: 7.5 Hz
  for (int step = 1; step <= 40; ++step) {
    const Stamp before = ekf.belief().stamp;
    const Stamp stamp = testing::at(T * step);
    const double dt = seconds_between(before, stamp);
    Eigen::MatrixXd A = Eigen::MatrixXd::Identity(12, 12);
    A.topRightCorner(6, 6) = dt * Eigen::MatrixXd::Identity(6, 6);
    Eigen::MatrixXd Q = Eigen::MatrixXd::Zero(12, 12);
    for (int i = 0; i < 6; ++i) {
      Q(i, i) = 0.16 * dt * dt * dt / 3.0;
      Q(i, i + 6) = Q(i + 6, i) = 0.16 * dt * dt / 2.0;
      Q(i + 6, i + 6) = 0.16 * dt;
    }
    x = A * x;
    P = A * P * A.transpose() + Q;

    const int tag = step % 3;
    PositionFix z = fix_of(tag, {3.0 + 0.04 * step, 4.0, 0.3}, stamp);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2, 12);
    H(0, 2 * tag) = H(1, 2 * tag + 1) = 1.0;
    auto expected = linear_kalman(x, P, z.position - x.segment<2>(2 * tag), H, kR);
    ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
    expect_near(ekf.belief().x, expected.x, 1e-10);
    expect_near(P_of(ekf), expected.P, 1e-10);
    x = expected.x;
    P = expected.P;

    // v_i = R(heading) [v - w y_i; w x_i], the heading that of the tags.
    const double heading = ekf.pose().heading;
    const double v = 0.3;
    const double w = 0.1;
    Vector<6> r;
    Eigen::MatrixXd B(6, 3);
    for (int i = 0; i < 3; ++i) {
      const double tx = testing::Scrubber::kTagX[i];
      const double ty = testing::Scrubber::kTagY[i];
      const double c = std::cos(heading);
      const double s = std::sin(heading);
      r.segment<2>(2 * i) =
          Vector<2>(c * (v - w * ty) - s * w * tx, s * (v - w * ty) + c * w * tx) -
          x.segment<2>(6 + 2 * i);
      B.row(2 * i) << c, -s, -c * ty - s * tx;
      B.row(2 * i + 1) << s, c, -s * ty + c * tx;
    }
    const Vector<3> wheels(0.03 * 0.03, 0.01 * 0.01, 0.05 * 0.05);
    const Eigen::MatrixXd R =
        B * wheels.asDiagonal() * B.transpose() + 0.0004 * Eigen::MatrixXd::Identity(6, 6);
    H = Eigen::MatrixXd::Zero(6, 12);
    H.rightCols(6) = Eigen::MatrixXd::Identity(6, 6);
    expected = linear_kalman(x, P, r, H, R);
    x = expected.x;
    P = expected.P;
    // The sides, as one measurement.
    Vector<3> off;
    H = Eigen::MatrixXd::Zero(3, 12);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      const Vector<2> d = x.segment<2>(2 * j) - x.segment<2>(2 * i);
      const double known = std::hypot(testing::Scrubber::kTagX[j] - testing::Scrubber::kTagX[i],
                                      testing::Scrubber::kTagY[j] - testing::Scrubber::kTagY[i]);
      off(i) = known - d.norm();
      H.block(i, 2 * i, 1, 2) = -d.transpose() / d.norm();
      H.block(i, 2 * j, 1, 2) = d.transpose() / d.norm();
    }
    const double nis_of_velocities = expected.nis;
    expected = linear_kalman(x, P, off, H, 0.0001 * Eigen::MatrixXd::Identity(3, 3));
    const Outcome outcome = ekf.on(Velocity{stamp, v, w});
    ASSERT_EQ(outcome.verdict, Verdict::kFused);
    EXPECT_EQ(outcome.dof, 6);
    EXPECT_NEAR(outcome.nis, nis_of_velocities, 1e-7);
    EXPECT_NEAR(ekf.sides().nis, expected.nis, 1e-7);
    expect_near(ekf.belief().x, expected.x, 1e-10);
    expect_near(P_of(ekf), expected.P, 1e-10);
    x = ekf.belief().x;
    P = P_of(ekf);
  }
}

TEST(TagTriangleEkf, the_way_it_goes_tells_the_heading_unless_that_is_taken_as_known) {
  // It heads 0.1 rad further left than its odometry says, and one tag is located: only that it
  // drives ahead, and where that leads, shows it.
  TagTriangleEkf::Config config;
  for (const bool is_known : {false, true}) {
    config.heading_is_known = is_known;
    TagTriangleEkf ekf = ekf_at({0.0, 0.0, 0.0}, config);
    for (int i = 1; i <= 60; ++i) {
      const Stamp stamp = testing::at(0.1 * i);
      const Pose2 truth = Pose2{0.0, 0.0, 0.1} * Pose2{0.05 * i, 0.0, 0.0};
      ekf.on(Velocity{stamp, 0.5, 0.0});
      ekf.on(fix_of(0, truth, stamp));
    }
    EXPECT_EQ(std::abs(ekf.pose().heading - 0.1) < 0.03, !is_known) << ekf.pose().heading;
  }
}

TEST(TagTriangleEkf, the_pose_is_that_of_the_rigid_fit_of_its_tags) {
  testing::Scrubber run;
  testing::drive(run, 1, 20.0);
  TagTriangleEkf ekf(independent(), {{}, triangle()}, run.start);
  for (const Message& message : run.messages) {
    ekf.on(message);
  }
  Matrix<2, 3> body;
  Matrix<2, 3> world;
  for (int i = 0; i < 3; ++i) {
    body.col(i) << testing::Scrubber::kTagX[i], testing::Scrubber::kTagY[i];
    world.col(i) = ekf.belief().x.segment<2>(2 * i);
  }
  const Matrix<6, 6> P = ekf.belief().P.topLeftCorner<6, 6>();
  const RigidFit fit = rigid_fit(body, world, P);
  EXPECT_EQ(fit.status, RigidFitStatus::kFitted);
  expect_pose_near(ekf.pose(), fit.pose, 1e-12);
  expect_near(ekf.estimate().covariance, fit.covariance, 1e-12);
  EXPECT_NEAR(ekf.fit().nis, fit.nis, 1e-9);
  EXPECT_LT(fit.nis, 16.3);  // the sides hold it together
}

TEST(TagTriangleEkf, an_increment_is_its_mean_velocity_from_its_beginning_on) {
  TagTriangleEkf by_velocity = ekf_at(kPose);
  TagTriangleEkf by_increment = by_velocity;
  TagTriangleEkf late = by_velocity;
  const double T = 0.2;
  by_velocity.on(Velocity{0, 0.3, 0.5});
  EXPECT_EQ(by_increment.on(Increment{0, testing::at(T), arc(0.3 * T, 0.0, 0.5 * T)}).verdict,
            Verdict::kFused);
  EXPECT_EQ(by_increment.belief().stamp, 0);
  expect_near(by_increment.belief().x, by_velocity.belief().x, 1e-12);
  expect_near(P_of(by_increment), P_of(by_velocity), 1e-12);
  // A fix within its time came first: then it is fused there.
  late.on(fix_of(0, kPose, testing::at(0.1)));
  TagTriangleEkf same = late;
  EXPECT_EQ(late.on(Increment{0, testing::at(T), arc(0.3 * T, 0.0, 0.5 * T)}).verdict,
            Verdict::kFused);
  same.on(Velocity{testing::at(0.1), 0.3, 0.5});
  expect_near(late.belief().x, same.belief().x, 1e-12);
  EXPECT_EQ(late.on(Increment{5, 5, {}}).verdict, Verdict::kStale);
  EXPECT_EQ(late.on(Increment{kSecond, kSecond, {0.1, 0.0, 0.0}}).verdict, Verdict::kNotModelled);
}

TEST(TagTriangleEkf, ranges_of_the_tags_stand_in_for_an_rtls) {
  const Pose2 truth{2.0, 1.0, 0.6};
  const auto hall = testing::hall();
  TagTriangleEkf::Config config;
  config.range.sigma_m = 0.02;
  TagTriangleEkf ekf(config, {hall, triangle()},
                     PoseEstimate{0, {1.7, 1.2, 0.4}, Vector<3>(0.1, 0.1, 0.1).asDiagonal()});
  for (int epoch = 0; epoch < 30; ++epoch) {
    const Stamp stamp = testing::at(0.1 * epoch);
    for (int tag = 0; tag < 3; ++tag) {
      for (const Anchor& anchor : hall->anchors()) {
        const Vector<2> p = tag_at(truth, tag);
        const double range = (Vector<3>(p.x(), p.y(), 1.0) - anchor.position).norm();
        ASSERT_EQ(ekf.on(Range{stamp, 10 + tag, anchor.id, range, {}}).verdict, Verdict::kFused);
      }
    }
    ASSERT_EQ(ekf.on(Velocity{stamp, 0.0, 0.0}).verdict, Verdict::kFused);
  }
  expect_pose_near(ekf.pose(), truth, 1e-3);
  EXPECT_EQ(ekf.on(Range{3 * kSecond, 99, 0, 3.0, {}}).verdict, Verdict::kNotModelled);
  EXPECT_EQ(ekf.on(Range{3 * kSecond, 10, 99, 3.0, {}}).verdict, Verdict::kNotModelled);
  TagTriangleEkf without = ekf_at(kPose);
  EXPECT_EQ(without.on(Range{0, 10, 0, 3.0, {}}).verdict, Verdict::kNotModelled);
}

TEST(TagTriangleEkf, sides_held_without_odometry_make_tags_surer_and_the_pose_as_sure) {
  TagTriangleEkf loose(independent(), {{}, triangle()}, PoseEstimate{0, {3.0, 4.0, 0.1}, kP});
  TagTriangleEkf held = loose;
  for (int i = 1; i <= 40; ++i) {
    for (const PositionFix& z : epoch_at(kPose, i * kSecond)) {
      loose.on(z);
      held.on(z);
    }
    EXPECT_EQ(held.hold_sides().verdict, Verdict::kFused);
    EXPECT_EQ(held.sides().dof, 3);
    EXPECT_EQ(held.belief().stamp, i * kSecond);
  }
  EXPECT_EQ(loose.sides().verdict, Verdict::kIgnored);
  EXPECT_NEAR(held.pose().heading, kPose.heading, 0.02);
  EXPECT_LT(held.belief().P(0, 0), 0.5 * loose.belief().P(0, 0));
  EXPECT_LT(held.fit().nis, 1e-6);
  // Each tag is located as well as the others: then the rigid fit knows all that the sides know.
  expect_near(held.estimate().covariance, loose.estimate().covariance, 1e-4);
}

TEST(TagTriangleEkf, what_is_not_fused_leaves_no_trace) {
  TagTriangleEkf ekf = ekf_at(kPose);
  ekf.on(Velocity{kSecond, 0.3, 0.0});
  const TagTriangleEkf before = ekf;
  const auto expect_no_trace = [&](const Message& message, Verdict verdict) {
    EXPECT_EQ(ekf.on(message).verdict, verdict);
    EXPECT_TRUE(same_bits(ekf.belief(), before.belief()));
    EXPECT_EQ(ekf.sides().nis, before.sides().nis);
  };
  const Stamp later = 2 * kSecond;
  expect_no_trace(PositionFix{later, {90.0, 0.0}, kR, 10}, Verdict::kGated);
  expect_no_trace(Velocity{later, 30.0, 0.0}, Verdict::kGated);
  expect_no_trace(PositionFix{later, {3.0, 4.0}, kR, 9}, Verdict::kNotModelled);
  expect_no_trace(PositionFix{later, {3.0, 4.0}, kR}, Verdict::kNotModelled);
  expect_no_trace(fix_of(0, kPose, 0), Verdict::kStale);
  expect_no_trace(Velocity{0, 0.3, 0.0}, Verdict::kStale);
  expect_no_trace(Increment{0, kSecond / 2, {0.1, 0.0, 0.0}}, Verdict::kStale);
  expect_no_trace(PoseObservation{later, kPose, kP}, Verdict::kIgnored);
  expect_no_trace(RangeBearing{later, 1, 1.0, 0.0, {}}, Verdict::kIgnored);
}

TEST(TagTriangleEkf, a_message_that_is_not_valid_is_refused_and_leaves_no_trace) {
  TagTriangleEkf ekf = ekf_at(kPose);
  const GaussianBelief before = ekf.belief();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused([&] { ekf.on(PositionFix{kSecond, {nan, 0.0}, kR, 10}); }, "nan");
  expect_refused([&] { ekf.on(PositionFix{kSecond, {1.0, 0.0}, -kR, 10}); }, "covariance");
  expect_refused([&] { ekf.on(Velocity{kSecond, nan, 0.0}); }, "nan");
  expect_refused([&] { ekf.on(Range{kSecond, 10, 0, -1.0, {}}); }, "-1");
  expect_refused([&] { ekf.advance_to(std::numeric_limits<Stamp>::max()); }, "ns");
  expect_refused([&] { (void)ekf.estimate(-1); }, "before the belief");
  EXPECT_TRUE(same_bits(ekf.belief(), before));
}

TEST(TagTriangleEkf, a_copy_is_a_snapshot) {
  testing::Scrubber run;
  testing::drive(run, 3, 10.0);
  TagTriangleEkf ekf({}, {{}, triangle()}, run.start);
  for (const Message& message : run.messages) {
    ekf.on(message);
  }
  const TagTriangleEkf snapshot = ekf;
  const Velocity next{ekf.belief().stamp + kSecond / 8, 0.3, 0.1};
  ekf.on(next);
  TagTriangleEkf other = snapshot;
  EXPECT_FALSE(same_bits(other.belief(), ekf.belief()));
  other.on(next);
  EXPECT_TRUE(same_bits(other.belief(), ekf.belief()));
}

TEST(TagTriangleEkf, estimates_ahead_with_the_velocity_of_the_tags) {
  TagTriangleEkf ekf = ekf_at({0.0, 0.0, 0.0});
  for (int i = 0; i <= 20; ++i) {
    ekf.on(Velocity{testing::at(0.1 * i), 0.5, 0.0});
  }
  const PoseEstimate now = ekf.estimate();
  const PoseEstimate ahead = ekf.estimate(now.stamp + kSecond);
  EXPECT_NEAR(ahead.pose.x - now.pose.x, 0.5, 0.01);
  EXPECT_GT(ahead.covariance(0, 0), now.covariance(0, 0));
  EXPECT_EQ(ekf.belief().stamp, now.stamp);
}

// Bad input --------------------------------------------------------------------------------------

std::vector<Tag> tags_at(const Vector<2>& a, const Vector<2>& b, const Vector<2>& c) {
  return {{10, {a.x(), a.y(), 1.0}}, {11, {b.x(), b.y(), 1.0}}, {12, {c.x(), c.y(), 1.0}}};
}

TEST(TagTriangleEkf, refuses_tags_that_make_no_triangle_and_says_which) {
  const PoseEstimate start{0, kPose, kP};
  const auto with = [&](const std::vector<Tag>& tags) {
    return [=] { TagTriangleEkf({}, {{}, tags}, start); };
  };
  expect_refused(with({triangle()[0], triangle()[1]}), "2 tags", "expected 3");
  expect_refused(with(tags_at({0.5, 0.1}, {-0.5, 0.2}, {0.5, 0.1})), "tag 12 and tag 10",
                 "one point");
  expect_refused(with(tags_at({0.5, 0.0}, {-0.5, 0.0}, {0.1, 0.0})), "tag", "line");
  expect_refused(with(tags_at({0.5, 0.0}, {-0.5, 0.0}, {0.1, 0.02})), "on a line");
  expect_refused(with(tags_at({0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0})), "one point");
  std::vector<Tag> twice = triangle();
  twice[2].id = 10;
  expect_refused(with(twice), "tag 10", "twice");
  EXPECT_NO_THROW(TagTriangleEkf({}, {{}, tags_at({0.5, 0.0}, {-0.5, 0.0}, {0.1, 0.06})}, start));
}

TEST(TagTriangleEkf, refuses_sides_that_contradict_the_places_of_the_tags) {
  TagTriangleEkf::Config config;
  const double side = std::hypot(1.05, 0.25);
  config.sides_m = Vector<3>(side, 0.5, side);
  EXPECT_NO_THROW((void)ekf_at(kPose, config));
  config.sides_m = Vector<3>(side, 0.55, side);
  expect_refused([&] { (void)ekf_at(kPose, config); }, "0.55 m from tag 11 to tag 12", "0.5 m");
}

TEST(TagTriangleEkf, refuses_a_config_out_of_range) {
  const auto with = [](const auto& change) {
    return [=] {
      TagTriangleEkf::Config config;
      change(config);
      (void)ekf_at(kPose, config);
    };
  };
  using Config = TagTriangleEkf::Config;
  expect_refused(with([](Config& c) { c.side.sigma_m = 0.0; }), "side.sigma_m");
  expect_refused(with([](Config& c) { c.side.sigma_m = 1e-6; }), "0.0001");
  expect_refused(with([](Config& c) { c.motion.sigma_velocity_per_sqrt_s = -1.0; }), "motion.");
  expect_refused(with([](Config& c) { c.velocity.sigma_point_mps = 0.0; }), "velocity.");
  expect_refused(with([](Config& c) { c.sigma_start_velocity_mps = 0.0; }), "sigma_start_velocity");
  expect_refused(with([](Config& c) { c.velocity.gate = 0.0; }), "probability");
  expect_refused(with([](Config& c) { c.range.sigma_m = 0.0; }), "range.sigma_m");
  expect_refused(
      [] {
        TagTriangleEkf({}, {{}, triangle()}, PoseEstimate{0, kPose, -kP});
      },
      "covariance");
}

TEST(TagTriangleEkf, names_the_order_of_ids_that_would_fit_a_start) {
  std::vector<PositionFix> swapped = epoch_at(kPose);
  for (PositionFix& z : swapped) {
    z.covariance = 0.0025 * Matrix<2, 2>::Identity();
  }
  std::swap(swapped[0].tag, swapped[1].tag);  // 11, 10, 12
  expect_refused(
      [&] {
        TagTriangleEkf({}, {{}, triangle()}, swapped);
      },
      "tags 11, 10, 12", "as tags 10, 11, 12", "swapped");
  std::vector<PositionFix> torn = epoch_at(kPose);
  torn[1].position.x() += 5.0;
  expect_refused(
      [&] {
        TagTriangleEkf({}, {{}, triangle()}, torn);
      },
      "nor in any other order", "10-11", "1.07");
  std::vector<PositionFix> late = epoch_at(kPose);
  late[2].stamp = 5;
  expect_refused([&] { TagTriangleEkf({}, {{}, triangle()}, late); }, "one stamp");
  std::vector<PositionFix> strange = epoch_at(kPose);
  strange[0].tag.reset();
  expect_refused([&] { TagTriangleEkf({}, {{}, triangle()}, strange); }, "no tag", "10, 11, 12");
}

// Accuracy ---------------------------------------------------------------------------------------

/// Root mean square error of the position [m] from 20 s on, with messages that `change` spoils.
template <class Change>
double rmse(const TagTriangleEkf::Config& config, const Change& change, std::uint64_t seed = 5) {
  testing::Scrubber run;
  testing::drive(run, seed, 120.0);
  TagTriangleEkf ekf(config, {{}, triangle()}, run.start);
  double sum = 0.0;
  int count = 0;
  for (std::size_t k = 0; k < run.messages.size(); ++k) {
    Message message = run.messages[k];
    if (!change(message)) {
      continue;
    }
    ekf.on(message);
    if (run.truth[k][0] > 20e9) {
      const Pose2 pose = ekf.pose();
      sum += std::pow(pose.x - run.truth[k][1], 2) + std::pow(pose.y - run.truth[k][2], 2);
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

bool nothing(Message& /*message*/) { return true; }

TEST(TagTriangleEkf, wheels_and_fixes_together_are_better_than_either) {
  // Three fixes of 0.15 m make a position of 0.12 m over both axes.
  for (const std::uint64_t seed : {5U, 6U, 7U}) {
    const double fused = rmse({}, nothing, seed);
    EXPECT_LT(fused, 0.09);
    const double no_wheels = rmse(
        {}, [](Message& m) { return !std::holds_alternative<Velocity>(m); }, seed);
    const double no_fixes = rmse(
        {}, [](Message& m) { return !std::holds_alternative<PositionFix>(m); }, seed);
    EXPECT_GT(no_wheels, 1.3 * fused);
    EXPECT_GT(no_fixes, 3.0 * fused);
    const double turned = rmse(
        {},
        [](Message& m) {
          if (Velocity* u = std::get_if<Velocity>(&m)) {
            u->turn_rate = -u->turn_rate;
          }
          return true;
        },
        seed);
    EXPECT_GT(turned, 0.09);  // the bound above notices a wrong sign
  }
}

TEST(TagTriangleEkf, carries_on_when_a_tag_dies) {
  const auto dead = [](int tag) {
    return [tag](Message& m) {
      const PositionFix* z = std::get_if<PositionFix>(&m);
      return z == nullptr || z->tag != 10 + tag || z->stamp < 10 * kSecond;
    };
  };
  for (const int tag : {0, 1, 2}) {
    EXPECT_LT(rmse({}, dead(tag)), 0.12) << "without tag " << tag;
  }
}

TEST(TagTriangleEkf, keeps_the_triangle_over_ten_thousand_updates) {
  testing::Scrubber run;
  testing::drive(run, 9, 1200.0);
  TagTriangleEkf ekf({}, {{}, triangle()}, run.start);
  for (const Message& message : run.messages) {
    ekf.on(message);
  }
  ASSERT_GT(run.messages.size(), 10000U);
  EXPECT_TRUE(testing::is_covariance(P_of(ekf)));
  const Vector<2> side = ekf.belief().x.segment<2>(2) - ekf.belief().x.head<2>();
  EXPECT_NEAR(side.norm(), std::hypot(1.05, 0.25), 0.005);
}

}  // namespace
}  // namespace locfuse::test_tag_triangle_ekf
