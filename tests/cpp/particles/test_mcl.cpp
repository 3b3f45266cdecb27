// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "locfuse/particles/mcl.hpp"
#include "support/expect.hpp"
#include "support/pose_errors.hpp"
#include "support/rooms.hpp"

namespace locfuse::test_mcl {
namespace {

using testing::Rng;
using testing::uniform;

constexpr Stamp kStep = 200'000'000;

/// A drive around the middle of a room: increments with noise, a scan after each.
struct Drive {
  testing::Room room;
  std::vector<Pose2> truth;  // one more than increments
  std::vector<Increment> increments;
  std::vector<LaserScan> scans;
};

OdometryMotion::Config odometry() { return {0.05, 0.03, 0.04, 0.05, 0.0, 0.0}; }

Drive drive(std::uint64_t seed, int steps) {
  Rng rng(seed);
  Drive run;
  run.room = testing::random_room(rng);
  const OdometryMotion motion(odometry());
  Pose2 pose = run.room.middle * Pose2{0.0, -1.0, 0.0};
  run.truth.push_back(pose);
  const double length = 0.1;
  for (int i = 0; i < steps; ++i) {
    const Pose2 step = arc(length, 0.0, length);  // a circle of one metre
    const Matrix<3, 3> Q = motion.propagate({}, step, 0.2).noise;
    const Vector<3> off{testing::normal(rng, std::sqrt(Q(0, 0))),
                        testing::normal(rng, std::sqrt(Q(1, 1))),
                        testing::normal(rng, std::sqrt(Q(2, 2)))};
    pose = pose * retract(step, off);
    run.truth.push_back(pose);
    run.increments.push_back({i * kStep, (i + 1) * kStep, step});
    run.scans.push_back(testing::scan_from(run.room.walls, pose, rng, 0.02));
    run.scans.back().stamp = (i + 1) * kStep;
  }
  return run;
}

Mcl::Config config(std::uint64_t seed = 1) {
  Mcl::Config config;
  config.odometry = odometry();
  config.seed = seed;
  return config;
}

PoseHypothesis near(const Pose2& pose, double sigma_xy, double sigma_heading) {
  const Vector<3> sigma(sigma_xy, sigma_xy, sigma_heading);
  return {{0, pose, sigma.cwiseAbs2().asDiagonal()}, 1.0};
}

using Errors = testing::PoseErrors;

// Rotated from cells to metres, they were symmetric only up to rounding.
TEST(Mcl, covariances_are_symmetric_to_the_bit_on_a_turned_map) {
  const Drive run = drive(3, 1);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth.front(), 0.05, 0.05),
                near(run.room.middle * Pose2{1.5, 0.5, 1.5}, 0.05, 0.05)});
  ASSERT_EQ(mcl.hypotheses().size(), 2U);
  for (const PoseHypothesis& hypothesis : mcl.hypotheses()) {
    EXPECT_TRUE(testing::is_covariance(hypothesis.estimate.covariance));
  }
  EXPECT_TRUE(testing::is_covariance(mcl.estimate().covariance));
  EXPECT_TRUE(testing::is_covariance(mcl.overall_estimate().covariance));
}

// A step of 8e269 m, from a counter or a flipped bit, made it infinite until the next start.
TEST(Mcl, a_step_beyond_all_limits_leaves_the_covariance_finite) {
  const Drive run = drive(3, 1);
  for (const double limit : {Limits{}.speed_mps, 1e12}) {
    Mcl::Config settings = config();
    settings.limits.speed_mps = limit;
    Mcl mcl(settings, testing::on_map(run.room.map), 0);
    mcl.start_at({near(run.room.middle, 0.1, 0.05)});
    const Increment far{1'000'000'000, 48'000'000'000, {-7.9e269, 0.9, 3.8}};
    EXPECT_EQ(mcl.on(far).verdict, Verdict::kImplausible);
    EXPECT_EQ(mcl.on(Increment{48'000'000'000, 96'000'000'000, {0.9, 0.9, 3.8}}).verdict,
              Verdict::kFused);
    EXPECT_TRUE(testing::is_covariance(mcl.estimate().covariance));
    EXPECT_TRUE(testing::is_covariance(mcl.overall_estimate().covariance));
  }
}

