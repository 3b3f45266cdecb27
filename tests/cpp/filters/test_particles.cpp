// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>

#include "locfuse/error.hpp"
#include "locfuse/filters/clustering.hpp"
#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/particles.hpp"
#include "locfuse/filters/resampling.hpp"
#include "locfuse/filters/workers.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "locfuse/math/counter_random.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_particles {
namespace {

using testing::Rng;
using testing::uniform;

ParticleBelief all_at(const Pose2& pose, int count) {
  ParticleBelief belief;
  belief.resize(count);
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
    belief.x[k] = static_cast<float>(pose.x);
    belief.y[k] = static_cast<float>(pose.y);
    belief.c[k] = static_cast<float>(std::cos(pose.heading));
    belief.s[k] = static_cast<float>(std::sin(pose.heading));
    belief.weight[k] = 1.0F / static_cast<float>(count);
  }
  return belief;
}

Pose2 pose_of(const ParticleBelief& belief, std::size_t k) {
  return {static_cast<double>(belief.x[k]), static_cast<double>(belief.y[k]),
          static_cast<double>(std::atan2(belief.s[k], belief.c[k]))};
}

double total(const ParticleBelief& belief) {
  return std::accumulate(belief.weight.begin(), belief.weight.end(), 0.0);
}

TEST(Random, numbers_of_a_counter_are_uniform_and_normal) {
  constexpr int kCount = 200'000;
  double sum = 0.0;
  double squares = 0.0;
  double normal_squares = 0.0;
  double normal_fourth = 0.0;
  for (std::uint64_t n = 0; n < kCount; ++n) {
    const double u = random_uniform(7, n);
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    sum += u;
    squares += (u - 0.5) * (u - 0.5);
    const double z = random_normal(8, n);
    normal_squares += z * z;
    normal_fourth += z * z * z * z;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 5.0 * std::sqrt(1.0 / 12.0 / kCount));
  EXPECT_NEAR(squares / kCount, 1.0 / 12.0, 5.0 * std::sqrt(1.0 / 180.0 / kCount));
  EXPECT_NEAR(normal_squares / kCount, 1.0, 5.0 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(normal_fourth / kCount, 3.0, 5.0 * std::sqrt(96.0 / kCount));
}

TEST(Particles, move_by_draws_from_the_motion_and_its_covariance) {
  constexpr int kCount = 200'000;
  Rng rng(1);
  for (int trial = 0; trial < 3; ++trial) {
    const Pose2 start{30.0, -20.0, uniform(rng, -3.0, 3.0)};
    UncertainMotion step{{2.0, -1.0, uniform(rng, -3.0, 3.0)}, {}};
    const Matrix<3, 3> scale = Vector<3>(1.0, 1.0, 0.05).asDiagonal();
    step.covariance = scale * testing::random_covariance(rng, 3) * scale;
    ParticleBelief belief = all_at(start, kCount);
    Workers workers(1);
    move(belief, step, 11 + static_cast<std::uint64_t>(trial), workers);
    Vector<3> mean = Vector<3>::Zero();
    Matrix<3, 3> scatter = Matrix<3, 3>::Zero();
    for (std::size_t k = 0; k < kCount; ++k) {
      const Pose2 moved = inverse(start) * pose_of(belief, k);
      const Vector<3> off = local(moved, step.motion);
      mean += off / kCount;
      scatter += off * off.transpose() / kCount;
    }
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(mean(i), 0.0, 5.0 * std::sqrt(step.covariance(i, i) / kCount)) << i;
      for (int j = 0; j < 3; ++j) {
        const double most = std::sqrt(step.covariance(i, i) * step.covariance(j, j));
        EXPECT_NEAR(scatter(i, j), step.covariance(i, j), 5.0 * most * std::sqrt(2.0 / kCount));
      }
    }
  }
}

