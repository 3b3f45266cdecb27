// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "locfuse/frontends/locate.hpp"
#include "support/expect.hpp"
#include "support/ranging.hpp"

namespace locfuse {
namespace {

using testing::Anchors;
using testing::expect_near;
using testing::Rng;
using testing::view;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

PositionSolution locate_from(const Anchors& anchors, const std::vector<double>& ranges,
                             const LocateOptions& options = {}, double sigma = 0.1) {
  return locate(anchors.table(), view(ranges), view(anchors.sigmas(sigma)), options);
}

Anchors line_of_anchors() { return {{0.0, 0.0, 5.0, 0.0, 10.0, 0.0}, 2, {}}; }

TEST(Locate, both_solvers_agree_on_good_ranges) {
  const Anchors anchors = testing::room();
  const Eigen::Vector2d truth(3.0, 4.0);
  for (const RangeMl ml : {RangeMl::kNewton, RangeMl::kCeres, RangeMl::kBoth}) {
    LocateOptions options;
    options.ml = ml;
    const PositionSolution found = locate_from(anchors, anchors.ranges_from(truth), options);
    ASSERT_EQ(found.status, PositionStatus::kUnique);
    EXPECT_TRUE(found.reason.empty());
    EXPECT_FALSE(found.termination.empty());
    expect_near(found.hypotheses[0].position, truth, 1e-9);
    expect_near(found.comparison->squared_range_position, truth, 1e-9);
    EXPECT_TRUE(found.comparison->agree());
    EXPECT_EQ(found.comparison->dof, 2);
    EXPECT_EQ(found.fit_dof, 3);
    EXPECT_LT(found.residuals.cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_NEAR(found.dop->position, std::sqrt(found.hypotheses[0].covariance.trace()) / 0.1, 1e-9);
  }
}

/// Position and covariance of `fit`, from the origin of the layout.
template <class Fit>
void expect_is(const PositionHypothesis& found, const RangeLayout<2>& layout, const Fit& fit) {
  EXPECT_EQ(found.position, layout.centre + fit.position);
  EXPECT_EQ(found.cost, fit.cost);
  expect_near(found.covariance, Matrix<2, 2>(fit.information.inverse()), 1e-9);
}

TEST(Locate, returns_minimum_and_covariance_of_the_solver_that_is_named) {
  Rng rng(12);
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.3);
  const RangeLayout<2> layout(anchors.table(), view(sigma));
  int differing = 0;
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> ranges = anchors.ranges_from(testing::random_point(rng, 2));
    testing::add_noise(rng, 0.3, ranges);
    const Vector<2> start = solve_squared_ranges<2>(layout, view(ranges)).position[0];
    const RangeFit<2> ours = fit_ranges<2>(layout, view(ranges), start);
    const RangeFit<2> ceres = fit_ranges_ceres<2>(layout, view(ranges), start);
    LocateOptions options;
    expect_is(locate_from(anchors, ranges, options, 0.3).hypotheses.at(0), layout, ours);
    options.ml = RangeMl::kCeres;
    expect_is(locate_from(anchors, ranges, options, 0.3).hypotheses.at(0), layout, ceres);
    options.ml = RangeMl::kBoth;
    const PositionSolution both = locate_from(anchors, ranges, options, 0.3);
    expect_is(both.hypotheses.at(0), layout, ours);
    ASSERT_TRUE(both.ml_comparison);
    EXPECT_EQ(both.ml_comparison->ceres_position, layout.centre + ceres.position);
    EXPECT_EQ(both.ml_comparison->ceres_cost, ceres.cost);
    const Vector<2> apart = ceres.position - ours.position;
    EXPECT_NEAR(both.ml_comparison->distance, apart.norm(), 1e-14);
    EXPECT_NEAR(both.ml_comparison->sigmas, std::sqrt(apart.dot(ours.information * apart)), 1e-9);
    EXPECT_LT(both.ml_comparison->sigmas, 1e-3);
    differing += apart.isZero(0.0) ? 0 : 1;
  }
  EXPECT_GT(differing, 40);  // else two solvers were not compared
}

TEST(Locate, a_ceres_that_is_stopped_early_says_so_and_ours_does_not_finish_it) {
  const Anchors anchors = testing::room();
  std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  ranges[0] += 2.0;
  LocateOptions options;
  options.ml = RangeMl::kCeres;
  options.ceres.max_iterations = 1;
  const PositionSolution found = locate_from(anchors, ranges, options, 1.0);
  EXPECT_EQ(found.status, PositionStatus::kNotConverged);
  EXPECT_NE(found.reason.find("Maximum number of iterations"), std::string::npos) << found.reason;
  options.ml = RangeMl::kBoth;
  const PositionSolution both = locate_from(anchors, ranges, options, 1.0);
  EXPECT_EQ(both.status, PositionStatus::kUnique);
  EXPECT_EQ(both.ml_comparison->ceres_position, found.hypotheses.at(0).position);
  EXPECT_GT(both.ml_comparison->distance, 1e-4);
}

// In a flat valley Ceres takes all its steps.
TEST(Locate, both_solvers_say_the_same_over_layouts_and_noise) {
  Rng rng(13);
  int stopped = 0;
  for (int trial = 0; trial < 600; ++trial) {
    const int columns = 2 + trial % 2;
    const Anchors anchors = testing::random_anchors(rng, columns + 1 + trial % 4, columns);
    const double sigma = trial % 3 == 0 ? 1.0 : 0.1;
    std::vector<double> ranges = anchors.ranges_from(testing::random_point(rng, columns));
    testing::add_noise(rng, sigma, ranges);
    if (!std::all_of(ranges.begin(), ranges.end(), [](double range) { return range > 0.0; })) {
      continue;
    }
    LocateOptions options;
    const PositionSolution ours = locate_from(anchors, ranges, options, sigma);
    options.ml = RangeMl::kCeres;
    const PositionSolution ceres = locate_from(anchors, ranges, options, sigma);
    EXPECT_NE(ours.status, PositionStatus::kNotConverged) << trial;
    if (ceres.status == PositionStatus::kNotConverged) {
      ++stopped;
      continue;
    }
    EXPECT_EQ(ours.status, ceres.status) << trial << ours.reason << " / " << ceres.reason;
    EXPECT_EQ(ours.hypotheses.size(), ceres.hypotheses.size()) << trial;
  }
  EXPECT_LE(stopped, 3);
}

// With an infinite weight the cost of a position was NaN.
TEST(Locate, rejects_a_sigma_without_a_finite_weight) {
  const Anchors anchors = testing::room();
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  for (const double sigma : {1e-170, 1e-13, 1e13, 1e170}) {
    testing::expect_refused([&] { (void)locate_from(anchors, ranges, {}, sigma); }, "sigma",
                            "1e12");
  }
}

// The position was NaN.
TEST(Locate, rejects_a_height_whose_square_is_infinite) {
  Anchors anchors;
  for (const Vector<3>& place :
       {Vector<3>(0.0, 0.0, 1.0), Vector<3>(9.0, 0.0, 2.0), Vector<3>(0.0, 9.0, 3.0)}) {
    anchors.rows.insert(anchors.rows.end(), place.data(), place.data() + 3);
  }
  anchors.columns = 3;
  anchors.height = 1e200;
  const Vector<3> ranges(5.0, 6.0, 7.0);
  const Vector<3> sigma = Vector<3>::Constant(0.1);
  testing::expect_refused([&] { Multilateration<2>(anchors.table(), sigma, {}); }, "height");
  testing::expect_refused([&] { (void)locate(anchors.table(), ranges, sigma, {}); }, "height");
}

// By rounding, the predicted decrease of the last step could exceed the cost.
TEST(Locate, costs_are_not_negative_where_ranges_fit_to_the_bit) {
  testing::Rng rng(1);
  const double rows[] = {10.12, 12.35, 11.1, -10.04};
  const Vector<2> sigma(0.5, 0.001);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector2d truth = testing::random_pose(rng).position();
    const Vector<2> ranges((truth - Eigen::Vector2d(rows[0], rows[1])).norm(),
                           (truth - Eigen::Vector2d(rows[2], rows[3])).norm());
    const PositionSolution found = locate({RowsView(rows, 2, 2), {}}, ranges, sigma, {});
    ASSERT_FALSE(found.hypotheses.empty());
    for (const PositionHypothesis& hypothesis : found.hypotheses) {
      EXPECT_GE(hypothesis.cost, 0.0) << trial;
    }
  }
}

