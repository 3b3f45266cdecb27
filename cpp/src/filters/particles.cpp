// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/particles.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "filters/particle_lanes.hpp"
#include "locfuse/error.hpp"
#include "locfuse/math/counter_random.hpp"
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

double sum_of(const std::vector<float>& values, int size) {
  return std::accumulate(values.begin(), values.begin() + size, 0.0);
}

/// Weights times exp(share * (log_likelihood - most)); returns (sum, sum of squares).
template <class Each>
std::pair<double, double> weigh(const ParticleBelief& belief,
                                const std::vector<float>& log_likelihood, double most, double share,
                                const Each& each) {
  double sum = 0.0;
  double squares = 0.0;
  for (int i = 0; i < belief.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double w = static_cast<double>(belief.weight[k]) *
                     std::exp(share * (static_cast<double>(log_likelihood[k]) - most));
    sum += w;
    squares += w * w;
    each(k, w);
  }
  return {sum, squares};
}

}  // namespace

void ParticleBelief::resize(int count) {
  if (count < 1 || count > kMost) {
    throw std::invalid_argument("there are " + std::to_string(count) +
                                " particles, expected 1 to " + std::to_string(kMost));
  }
  constexpr int kGroup = internal::kParticleGroup;
  const auto filled = static_cast<std::size_t>((count + kGroup - 1) / kGroup * kGroup);
  for (std::vector<float>* column : {&x, &y, &c, &s, &weight}) {
    column->resize(filled);
  }
  for (auto k = static_cast<std::size_t>(count); k < filled; ++k) {
    x[k] = y[k] = s[k] = weight[k] = 0.0F;
    c[k] = 1.0F;
  }
  size = count;
}

void move(ParticleBelief& belief, const UncertainMotion& step, std::uint64_t key,
          Workers& workers) {
  const Matrix<3, 3> L = triangle_of(root_of(step.covariance));
  if (!L.allFinite() || !std::isfinite(step.motion.x + step.motion.y + step.motion.heading)) {
    throw NumericalError("a motion of particles is not finite");
  }
  const auto f = [](double value) { return static_cast<float>(value); };
  const internal::LaneMotion motion{
      f(step.motion.x),
      f(step.motion.y),
      f(step.motion.heading),
      {f(L(0, 0)), f(L(1, 0)), f(L(1, 1)), f(L(2, 0)), f(L(2, 1)), f(L(2, 2))}};
  const internal::LaneParticles particles{belief.x.data(), belief.y.data(), belief.c.data(),
                                          belief.s.data()};
  const internal::MoveParticles move_part = mover();
  workers.share(static_cast<int>(belief.x.size()), internal::kParticleGroup,
                [&](int begin, int end) { move_part(particles, begin, end, motion, key); });
}

double reweigh(ParticleBelief& belief, const std::vector<float>& log_likelihood, double most_share,
               double least_effective) {
  double most = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < belief.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (belief.weight[k] > 0.0F) {
      most = std::max(most, static_cast<double>(log_likelihood[k]));
    }
  }
  if (!std::isfinite(most)) {
    throw NumericalError("no particle has a likelihood");
  }
  const auto effective = [&](double share) {
    const auto [sum, squares] =
        weigh(belief, log_likelihood, most, share, [](std::size_t, double) {});
    return sum * sum / squares;
  };
  const double least = std::min(least_effective, effective_size(belief));
  double share = most_share;
  if (effective(share) < least) {  // the largest that leaves enough, to a hundredth of itself
    double low = 0x1p-30 * share;
    for (int step = 0; step < 12; ++step) {
      const double middle = std::sqrt(low * share);
      (effective(middle) < least ? share : low) = middle;
    }
    share = low;
  }
  const double sum = weigh(belief, log_likelihood, most, share, [&](std::size_t k, double w) {
                       belief.weight[k] = static_cast<float>(w);
                     }).first;
  for (int i = 0; i < belief.size; ++i) {
    belief.weight[static_cast<std::size_t>(i)] /= static_cast<float>(sum);
  }
  return share;
}

double effective_size(const ParticleBelief& belief) {
  double squares = 0.0;
  for (int i = 0; i < belief.size; ++i) {
    const double w = static_cast<double>(belief.weight[static_cast<std::size_t>(i)]);
    squares += w * w;
  }
  const double sum = sum_of(belief.weight, belief.size);
  return sum * sum / squares;
}