TEST(Particles, keep_unit_headings_over_many_moves) {
  ParticleBelief belief = all_at({}, 100);
  Workers workers(1);
  for (std::uint64_t key = 0; key < 10'000; ++key) {
    move(belief, {{0.1, 0.0, 0.05}, Matrix<3, 3>::Identity() * 1e-6}, key, workers);
  }
  for (std::size_t k = 0; k < 100; ++k) {
    EXPECT_NEAR(static_cast<double>(std::hypot(belief.c[k], belief.s[k])), 1.0, 1e-5);
  }
}

TEST(Particles, move_alike_on_any_number_of_threads) {
  ParticleBelief alone = all_at({1.0, 2.0, 0.5}, 1003);
  const UncertainMotion step{{1.0, 0.0, 0.2}, Matrix<3, 3>::Identity() * 0.01};
  Workers one(1);
  move(alone, step, 5, one);
  for (const int threads : {2, 3, 7}) {
    ParticleBelief shared = all_at({1.0, 2.0, 0.5}, 1003);
    Workers workers(threads);
    move(shared, step, 5, workers);
    EXPECT_EQ(shared.x, alone.x);
    EXPECT_EQ(shared.y, alone.y);
    EXPECT_EQ(shared.c, alone.c);
    EXPECT_EQ(shared.s, alone.s);
  }
}

TEST(Workers, do_each_part_once_however_often_they_are_asked) {
  for (const int threads : {1, 2, 5}) {
    Workers workers(threads);
    for (int count = 0; count < 60; ++count) {
      std::vector<int> done(static_cast<std::size_t>(count), 0);
      workers.share(count, 8, [&](int begin, int end) {
        EXPECT_EQ(begin % 8, 0);
        for (int i = begin; i < end; ++i) {
          ++done[static_cast<std::size_t>(i)];
        }
      });
      EXPECT_EQ(std::count(done.begin(), done.end(), 1), count);
    }
  }
  testing::expect_refused([] { Workers(0); }, "threads is 0");
}

TEST(Particles, weigh_by_the_likelihood_where_enough_stay) {
  ParticleBelief belief = all_at({}, 4);
  belief.weight = {0.1F, 0.2F, 0.3F, 0.4F, 0.0F, 0.0F, 0.0F, 0.0F};
  const std::vector<float> log_likelihood{-700.0F, -701.0F, -700.5F, -702.0F, 0, 0, 0, 0};
  EXPECT_EQ(reweigh(belief, log_likelihood, 1.0, 1.0), 1.0);
  const double expected[] = {0.1, 0.2 * std::exp(-1.0), 0.3 * std::exp(-0.5), 0.4 * std::exp(-2.0)};
  const double sum = std::accumulate(std::begin(expected), std::end(expected), 0.0);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(static_cast<double>(belief.weight[k]), expected[k] / sum, 1e-6);
  }
}

TEST(Particles, keep_enough_of_them_where_a_likelihood_is_too_narrow) {
  constexpr int kCount = 1000;
  Rng rng(3);
  ParticleBelief belief = all_at({}, kCount);
  std::vector<float> log_likelihood(belief.x.size());
  for (float& value : log_likelihood) {
    value = static_cast<float>(uniform(rng, -5000.0, 0.0));
  }
  const double share = reweigh(belief, log_likelihood, 1.0, 100.0);
  EXPECT_LT(share, 0.1);
  EXPECT_GE(effective_size(belief), 100.0);
  EXPECT_LE(effective_size(belief), 130.0);  // the largest share that leaves them
  EXPECT_NEAR(total(belief), 1.0, 1e-5);
}

TEST(Particles, refuse_likelihoods_that_are_none) {
  ParticleBelief belief = all_at({}, 8);
  const std::vector<float> none(8, -std::numeric_limits<float>::infinity());
  EXPECT_THROW(reweigh(belief, none, 1.0, 1.0), NumericalError);
  EXPECT_EQ(belief.weight[0], 0.125F);
}