TEST(Locate, a_prior_beyond_double_precision_leaves_a_direction_open) {
  const Anchors anchors = testing::room();
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  for (const double tight : {1e-3, 1e-6, 1e-9, 1e-12}) {
    for (const RangeMl ml : {RangeMl::kNewton, RangeMl::kCeres}) {
      LocateOptions options;
      options.ml = ml;
      options.prior = {Eigen::Vector2d(3.0, 4.0), Eigen::Vector2d(2.0, tight)};
      const PositionSolution found = locate_from(anchors, ranges, options);
      const bool has_digits = tight > 1e-8;
      EXPECT_EQ(found.status,
                has_digits ? PositionStatus::kUnique : PositionStatus::kUnderdetermined)
          << tight;
      EXPECT_EQ(found.hypotheses.at(0).covariance.allFinite(), has_digits) << tight;
    }
  }
  LocateOptions options;
  options.prior = {Eigen::Vector2d(3.0, 4.0), Eigen::Vector2d(2.0, 1e-66)};
  testing::expect_refused([&] { (void)locate_from(anchors, ranges, options); }, "prior", "1e-12");
}

// A covariance from eigenvectors, or from cofactors, was symmetric only to rounding.
TEST(Locate, covariances_are_symmetric_to_the_bit) {
  const Anchors anchors = testing::room();
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d truth(3.0 + 0.1 * i, 4.0 - 0.07 * i);
    const std::vector<double> ranges = anchors.ranges_from(truth);
    const PositionSolution found = locate_from(anchors, ranges);
    ASSERT_EQ(found.status, PositionStatus::kUnique);
    EXPECT_TRUE(testing::is_covariance(found.hypotheses[0].covariance));
    const Multilateration<2> solver(anchors.table(), view(anchors.sigmas(0.1)), {});
    EXPECT_TRUE(testing::is_covariance(solver.solve(view(ranges)).covariance));
  }
}

