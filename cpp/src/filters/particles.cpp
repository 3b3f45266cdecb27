// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/particles.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "filters/fast_math.hpp"
#include "filters/particle_lanes.hpp"
#include "locfuse/error.hpp"
#include "locfuse/math/angle.hpp"
#include "math/processor.hpp"

namespace locfuse {
namespace {

internal::MoveParticles mover() {
#ifdef LOCFUSE_LANES_AVX2
  if (internal::has_avx2()) {
    return internal::avx2::move_particles;
  }
#endif
  return internal::portable::move_particles;
}

/// Lower triangle L with L L' = P, where P may leave directions out.
Matrix<3, 3> root_of(const Matrix<3, 3>& P) {
  const Eigen::LDLT<Matrix<3, 3>> factor(P);
  Matrix<3, 3> lower = factor.matrixL();
  lower = factor.transpositionsP().transpose() * lower;
  return lower * factor.vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// The lower triangle L with L L' = A A'.
Matrix<3, 3> triangle_of(const Matrix<3, 3>& A) {
  Matrix<3, 3> L = Matrix<3, 3>::Zero();
  const Matrix<3, 3> P = A * A.transpose();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column <= row; ++column) {
      double rest = P(row, column);
      for (int k = 0; k < column; ++k) {
        rest -= L(row, k) * L(column, k);
      }
      if (row == column) {
        L(row, column) = std::sqrt(std::max(rest, 0.0));
      } else {
        L(row, column) = L(column, column) > 0.0 ? rest / L(column, column) : 0.0;
      }
    }
  }
  return L;
}

/// Sum and sum of squares of weight * exp(share * (log_likelihood - highest)), kept in `weighed`.
std::pair<double, double> weigh(const ParticleBelief& belief,
                                const std::vector<float>& log_likelihood, double highest,
                                double share, std::vector<float>& weighed) {
  const auto size = static_cast<std::size_t>(belief.size);
  const auto by = static_cast<float>(share);
  const auto top = static_cast<float>(highest);
  for (std::size_t k = 0; k < size; ++k) {
    weighed[k] = belief.weight[k] * internal::exp_of(by * (log_likelihood[k] - top));
  }
  return internal::sums_of(weighed, belief.size);
}

}  // namespace

void ParticleBelief::resize(int count) {
  if (count < 1 || count > kMaxSize) {
    throw std::invalid_argument("there are " + std::to_string(count) +
                                " particles, expected 1 to " + std::to_string(kMaxSize));
  }
  constexpr auto kGroup = static_cast<std::size_t>(internal::kParticleGroup);
  const auto filled = (static_cast<std::size_t>(count) + kGroup - 1) / kGroup * kGroup;
  for (std::vector<float>* column : {&x, &y, &c, &s, &weight, &box}) {
    column->resize(filled);
  }
  for (auto k = static_cast<std::size_t>(count); k < filled; ++k) {
    x[k] = y[k] = s[k] = weight[k] = box[k] = 0.0F;
    c[k] = 1.0F;
  }
  size = count;
}

void move(ParticleBelief& belief, const UncertainMotion& step, std::uint64_t key,
          Workers& workers) {
  Matrix<3, 3> L = triangle_of(root_of(step.covariance));
  // Any heading [rad], and few enough turns for the lanes.
  constexpr double kMaxHeadingSigma = 100.0;
  if (const double turn = L.row(2).norm(); turn > kMaxHeadingSigma) {
    L.row(2) *= kMaxHeadingSigma / turn;
  }
  constexpr double kMaxMotion = 1e30;  // [cells]; particles are kept in single precision
  const double farthest = std::max(
      {std::abs(step.motion.x), std::abs(step.motion.y), L.topRows<2>().cwiseAbs().maxCoeff()});
  if (!L.allFinite() || !(farthest <= kMaxMotion) || !std::isfinite(step.motion.heading)) {
    throw NumericalError("a motion of particles is not finite");
  }
  const auto f = [](double value) { return static_cast<float>(value); };
  const internal::LaneMotion motion{
      f(step.motion.x),
      f(step.motion.y),
      f(wrap_angle(step.motion.heading)),
      {f(L(0, 0)), f(L(1, 0)), f(L(1, 1)), f(L(2, 0)), f(L(2, 1)), f(L(2, 2))}};
  const internal::LaneParticles particles{belief.x.data(), belief.y.data(), belief.c.data(),
                                          belief.s.data()};
  const internal::MoveParticles move_part = mover();
  workers.share(static_cast<int>(belief.x.size()), internal::kParticleGroup,
                [&](int begin, int end) { move_part(particles, begin, end, motion, key); });
}

double reweigh(ParticleBelief& belief, const std::vector<float>& log_likelihood, double max_share,
               double min_effective) {
  double highest = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < belief.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (belief.weight[k] > 0.0F) {
      highest = std::max(highest, static_cast<double>(log_likelihood[k]));
    }
  }
  if (!std::isfinite(highest)) {
    throw NumericalError("no particle has a likelihood");
  }
  std::vector<float> weighed(static_cast<std::size_t>(belief.size));
  float sum = 0.0F;
  const auto effective = [&](double share) {
    const auto [total, squares] = weigh(belief, log_likelihood, highest, share, weighed);
    sum = static_cast<float>(total);
    return total * total / squares;
  };
  const double enough = std::min(min_effective, effective_size(belief));
  double share = max_share;
  // The largest share that leaves enough, to a hundredth of itself: log n_eff is all but a straight
  // line over log share.
  double high = effective(share);
  double low_share = 0x1p-30 * share;
  double low = effective_size(belief);
  for (int step = 0; step < 20 && high < enough && low_share < 0.99 * share; ++step) {
    const double slope = std::log(high / low) / std::log(share / low_share);
    const double secant = low_share * std::exp(std::log(enough / low) / slope);
    const double middle = step % 3 == 2 ? std::sqrt(low_share * share)
                                        : std::clamp(secant, 1.004 * low_share, 0.996 * share);
    const double now = effective(middle);
    (now < enough ? share : low_share) = middle;
    (now < enough ? high : low) = now;
  }
  if (high < enough) {
    share = low_share;
    effective(share);
  }
  for (std::size_t k = 0; k < weighed.size(); ++k) {
    belief.weight[k] = weighed[k] / sum;
  }
  return share;
}

double effective_size(const ParticleBelief& belief) {
  const auto [sum, squares] = internal::sums_of(belief.weight, belief.size);
  return sum * sum / squares;
}

}  // namespace locfuse