TEST(Particles, are_resampled_in_proportion_to_their_weight) {
  constexpr int kCount = 500;
  Rng rng(4);
  for (std::uint64_t key = 0; key < 20; ++key) {
    ParticleBelief belief = all_at({}, kCount);
    double sum = 0.0;
    for (std::size_t k = 0; k < kCount; ++k) {
      belief.x[k] = static_cast<float>(k);
      belief.weight[k] = static_cast<float>(std::pow(uniform(rng, 0.0, 1.0), 4.0));
      sum += static_cast<double>(belief.weight[k]);
    }
    const std::vector<float> before = belief.weight;
    ParticleBelief scratch;
    resample(belief, 2000, {}, key, scratch);
    ASSERT_EQ(belief.size, 2000);
    EXPECT_NEAR(total(belief), 1.0, 1e-4);
    std::vector<int> copies(kCount, 0);
    for (std::size_t k = 0; k < 2000; ++k) {
      ++copies[static_cast<std::size_t>(belief.x[k])];
    }
    for (std::size_t k = 0; k < kCount; ++k) {
      EXPECT_NEAR(copies[k], 2000.0 * static_cast<double>(before[k]) / sum, 1.001);
    }
  }
}

TEST(Particles, resampled_by_bin_no_place_gains_or_loses) {
  // Places ten cells apart, each twice as likely as the one before, the first ones next to nothing.
  constexpr int kPlaces = 24;
  constexpr int kEach = 40;
  const ParticleBins bins{5.0, 24.0};
  Rng rng(5);
  ParticleBelief belief = all_at({}, kPlaces * kEach);
  std::vector<double> before(kPlaces, 0.0);
  double sum = 0.0;
  for (std::size_t k = 0; k < kPlaces * kEach; ++k) {
    const std::size_t place = k % kPlaces;
    belief.x[k] = static_cast<float>(10.0 * static_cast<double>(place) + uniform(rng, 0.5, 4.5));
    belief.y[k] = 2.0F;
    const double weight = std::exp2(static_cast<double>(place)) * uniform(rng, 0.2, 1.0);
    belief.weight[k] = static_cast<float>(weight);
    before[place] += static_cast<double>(belief.weight[k]);
    sum += static_cast<double>(belief.weight[k]);
  }
  for (float& weight : belief.weight) {
    weight = static_cast<float>(static_cast<double>(weight) / sum);
  }
  ParticleBelief scratch;
  for (std::uint64_t key = 0; key < 300; ++key) {
    resample_by_bin(belief, 500, bins, 0.5, 1e-6, key, scratch);
    ASSERT_EQ(belief.size, 500);
    ASSERT_NEAR(total(belief), 1.0, 1e-4);
  }
  std::vector<double> after(kPlaces, 0.0);
  std::vector<int> count(kPlaces, 0);
  for (std::size_t k = 0; k < 500; ++k) {
    const auto place = static_cast<std::size_t>(belief.x[k] / 10.0F);
    after[place] += static_cast<double>(belief.weight[k]);
    ++count[place];
  }
  for (std::size_t place = 0; place < kPlaces; ++place) {
    const double share = before[place] / sum;
    if (share < 0.9e-6) {
      EXPECT_EQ(count[place], 0) << place;
    } else if (share > 1.1e-6) {
      EXPECT_NEAR(after[place] / share, 1.0, 1e-3) << place;
      EXPECT_GE(count[place], 1) << place;
    }
  }
  // The square root of the weights sets how many: half of all weight is the last one's.
  EXPECT_NEAR(count[kPlaces - 1], (500 - 20) * (1.0 - std::sqrt(0.5)), 25.0);
}

TEST(Particles, within_a_bin_are_resampled_in_proportion_to_their_weight) {
  const ParticleBins bins{100.0, 24.0};
  ParticleBelief belief = all_at({}, 4);
  for (std::size_t k = 0; k < 4; ++k) {
    belief.x[k] = static_cast<float>(k + 1);
    belief.weight[k] = 0.1F * static_cast<float>(k + 1);
  }
  ParticleBelief scratch;
  resample_by_bin(belief, 1000, bins, 0.5, 1e-9, 3, scratch);
  ASSERT_EQ(belief.size, 1000);
  std::vector<int> copies(5, 0);
  for (std::size_t k = 0; k < 1000; ++k) {
    EXPECT_NEAR(static_cast<double>(belief.weight[k]), 1e-3, 1e-8);
    ++copies[static_cast<std::size_t>(belief.x[k])];
  }
  for (std::size_t k = 1; k < 5; ++k) {
    EXPECT_NEAR(copies[k], 100.0 * static_cast<double>(k), 1.001);
  }
}