TEST(Locate, returns_both_sides_of_anchors_on_a_line_and_a_box_or_prior_decides) {
  const Anchors anchors = line_of_anchors();
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, -4.0));
  PositionSolution found = locate_from(anchors, ranges);
  EXPECT_EQ(found.status, PositionStatus::kAmbiguous);
  EXPECT_NE(found.reason.find("2 positions"), std::string::npos);
  ASSERT_EQ(found.hypotheses.size(), 2U);
  EXPECT_NEAR(found.hypotheses[0].position(1) + found.hypotheses[1].position(1), 0.0, 1e-9);

  LocateOptions options;
  options.box = {Eigen::Vector2d(-1.0, -9.0), Eigen::Vector2d(11.0, 0.0)};
  found = locate_from(anchors, ranges, options);
  ASSERT_EQ(found.status, PositionStatus::kUnique);
  expect_near(found.hypotheses[0].position, Eigen::Vector2d(3.0, -4.0), 1e-6);
  options.box = {Eigen::Vector2d(-1.0, 5.0), Eigen::Vector2d(11.0, 9.0)};
  found = locate_from(anchors, ranges, options);
  EXPECT_EQ(found.status, PositionStatus::kExcluded);
  EXPECT_TRUE(found.hypotheses.empty());

  options.box.reset();
  options.prior = {Eigen::Vector2d(0.0, -3.0), Eigen::Vector2d(kInfinity, 1.0)};
  found = locate_from(anchors, ranges, options);
  ASSERT_EQ(found.status, PositionStatus::kUnique) << found.reason;
  EXPECT_NEAR(found.hypotheses[0].position(1), -4.0, 0.1);
}

