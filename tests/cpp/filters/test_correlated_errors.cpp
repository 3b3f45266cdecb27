// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <map>

#include "locfuse/filters/kalman.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_correlated_errors {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using testing::random_covariance;
using testing::random_matrix;
using AnyLinearization = Linearization<Eigen::Dynamic, Eigen::Dynamic>;

constexpr double kTime = 3.0;  // s

/// The error of the state and a unit error of each source together, moved as the filter's gains
/// move them: nothing is left out, and nothing is in steps.
class Together {
 public:
  explicit Together(const MatrixXd& P) : size_(P.rows()), all_(P) {}

  [[nodiscard]] MatrixXd state() const { return all_.topLeftCorner(size_, size_); }

  void move(const MatrixXd& F, const MatrixXd& Q) {
    MatrixXd T = MatrixXd::Identity(all_.rows(), all_.rows());
    T.topLeftCorner(size_, size_) = F;
    all_ = (T * all_ * T.transpose()).eval();
    all_.topLeftCorner(size_, size_) += Q;
  }

  /// How errors of a kind are taken to be.
  struct Parts {
    double share = 0.0;
    double common = 0.0;  // of that
    double factor = 1.0;
  };
  /// Of `sources`, by a gain and with those parts of R correlated.
  void fuse(const MatrixXd& K, const AnyLinearization& lin, const Parts& parts, Stamp stamp) {
    const Index m = lin.noise.rows();
    MatrixXd T = MatrixXd::Identity(all_.rows() + 2 * m, all_.rows() + 2 * m);
    T.topLeftCorner(size_, size_) -= K * lin.jacobian;
    const MatrixXd L = MatrixXd(lin.noise.llt().matrixL()) * std::sqrt(parts.factor);
    for (Index i = 0; i < m; ++i) {
      const std::uint64_t source = lin.correlation.sources[static_cast<std::size_t>(i)];
      T.block(0, row_of(source, stamp), size_, 1) -=
          std::sqrt(parts.share - parts.common) * K * L.col(i);
      T.block(0, row_of(source % 4 + kOfAll, stamp), size_, 1) -=
          std::sqrt(parts.common) * K * L.col(i);
    }
    const MatrixXd kept = T.topLeftCorner(all_.rows(), all_.rows());
    all_ = (kept * all_ * kept.transpose()).eval();
    all_.topLeftCorner(size_, size_) +=
        K * (parts.factor * lin.noise - parts.share * L * L.transpose()) * K.transpose();
  }

 private:
  static constexpr std::uint64_t kOfAll = 1'000'000;

  Index row_of(std::uint64_t source, Stamp stamp) {
    if (rows_.count(source) == 0) {
      const Index at = all_.rows();
      all_.conservativeResize(at + 1, at + 1);
      all_.row(at).setZero();
      all_.col(at).setZero();
      all_(at, at) = 1.0;
      rows_[source] = {at, stamp};
    }
    auto& [at, last] = rows_[source];
    const double kept = std::exp(-seconds_between(last, stamp) / kTime);
    all_.row(at) *= kept;
    all_.col(at) *= kept;
    all_(at, at) = 1.0;
    last = stamp;
    return at;
  }

  Index size_;
  MatrixXd all_;
  std::map<std::uint64_t, std::pair<Index, Stamp>> rows_;
};

MatrixXd gain_of(const GaussianBelief& belief, const AnyLinearization& lin) {
  const MatrixXd P = belief.P;
  const MatrixXd PHt = P * lin.jacobian.transpose();
  return PHt * MatrixXd(lin.jacobian * PHt + lin.noise).inverse();
}