TEST(Particles, of_more_places_than_particles_some_go_by_chance) {
  const ParticleBins bins{5.0, 24.0};
  ParticleBelief belief = all_at({}, 400);
  for (std::size_t k = 0; k < 400; ++k) {
    belief.x[k] = static_cast<float>(10 * k);
  }
  ParticleBelief scratch;
  resample_by_bin(belief, 100, bins, 0.5, 1e-9, 3, scratch);
  ASSERT_EQ(belief.size, 100);
  EXPECT_NEAR(total(belief), 1.0, 1e-5);
}

// Ranges at a start once left copies of the one particle that was nearest, and with it a heading by
// chance: a robot was ready, 45 degrees off.
TEST(Particles, copies_share_the_box_that_their_original_stands_for) {
  constexpr int kCopies = 8000;
  ParticleBelief belief = all_at({50.0, 40.0, 3.0}, 1);
  belief.box[0] = 6.0F;
  belief.turn_per_cell = 0.05;
  ParticleBelief scratch;
  resample(belief, kCopies, {}, 7, scratch);
  const double part = 6.0 / 20.0;  // a twentieth along each side
  const double expected = (36.0 - part * part) / 12.0;
  Vector<3> squares = Vector<3>::Zero();
  for (std::size_t k = 0; k < kCopies; ++k) {
    squares += local(pose_of(belief, k), {50.0, 40.0, 3.0}).cwiseAbs2() / kCopies;
    EXPECT_NEAR(static_cast<double>(belief.box[k]), part, 1e-6);
  }
  EXPECT_NEAR(squares.x() / expected, 1.0, 0.07);  // four sigma of a variance of 8,000 draws
  EXPECT_NEAR(squares.y() / expected, 1.0, 0.07);
  EXPECT_NEAR(squares.z() / (expected * 0.05 * 0.05), 1.0, 0.07);
}

TEST(Particles, points_stay_points_and_small_boxes_become_them) {
  ParticleBelief belief = all_at({50.0, 40.0, 3.0}, 1);
  ParticleBelief scratch;
  resample(belief, 100, {}, 7, scratch);
  EXPECT_EQ(belief.x[99], 50.0F);
  belief = all_at({50.0, 40.0, 3.0}, 1);
  belief.box[0] = 0.3F;
  resample(belief, 100, {}, 7, scratch);
  EXPECT_NE(belief.x[99], belief.x[98]);
  EXPECT_EQ(belief.box[99], 0.0F);
}

TEST(Particles, draw_fresh_ones_of_the_weight_asked_for) {
  ParticleBelief belief = all_at({1.0, 1.0, 0.0}, 100);
  ParticleBelief scratch;
  int drawn = 0;
  const FreshParticles fresh{20, 0.01, [&](ParticleBelief& to, int k) {
                               to.x[static_cast<std::size_t>(k)] = 9.0F;
                               ++drawn;
                             }};
  resample(belief, 100, fresh, 1, scratch);
  EXPECT_EQ(drawn, 20);
  double weight = 0.0;
  for (std::size_t k = 80; k < 100; ++k) {
    EXPECT_EQ(belief.x[k], 9.0F);
    weight += static_cast<double>(belief.weight[k]);
  }
  EXPECT_NEAR(weight, 0.01, 1e-6);
  EXPECT_NEAR(total(belief), 1.0, 1e-5);
}