// Only the best cluster was propagated; with the share of the others it was not a covariance.
TEST(Mcl, the_covariance_of_all_particles_is_propagated_as_a_whole) {
  const Drive run = drive(3, 1);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  PoseHypothesis vague = near(run.room.middle, 0.05, 1.5);
  PoseHypothesis sharp = near(run.room.middle * Pose2{2.5, 0.0, 0.0}, 0.05, 0.05);
  vague.probability = 0.6;
  sharp.probability = 0.4;
  mcl.start_at({vague, sharp});
  const PoseEstimate here = mcl.overall_estimate();
  ASSERT_GT(here.covariance(2, 2), 0.5);
  mcl.on(Increment{0, 1'000'000'000, {30.0, 0.0, 0.0}});
  const PoseEstimate there = mcl.overall_estimate();
  EXPECT_TRUE(testing::is_covariance(there.covariance)) << there.covariance;
  // A heading error moves the end of the path sideways.
  EXPECT_GT(there.covariance(1, 1) + there.covariance(0, 0), 900.0 * 0.5);
  EXPECT_NEAR(there.covariance(2, 2), here.covariance(2, 2), 0.1);
}

TEST(Mcl, tracks_to_centimetres_with_consistent_covariance) {
  Errors errors;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Drive run = drive(seed, 60);
    Mcl mcl(config(seed), testing::on_map(run.room.map), 0);
    mcl.start_at({near(run.truth[0], 0.2, 0.1)});
    for (std::size_t i = 0; i < run.scans.size(); ++i) {
      mcl.on(run.increments[i]);
      mcl.on(run.scans[i]);
      if (i >= 20) {
        errors.add(mcl.estimate(), run.truth[i + 1]);
      }
    }
    EXPECT_TRUE(mcl.ready());
    EXPECT_GT(mcl.explained(), 0.95);
  }
  const double rmse = std::sqrt(errors.squared / errors.count);
  const double heading = std::sqrt(errors.squared_heading / errors.count) * 180.0 / kPi;
  std::printf("RMSE %.4f m, heading %.3f deg, NEES %.2f\n", rmse, heading,
              errors.nees / errors.count);
  EXPECT_LE(rmse, 0.04);
  EXPECT_LE(heading, 1.0);
  // Scans share the map's rounding, so the covariance is conservative, never optimistic.
  EXPECT_LE(errors.nees / errors.count, 3.5);
  EXPECT_GE(errors.nees / errors.count, 0.3);
}

TEST(Mcl, tracks_with_the_beam_model_as_well) {
  for (const bool zhang : {false, true}) {
    Errors errors;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const Drive run = drive(seed, 40);
      Mcl::Config by_beams = config(seed);
      by_beams.min_particles = by_beams.max_particles = 500;
      by_beams.likelihood = Mcl::Likelihood::kBeams;
      by_beams.beam_model = zhang ? BeamModel::gaussian_and_no_return() : BeamModel::Config{};
      Mcl mcl(by_beams, testing::on_map(run.room.map), 0);
      mcl.start_at({near(run.truth[0], 0.2, 0.1)});
      for (std::size_t i = 0; i < run.scans.size(); ++i) {
        mcl.on(run.increments[i]);
        mcl.on(run.scans[i]);
        if (i >= 20) {
          errors.add(mcl.estimate(), run.truth[i + 1]);
        }
      }
      EXPECT_TRUE(mcl.ready());
    }
    EXPECT_LE(std::sqrt(errors.squared / errors.count), 0.06);
    EXPECT_LE(errors.nees / errors.count, 4.0);
  }
}