/// Moves, turns and measures at random; the reported covariance is that of all errors together.
void expect_together(testing::Rng& rng, const std::vector<std::string>& more, int points = 0) {
  GaussianBelief belief = GaussianBelief::of_pose(0, {1.0, 2.0, 0.5}, random_covariance(rng, 3));
  std::vector<Slot> slots{belief.slot("body")};
  for (const std::string& name : more) {
    slots.push_back(belief.add(name, SlotKind::kScalar, Vector<1>(0.1), random_covariance(rng, 1)));
  }
  for (int point = 0; point < points; ++point) {
    slots.push_back(belief.add(std::to_string(point), SlotKind::kPoint2, random_matrix(rng, 2, 1),
                               random_covariance(rng, 2)));
  }
  const Index size = belief.dimension();
  Together together(belief.P);
  for (int step = 0; step < 150; ++step) {
    belief.stamp += static_cast<Stamp>(testing::uniform(rng, 0.0, 2.0) * kNanosecondsPerSecond);
    const Pose2 at = belief.pose(slots.front());
    Propagation<Pose2, 3> motion{at, Matrix<3, 3>::Identity(), 0.1 * random_covariance(rng, 3)};
    motion.jacobian += 0.1 * random_matrix(rng, 3, 3);
    predict(belief, motion, slots.front());
    MatrixXd F = MatrixXd::Identity(size, size);
    F.topLeftCorner<3, 3>() = motion.jacobian;
    MatrixXd Q = MatrixXd::Zero(size, size);
    Q.topLeftCorner<3, 3>() = motion.noise;
    together.move(F, Q);

    const Index m = 1 + step % 3;
    AnyLinearization lin{0.5 * random_matrix(rng, m, 1),
                         random_matrix(rng, m, size),
                         random_covariance(rng, static_cast<int>(m)),
                         {}};
    lin.correlation.kind = static_cast<std::size_t>(step % 2);
    const bool is_correlated = step % 5 != 4;
    lin.correlation.time_s = is_correlated ? kTime : 0.0;
    const auto first = static_cast<std::uint64_t>(10 * m + 100 * (step / 3 % 2));
    for (std::size_t i = 0; i < 3; ++i) {
      lin.correlation.sources[i] = first + i;
    }
    const MatrixXd K = gain_of(belief, lin);
    const std::size_t kind = lin.correlation.kind;
    const Together::Parts parts{belief.correlated.share(kind), belief.correlated.common(kind),
                                belief.correlated.factor(kind)};
    if (step % 7 == 6 && m == 2 && size == 3) {  // the same in a type of known size
      const Linearization<2, 3> fixed{
          lin.residual,
          lin.jacobian,
          lin.noise,
          {lin.correlation.time_s, lin.correlation.kind, {first, first + 1}}};
      ASSERT_EQ(update(belief, fixed, slots, Gate()).verdict, Verdict::kFused);
    } else {
      ASSERT_EQ(update(belief, lin, slots, Gate()).verdict, Verdict::kFused);
    }
    if (is_correlated) {
      together.fuse(K, lin, parts, belief.stamp);
    } else {
      MatrixXd I_KH = MatrixXd::Identity(size, size) - K * lin.jacobian;
      together.move(I_KH, K * lin.noise * K.transpose());
    }
    if (step % 4 == 3 && points > 0) {
      Eigen::VectorXd shift = 0.1 * random_matrix(rng, static_cast<int>(size), 1);
      shift(2) = 0.0;  // with a heading that stays the arcs are lines
      turn_map_with_mean(belief, belief.x - shift);
      F.setIdentity();
      for (Index row = 0; row < size; row += row == 0 ? 3 : 2) {
        F(row, 2) = -shift(row + 1);
        F(row + 1, 2) = shift(row);
      }
      together.move(F, MatrixXd::Zero(size, size));
    } else if (step % 4 == 3) {
      const Vector<2> before(0.0, 0.0);
      const Vector<2> shift = belief.pose(slots.front()).position() - before;
      turn_with_mean(belief, slots.front(), before);
      F.setIdentity();
      F(0, 2) = -shift.y();
      F(1, 2) = shift.x();
      together.move(F, MatrixXd::Zero(size, size));
    }
    const MatrixXd expected = together.state();
    const double scale = expected.diagonal().maxCoeff();
    ASSERT_LT((belief.marginal(slots) - expected).cwiseAbs().maxCoeff(), 1e-9 * scale)
        << "in step " << step;
  }
}

TEST(CorrelatedErrors, report_what_all_errors_together_have) {
  testing::Rng rng(1);
  for (int k = 0; k < 20; ++k) {
    expect_together(rng, {});
    expect_together(rng, {"offset", "scale"});
    expect_together(rng, {}, 2);
  }
  expect_together(rng, {}, 10);  // so many that all is done at once
}

TEST(CorrelatedErrors, of_what_placed_a_point_are_not_averaged_away_by_the_same_again) {
  for (const int others : {0, 8}) {
    GaussianBelief belief = GaussianBelief::of_pose(0, {}, 1e-8 * Matrix<3, 3>::Identity());
    for (int k = 0; k < others; ++k) {
      belief.add(std::to_string(k), SlotKind::kPoint2, Vector<2>::Zero(), Matrix<2, 2>::Identity());
    }
    const Matrix<2, 2> R = 0.01 * Matrix<2, 2>::Identity();
    const Matrix<2, 3> by_pose = Matrix<2, 3>::Identity();
    const Slot point = augment(belief, "point", SlotKind::kPoint2, Vector<2>(1.0, 2.0), by_pose, R,
                               belief.slot("body"));
    const ErrorCorrelation<2> same{kTime, 0, {7, 8}};
    keep_error_of_new(belief, {Vector<2>::Zero(), Matrix<2, 2>::Identity(), R, same}, point);
    for (int k = 0; k < 99; ++k) {
      Linearization<2, 2> again{Vector<2>::Zero(), Matrix<2, 2>::Identity(), R, same};
      ASSERT_EQ(update(belief, again, point, Gate()).verdict, Verdict::kFused);
    }
    const int row = belief.offset(point);
    EXPECT_NEAR(belief.P(row, row), 0.01 / 100, 1e-6);
    EXPECT_NEAR(belief.marginal(point)(0, 0), 0.01, 1e-3);
    EXPECT_NEAR(belief.marginal(point)(1, 1), 0.01, 1e-3);
  }
}