TEST(Particles, effective_size_is_that_of_equal_weights) {
  ParticleBelief belief = all_at({}, 10);
  EXPECT_NEAR(effective_size(belief), 10.0, 1e-5);
  belief.weight.assign(16, 0.0F);
  belief.weight[3] = belief.weight[7] = 0.5F;
  EXPECT_NEAR(effective_size(belief), 2.0, 1e-6);
}

TEST(Particles, kld_sampling_follows_the_chi_square_quantile) {
  // Fox (2003), eq. (4): n = chi2(k - 1, 1 - delta) / (2 epsilon).
  for (const int bins : {5, 20, 100, 1000}) {
    const double exact = chi_squared_quantile(bins - 1, 0.99) / (2.0 * 0.05);
    EXPECT_NEAR(kld_particles(bins, 0.05, 2.3263), exact, 0.01 * exact);
  }
  EXPECT_EQ(kld_particles(1, 0.05, 2.3263), 1.0);
}

TEST(Particles, bins_without_weight_do_not_count) {
  ParticleBelief belief = all_at({0.5, 0.5, 0.0}, 8);
  belief.x[1] = 10.5F;
  belief.x[2] = 20.5F;
  belief.weight[2] = 1e-4F;
  EXPECT_EQ(occupied_bins(belief, {2.0, 8.0}, 0.1), 2);
  EXPECT_EQ(occupied_bins(belief, {2.0, 8.0}, 0.0), 3);
}

TEST(Particles, clusters_have_their_own_means_across_the_cut_of_the_heading) {
  constexpr int kCount = 20'000;
  Rng rng(6);
  ParticleBelief belief = all_at({}, kCount);
  const Pose2 middle[] = {{100.0, 50.0, kPi - 0.02}, {100.0, 50.0, 0.0}};
  for (std::size_t k = 0; k < kCount; ++k) {
    const Pose2& from = middle[k % 10 < 7 ? 0 : 1];
    const Pose2 pose = retract(
        from, {testing::normal(rng, 3.0), testing::normal(rng, 1.0), testing::normal(rng, 0.1)});
    belief.x[k] = static_cast<float>(pose.x);
    belief.y[k] = static_cast<float>(pose.y);
    belief.c[k] = static_cast<float>(std::cos(pose.heading));
    belief.s[k] = static_cast<float>(std::sin(pose.heading));
  }
  const std::vector<ParticleCluster> clusters = clusters_of(belief, {10.0, 24.0}, 8);
  ASSERT_EQ(clusters.size(), 2U);
  EXPECT_NEAR(clusters[0].weight, 0.7, 0.01);
  EXPECT_NEAR(clusters[1].weight, 0.3, 0.01);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(clusters[i].mean.x, 100.0, 0.2);
    EXPECT_NEAR(clusters[i].mean.y, 50.0, 0.1);
    EXPECT_NEAR(angle_difference(clusters[i].mean.heading, middle[i].heading), 0.0, 0.01);
    EXPECT_NEAR(clusters[i].covariance(0, 0), 9.0, 0.6);
    EXPECT_NEAR(clusters[i].covariance(1, 1), 1.0, 0.1);
    EXPECT_NEAR(clusters[i].covariance(2, 2), 0.01, 0.002);
  }
}

// Their columns ran over into rows, and beyond 2^63 into anything.
TEST(Particles, that_are_far_off_share_no_cluster_with_what_is_on_the_map) {
  ParticleBelief belief = all_at({}, 8);
  belief.x = {0.0F, 0x1p24F, 1e30F, 2e30F, -1e30F, 0.0F, 0.0F, 5.0F};
  belief.y = {3.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1e30F, -1e30F, 3.0F};
  const std::vector<ParticleCluster> clusters = clusters_of(belief, {1.0, 1.0}, 8);
  ASSERT_EQ(clusters.size(), 6U);
  EXPECT_DOUBLE_EQ(clusters[0].weight, 0.375) << "all beyond 2^24 to one side";
  for (const ParticleCluster& cluster : clusters) {
    EXPECT_TRUE(cluster.covariance.allFinite());
  }
}