TEST(Mcl, localizes_globally_and_is_not_ready_before) {
  int found = 0;
  int ready_and_wrong = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Drive run = drive(100 + seed, 60);
    Mcl::Config settings = config(seed);
    settings.max_particles = 20'000;
    Mcl mcl(settings, testing::on_map(run.room.map), 0);
    EXPECT_FALSE(mcl.ready());
    for (std::size_t i = 0; i < run.scans.size(); ++i) {
      mcl.on(run.increments[i]);
      mcl.on(run.scans[i]);
      const Vector<3> e = local(mcl.estimate().pose, run.truth[i + 1]);
      const bool right = e.head<2>().norm() < 0.3 && std::abs(e.z()) < 0.2;
      ready_and_wrong += static_cast<int>(mcl.ready() && !right);
      if (i + 1 == run.scans.size()) {
        found += static_cast<int>(right && mcl.ready());
      }
    }
    EXPECT_LT(mcl.belief().size, 2000);  // few are needed once it is localized
  }
  EXPECT_GE(found, 19);
  EXPECT_LE(ready_and_wrong, 12);  // of 1200
}

TEST(Mcl, relocalizes_after_a_kidnapping) {
  int recovered = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Drive run = drive(200 + seed, 120);
    Mcl::Config settings = config(seed);
    settings.max_particles = 5000;
    settings.most_drop = 1.0;  // the map is exact, and in so small a room any place fits a little
    Mcl mcl(settings, testing::on_map(run.room.map), 0);
    mcl.start_at({near(run.truth[0], 0.2, 0.1)});
    for (std::size_t i = 0; i < run.scans.size(); ++i) {
      if (i >= 30 && i < 70) {  // lifted, and put down 4 m of circle ahead
        continue;
      }
      Increment step = run.increments[i];
      mcl.on(step);
      mcl.on(run.scans[i]);
    }
    const Vector<3> e = local(mcl.estimate().pose, run.truth.back());
    recovered += static_cast<int>(e.head<2>().norm() < 0.3 && std::abs(e.z()) < 0.2);
  }
  EXPECT_GE(recovered, 19);
}

/// A room that looks the same from two poses, and a robot without a start.
struct TwinRoom {
  TwinRoom() { testing::add_box(walls, {}, 8.0, 5.0); }

  [[nodiscard]] std::shared_ptr<const OccupancyGrid> map() const {
    return testing::map_of(walls, 200, 160, 0.05, {-5.0, -4.0, 0.0});
  }

  void drive(Mcl& mcl, const Pose2& step, int steps, Rng& rng) {
    for (int i = 0; i < steps; ++i) {
      pose = pose * step;
      mcl.on(Increment{i * kStep, (i + 1) * kStep, step});
      LaserScan scan = testing::scan_from(walls, pose, rng, 0.02);
      scan.stamp = (i + 1) * kStep;
      mcl.on(scan);
      ASSERT_FALSE(mcl.ready()) << i;
    }
  }

  /// Expects both poses among the hypotheses, within `off` and above `probability`.
  void expect_both(const Mcl& mcl, double off, double probability) const {
    for (const Pose2& fits : {pose, Pose2{0.0, 0.0, kPi} * pose}) {
      const bool there = std::any_of(
          mcl.hypotheses().begin(), mcl.hypotheses().end(), [&](const PoseHypothesis& h) {
            return local(h.estimate.pose, fits).norm() < off && h.probability > probability;
          });
      EXPECT_TRUE(there);
    }
  }

  testing::Walls walls;
  Pose2 pose{-1.0, -1.0, 0.3};
};

TEST(Mcl, reports_both_poses_of_a_symmetric_room) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    TwinRoom room;
    Mcl::Config settings = config(seed);
    settings.min_particles = 5000;
    settings.max_particles = 20'000;
    settings.scouts = 0;
    Mcl mcl(settings, testing::on_map(room.map()), 0);
    ASSERT_NO_FATAL_FAILURE(room.drive(mcl, arc(0.26, 0.0, 0.1), 8, rng));
    ASSERT_GE(mcl.hypotheses().size(), 2U);
    room.expect_both(mcl, 0.3, 0.05);
  }
}

// With resampling across bins one of the two died by chance within some metres, and the other was
// ready.
TEST(Mcl, of_two_poses_that_fit_equally_none_dies_by_chance) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    TwinRoom room;
    Mcl mcl(config(seed), testing::on_map(room.map()), 0);
    ASSERT_NO_FATAL_FAILURE(room.drive(mcl, arc(0.1, 0.0, 0.1), 300, rng));
    room.expect_both(mcl, 0.2, 0.02);
  }
}

