// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>

#include "locfuse/frontends/multilateration.hpp"
#include "locfuse/frontends/range_batch.hpp"
#include "locfuse/frontends/range_geometry.hpp"
#include "support/expect.hpp"
#include "support/ranging.hpp"

namespace locfuse {
namespace {

using testing::Anchors;
using testing::expect_near;
using testing::Rng;
using testing::view;

template <int N>
RangePosition<N> solve(const Anchors& anchors, const std::vector<double>& ranges,
                       double sigma = 0.1) {
  return Multilateration<N>(anchors.table(), view(anchors.sigmas(sigma)), {}).solve(view(ranges));
}

/// Positions of four equal epochs, as many as there are lanes.
template <int N>
struct FourTimes {
  std::array<double, 4 * N> position;
  std::array<double, 4 * N * N> covariance;
  std::array<double, 4> cost;
  std::array<PositionStatus, 4> status;

  FourTimes(const Multilateration<N>& solver, const std::vector<double>& epoch) {
    std::vector<double> ranges;
    for (int k = 0; k < 4; ++k) {
      ranges.insert(ranges.end(), epoch.begin(), epoch.end());
    }
    locate_batch<N>(solver, RangeSolver::kNewton, {},
                    RowsView(ranges.data(), 4, solver.layout().size),
                    {{position.data(), 4, N},
                     {covariance.data(), 4, N * N},
                     {cost.data(), 4},
                     {status.data(), 4}});
  }
};

TEST(Multilateration, is_consistent_over_ten_thousand_positions) {
  Rng rng(5);
  const Anchors anchors = testing::room();
  const Multilateration<2> solver(anchors.table(), view(anchors.sigmas(0.1)), {});
  double nees = 0.0;
  int inconsistent = 0;
  constexpr int kTrials = 10'000;
  for (int i = 0; i < kTrials; ++i) {
    const Eigen::Vector2d truth = testing::random_point(rng, 2);
    std::vector<double> ranges = anchors.ranges_from(truth);
    testing::add_noise(rng, 0.1, ranges);
    const auto found = solver.solve(view(ranges));
    ASSERT_LE(found.status, PositionStatus::kInconsistent);
    inconsistent += found.status == PositionStatus::kInconsistent ? 1 : 0;
    const Eigen::Vector2d error = found.position - truth;
    nees += error.dot(found.covariance.inverse() * error);
  }
  // 99 % band of the mean of 10,000 chi-square variables of 2 dof, and of 10,000 alarms at 0.1 %.
  EXPECT_NEAR(nees / kTrials, 2.0, 2.576 * 2.0 / std::sqrt(kTrials));
  EXPECT_NEAR(inconsistent, 10, 9);
}

TEST(Multilateration, never_takes_a_side_of_anchors_on_a_line_or_plane) {
  Rng rng(6);
  for (int trial = 0; trial < 2'000; ++trial) {
    Anchors line = testing::random_anchors(rng, 5, 2);
    Anchors plane = testing::random_anchors(rng, 6, 3);
    const double slope = testing::uniform(rng, -2.0, 2.0);
    for (std::size_t i = 0; i < 5; ++i) {
      line.rows[2 * i + 1] = slope * line.rows[2 * i];
    }
    for (std::size_t i = 0; i < 6; ++i) {
      plane.rows[3 * i + 2] = slope * plane.rows[3 * i] + plane.rows[3 * i + 1];
    }
    std::vector<double> ranges = line.ranges_from(testing::random_point(rng, 2));
    testing::add_noise(rng, 0.1, ranges);
    EXPECT_GE(solve<2>(line, ranges).status, PositionStatus::kAmbiguous);
    ranges = plane.ranges_from(testing::random_point(rng, 3));
    testing::add_noise(rng, 0.1, ranges);
    EXPECT_GE(solve<3>(plane, ranges).status, PositionStatus::kAmbiguous);
  }
}

TEST(Multilateration, ignores_anchors_without_a_range) {
  const Anchors anchors = testing::room();
  std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  ranges[1] = std::nan("");
  const auto found = solve<2>(anchors, ranges);
  EXPECT_EQ(found.status, PositionStatus::kUnique);
  expect_near(found.position, Eigen::Vector2d(3.0, 4.0), 1e-9);
  ranges[0] = ranges[2] = ranges[3] = std::nan("");
  const auto lost = solve<2>(anchors, ranges);
  EXPECT_EQ(lost.status, PositionStatus::kUnderdetermined);
  EXPECT_FALSE(lost.has_position);
}

TEST(Multilateration, rejects_ranges_that_are_not_positive) {
  const Anchors anchors = testing::room();
  for (const double bad : {0.0, -1.5, HUGE_VAL}) {
    std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
    ranges[3] = bad;
    testing::expect_refused([&] { (void)solve<2>(anchors, ranges); }, "range 3", "positive");
  }
}

TEST(Multilateration, rejects_invalid_probabilities_and_dimensions) {
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const auto with = [&](double side, double alarm) {
    (void)Multilateration<2>(anchors.table(), view(sigma), {{}, {side, alarm}});
  };
  testing::expect_refused([&] { with(0.5, 0.1); }, "wrong_side_probability", "0.5");
  testing::expect_refused([&] { with(1e-6, 1.0); }, "false_alarm_probability", "1.0");
  testing::expect_refused([&] { (void)Multilateration<3>(anchors.table(), view(sigma), {}); },
                          "2 dimensions", "expected 3");
}

struct Located {
  std::vector<double> position;
  std::vector<double> covariance;
  std::vector<double> cost;
  std::vector<PositionStatus> status;
};

/// A batch of epochs.
Located located(const Multilateration<2>& solver, const std::vector<double>& ranges,
                std::size_t epochs) {
  Located all{std::vector<double>(2 * epochs), std::vector<double>(4 * epochs),
              std::vector<double>(epochs), std::vector<PositionStatus>(epochs)};
  const auto rows = static_cast<Eigen::Index>(epochs);
  locate_batch<2>(solver, RangeSolver::kNewton, {},
                  RowsView(ranges.data(), rows, solver.layout().size),
                  {{all.position.data(), rows, 2},
                   {all.covariance.data(), rows, 4},
                   {all.cost.data(), rows},
                   {all.status.data(), rows}});
  return all;
}

TEST(LocateBatch, equals_one_epoch_at_a_time) {
  Rng rng(7);
  const Anchors anchors = testing::room();
  const Multilateration<2> solver(anchors.table(), view(anchors.sigmas(0.1)), {});
  constexpr std::size_t kEpochs = 203;
  std::vector<double> ranges;
  for (std::size_t i = 0; i < kEpochs; ++i) {
    std::vector<double> row = anchors.ranges_from(testing::random_point(rng, 2));
    testing::add_noise(rng, i % 7 == 0 ? 3.0 : 0.1, row);
    row[i % 5] = i % 11 == 0 ? std::nan("") : row[i % 5];
    ranges.insert(ranges.end(), row.begin(), row.end());
  }
  const auto [position, covariance, cost, status] = located(solver, ranges, kEpochs);
  for (std::size_t i = 0; i < kEpochs; ++i) {
    const auto found = solver.solve(view(ranges).segment<5>(static_cast<Eigen::Index>(5 * i)));
    EXPECT_EQ(status[i], found.status);
    EXPECT_NEAR(cost[i], found.cost, 1e-6 * (1.0 + found.cost));
    EXPECT_NEAR(position[2 * i], found.position(0), 1e-6);
    EXPECT_NEAR(position[2 * i + 1], found.position(1), 1e-6);
    if (std::isfinite(found.covariance(0, 0))) {
      EXPECT_NEAR(covariance[4 * i + 1], found.covariance(0, 1), 1e-6);
    }
  }
}

TEST(LocateBatch, marks_an_epoch_with_a_bad_range) {
  const Anchors anchors = testing::room();
  const Multilateration<2> solver(anchors.table(), view(anchors.sigmas(0.1)), {});
  std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  ranges[2] = -1.0;
  double position[2];
  double covariance[4];
  double cost = 0.0;
  PositionStatus status = PositionStatus::kUnique;
  locate_batch<2>(solver, RangeSolver::kNewton, {}, RowsView(ranges.data(), 1, 5),
                  {{position, 1, 2}, {covariance, 1, 4}, {&cost, 1}, {&status, 1}});
  EXPECT_EQ(status, PositionStatus::kBadRange);
  EXPECT_TRUE(std::isnan(position[0]) && std::isnan(cost));
}

// The inverse by cofactors had negative variances, and lanes differed from the scalar code.
TEST(Multilateration, a_position_far_from_its_anchors_has_a_valid_or_infinite_covariance) {
  const Anchors anchors{{-1.0, -3.0, 3.0, -2.0, -2.0, 3.0, 2.0, 1.0, 2.0, 2.0, 2.0, 2.0}, 3, {}};
  const std::vector<double> epoch{18945.095365294394, 18946.315460620281, 18944.152114553184,
                                  18944.604086508218};
  const std::vector<double> sigma = anchors.sigmas(0.0013684781939447871);
  const Multilateration<3> solver(anchors.table(), view(sigma), {});
  const RangePosition<3> found = solver.solve(view(epoch));
  EXPECT_TRUE(std::isinf(found.covariance(0, 0)) ||
              found.covariance.llt().info() == Eigen::Success);
  const FourTimes<3> batch(solver, epoch);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(batch.status[k], found.status);
    const Eigen::Map<const Matrix<3, 3>> P(&batch.covariance[9 * k]);
    EXPECT_TRUE(std::isinf(P(0, 0)) || P.llt().info() == Eigen::Success);
  }
}

TEST(Multilateration, lanes_have_costs_that_are_not_negative_where_ranges_fit_to_the_bit) {
  const Anchors anchors{{-5.0, -5.0, 5.0, -5.0, -5.0, 5.0}, 2, {}};
  const std::vector<double> sigma = anchors.sigmas(0.10380419740052697);
  const Multilateration<2> solver(anchors.table(), view(sigma), {});
  const FourTimes<2> batch(solver, {2.0, 10.198039027185567, 8.0});
  EXPECT_GE(*std::min_element(batch.cost.begin(), batch.cost.end()), 0.0);
}

TEST(Multilateration, without_convergence_the_covariance_is_valid_or_infinite) {
  const Anchors anchors{{3.0, 2.0, 1.0, 1.0, 5.0, 2.0, 2.0, 4.0, -5.0}, 3, {}};
  const std::vector<double> sigma{1.0, 0.34755387862793147, 1.0};
  const std::vector<double> ranges{1.8315971618627447, 25.207983676931903, 28.472496004964928};
  const auto found = Multilateration<3>(anchors.table(), view(sigma), {}).solve(view(ranges));
  EXPECT_TRUE(std::isinf(found.covariance(0, 0)) ||
              found.covariance.llt().info() == Eigen::Success);
}

TEST(Multilateration, rejects_lengths_whose_squares_overflow) {
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  Multilateration<2>::Config config;
  config.loss = {RangeLossKind::kCauchy, -1.0};
  testing::expect_refused([&] { Multilateration<2>(anchors.table(), view(sigma), config); },
                          "scale of a loss is -1");
  const Multilateration<2> solver(anchors.table(), view(sigma), {});
  std::vector<double> ranges(static_cast<std::size_t>(anchors.size()), 1.0);
  ranges[0] = 1e153;
  testing::expect_refused([&] { (void)solver.solve(view(ranges)); }, "range 0", "1e12");
  EXPECT_THROW((void)solver.cost_limit(5000), std::out_of_range);
  testing::expect_refused([&] { (void)dilution(anchors.table(), Eigen::Vector3d::Zero()); },
                          "3 coordinates");
}

TEST(Multilateration, rejects_views_of_wrong_shape) {
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const Multilateration<2> solver(anchors.table(), view(sigma), {});
  testing::expect_refused([&] { validate(anchors.table(), view({0.1, 0.1})); }, "sigma has 2", "5");
  testing::expect_refused([&] { (void)solver.solve(view({1.0, 2.0})); }, "2 ranges", "5");
  const auto batch = [&](const std::optional<RowsView>& own, Eigen::Index columns,
                         Eigen::Index rows) {
    const std::vector<double> ranges(10, 1.0);
    std::array<double, 8> numbers;
    PositionStatus status[2];
    locate_batch<2>(solver, RangeSolver::kSquaredRange, own, RowsView(ranges.data(), 2, columns),
                    {{numbers.data(), rows, 2},
                     {numbers.data(), rows, 4},
                     {numbers.data(), rows},
                     {status, rows}});
  };
  batch({}, 5, 2);
  testing::expect_refused([&] { batch({}, 4, 2); }, "4 columns", "expected 5");
  testing::expect_refused([&] { batch({}, 5, 1); }, "output", "2 epochs");
  testing::expect_refused([&] { batch(anchors.table().rows, 5, 2); }, "5 x 2", "10 x 2");
}

TEST(CramerRao, bounds_are_symmetric_to_the_bit) {
  const Anchors anchors{{0.0, 0.0, 10.0, 0.0, 10.0, 8.0, 0.0, 8.0}, 2, {}};
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const Eigen::MatrixXd bound =
      cramer_rao(anchors.table(), view(sigma), Eigen::RowVector2d(3.1, 4.7)).front();
  EXPECT_TRUE(testing::same_bits(bound, bound.transpose()));
}

/// Newton's method left the interval of the root and found the other side of near-collinear
/// anchors, as a unique position.
TEST(LocateBatch, resolves_the_mirror_ambiguity_of_near_collinear_anchors_as_one_epoch_does) {
  const double rows[]{-7.8850491124541922, 2.9824225176991233, 7.0333145448496062,
                      3.1313416017249129,  8.9141442505646289, 2.9253289270663254,
                      -2.53445797811532,   3.1427492820972645, -3.039354209319713,
                      2.9722785041470146,  5.7854403234287659, 2.9907402451261436,
                      -8.4952555970064587, 2.994430680270447,  -8.3108798663409438,
                      3.0851710617012222,  9.4700463249205562, 2.8981342849457534};
  const std::vector<double> one{13.828661969214242, 28.740656068774946, 30.622077030904659,
                                19.175337456542302, 18.672993161277248, 27.487063184754572,
                                13.217019927785296, 13.405033482417576, 31.171527923030087};
  const std::vector<double> sigma(9, 0.0032831926475160962);
  const Multilateration<2> solver({RowsView(rows, 9, 2), {}}, view(sigma), {});
  const auto alone = solver.solve(view(one));
  constexpr std::size_t kEpochs = 4;
  std::vector<double> ranges;
  for (std::size_t i = 0; i < kEpochs; ++i) {
    ranges.insert(ranges.end(), one.begin(), one.end());
  }
  const auto [position, covariance, cost, status] = located(solver, ranges, kEpochs);
  EXPECT_EQ(status[0], alone.status);
  EXPECT_NEAR(cost[0], alone.cost, 1e-6 * alone.cost);
  EXPECT_NEAR(position[1], alone.position(1), 1e-6);
}

}  // namespace
}  // namespace locfuse