TEST(Particles, refuse_to_be_none) {
  ParticleBelief belief;
  testing::expect_refused([&] { belief.resize(0); }, "0 particles");
}

/// It is not part of the most likely one, so that it may be more likely than that.
TEST(Particles, one_of_no_weight_stays_so_however_likely_it_is) {
  for (const float better : {89.1F, 500.0F, 1e6F, std::numeric_limits<float>::quiet_NaN()}) {
    ParticleBelief belief = all_at({}, 2);
    belief.weight[0] = 0.0F;
    belief.weight[1] = 1.0F;
    std::vector<float> log_likelihood(belief.x.size(), 0.0F);
    log_likelihood[0] = better;
    reweigh(belief, log_likelihood, 1.0, 1.0);
    EXPECT_EQ(belief.weight[0], 0.0F) << better;
    EXPECT_EQ(belief.weight[1], 1.0F) << better;
  }
}

TEST(Particles, one_of_no_weight_leaves_the_ratio_of_the_others_as_it_is) {
  for (const float better : {89.1F, 500.0F, 1e6F, std::numeric_limits<float>::quiet_NaN()}) {
    ParticleBelief belief = all_at({}, 3);
    belief.weight[0] = 0.0F;
    belief.weight[1] = 0.5F;
    belief.weight[2] = 0.5F;
    std::vector<float> log_likelihood(belief.x.size(), 0.0F);
    log_likelihood[0] = better;
    log_likelihood[2] = -1.0F;
    reweigh(belief, log_likelihood, 1.0, 1.0);
    EXPECT_EQ(belief.weight[0], 0.0F) << better;
    EXPECT_NEAR(belief.weight[2] / belief.weight[1], std::exp(-1.0), 1e-5) << better;
    EXPECT_NEAR(belief.weight[1] + belief.weight[2], 1.0, 1e-6) << better;
  }
}

TEST(Particles, a_heading_that_may_have_turned_any_number_of_times_stays_on_the_circle) {
  ParticleBelief belief = all_at({}, 64);
  UncertainMotion motion;
  motion.motion.heading = 1e9;
  motion.covariance(2, 2) = 1e22;
  Workers workers(1);
  move(belief, motion, 1, workers);
  for (std::size_t k = 0; k < 64; ++k) {
    EXPECT_NEAR(std::hypot(belief.c[k], belief.s[k]), 1.0F, 1e-3F);
  }
}

TEST(Particles, refuse_a_motion_that_single_precision_does_not_hold) {
  ParticleBelief belief = all_at({}, 8);
  Workers workers(1);
  EXPECT_THROW(move(belief, {{1e39, 0.0, 0.0}, Matrix<3, 3>::Zero()}, 1, workers), NumericalError);
}

TEST(Particles, bins_without_a_side_or_a_heading_are_refused) {
  const ParticleBelief belief = all_at({}, 8);
  testing::expect_refused([&] { (void)clusters_of(belief, {0.0, 24.0}, 3); }, "side of 0");
  testing::expect_refused([&] { (void)clusters_of(belief, {1.0, 0.0}, 3); }, "0 headings");
}

TEST(Workers, what_a_part_throws_is_thrown_when_all_are_done) {
  Workers workers(4);
  for (int i = 0; i < 100; ++i) {
    const auto part = [](int begin, int) {
      if (begin > 0) {
        throw NumericalError("no");
      }
    };
    EXPECT_THROW(workers.share(64, 1, part), NumericalError);
  }
  std::atomic<int> done = 0;
  workers.share(64, 1, [&](int begin, int end) { done += end - begin; });
  EXPECT_EQ(done, 64);
}

TEST(Workers, share_as_many_as_an_integer_counts) {
  constexpr int kMost = std::numeric_limits<int>::max();
  Workers workers(2);
  std::atomic<long long> done = 0;
  workers.share(kMost, 8, [&](int begin, int end) { done += end - begin; });
  EXPECT_EQ(done, kMost);
}

}  // namespace
}  // namespace locfuse::test_particles