void resample(ParticleBelief& belief, int count, const FreshParticles& fresh, std::uint64_t key,
              ParticleBelief& scratch) {
  scratch.resize(count);
  scratch.stamp = belief.stamp;
  const int kept = std::max(count - fresh.count, 1);
  const double step = sum_of(belief.weight, belief.size) / kept;
  double next = random_uniform(key, 0) * step;
  double passed = 0.0;
  int to = 0;
  for (int from = 0; from < belief.size && to < kept; ++from) {
    const auto k = static_cast<std::size_t>(from);
    passed += static_cast<double>(belief.weight[k]);
    const bool last = from + 1 == belief.size;  // rounding may leave the last ones over
    for (; to < kept && (next < passed || last); ++to, next += step) {
      const auto i = static_cast<std::size_t>(to);
      scratch.x[i] = belief.x[k];
      scratch.y[i] = belief.y[k];
      scratch.c[i] = belief.c[k];
      scratch.s[i] = belief.s[k];
    }
  }
  const double probability = kept < count ? fresh.probability : 0.0;
  const auto weights = scratch.weight.begin();
  std::fill(weights, weights + kept, static_cast<float>((1.0 - probability) / kept));
  std::fill(weights + kept, weights + count,
            static_cast<float>(probability / std::max(count - kept, 1)));
  for (; to < count; ++to) {
    fresh.draw(scratch, to);
  }
  std::swap(belief, scratch);
}

namespace {

constexpr double kThin = 0.05;  // share of the heaviest bin below which one is in no cluster

/// A bin's number: heading, row and column.
class Binning {
 public:
  explicit Binning(const ParticleBins& bins)
      : per_side_(1.0 / bins.side), headings_(static_cast<int>(bins.headings)) {}

  [[nodiscard]] std::int64_t bin(const ParticleBelief& belief, std::size_t k) const {
    const auto column = static_cast<std::int64_t>(static_cast<double>(belief.x[k]) * per_side_);
    const auto row = static_cast<std::int64_t>(static_cast<double>(belief.y[k]) * per_side_);
    const double turn =
        static_cast<double>(std::atan2(belief.s[k], belief.c[k])) / (2.0 * kPi) + 0.5;
    const auto heading = static_cast<std::int64_t>(turn * headings_) % headings_;
    return number(heading, row + kShift, column + kShift);
  }

  template <class Each>
  void around(std::int64_t bin, const Each& each) const {
    const std::int64_t heading = bin >> 48;
    const std::int64_t row = (bin >> 24) & 0xFFFFFF;
    const std::int64_t column = bin & 0xFFFFFF;
    for (int h = -1; h <= 1; ++h) {
      for (int r = -1; r <= 1; ++r) {
        for (int c = -1; c <= 1; ++c) {
          each(number((heading + h + headings_) % headings_, row + r, column + c));
        }
      }
    }
  }

 private:
  static constexpr std::int64_t kShift = 1 << 20;  // so that none is negative
  static std::int64_t number(std::int64_t heading, std::int64_t row, std::int64_t column) {
    return heading << 48 | row << 24 | column;
  }
  double per_side_;
  int headings_;
};

}  // namespace

int occupied_bins(const ParticleBelief& belief, const ParticleBins& bins, double least) {
  const Binning binning(bins);
  std::vector<std::int64_t> numbers;
  numbers.reserve(static_cast<std::size_t>(belief.size));
  std::int64_t last = -1;
  for (int i = 0; i < belief.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (belief.weight[k] * static_cast<float>(belief.size) >= static_cast<float>(least)) {
      const std::int64_t bin = binning.bin(belief, k);
      if (bin != last) {  // copies of one particle follow one another
        numbers.push_back(last = bin);
      }
    }
  }
  std::sort(numbers.begin(), numbers.end());
  return static_cast<int>(std::unique(numbers.begin(), numbers.end()) - numbers.begin());
}

double kld_particles(int bins, double error, double quantile) {
  if (bins < 2) {
    return 1.0;
  }
  const double k = bins - 1;
  const double b = 2.0 / (9.0 * k);
  const double root = 1.0 - b + std::sqrt(b) * quantile;
  return k / (2.0 * error) * root * root * root;
}