TEST(Mcl, is_the_same_on_any_number_of_threads) {
  const Drive run = drive(7, 30);
  std::vector<float> alone;
  for (const int threads : {1, 2, 3}) {
    Mcl::Config settings = config(7);
    settings.threads = threads;
    Mcl mcl(settings, testing::on_map(run.room.map), 0);
    for (std::size_t i = 0; i < run.scans.size(); ++i) {
      mcl.on(run.increments[i]);
      mcl.on(run.scans[i]);
    }
    if (threads == 1) {
      alone = mcl.belief().x;
    }
    EXPECT_EQ(mcl.belief().x, alone);
  }
}

TEST(Mcl, a_copy_is_a_snapshot) {
  const Drive run = drive(8, 20);
  Mcl mcl(config(8), testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth[0], 0.2, 0.1)});
  Mcl copy = mcl;
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    mcl.on(run.increments[i]);
    mcl.on(run.scans[i]);
  }
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    copy.on(run.increments[i]);
    copy.on(run.scans[i]);
  }
  EXPECT_EQ(copy.belief().x, mcl.belief().x);
  EXPECT_EQ(copy.belief().weight, mcl.belief().weight);
}

TEST(Mcl, a_scan_during_an_increment_uses_its_part_of_the_arc) {
  const Drive run = drive(9, 1);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth[0], 1e-4, 1e-5)});
  mcl.on(Increment{0, 1'000'000'000, arc(0.4, 0.0, 0.2)});
  LaserScan scan = run.scans[0];
  scan.stamp = 500'000'000;
  EXPECT_EQ(mcl.on(scan).verdict, Verdict::kFused);
  const Pose2 half = run.truth[0] * arc(0.2, 0.0, 0.1);
  EXPECT_LT(local(mcl.hypotheses().front().estimate.pose, half).norm(), 0.1);
  const PoseEstimate end = mcl.estimate();
  EXPECT_EQ(end.stamp, 1'000'000'000);
  EXPECT_LT(local(end.pose, run.truth[0] * arc(0.4, 0.0, 0.2)).norm(), 0.1);
}

TEST(Mcl, a_second_scan_without_motion_is_not_used) {
  const Drive run = drive(10, 1);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  LaserScan scan = run.scans[0];
  EXPECT_EQ(mcl.on(scan).verdict, Verdict::kFused);
  const std::vector<float> before = mcl.belief().x;
  scan.stamp += kStep;
  EXPECT_EQ(mcl.on(scan).verdict, Verdict::kNotModelled);
  EXPECT_EQ(mcl.belief().x, before);
  scan.stamp = 0;
  EXPECT_EQ(mcl.on(scan).verdict, Verdict::kStale);
}

TEST(Mcl, after_a_start_ten_stationary_scans_are_used) {
  const Drive run = drive(10, 1);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth[1], 0.3, 0.1)});
  LaserScan scan = run.scans[0];
  int used = 0;
  for (int i = 0; i < 20; ++i) {
    scan.stamp = i * kStep / 20;
    used += static_cast<int>(mcl.on(scan).verdict == Verdict::kFused);
  }
  EXPECT_EQ(used, 11);
  EXPECT_LT(local(mcl.estimate().pose, run.truth[1]).head<2>().norm(), 0.1);
}

TEST(Mcl, the_scan_matching_proposal_leaves_the_belief_unchanged) {
  Vector<3> apart = Vector<3>::Zero();
  Vector<3> wider = Vector<3>::Zero();
  constexpr int kRuns = 10;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const Drive run = drive(300 + seed, 12);
    std::vector<PoseEstimate> ends;
    for (const bool refined : {false, true}) {
      Mcl::Config settings = config(seed);
      settings.min_particles = settings.max_particles = 20'000;
      settings.proposal = refined ? Mcl::Proposal::kScanMatch : Mcl::Proposal::kOdometry;
      Mcl mcl(settings, testing::on_map(run.room.map), 0);
      mcl.start_at({near(run.truth[0], 0.1, 0.05)});
      for (std::size_t i = 0; i < run.scans.size(); ++i) {
        mcl.on(run.increments[i]);
        mcl.on(run.scans[i]);
      }
      ends.push_back(mcl.hypotheses().front().estimate);
    }
    apart += local(ends[1].pose, ends[0].pose) / kRuns;
    wider += ends[1].covariance.diagonal().cwiseQuotient(ends[0].covariance.diagonal()) / kRuns;
  }
  EXPECT_LT(apart.head<2>().norm(), 0.003);
  EXPECT_LT(std::abs(apart.z()), 0.002);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(wider(i), 1.0, 0.2) << i;
  }
}