/// One number that stands, measured again and again.
struct Standing {
  GaussianBelief belief = GaussianBelief::of_pose(0, {}, Matrix<3, 3>::Identity());
  Slot body = belief.slot("body");

  void measure(double residual, std::uint64_t source, double seconds, double time_s = kTime) {
    belief.stamp += static_cast<Stamp>(seconds * kNanosecondsPerSecond);
    Linearization<1, 3> lin{
        Vector<1>(residual - belief.x(0)), {1.0, 0.0, 0.0}, Vector<1>(0.01), {time_s, 0, {source}}};
    ASSERT_EQ(update(belief, lin, body, Gate()).verdict, Verdict::kFused);
  }
  [[nodiscard]] double reported() const { return belief.marginal_of_first<3>()(0, 0); }
};

TEST(CorrelatedErrors, are_not_averaged_away_before_anything_is_learnt) {
  Standing one;
  for (int k = 0; k < 100; ++k) {
    one.measure(0.0, 1, 0.0);  // the same error again, as of one instant
  }
  EXPECT_NEAR(one.belief.P(0, 0), 0.01 / 100, 1e-6);
  EXPECT_NEAR(one.reported(), 0.01, 1e-3);
}

TEST(CorrelatedErrors, of_other_sources_are_averaged) {
  Standing many;
  for (int k = 0; k < 50; ++k) {
    many.measure(0.0, static_cast<std::uint64_t>(k), 0.0);
  }
  EXPECT_NEAR(many.reported(), many.belief.P(0, 0), 1e-5);
}

TEST(CorrelatedErrors, change_nothing_where_errors_are_independent) {
  testing::Rng rng(1);
  Standing with;
  Standing without;
  for (int k = 0; k < 100; ++k) {
    const double z = testing::normal(rng, 0.1);
    with.measure(z, 1, 0.1);
    without.measure(z, 1, 0.1, 0.0);
  }
  EXPECT_EQ(with.belief.x, without.belief.x);
  EXPECT_EQ(Eigen::MatrixXd(with.belief.P), Eigen::MatrixXd(without.belief.P));
  EXPECT_TRUE(without.belief.correlated.is_empty());
  EXPECT_EQ(without.reported(), without.belief.P(0, 0));
}

TEST(CorrelatedErrors, are_learnt_from_innovations) {
  testing::Rng rng(1);
  // What is measured moves, or there would be no innovations after a while.
  const auto learn = [&](double kept, double scale) {
    Standing one;
    double x = 0.0;
    double own = testing::normal(rng, 0.1);
    for (int k = 0; k < 3000; ++k) {
      own = kept * own + std::sqrt(1.0 - kept * kept) * testing::normal(rng, 0.1);
      x += testing::normal(rng, 0.01);
      Propagation<Pose2, 3> step{
          {one.belief.x(0), 0.0, 0.0}, Matrix<3, 3>::Identity(), 1e-4 * Matrix<3, 3>::Identity()};
      predict(one.belief, step, one.body);
      one.measure(x + scale * own, 1, 0.1);
    }
    return std::pair(one.belief.correlated.share(0), one.belief.correlated.factor(0));
  };
  const auto [independent, right] = learn(0.0, 1.0);
  EXPECT_LT(independent, 0.15);
  EXPECT_NEAR(right, 1.0, 0.1);
  const auto [correlated, followed] = learn(std::exp(-0.1), 1.0);
  EXPECT_GT(correlated, 0.6);
  const auto [still_independent, twice] = learn(0.0, 2.0);
  EXPECT_LT(still_independent, 0.15);
  EXPECT_GT(twice, 2.5);
}

