// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/particles.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "filters/particle_lanes.hpp"
#include "locfuse/error.hpp"
#include "locfuse/math/angle.hpp"
#include "locfuse/math/counter_random.hpp"
#include "math/processor.hpp"

namespace locfuse {
namespace {

constexpr double kPoint = 0.1;  // side of a box below which it is a point [cells]

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

/// Sum and sum of squares, in eight chains.
std::pair<double, double> sums_of(const std::vector<float>& values, int size) {
  std::array<double, 8> sums{};
  std::array<double, 8> squares{};
  for (std::size_t k = 0; k < static_cast<std::size_t>(size); ++k) {
    const auto value = static_cast<double>(values[k]);
    sums[k % 8] += value;
    squares[k % 8] += value * value;
  }
  return {std::accumulate(sums.begin(), sums.end(), 0.0),
          std::accumulate(squares.begin(), squares.end(), 0.0)};
}

/// exp(x) for x <= 0, to 2e-7 of itself, without a branch: compilers make lanes of it. 1 above, and
/// next to nothing for NaN.
float exp_of(float x) {
  const float y = std::max(-126.0F, 1.4426950F * std::min(x, 0.0F));
  const auto n = static_cast<std::int32_t>(y - 0.5F);  // towards zero
  const float f = y - static_cast<float>(n);
  const float power =
      1.0F +
      f * (0.6931472F + f * (0.2402265F + f * (0.0555041F + f * (0.0096181F + f * 0.0013333F))));
  const std::int32_t bits = (n + 127) << 23;
  float scale = 0.0F;
  std::memcpy(&scale, &bits, sizeof scale);
  return scale * power;
}

/// Sum and sum of squares of weight * exp(share * (log_likelihood - most)), kept in `weighed`.
std::pair<double, double> weigh(const ParticleBelief& belief,
                                const std::vector<float>& log_likelihood, double most, double share,
                                std::vector<float>& weighed) {
  const auto size = static_cast<std::size_t>(belief.size);
  const auto by = static_cast<float>(share);
  const auto top = static_cast<float>(most);
  for (std::size_t k = 0; k < size; ++k) {
    weighed[k] = belief.weight[k] * exp_of(by * (log_likelihood[k] - top));
  }
  return sums_of(weighed, belief.size);
}

}  // namespace

void ParticleBelief::resize(int count) {
  if (count < 1 || count > kMost) {
    throw std::invalid_argument("there are " + std::to_string(count) +
                                " particles, expected 1 to " + std::to_string(kMost));
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
  constexpr double kAny = 100.0;  // a heading with this sigma is any [rad]; it fits a lane's turns
  if (const double turn = L.row(2).norm(); turn > kAny) {
    L.row(2) *= kAny / turn;
  }
  constexpr double kFarthest = 1e30;  // in single precision, in which particles are kept
  const double farthest = std::max(
      {std::abs(step.motion.x), std::abs(step.motion.y), L.topRows<2>().cwiseAbs().maxCoeff()});
  if (!L.allFinite() || !(farthest <= kFarthest) || !std::isfinite(step.motion.heading)) {
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
  std::vector<float> weighed(static_cast<std::size_t>(belief.size));
  float sum = 0.0F;
  const auto effective = [&](double share) {
    const auto [total, squares] = weigh(belief, log_likelihood, most, share, weighed);
    sum = static_cast<float>(total);
    return total * total / squares;
  };
  const double least = std::min(least_effective, effective_size(belief));
  double share = most_share;
  // The largest share that leaves enough, to a hundredth of itself: log n_eff is all but a straight
  // line over log share.
  double high = effective(share);
  double low_share = 0x1p-30 * share;
  double low = effective_size(belief);
  for (int step = 0; step < 20 && high < least && low_share < 0.99 * share; ++step) {
    const double slope = std::log(high / low) / std::log(share / low_share);
    const double secant = low_share * std::exp(std::log(least / low) / slope);
    const double middle = step % 3 == 2 ? std::sqrt(low_share * share)
                                        : std::clamp(secant, 1.004 * low_share, 0.996 * share);
    const double now = effective(middle);
    (now < least ? share : low_share) = middle;
    (now < least ? high : low) = now;
  }
  if (high < least) {
    share = low_share;
    effective(share);
  }
  for (std::size_t k = 0; k < weighed.size(); ++k) {
    belief.weight[k] = weighed[k] / sum;
  }
  return share;
}

double effective_size(const ParticleBelief& belief) {
  const auto [sum, squares] = sums_of(belief.weight, belief.size);
  return sum * sum / squares;
}

namespace {

/// Spreads copies over the box that their original stood for; each stands for its part of it.
void share_box(ParticleBelief& belief, int begin, int end, std::uint64_t key) {
  const double side = static_cast<double>(belief.box[static_cast<std::size_t>(begin)]);
  const double part = side / std::cbrt(end - begin);
  const double sigma = std::sqrt((side * side - part * part) / 12.0);
  for (int i = begin; i < end; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Vector<3> off = Vector<3>(sigma, sigma, belief.turn_per_cell * sigma)
                              .cwiseProduct(random_normal3(key, static_cast<std::uint64_t>(i)));
    belief.put(k, retract(belief.pose(k), off));
    belief.box[k] = part < kPoint ? 0.0F : static_cast<float>(part);
  }
}

/// Puts `copies` of some particles, of `weight` together, to `to` and on: by one random number and
/// equal steps. `at` gives the index of each of the `count`.
template <class At>
void draw(const ParticleBelief& belief, int count, const At& at, double weight, int copies,
          double uniform, std::uint64_t key, ParticleBelief& drawn, int to) {
  const double step = weight / copies;
  const int all = to + copies;
  double next = uniform * step;
  double passed = 0.0;
  for (int from = 0; from < count && to < all; ++from) {
    const std::size_t k = at(from);
    passed += static_cast<double>(belief.weight[k]);
    const bool last = from + 1 == count;  // rounding may leave the last ones over
    const int first = to;
    for (; to < all && (next < passed || last); ++to, next += step) {
      drawn.put(static_cast<std::size_t>(to), belief, k);
    }
    if (to - first > 1 && belief.box[k] > 0.0F) {
      share_box(drawn, first, to, random_bits(key, 1));
    }
  }
}

}  // namespace

void resample(ParticleBelief& belief, int count, const FreshParticles& fresh, std::uint64_t key,
              ParticleBelief& scratch) {
  scratch.resize(count);
  scratch.stamp = belief.stamp;
  scratch.turn_per_cell = belief.turn_per_cell;
  const int kept = std::max(count - fresh.count, 1);
  draw(
      belief, belief.size, [](int k) { return static_cast<std::size_t>(k); },
      sums_of(belief.weight, belief.size).first, kept, random_uniform(key, 0), key, scratch, 0);
  const double probability = kept < count ? fresh.probability : 0.0;
  const auto weights = scratch.weight.begin();
  std::fill(weights, weights + kept, static_cast<float>((1.0 - probability) / kept));
  std::fill(weights + kept, weights + count,
            static_cast<float>(probability / std::max(count - kept, 1)));
  for (int to = kept; to < count; ++to) {
    fresh.draw(scratch, to);
  }
  std::swap(belief, scratch);
}

namespace {

/// Heading of (cosine, sine) in [-pi, pi], to 2e-5 rad: what bins and covariances need.
float heading_of(float c, float s) {
  const float less = std::min(std::abs(c), std::abs(s));
  const float more = std::max(std::abs(c), std::abs(s));
  const float t = less / more;
  const float q = t * t;
  // Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.49.
  float angle =
      t * (0.9998660F + q * (-0.3302995F + q * (0.1801410F + q * (-0.0851330F + q * 0.0208351F))));
  angle = std::abs(s) > std::abs(c) ? static_cast<float>(0.5 * kPi) - angle : angle;
  angle = c < 0.0F ? static_cast<float>(kPi) - angle : angle;
  return s < 0.0F ? -angle : angle;
}

constexpr double kThin = 0.05;  // share of the heaviest bin below which one is in no cluster

/// A bin's number: heading, row and column.
class Binning {
 public:
  explicit Binning(const ParticleBins& bins)
      : per_side_(1.0 / bins.side), headings_(static_cast<int>(bins.headings)) {
    if (!(bins.side > 0.0 && headings_ >= 1)) {
      throw std::invalid_argument("bins have a side of " + std::to_string(bins.side) +
                                  " cells and " + std::to_string(headings_) +
                                  " headings, expected more than 0, and 1 or more");
    }
  }

  [[nodiscard]] std::int64_t bin(const ParticleBelief& belief, std::size_t k) const {
    const std::int64_t column = along(belief.x[k]);
    const std::int64_t row = along(belief.y[k]);
    const double turn =
        static_cast<double>(heading_of(belief.c[k], belief.s[k])) / (2.0 * kPi) + 0.5;
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
  static constexpr std::int64_t kShift = 1 << 20;                // so that none is negative
  static constexpr std::int64_t kLast = (1 << 24) - 1 - kShift;  // that 24 bits hold
  /// Row or column. All that lies farther off the map than these can tell is in the last one but
  /// one, so that those beside it are there, too.
  [[nodiscard]] std::int64_t along(float cells) const {
    const double bin = static_cast<double>(cells) * per_side_;
    return static_cast<std::int64_t>(
        std::clamp(bin, 1.0 - static_cast<double>(kShift), static_cast<double>(kLast) - 1.0));
  }
  static std::int64_t number(std::int64_t heading, std::int64_t row, std::int64_t column) {
    return heading << 48 | row << 24 | column;
  }
  double per_side_;
  int headings_;
};

/// Which bins are occupied, and by which particles.
struct Occupied {
  std::vector<std::int64_t> numbers;      ///< of each bin, in order of the first particle in it
  std::vector<std::int32_t> of_particle;  ///< index into `numbers`
  std::unordered_map<std::int64_t, std::int32_t> at;
};

Occupied occupied(const ParticleBelief& belief, const Binning& binning) {
  // Most particles share few bins: the last ones seen are kept at hand.
  struct Seen {
    std::int64_t number = -1;
    std::int32_t index = 0;
  };
  std::array<Seen, 64> seen;
  Occupied result;
  result.of_particle.resize(static_cast<std::size_t>(belief.size));
  for (std::size_t k = 0; k < result.of_particle.size(); ++k) {
    const std::int64_t number = binning.bin(belief, k);
    Seen& slot = seen[static_cast<std::size_t>(number ^ (number >> 22) ^ (number >> 44)) % 64];
    if (slot.number != number) {
      const auto [found, is_new] =
          result.at.try_emplace(number, static_cast<std::int32_t>(result.numbers.size()));
      if (is_new) {
        result.numbers.push_back(number);
      }
      slot = {number, found->second};
    }
    result.of_particle[k] = slot.index;
  }
  return result;
}

}  // namespace

void resample_by_bin(ParticleBelief& belief, int count, const ParticleBins& bins, double power,
                     double least, std::uint64_t key, ParticleBelief& scratch) {
  const Occupied in = occupied(belief, Binning(bins));
  std::vector<double> weight(in.numbers.size(), 0.0);
  for (std::size_t k = 0; k < in.of_particle.size(); ++k) {
    weight[static_cast<std::size_t>(in.of_particle[k])] += static_cast<double>(belief.weight[k]);
  }
  // Those that are kept have one particle at least, and share the others out.
  const double total = std::accumulate(weight.begin(), weight.end(), 0.0);
  double shares = 0.0;
  int kept = 0;
  std::vector<double> share(weight.size(), 0.0);
  for (std::size_t b = 0; b < weight.size(); ++b) {
    if (weight[b] >= least * total) {
      share[b] = std::pow(weight[b] / total, power);
      shares += share[b];
      ++kept;
    }
  }
  if (kept > count) {
    resample(belief, count, {}, key, scratch);
    return;
  }
  std::vector<int> copies(weight.size(), 0);
  double passed = 0.0;
  int given = 0;
  for (std::size_t b = 0; b < weight.size(); ++b) {
    if (share[b] > 0.0) {
      passed += share[b] / shares * (count - kept);
      copies[b] = 1 + static_cast<int>(passed + 1e-9) - given;
      given += copies[b] - 1;
    }
  }
  // Particles of a bin together, in their order.
  std::vector<std::size_t> begin(weight.size(), 0);
  for (const std::int32_t b : in.of_particle) {
    ++begin[static_cast<std::size_t>(b)];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::size_t> order(in.of_particle.size());
  for (std::size_t k = in.of_particle.size(); k-- > 0;) {
    order[--begin[static_cast<std::size_t>(in.of_particle[k])]] = k;
  }
  scratch.resize(kept + given);
  scratch.stamp = belief.stamp;
  scratch.turn_per_cell = belief.turn_per_cell;
  int to = 0;
  for (std::size_t b = 0; b < weight.size(); ++b) {
    if (copies[b] == 0) {
      continue;
    }
    const std::size_t first = begin[b];
    const std::size_t last = b + 1 < weight.size() ? begin[b + 1] : order.size();
    draw(
        belief, static_cast<int>(last - first),
        [&](int i) { return order[first + static_cast<std::size_t>(i)]; }, weight[b], copies[b],
        random_uniform(key, b), key, scratch, to);
    std::fill_n(scratch.weight.begin() + to, copies[b],
                static_cast<float>(weight[b] / copies[b] / total));
    to += copies[b];
  }
  std::swap(belief, scratch);
}

int occupied_bins(const ParticleBelief& belief, const ParticleBins& bins, double least) {
  const Occupied in = occupied(belief, Binning(bins));
  std::vector<std::uint8_t> counts(in.numbers.size());
  for (std::size_t k = 0; k < in.of_particle.size(); ++k) {
    if (belief.weight[k] * static_cast<float>(belief.size) >= static_cast<float>(least)) {
      counts[static_cast<std::size_t>(in.of_particle[k])] = 1;
    }
  }
  return std::accumulate(counts.begin(), counts.end(), 0);
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
  const Occupied in = occupied(belief, binning);
  // Neighbours are mostly in one bin: their sums stay in registers.
  const auto each_run = [&](const auto& run) {
    const std::size_t size = in.of_particle.size();
    for (std::size_t begin = 0, end = 0; begin < size; begin = end) {
      const std::int32_t bin = in.of_particle[begin];
      for (end = begin + 1; end < size && in.of_particle[end] == bin; ++end) {
      }
      run(static_cast<std::size_t>(bin), begin, end);
    }
  };
  std::vector<double> weight(in.numbers.size(), 0.0);
  each_run([&](std::size_t bin, std::size_t begin, std::size_t end) {
    weight[bin] += std::accumulate(&belief.weight[begin], &belief.weight[0] + end, 0.0);
  });
  // What lies between two clusters, thinly spread, must not join them.
  const double least = kThin * *std::max_element(weight.begin(), weight.end());
  std::vector<int> cluster_of(weight.size(), -1);
  int count = 0;
  std::vector<std::int32_t> open;
  for (std::size_t start = 0; start < weight.size(); ++start) {
    if (cluster_of[start] >= 0 || weight[start] < least) {
      continue;
    }
    cluster_of[start] = count;
    open.assign(1, static_cast<std::int32_t>(start));
    while (!open.empty()) {
      const std::int64_t number = in.numbers[static_cast<std::size_t>(open.back())];
      open.pop_back();
      binning.around(number, [&](std::int64_t next) {
        const auto found = in.at.find(next);
        if (found == in.at.end()) {
          return;
        }
        const auto neighbour = static_cast<std::size_t>(found->second);
        if (cluster_of[neighbour] < 0) {
          cluster_of[neighbour] = count;
          if (weight[neighbour] >= least) {  // a thin one ends the cluster
            open.push_back(found->second);
          }
        }
      });
    }
    ++count;
  }
  struct Sums {
    double w = 0.0;
    Vector<4> pose = Vector<4>::Zero();  // x, y, cosine, sine
    Matrix<3, 3> scatter = Matrix<3, 3>::Zero();
  };
  std::vector<Sums> sums(static_cast<std::size_t>(count));
  each_run([&](std::size_t bin, std::size_t begin, std::size_t end) {
    if (cluster_of[bin] < 0) {
      return;
    }
    double weights = 0.0;
    Vector<4> poses = Vector<4>::Zero();
    for (std::size_t k = begin; k < end; ++k) {
      const auto w = static_cast<double>(belief.weight[k]);
      weights += w;
      poses += w * Vector<4>(belief.x[k], belief.y[k], belief.c[k], belief.s[k]);
    }
    Sums& sum = sums[static_cast<std::size_t>(cluster_of[bin])];
    sum.w += weights;
    sum.pose += poses;
  });
  std::vector<ParticleCluster> clusters(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    Vector<4>& pose = sums[i].pose;
    clusters[i].weight = sums[i].w;
    clusters[i].mean = {pose.x() / sums[i].w, pose.y() / sums[i].w, std::atan2(pose.w(), pose.z())};
    pose.tail<2>().normalize();
  }
  each_run([&](std::size_t bin, std::size_t begin, std::size_t end) {
    if (cluster_of[bin] < 0) {
      return;
    }
    const auto cluster = static_cast<std::size_t>(cluster_of[bin]);
    const Pose2& mean = clusters[cluster].mean;
    const auto c = static_cast<float>(sums[cluster].pose.z());
    const auto s = static_cast<float>(sums[cluster].pose.w());
    Matrix<3, 3> scatter = Matrix<3, 3>::Zero();
    for (std::size_t k = begin; k < end; ++k) {
      const Vector<3> off(static_cast<double>(belief.x[k]) - mean.x,
                          static_cast<double>(belief.y[k]) - mean.y,
                          static_cast<double>(heading_of(belief.c[k] * c + belief.s[k] * s,
                                                         belief.s[k] * c - belief.c[k] * s)));
      const Vector<3> weighed = static_cast<double>(belief.weight[k]) * off;
      scatter.noalias() += weighed * off.transpose();
    }
    sums[cluster].scatter += scatter;
  });
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