TEST(Mcl, starts_with_its_own_particles) {
  const Drive run = drive(16, 1);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  Matrix<4, Eigen::Dynamic> columns(4, 3);
  columns << 1.0, 1.1, 1.2, 2.0, 2.0, 2.0, 0.1, 0.1, 7.0, 1.0, 2.0, 1.0;
  mcl.start_with(5, columns);
  EXPECT_EQ(mcl.belief().size, 3);
  EXPECT_EQ(mcl.belief().stamp, 5);
  const Vector<2> second = mcl.grid().to_world({mcl.belief().x[1], mcl.belief().y[1]});
  EXPECT_NEAR(second.x(), 1.1, 1e-5);
  EXPECT_FLOAT_EQ(mcl.belief().weight[1], 0.5F);
  EXPECT_NEAR(std::atan2(mcl.belief().s[2], mcl.belief().c[2]) + mcl.grid().origin().heading,
              7.0 - 2.0 * kPi, 1e-5);
  columns(3, 0) = -1.0;
  testing::expect_refused([&] { mcl.start_with(5, columns); }, "weight >= 0");
  columns.row(3).setZero();
  testing::expect_refused([&] { mcl.start_with(5, columns); }, "some weight > 0");
  EXPECT_EQ(mcl.belief().size, 3);
}

TEST(Mcl, ranges_and_fixes_and_poses_weigh_particles) {
  const Drive run = drive(11, 1);
  const Pose2 truth = run.truth[0];
  std::vector<Anchor> rows;
  for (int i = 0; i < 4; ++i) {
    const Vector<2> p = run.room.middle.act({i % 2 == 0 ? -4.0 : 4.0, i < 2 ? -3.0 : 3.0});
    rows.push_back({i, {p.x(), p.y(), 2.0}});
  }
  const auto anchors = std::make_shared<const AnchorMap>(rows);
  Mcl::Config settings = config();
  settings.max_particles = 20'000;
  Mcl mcl(settings, {anchors, {Tag{0, {0.0, 0.0, 1.0}}}, {}, run.room.map}, 0);
  for (int epoch = 0; epoch < 3; ++epoch) {  // few particles take in information in parts
    for (const Anchor& anchor : rows) {
      const Vector<3> tag(truth.x, truth.y, 1.0);
      EXPECT_EQ(mcl.on(Range{0, 0, anchor.id, (anchor.position - tag).norm(), 0.1}).verdict,
                Verdict::kFused);
    }
  }
  EXPECT_EQ(mcl.on(Range{0, 0, 99, 3.0, 0.1}).verdict, Verdict::kNotModelled);
  // An anchor in the origin at the height of the tag was once taken for an unknown one.
  const auto origin = std::make_shared<const AnchorMap>(std::vector<Anchor>{{0, {0.0, 0.0, 1.0}}});
  Mcl at_origin(settings, {origin, {Tag{0, {0.0, 0.0, 1.0}}}, {}, run.room.map}, 0);
  EXPECT_EQ(at_origin.on(Range{0, 0, 0, 3.0, 0.1}).verdict, Verdict::kFused);
  const auto mean = [&] {
    Vector<2> sum = Vector<2>::Zero();
    for (std::size_t k = 0; k < static_cast<std::size_t>(mcl.belief().size); ++k) {
      sum += static_cast<double>(mcl.belief().weight[k]) *
             mcl.grid().to_world(Vector<2>(mcl.belief().x[k], mcl.belief().y[k]));
    }
    return sum;
  };
  EXPECT_LT((mean() - truth.position()).norm(), 0.15);
  PositionFix fix{0, truth.position(), 0.01 * Matrix<2, 2>::Identity()};
  EXPECT_EQ(mcl.on(fix).verdict, Verdict::kFused);
  EXPECT_EQ(mcl.on(PoseObservation{0, truth, 0.01 * Matrix<3, 3>::Identity()}).verdict,
            Verdict::kFused);
  EXPECT_LT((mcl.estimate().pose.position() - truth.position()).norm(), 0.15);
  // A fix of tag 1 is behind the body; one of an unknown tag is not used.
  Mcl with_tag(settings, {{}, {Tag{1, {-1.0, 0.0, 0.0}}}, {}, run.room.map}, 0);
  with_tag.start_at({{{0, truth, 0.01 * Matrix<3, 3>::Identity()}, 1.0}});
  fix.position = truth.act({-1.0, 0.0});
  fix.tag = 1;
  EXPECT_EQ(with_tag.on(fix).verdict, Verdict::kFused);
  EXPECT_LT((with_tag.estimate().pose.position() - truth.position()).norm(), 0.15);
  fix.tag = 2;
  EXPECT_EQ(with_tag.on(fix).verdict, Verdict::kNotModelled);
  Mcl without(settings, testing::on_map(run.room.map), 0);
  EXPECT_EQ(without.on(Range{0, 0, 0, 3.0, 0.1}).verdict, Verdict::kNotModelled);
}