TEST(CorrelatedErrors, of_all_sources_are_learnt_from_innovations_of_different_ones) {
  const auto learn = [](double sigma_common) {
    testing::Rng rng(1);
    Standing one;
    double x = 0.0;
    double common = testing::normal(rng, sigma_common);
    for (int k = 0; k < 3000; ++k) {
      const double kept = std::exp(-0.1);
      common = kept * common + std::sqrt(1.0 - kept * kept) * testing::normal(rng, sigma_common);
      x += testing::normal(rng, 0.01);
      Propagation<Pose2, 3> step{
          {one.belief.x(0), 0.0, 0.0}, Matrix<3, 3>::Identity(), 1e-4 * Matrix<3, 3>::Identity()};
      predict(one.belief, step, one.body);
      const double own = std::sqrt(0.01 - sigma_common * sigma_common);
      one.measure(x + common + testing::normal(rng, own), static_cast<std::uint64_t>(4 * (k % 3)),
                  0.1);
    }
    return one;
  };
  const Standing of_each = learn(0.0);
  const Standing of_all = learn(0.09);
  EXPECT_LT(of_each.belief.correlated.common(0), 0.15);
  EXPECT_GT(of_all.belief.correlated.common(0), 0.5);
  EXPECT_LE(of_all.belief.correlated.common(0), of_all.belief.correlated.share(0));
  EXPECT_EQ(of_all.belief.correlated.common(1), 0.0);
  EXPECT_GT(of_all.reported(), 2.0 * of_each.reported());
}

TEST(CorrelatedErrors, last_as_long_as_the_body_stands) {
  Standing stands;
  Standing moves;
  for (int k = 0; k < 100; ++k) {
    stands.belief.correlated.stand(1.0);
    stands.measure(0.0, 1, 1.0);
    moves.measure(0.0, 1, 1.0);
  }
  EXPECT_NEAR(stands.reported(), 0.01, 1e-3);
  EXPECT_LT(moves.reported(), 0.002);
}

TEST(CorrelatedErrors, beyond_what_numbers_hold_are_forgotten) {
  Standing one;
  one.measure(0.0, 1, 0.1);
  Propagation<Pose2, 3> step{{}, Matrix<3, 3>::Identity(), Matrix<3, 3>::Identity()};
  step.jacobian(0, 2) = 1e200;
  one.belief.correlated.move(step.jacobian, std::array<int, 3>{0, 1, 2}.data());
  one.belief.correlated.move(1e200 * step.jacobian, std::array<int, 3>{0, 1, 2}.data());
  EXPECT_EQ(one.reported(), one.belief.P(0, 0));
  one.measure(0.0, 1, 0.1);
  EXPECT_TRUE(one.belief.correlated.is_empty());
  one.measure(0.0, 1, 0.1);
  EXPECT_FALSE(one.belief.correlated.is_empty());
  EXPECT_TRUE(std::isfinite(one.reported()));
}

TEST(CorrelatedErrors, of_many_sources_are_those_that_were_fused_last) {
  Standing one;
  for (int round = 0; round < 3; ++round) {
    for (std::uint64_t source = 0; source < 200; ++source) {
      one.measure(0.0, source, 1e-3);
    }
  }
  EXPECT_TRUE(std::isfinite(one.reported()));
  EXPECT_GE(one.reported(), one.belief.P(0, 0));
}

TEST(CorrelatedErrors, follow_variables_that_come_and_go) {
  testing::Rng rng(1);
  GaussianBelief belief = GaussianBelief::of_pose(0, {}, random_covariance(rng, 3));
  const Slot body = belief.slot("body");
  const auto measure = [&](const std::vector<Slot>& slots, Index columns) {
    AnyLinearization lin{random_matrix(rng, 1, 1),
                         random_matrix(rng, 1, static_cast<int>(columns)),
                         random_covariance(rng, 1),
                         {kTime, 0, {7, 8, 9}}};
    ASSERT_EQ(update(belief, lin, slots, Gate()).verdict, Verdict::kFused);
  };
  measure({body}, 3);
  measure({body}, 3);
  const MatrixXd G = random_matrix(rng, 2, 3);
  const MatrixXd before = belief.correlated.excess();
  const Slot point = augment(belief, "point", SlotKind::kPoint2, Vector<2>(1.0, 2.0), G,
                             random_covariance(rng, 2), body);
  const MatrixXd after = belief.correlated.excess();
  EXPECT_LT((after.bottomLeftCorner(2, 3) - G * before).norm(), 1e-12);
  EXPECT_LT((after.bottomRightCorner(2, 2) - G * before * G.transpose()).norm(), 1e-12);
  EXPECT_EQ(MatrixXd(after.topLeftCorner(3, 3)), before);
  measure({body, point}, 5);
  const MatrixXd kept = belief.correlated.excess().topLeftCorner(3, 3);
  belief.remove(point);
  EXPECT_EQ(MatrixXd(belief.correlated.excess()), kept);
  measure({body}, 3);
}

}  // namespace
}  // namespace locfuse::test_correlated_errors