std::vector<ParticleCluster> clusters_of(const ParticleBelief& belief, const ParticleBins& bins,
                                         int most) {
  const Binning binning(bins);
  struct Bin {
    double weight = 0.0;
    int cluster = -1;
  };
  std::unordered_map<std::int64_t, Bin> found;
  std::vector<std::int64_t> bin_of(static_cast<std::size_t>(belief.size));
  for (std::size_t k = 0; k < bin_of.size(); ++k) {
    bin_of[k] = binning.bin(belief, k);
    found[bin_of[k]].weight += static_cast<double>(belief.weight[k]);
  }
  // In a fixed order, so that ties are decided alike everywhere.
  std::vector<std::int64_t> order;
  order.reserve(found.size());
  for (const auto& [number, bin] : found) {
    order.push_back(number);
  }
  std::sort(order.begin(), order.end());
  double heaviest = 0.0;
  for (const auto& [number, bin] : found) {
    heaviest = std::max(heaviest, bin.weight);
  }
  // What lies between two clusters, thinly spread, must not join them.
  const double least = kThin * heaviest;
  order.erase(std::remove_if(order.begin(), order.end(),
                             [&](std::int64_t bin) { return found[bin].weight < least; }),
              order.end());
  int count = 0;
  std::vector<std::int64_t> open;
  for (const std::int64_t start : order) {
    if (found[start].cluster >= 0) {
      continue;
    }
    found[start].cluster = count;
    open.assign(1, start);
    while (!open.empty()) {
      const std::int64_t at = open.back();
      open.pop_back();
      binning.around(at, [&](std::int64_t next) {
        const auto neighbour = found.find(next);
        if (neighbour != found.end() && neighbour->second.cluster < 0) {
          neighbour->second.cluster = count;
          if (neighbour->second.weight >= least) {  // a thin one ends the cluster
            open.push_back(next);
          }
        }
      });
    }
    ++count;
  }
  struct Sums {
    double w = 0.0, x = 0.0, y = 0.0, c = 0.0, s = 0.0;
    Matrix<3, 3> scatter = Matrix<3, 3>::Zero();
  };
  std::vector<Sums> sums(static_cast<std::size_t>(count));
  std::vector<int> cluster_of(bin_of.size());
  for (std::size_t k = 0; k < bin_of.size(); ++k) {
    cluster_of[k] = found[bin_of[k]].cluster;
    if (cluster_of[k] < 0) {
      continue;
    }
    Sums& sum = sums[static_cast<std::size_t>(cluster_of[k])];
    const double w = static_cast<double>(belief.weight[k]);
    sum.w += w;
    sum.x += w * static_cast<double>(belief.x[k]);
    sum.y += w * static_cast<double>(belief.y[k]);
    sum.c += w * static_cast<double>(belief.c[k]);
    sum.s += w * static_cast<double>(belief.s[k]);
  }
  std::vector<ParticleCluster> clusters(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const Sums& sum = sums[i];
    clusters[i].weight = sum.w;
    clusters[i].mean = {sum.x / sum.w, sum.y / sum.w, std::atan2(sum.s, sum.c)};
  }
  for (std::size_t k = 0; k < bin_of.size(); ++k) {
    if (cluster_of[k] < 0) {
      continue;
    }
    const auto cluster = static_cast<std::size_t>(cluster_of[k]);
    const Pose2& mean = clusters[cluster].mean;
    const Vector<3> off(
        static_cast<double>(belief.x[k]) - mean.x, static_cast<double>(belief.y[k]) - mean.y,
        angle_difference(
            std::atan2(static_cast<double>(belief.s[k]), static_cast<double>(belief.c[k])),
            mean.heading));
    sums[cluster].scatter += static_cast<double>(belief.weight[k]) * off * off.transpose();
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    clusters[i].covariance = sums[i].scatter / sums[i].w;
  }
  clusters.erase(std::remove_if(clusters.begin(), clusters.end(),
                                [](const ParticleCluster& c) { return !(c.weight > 0.0); }),
                 clusters.end());
  std::stable_sort(clusters.begin(), clusters.end(),
                   [](const auto& a, const auto& b) { return a.weight > b.weight; });
  if (clusters.size() > static_cast<std::size_t>(most)) {
    clusters.resize(static_cast<std::size_t>(most));
  }
  return clusters;
}

}  // namespace locfuse