TEST(Mcl, landmarks_weigh_particles_with_and_without_a_name) {
  const Drive run = drive(11, 1);
  const Pose2 truth = run.truth[0];
  std::vector<Landmark> posts;
  for (int i = 0; i < 4; ++i) {
    posts.push_back({i, run.room.middle.act({i % 2 == 0 ? -4.0 : 4.0, i < 2 ? -3.0 : 2.0 + i})});
  }
  const LandmarkSensor sight{std::make_shared<const LandmarkMap>(posts), {0.2, 0.0, 0.3}};
  const RangeBearingModel model({0.1, 0.05}, sight.T_body_sensor);
  for (const bool named : {true, false}) {
    Mcl::Config settings = config();
    settings.max_particles = 20'000;
    Mcl mcl(settings, {{}, {}, sight, run.room.map}, 0);
    for (int epoch = 0; epoch < 3; ++epoch) {
      for (const Landmark& post : posts) {
        const Vector<2> z = model.predict(truth, post.position);
        RangeBearing sighting{0, {}, z.x(), z.y(), {}};
        if (named) {
          sighting.landmark = post.id;
        }
        EXPECT_EQ(mcl.on(sighting).verdict, Verdict::kFused);
      }
    }
    const Vector<3> off = local(mcl.estimate().pose, truth);
    EXPECT_LT(off.head<2>().norm(), 0.2) << named;
    EXPECT_LT(std::abs(off.z()), 0.05) << named;
    EXPECT_EQ(mcl.on(RangeBearing{0, 99, 3.0, 0.0, {}}).verdict, Verdict::kNotModelled);
  }
  Mcl without(config(), testing::on_map(run.room.map), 0);
  EXPECT_EQ(without.on(RangeBearing{0, 0, 3.0, 0.0, {}}).verdict, Verdict::kNotModelled);
}

TEST(Mcl, without_odometry_the_belief_spreads) {
  const Drive run = drive(12, 1);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth[0], 0.05, 0.02)});
  LaserScan scan = run.scans[0];
  mcl.on(scan);
  const double before = mcl.estimate().covariance(0, 0);
  scan.stamp += 100 * kStep;
  mcl.on(scan);
  EXPECT_GT(mcl.belief().stamp, 0);
  EXPECT_GE(mcl.estimate().stamp, kStep);
  EXPECT_GT(mcl.estimate().covariance(0, 0), before);
}

