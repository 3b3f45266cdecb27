// SPDX-License-Identifier: Apache-2.0
#include "locfuse/recovery/air_sum.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <exception>
#include <type_traits>
#include <utility>
#include <variant>

#include "locfuse/error.hpp"
#include "locfuse/math/angle.hpp"
#include "recovery/outlier.hpp"

namespace locfuse {
namespace {

/// What places are kept; docs/air.md.
struct AirSumTuning {
  static constexpr double kMinShare = 1e-4;     ///< of the likeliest place's probability
  static constexpr std::size_t kMaxPlaces = 8;  ///< that are kept
  static constexpr double kSameDistance = 1.0;  ///< squared Mahalanobis distance of one place
  static constexpr double kMuchVaguer = 4.0;    ///< traces of two that are not one place
  static constexpr int kPasses = 3;  ///< of updates, each linearized where the last one ended
  static constexpr double kVagueBend = 1.0;    ///< from which on ranges are fused together
  static constexpr double kMaxBend = 1.0;      ///< up to which a place is one, once they are
  static constexpr double kTrackedBend = 2.0;  ///< up to which a body was not lost before
  static constexpr double kMaxEpochs = 5.0;    ///< for how many epochs ranges are kept
};

/// Whether they say the same: within one sigma of each other, and neither is much vaguer. What is
/// known of a heading counts where there is an attitude.
bool are_same(const AirEstimate& a, const AirEstimate& b) {
  const double turn = wrap_angle(a.pose.heading - b.pose.heading);
  if (a.attitude && turn * turn > AirSumTuning::kSameDistance *
                                      std::min(a.covariance(2, 2), b.covariance(2, 2))) {
    return false;
  }
  const std::vector<int> place{0, 1, 3};
  const Vector<3> off(a.pose.x - b.pose.x, a.pose.y - b.pose.y, a.height - b.height);
  const Matrix<3, 3> P = a.covariance(place, place);
  const Matrix<3, 3> Q = b.covariance(place, place);
  const double vaguer = std::max(P.trace(), Q.trace()) / std::min(P.trace(), Q.trace());
  return vaguer < AirSumTuning::kMuchVaguer &&
         std::max(off.dot(P.llt().solve(off)), off.dot(Q.llt().solve(off))) <
             AirSumTuning::kSameDistance;
}

/// Log density of a message under a place, if it was compared: any may be wrong, so that none
/// decides alone.
template <class M>
double log_density_of(const M& z, const Outcome& outcome, const AirSum::Config& config) {
  if constexpr (std::is_same_v<M, Velocity> || std::is_same_v<M, Increment> ||
                std::is_same_v<M, Imu>) {
    return 0.0;
  } else {
    return outcome.dof > 0 ? internal::log_density(outcome, config.wrong_share,
                                                   internal::log_anything(z, config.wrong_span_m))
                           : 0.0;
  }
}

}  // namespace

AirSum::AirSum(const Config& config, const AirEkf& start) : config_(config) {
  for (AirEkf& one : start.by_heading()) {
    components_.push_back({std::move(one), 0.0, false});
  }
}

void AirSum::add(const AirEkf& start, double odds) {
  std::vector<AirEkf> all = start.by_heading();
  const double each = std::log(odds) - std::log(static_cast<double>(all.size()));
  for (AirEkf& one : all) {
    components_.push_back({std::move(one), each, true});
  }
}

void AirSum::add_image(const AirEkf& image, double odds) {
  components_.push_back({image, std::log(odds), components_.front().moved});
}

bool AirSum::is_vague(const AirEkf& ekf, const Range& z) {
  return ekf.bend(z) > AirSumTuning::kVagueBend;
}

Outcome AirSum::on(const Range& z) {
  const Outcome looked = components_.front().ekf.weigh(z);
  if (looked.dof == 0) {
    return looked;
  }
  close_when_due(z.stamp);
  if (epoch_.empty() && std::any_of(components_.begin(), components_.end(),
                                    [&](const Component& c) { return is_vague(c.ekf, z); })) {
    begun_ = z.stamp;
    epoch_.emplace_back(z);
    return {Verdict::kIgnored, Reason::kWaits};
  }
  return epoch_.empty() ? weigh(z, news_of(z)) : keep(z);
}

Outcome AirSum::on(const Velocity& u) { return take(u); }
Outcome AirSum::on(const Increment& u) { return take(u); }
Outcome AirSum::on(const Imu& z) { return take(z); }
Outcome AirSum::on(const PositionFix& z) { return take(z); }
Outcome AirSum::on(const Altitude& z) { return take(z); }
Outcome AirSum::on(const Heading& z) { return take(z); }
Outcome AirSum::on(const PoseObservation& z) { return take(z); }
Outcome AirSum::on(const RangeBearing& z) { return take(z); }

template <class M>
Outcome AirSum::take(const M& message) {
  close_when_due(effective_stamp(message));
  return epoch_.empty() ? weigh(message) : keep(message);
}

/// Keeps what the likeliest place could use, in order.
template <class M>
Outcome AirSum::keep(const M& message) {
  if (effective_stamp(message) < effective_stamp(epoch_.back())) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  AirEkf first = components_.front().ekf;
  Outcome outcome = first.on(message);
  const bool is_measured = outcome.dof > 0;
  if (is_measured || outcome.verdict == Verdict::kFused) {
    epoch_.emplace_back(message);
  }
  return is_measured ? Outcome{Verdict::kIgnored, Reason::kWaits} : outcome;
}

template <class M>
Outcome AirSum::weigh(const M& z, double news) {
  Outcome first;
  for (std::size_t i = 0; i < components_.size(); ++i) {
    const Outcome outcome = components_[i].ekf.on(z);
    components_[i].log_weight += news * log_density_of(z, outcome, config_);
    first = i == 0 ? outcome : first;
  }
  reduce();
  return first;
}

/// How much of a range's error is not that of the one before, as which it counts from now on.
double AirSum::news_of(const Range& z) {
  const auto link = std::find_if(links_.begin(), links_.end(), [&](const Link& one) {
    return one.tag == z.tag && one.anchor == z.anchor;
  });
  if (link == links_.end()) {
    links_.push_back({z.tag, z.anchor, z.stamp});
    return 1.0;
  }
  const double seconds = seconds_between(std::exchange(link->stamp, z.stamp), z.stamp);
  return config_.correlation_s > 0.0 ? std::min(seconds / config_.correlation_s, 1.0) : 1.0;
}

void AirSum::close_when_due(Stamp stamp) {
  if (!epoch_.empty() && seconds_between(begun_, stamp) > config_.epoch_s) {
    close();
    begun_ = stamp;
  }
}

/// Fuses what is kept about each place that it allows, unless a belief about one of them would be
/// too vague: then it is kept for some epochs more.
void AirSum::close() {
  const std::vector<Link> links = links_;
  std::vector<Range> ranges;
  std::vector<double> news;
  for (const Message& message : epoch_) {
    if (const Range* z = std::get_if<Range>(&message)) {
      ranges.push_back(*z);
      news.push_back(news_of(*z));
    }
  }
  std::vector<Component> fused;
  if (!ranges.empty()) {
    for (const Component& component : components_) {
      fuse_epoch(component, ranges, news, fused);
    }
  }
  std::vector<Component> before = std::exchange(components_, std::move(fused));
  if (!components_.empty()) {
    reduce();
    const auto is_flat = [this](double limit) {
      return [this, limit](const Component& c) { return bend(c) <= limit; };
    };
    if (std::all_of(components_.begin(), components_.end(), is_flat(AirSumTuning::kMaxBend)) ||
        std::all_of(before.begin(), before.end(), is_flat(AirSumTuning::kTrackedBend))) {
      epoch_.clear();
      return;
    }
  }
  components_ = std::move(before);
  links_ = links;
  const double kept_s = AirSumTuning::kMaxEpochs * config_.epoch_s;
  forget(effective_stamp(epoch_.back()) - static_cast<Stamp>(kept_s * kNanosecondsPerSecond));
}

/// Drops ranges that are too old to be fused with those that come; the rest moves and corrects each
/// place by itself, all of it if no range is left.
void AirSum::forget(Stamp until) {
  const auto is_range = [](const Message& m) { return std::holds_alternative<Range>(m); };
  const auto first_left = std::find_if(epoch_.begin(), epoch_.end(), [&](const Message& m) {
    return is_range(m) && effective_stamp(m) >= until;
  });
  const std::vector<Message> old(epoch_.begin(), first_left);
  epoch_.erase(epoch_.begin(), first_left);
  for (const Message& message : old) {
    std::visit(
        [this](const auto& m) {
          using M = std::decay_t<decltype(m)>;
          if constexpr (!std::is_same_v<M, Range> && !std::is_same_v<M, LaserScan>) {
            weigh(m);
          }
        },
        message);
  }
}

/// The largest bend of what is kept.
double AirSum::bend(const Component& component) const {
  double most = 0.0;
  for (const Message& message : epoch_) {
    const Range* z = std::get_if<Range>(&message);
    most = z != nullptr ? std::max(most, component.ekf.bend(*z)) : most;
  }
  return most;
}

void AirSum::fuse_epoch(const Component& from, const std::vector<Range>& ranges,
                        const std::vector<double>& news, std::vector<Component>& to) const {
  AirEkf now = from.ekf;
  now.advance_to(ranges.front().stamp);
  for (const Vector<3>& place : now.places(ranges)) {
    fuse_at(from, place, news, to);
  }
}

/// Fuses what is kept about a place, and again about where that puts the body.
void AirSum::fuse_at(const Component& from, const Vector<3>& place, const std::vector<double>& news,
                     std::vector<Component>& to) const {
  const Stamp middle = effective_stamp(epoch_[epoch_.size() / 2]);
  Vector<3> about = place;
  try {
    Component fused = from;
    for (int pass = 0; pass < AirSumTuning::kPasses; ++pass) {
      fused = from;
      std::size_t i = 0;
      for (const Message& message : epoch_) {
        const Range* z = std::get_if<Range>(&message);
        if (z == nullptr) {
          fused.log_weight += std::visit(
              [&](const auto& m) -> double {
                using M = std::decay_t<decltype(m)>;
                if constexpr (std::is_same_v<M, LaserScan>) {
                  return 0.0;
                } else {
                  return log_density_of(m, fused.ekf.on(m), config_);
                }
              },
              message);
          continue;
        }
        const Outcome outcome = fused.ekf.on_at(*z, about, middle);
        fused.log_weight +=
            news[i++] * (outcome.verdict == Verdict::kFused
                             ? std::log1p(-config_.wrong_share) + outcome.log_likelihood()
                             : std::log(config_.wrong_share) +
                                   internal::log_anything(*z, config_.wrong_span_m));
      }
      about = fused.ekf.place_at(middle);
    }
    to.push_back(std::move(fused));
  } catch (const NumericalError&) {  // it is no place
  }
}

void AirSum::reduce() {
  for (Component& component : components_) {
    const double inside = std::min(component.log_inside, component.ekf.log_inside());
    component.log_weight += inside - std::exchange(component.log_inside, inside);
  }
  std::stable_sort(
      components_.begin(), components_.end(),
      [](const Component& a, const Component& b) { return a.log_weight > b.log_weight; });
  const double best = components_.front().log_weight;
  std::vector<Component> kept;
  for (Component& component : components_) {
    component.log_weight -= best;
    const auto same = std::find_if(kept.begin(), kept.end(), [&](const Component& other) {
      return are_same(component.ekf.current(), other.ekf.current());
    });
    if (same != kept.end()) {
      same->log_weight = internal::log_sum(same->log_weight, component.log_weight);
    } else if (component.log_weight > std::log(AirSumTuning::kMinShare) &&
               kept.size() < AirSumTuning::kMaxPlaces) {
      kept.push_back(std::move(component));
    }
  }
  components_ = std::move(kept);
}

const AirEkf* AirSum::decided() const {
  return components_.size() == 1 && epoch_.empty() ? &components_.front().ekf : nullptr;
}

bool AirSum::has_headings() const {
  return std::any_of(components_.begin(), components_.end(),
                     [](const Component& component) { return component.ekf.has_heading(); });
}

AirEkf AirSum::mean() const {
  double total = components_.front().log_weight;
  for (std::size_t i = 1; i < components_.size(); ++i) {
    total = internal::log_sum(total, components_[i].log_weight);
  }
  std::vector<std::pair<const AirEkf*, double>> others;
  for (std::size_t i = 1; i < components_.size(); ++i) {
    others.emplace_back(&components_[i].ekf, std::exp(components_[i].log_weight - total));
  }
  return components_.front().ekf.mixed(std::exp(components_.front().log_weight - total), others);
}

}  // namespace locfuse