TEST(Locate, a_height_resolves_anchors_on_a_line_in_space) {
  const Anchors anchors = {{0, 0, 2, 5, 0, 2, 10, 0, 2}, 3, {}};
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector3d(3.0, 4.0, 1.1));
  PositionSolution found = locate_from(anchors, ranges);
  EXPECT_EQ(found.status, PositionStatus::kUnderdetermined);
  EXPECT_NE(found.reason.find("circle"), std::string::npos) << found.reason;
  LocateOptions options;
  options.prior = {Eigen::Vector3d(0.0, 0.0, 1.1), Eigen::Vector3d(kInfinity, kInfinity, 0.01)};
  found = locate_from(anchors, ranges, options);
  EXPECT_EQ(found.status, PositionStatus::kAmbiguous) << found.reason;
  ASSERT_EQ(found.hypotheses.size(), 2U);
  for (const PositionHypothesis& hypothesis : found.hypotheses) {
    expect_near(hypothesis.position.cwiseAbs(), Eigen::Vector3d(3.0, 4.0, 1.1), 1e-3);
  }
}

TEST(Locate, reports_what_is_missing) {
  const Anchors one = {{1.0, 2.0}, 2, {}};
  EXPECT_NE(locate_from(one, {3.0}).reason.find("1 ranges"), std::string::npos);
  const Anchors none = {{}, 2, {}};
  EXPECT_EQ(locate_from(none, {}).status, PositionStatus::kUnderdetermined);
  const Anchors stack = {{1.0, 2.0, 1.0, 2.0, 1.0, 2.0}, 2, {}};
  const PositionSolution found = locate_from(stack, {3.0, 3.0, 3.0});
  EXPECT_EQ(found.status, PositionStatus::kUnderdetermined);
  EXPECT_NE(found.reason.find("one point"), std::string::npos) << found.reason;
  EXPECT_TRUE(found.hypotheses.empty());
}

TEST(Locate, names_the_direction_that_a_position_on_the_line_leaves_open) {
  const PositionSolution found =
      locate_from(line_of_anchors(), line_of_anchors().ranges_from(Eigen::Vector2d(3.0, 0.0)));
  EXPECT_EQ(found.status, PositionStatus::kUnderdetermined);
  ASSERT_FALSE(found.hypotheses.empty());
  EXPECT_NEAR(std::abs(found.hypotheses[0].weak_direction(1)), 1.0, 1e-6);
}

TEST(Locate, names_the_biased_range_and_alarms_at_the_stated_rate) {
  Rng rng(8);
  const Anchors anchors = {{0, 0, 10, 0, 10, 10, 0, 10, 5, 0, 5, 10}, 2, {}};
  LocateOptions options;
  options.rules.false_alarm_probability = 0.01;
  int named = 0;
  int alarms = 0;
  constexpr int kTrials = 2'000;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> ranges = anchors.ranges_from(testing::random_point(rng, 2));
    testing::add_noise(rng, 0.05, ranges);
    alarms += locate_from(anchors, ranges, options, 0.05).fits() ? 0 : 1;
    const std::size_t wrong = static_cast<std::size_t>(trial) % 6;
    ranges[wrong] += 1.0;
    const PositionSolution found = locate_from(anchors, ranges, options, 0.05);
    EXPECT_EQ(found.status, PositionStatus::kInconsistent);
    named += found.culprit && found.culprit->index == static_cast<int>(wrong) ? 1 : 0;
  }
  EXPECT_GE(named, kTrials * 99 / 100);
  EXPECT_NEAR(alarms, 20, 2.576 * std::sqrt(20.0));
}