TEST(Mcl, one_particle_is_enough_and_none_is_refused) {
  const Drive run = drive(13, 3);
  Mcl::Config one = config();
  one.min_particles = one.max_particles = 1;
  Mcl mcl(one, testing::on_map(run.room.map), 0);
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    mcl.on(run.increments[i]);
    mcl.on(run.scans[i]);
    EXPECT_TRUE(std::isfinite(mcl.estimate().pose.x));
  }
  one.min_particles = 0;
  testing::expect_refused([&] { Mcl(one, testing::on_map(run.room.map), 0); },
                          "min_particles is 0");
  one.min_particles = 5;
  testing::expect_refused([&] { Mcl(one, testing::on_map(run.room.map), 0); },
                          "max_particles is 1");
}

TEST(Mcl, bad_input_is_refused_and_changes_nothing) {
  const Drive run = drive(14, 2);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  LaserScan scan = run.scans[0];
  scan.ranges.assign(scan.ranges.size(), std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(mcl.on(scan).verdict, Verdict::kNotModelled);
  scan.ranges.clear();
  EXPECT_EQ(mcl.on(scan).verdict, Verdict::kNotModelled);
  scan.ranges = {1.0, 0.0, 1e300};
  EXPECT_EQ(mcl.on(scan).verdict, Verdict::kFused);  // the number of beams may change
  scan.geometry = nullptr;
  EXPECT_THROW(mcl.on(scan), std::invalid_argument);
  Increment wrong = run.increments[0];
  wrong.motion.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(mcl.on(wrong), std::invalid_argument);
  const std::vector<float> before = mcl.belief().x;
  testing::expect_refused([&] { mcl.start_at({}); }, "no pose");
  PoseHypothesis start = near({}, 0.1, 0.1);
  start.estimate.covariance.setZero();
  testing::expect_refused([&] { mcl.start_at({start}); }, "positive definite");
  testing::expect_refused(
      [&] {
        mcl.start_at({{near({}, 0.1, 0.1).estimate, INFINITY}});
      },
      "finite probabilities");
  // In single precision these particles were infinite.
  testing::expect_refused([&] { mcl.start_at({near({1e40, 0.0, 0.0}, 0.1, 0.1)}); }, "distance_m");
  testing::expect_refused([&] { mcl.start_at({near({}, 1e40, 0.1)}); }, "distance_m");
  PoseEstimate vague = near({}, 1e40, 0.1).estimate;
  vague.stamp = mcl.estimate().stamp;
  testing::expect_refused([&] { mcl.inject(vague, 0.5); }, "distance_m");
  testing::expect_refused([&] { mcl.start_with(0, Matrix<4, 1>(1e40, 0.0, 0.0, 1.0)); },
                          "distance_m");
  testing::expect_refused(
      [&] {
        const Vector<4> heavy(0.0, 0.0, 0.0, std::numeric_limits<double>::max());
        mcl.start_with(0, (Matrix<4, 2>() << heavy, heavy).finished());
      },
      "some weight > 0");
  EXPECT_EQ(mcl.belief().x, before);
  testing::expect_refused([&] { Mcl(config(), {}, 0); }, "no map");
  Mcl::Config settings = config();
  settings.threads = 0;
  testing::expect_refused([&] { Mcl(settings, testing::on_map(run.room.map), 0); }, "threads is 0");
  settings = config();
  settings.kld_error = std::numeric_limits<double>::quiet_NaN();
  testing::expect_refused([&] { Mcl(settings, testing::on_map(run.room.map), 0); },
                          "kld_error is nan");
}

TEST(Mcl, a_robot_off_the_map_or_in_a_wall_leaves_numbers_finite) {
  const Drive run = drive(15, 5);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  mcl.start_at({near({500.0, 500.0, 0.0}, 0.1, 0.1)});
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    mcl.on(run.increments[i]);
    mcl.on(run.scans[i]);
    EXPECT_TRUE(std::isfinite(mcl.estimate().pose.x + mcl.estimate().covariance.sum()));
  }
}

TEST(Mcl, one_particle_on_an_exact_map_has_a_covariance) {
  const Drive run = drive(3, 1);
  Mcl::Config c = config();
  c.sigma_map_m = c.sigma_map_rad = 0.0;
  Mcl mcl(c, testing::on_map(run.room.map), 0);
  mcl.start_with(0, Matrix<4, 1>(0.0, 0.0, 0.0, 1.0));
  EXPECT_TRUE(testing::is_covariance(mcl.estimate().covariance));
}

/// The way back subtracted what the way there had added to a variance, and more by rounding.
TEST(Mcl, a_long_way_there_and_back_leaves_a_covariance) {
  const Drive run = drive(3, 1);
  Mcl::Config c = config();
  c.odometry = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  Mcl mcl(c, testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth.front(), 0.1, 0.05)});
  const Stamp there = 11'000'000LL * 1'000'000'000;
  ASSERT_EQ(mcl.on(Increment{0, there, {1e9, 0.0, 0.0}}).verdict, Verdict::kFused);
  ASSERT_EQ(mcl.on(Increment{there, 2 * there, {-1e9, 0.0, 0.0}}).verdict, Verdict::kFused);
  mcl.on(Velocity{2 * there, 0.0, 0.0});
  EXPECT_TRUE(testing::is_covariance(mcl.estimate().covariance));
}

TEST(Mcl, a_scan_farther_off_the_map_than_an_integer_counts_is_accepted) {
  const Drive run = drive(3, 1);
  for (const Mcl::Likelihood likelihood : {Mcl::Likelihood::kField, Mcl::Likelihood::kBeams}) {
    Mcl::Config c = config();
    c.likelihood = likelihood;
    c.threads = 2;
    Mcl mcl(c, testing::on_map(run.room.map), 0);
    mcl.start_at({near(run.truth.front(), 0.05, 0.05)});
    const Stamp end = 600'000'000LL * 1'000'000'000;
    ASSERT_EQ(mcl.on(Increment{0, end, {5e10, 0.0, 0.0}}).verdict, Verdict::kFused);
    LaserScan scan = run.scans.front();
    scan.stamp = end;
    EXPECT_NO_THROW(mcl.on(scan));
    EXPECT_TRUE(testing::is_covariance(mcl.estimate().covariance));
  }
}

TEST(Mcl, a_fix_of_a_variance_without_a_root_leaves_health_finite) {
  const Drive run = drive(3, 8);
  Mcl mcl(config(), testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth.front(), 0.03, 0.02)});
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    mcl.on(run.increments[i]);
    mcl.on(run.scans[i]);
  }
  const Matrix<2, 2> tiny = 1e-320 * Matrix<2, 2>::Identity();
  EXPECT_EQ(mcl.on(PositionFix{9 * kStep, run.truth.back().position(), tiny}).verdict,
            Verdict::kFused);
  EXPECT_LE(mcl.health().wrong, 1.0);
  for (const SourceStatus& status : mcl.sources()) {
    EXPECT_LE(status.faulty, 1.0);
  }
}

TEST(Mcl, without_outliers_a_measurement_that_fits_nowhere_keeps_weights_equal) {
  const Drive run = drive(3, 1);
  Mcl::Config c = config();
  c.outlier_share = 0.0;
  Mcl mcl(c, testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth.front(), 0.03, 0.02)});
  const Vector<2> off = run.truth.front().position() + Vector<2>(5.0, 0.0);
  EXPECT_NO_THROW(mcl.on(PositionFix{1, off, 0.01 * Matrix<2, 2>::Identity()}));
}

/// A match without noise to draw from was detected only after particles had moved: the next scan
/// moved them once more.
TEST(Mcl, odometry_without_noise_moves_particles_once) {
  const Drive run = drive(3, 8);
  Mcl::Config c = config();
  c.odometry = {1e-160, 1e-160, 1e-160, 1e-160, 1e-160, 1e-160, 0.0};
  c.proposal = Mcl::Proposal::kScanMatch;
  Mcl mcl(c, testing::on_map(run.room.map), 0);
  mcl.start_at({near(run.truth.front(), 0.03, 0.02)});
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    mcl.on(run.increments[i]);
    EXPECT_NO_THROW(mcl.on(run.scans[i]));
    EXPECT_NO_THROW(mcl.on(run.scans[i]));
  }
  EXPECT_LT((mcl.estimate().pose.position() - run.truth.back().position()).norm(), 0.3);
}

}  // namespace
}  // namespace locfuse::test_mcl