TEST(Locate, cannot_identify_the_wrong_range_with_redundancy_one) {
  const Anchors anchors = {{0, 0, 10, 0, 3, 10}, 2, {}};
  std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(4.0, 4.0));
  ranges[0] += 2.0;
  const PositionSolution found = locate_from(anchors, ranges);
  EXPECT_EQ(found.status, PositionStatus::kInconsistent);
  EXPECT_FALSE(found.culprit.has_value());
  EXPECT_NE(found.reason.find("no single one"), std::string::npos) << found.reason;
}

TEST(Locate, ranges_that_contradict_each_other_by_100_m_are_inconsistent) {
  const Anchors anchors = testing::room();
  std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  ranges[0] += 100.0;
  ranges[3] += 60.0;
  const PositionSolution found = locate_from(anchors, ranges);
  EXPECT_EQ(found.status, PositionStatus::kInconsistent);
  EXPECT_TRUE(found.hypotheses[0].position.allFinite());
}

TEST(Locate, rejects_invalid_ranges_priors_and_boxes) {
  const Anchors anchors = testing::room();
  const std::vector<double> good = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  for (const double bad : {0.0, -1.5, std::nan(""), kInfinity}) {
    std::vector<double> ranges = good;
    ranges[3] = bad;
    testing::expect_refused([&] { (void)locate_from(anchors, ranges); }, "range 3", "positive");
  }
  LocateOptions options;
  options.prior = {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(0.0, 1.0)};
  testing::expect_refused([&] { (void)locate_from(anchors, good, options); }, "prior", "0.000");
  options.prior.reset();
  options.box = {Eigen::Vector2d(0.0, 2.0), Eigen::Vector2d(1.0, 1.0)};
  testing::expect_refused([&] { (void)locate_from(anchors, good, options); }, "box", "2.000");
}

TEST(CramerRao, equals_values_computed_by_hand) {
  const Anchors anchors = {{10.0, 0.0, 0.0, 5.0}, 2, {}};
  const auto bound =
      cramer_rao(anchors.table(), view(anchors.sigmas(0.1)), Eigen::RowVector2d(0.0, 0.0));
  expect_near(bound[0], 0.01 * Matrix<2, 2>::Identity(), 1e-15);
  EXPECT_NEAR(dilution(anchors.table(), Eigen::Vector2d(0.0, 0.0)).position, std::sqrt(2.0), 1e-15);
  // An anchor 3 m above and 4 m aside: 4/5 of its direction is in the plane.
  const Anchors above = {{4.0, 0.0, 3.0, 0.0, 4.0, 3.0}, 3, 0.0};
  EXPECT_NEAR(
      cramer_rao(above.table(), view(above.sigmas(0.1)), Eigen::RowVector2d(0.0, 0.0))[0](0, 0),
      0.01 / 0.64, 1e-15);
}

TEST(CramerRao, is_infinite_where_a_direction_is_open) {
  const Anchors anchors = line_of_anchors();
  const auto bound =
      cramer_rao(anchors.table(), view(anchors.sigmas(0.1)), Eigen::RowVector2d(3.0, 0.0));
  EXPECT_EQ(bound[0](1, 1), kInfinity);
}

TEST(Locate, rejects_invalid_solver_options) {
  const Anchors anchors = testing::room();
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  LocateOptions options;
  options.ceres.max_iterations = -1;
  testing::expect_refused([&] { (void)locate_from(anchors, ranges, options); }, "Ceres");
  options = {};
  options.ceres.parameter_tolerance = std::numeric_limits<double>::quiet_NaN();
  testing::expect_refused([&] { (void)locate_from(anchors, ranges, options); }, "Ceres");
  options = {};
  options.rules.false_alarm_probability = -1.0;
  testing::expect_refused([&] { (void)locate_from(anchors, ranges, options); },
                          "false_alarm_probability is -1");
  options = {};
  options.loss = {RangeLossKind::kCauchy, 1e-200};
  testing::expect_refused([&] { (void)locate_from(anchors, ranges, options); }, "scale of a loss");
}

}  // namespace
}  // namespace locfuse
