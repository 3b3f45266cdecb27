// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "math/sigma.hpp"

namespace locfuse {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int kTurnBias = 3;
constexpr int kAnchorOffset = 0;  // in the order of RangeErrors
constexpr int kAnchorScale = 1;
constexpr int kRangeDelay = 2;
constexpr const char* kHeadingOffset = "heading offset";
constexpr const char* kNames[] = {"scale",       "direction", "turn scale",     "turn bias",
                                  "sensor x",    "sensor y",  "sensor heading", "range offset",
                                  "range scale", "delay"};

double checked(const char* name, double sigma) {
  return internal::sigma_in_bounds(std::string("calibration.") + name, sigma);
}

Matrix<1, 1> variance_of(double sigma) { return Matrix<1, 1>(sigma * sigma); }

}  // namespace

Calibration::Calibration(const Config& config, const AnchorMap& anchors)
    : wander_(std::pow(
          checked("sigma_turn_bias_radps_per_sqrt_s", config.sigma_turn_bias_radps_per_sqrt_s), 2)),
      consider_(config.consider) {
  const double sensor = checked("sigma_sensor_m", config.sigma_sensor_m);
  const double sigmas[kCount] = {checked("sigma_scale", config.sigma_scale),
                                 checked("sigma_direction_rad", config.sigma_direction_rad),
                                 checked("sigma_turn_scale", config.sigma_turn_scale),
                                 checked("sigma_turn_bias_radps", config.sigma_turn_bias_radps),
                                 sensor,
                                 sensor,
                                 checked("sigma_sensor_rad", config.sigma_sensor_rad),
                                 checked("sigma_range_offset_m", config.sigma_range_offset_m),
                                 checked("sigma_range_scale", config.sigma_range_scale),
                                 checked("sigma_delay_s", config.sigma_delay_s)};
  if (wander_ > 0.0 && sigmas[kTurnBias] == 0.0) {
    throw std::invalid_argument(
        "calibration.sigma_turn_bias_radps_per_sqrt_s is set, but sigma_turn_bias_radps is 0: the "
        "bias is no state; expected both or neither");
  }
  slots_.push_back({0});  // of the body
  for (int error = 0; error < kCount; ++error) {
    if (sigmas[error] > 0.0) {
      add({kNames[error], error, sigmas[error]});
    }
    if (error + 1 == OdometryErrors::kCount) {
      motion_slots_ = slots_;
    }
  }
  correlation_s_ = checked("anchor_offset_correlation_s", config.anchor_offset_correlation_s);
  if (correlation_s_ > 0.0 && config.sigma_anchor_offset_m == 0.0) {
    throw std::invalid_argument(
        "calibration.anchor_offset_correlation_s is set, but sigma_anchor_offset_m is 0: offsets "
        "are no states; expected both or neither");
  }
  add_ranges(config, anchors);
  prepare_heading(config);
}

void Calibration::add(State state) {
  states_.push_back(std::move(state));
  slots_.push_back({static_cast<int>(states_.size())});
}

void Calibration::add_ranges(const Config& config, const AnchorMap& anchors) {
  const double offset = checked("sigma_anchor_offset_m", config.sigma_anchor_offset_m);
  const double scale = checked("sigma_anchor_scale", config.sigma_anchor_scale);
  const double delay = checked("sigma_range_delay_s", config.sigma_range_delay_s);
  if (!(offset + scale + delay > 0.0)) {
    return;
  }
  if (delay > 0.0) {
    add({"range delay", kCount + kRangeDelay, delay});
  }
  offset_variance_ = offset * offset;
  const Slot shared = slots_.back();
  ranges_.reserve(anchors.anchors().size());
  for (const Anchor& anchor : anchors.anchors()) {
    AnchorStates states{anchor.id, {slots_.front()}};
    const auto depend = [&](int error, Slot slot) {
      states.columns[static_cast<std::size_t>(error)] = static_cast<int>(states.slots.size()) + 2;
      states.slots.push_back(slot);
    };
    if (offset > 0.0) {
      add({"anchor offset", kCount + kAnchorOffset, offset, anchor.id});
      offsets_.push_back(slots_.back());
      depend(kAnchorOffset, slots_.back());
    }
    if (scale > 0.0) {
      add({"anchor scale", kCount + kAnchorScale, scale, anchor.id});
      depend(kAnchorScale, slots_.back());
    }
    if (delay > 0.0) {
      depend(kRangeDelay, shared);
    }
    ranges_.push_back(std::move(states));
  }
}

void Calibration::prepare_heading(const Config& config) {
  heading_sigma_ = checked("sigma_heading_offset_rad", config.sigma_heading_offset_rad);
  const double wander =
      checked("sigma_heading_offset_rad_per_sqrt_s", config.sigma_heading_offset_rad_per_sqrt_s);
  heading_slots_ = {slots_.front(), {static_cast<int>(slots_.size())}};
  heading_wander_ = wander * wander;
}

void Calibration::add_heading_to(GaussianBelief& belief) const {
  belief.add(kHeadingOffset, SlotKind::kScalar, Vector<1>(0.0), variance_of(heading_sigma_));
}

void Calibration::add_to(GaussianBelief& belief) const {
  for (const State& state : states_) {
    const std::string name =
        state.anchor ? state.name + " " + std::to_string(*state.anchor) : state.name;
    const Slot slot = belief.add(name, SlotKind::kScalar, Vector<1>(0.0), variance_of(state.sigma));
    if (consider_) {
      belief.consider(slot);
    }
  }
}

std::vector<CalibratedError> Calibration::errors(const GaussianBelief& belief) const {
  std::vector<CalibratedError> all;
  all.reserve(states_.size());
  for (std::size_t k = 0; k < states_.size(); ++k) {
    const int row = belief.offset(slots_[k + 1]);
    const State& state = states_[k];
    all.push_back(
        {state.name, state.anchor, belief.x(row), std::sqrt(belief.P(row, row)), state.sigma});
  }
  if (has_heading(belief)) {
    const int row = belief.offset(heading_slots_.back());
    all.push_back({kHeadingOffset, std::nullopt, belief.x(row), std::sqrt(belief.P(row, row)),
                   heading_sigma_});
  }
  return all;
}

std::array<double, Calibration::kCount> Calibration::values(const GaussianBelief& belief) const {
  std::array<double, kCount> values{};
  for (std::size_t k = 0; k < states_.size() && states_[k].error < kCount; ++k) {
    values[static_cast<std::size_t>(states_[k].error)] = belief.x(belief.offset(slots_[k + 1]));
  }
  return values;
}

const Calibration::AnchorStates* Calibration::find(Id anchor) const {
  const auto at =
      std::lower_bound(ranges_.begin(), ranges_.end(), anchor,
                       [](const AnchorStates& states, Id id) { return states.anchor < id; });
  return at != ranges_.end() && at->anchor == anchor ? &*at : nullptr;
}

std::optional<Linearization<1, Eigen::Dynamic>> Calibration::linearize(const GaussianBelief& belief,
                                                                       const RangeModel& model,
                                                                       const Range& z,
                                                                       const Pose2& rate) const {
  const AnchorStates& states = *find(z.anchor);
  std::array<double, RangeErrors::kCount> e{};
  for (std::size_t error = 0; error < e.size(); ++error) {
    if (const int column = states.columns[error]; column != kNone) {
      e[error] = belief.x(belief.offset(states.slots[static_cast<std::size_t>(column - 2)]));
    }
  }
  const auto full =
      model.linearize_with_errors(belief.pose(slots_[0]), z, {e[0], e[1], e[2]}, rate);
  if (!full) {
    return std::nullopt;
  }
  Linearization<1, Eigen::Dynamic> lin{
      full->residual, Matrix<1, Eigen::Dynamic>(static_cast<Index>(states.slots.size()) + 2),
      full->noise};
  lin.jacobian.leftCols<3>() = full->jacobian.leftCols<3>();
  for (std::size_t error = 0; error < e.size(); ++error) {
    if (const int column = states.columns[error]; column != kNone) {
      lin.jacobian(column) = full->jacobian(static_cast<Index>(3 + error));
    }
  }
  return lin;
}

Propagation<Eigen::VectorXd, Eigen::Dynamic> Calibration::propagate(
    const GaussianBelief& belief, const OdometryMotion& model, const Pose2& motion, double seconds,
    const std::optional<Vector<3>>& variance) const {
  const std::array<double, kCount> e = values(belief);
  const OdometryMotion::Corrected corrected =
      model.propagate(belief.pose(slots_[0]), motion, seconds, {e[0], e[1], e[2], e[3]}, variance);
  const auto size = static_cast<Index>(2 + motion_slots_.size());
  Propagation<Eigen::VectorXd, Eigen::Dynamic> step{
      belief.mean(motion_slots_), MatrixXd::Identity(size, size), MatrixXd::Zero(size, size)};
  const Pose2& moved = corrected.step.moved;
  step.moved.head<3>() << moved.x, moved.y, moved.heading;
  step.jacobian.topLeftCorner<3, 3>() = corrected.step.jacobian;
  step.noise.topLeftCorner<3, 3>() = corrected.step.noise;
  for (std::size_t k = 0; k + 1 < motion_slots_.size(); ++k) {
    const auto column = static_cast<Index>(3 + k);
    step.jacobian.block<3, 1>(0, column) = corrected.by_errors.col(states_[k].error);
    if (states_[k].error == kTurnBias) {
      step.noise(column, column) = wander_ * seconds;
    }
  }
  return step;
}

Propagation<Eigen::VectorXd, Eigen::Dynamic> Calibration::wander(const GaussianBelief& belief,
                                                                 double seconds) const {
  const double kept = std::exp(-seconds / correlation_s_);
  const double forgotten = -std::expm1(-2.0 * seconds / correlation_s_);  // 1 - kept^2
  const auto size = static_cast<Index>(offsets_.size());
  return {kept * belief.mean(offsets_), kept * MatrixXd::Identity(size, size),
          forgotten * offset_variance_ * MatrixXd::Identity(size, size)};
}

std::optional<Linearization<Eigen::Dynamic, Eigen::Dynamic>> Calibration::linearize(
    const GaussianBelief& belief, const RangeBearingModel& model, const Vector<2>& landmark,
    const RangeBearing& z, const Pose2& rate) const {
  const std::array<double, kCount> e = values(belief);
  const auto full = model.linearize_with_errors(belief.pose(slots_[0]), landmark, z,
                                                {{e[4], e[5], e[6]}, e[7], e[8], e[9]}, rate);
  if (!full) {
    return std::nullopt;
  }
  const Index rows = full->residual.size();
  Linearization<Eigen::Dynamic, Eigen::Dynamic> lin{
      full->residual, MatrixXd::Zero(rows, static_cast<Index>(3 + states_.size())), full->noise};
  lin.jacobian.leftCols<3>() = full->jacobian.leftCols<3>();
  for (std::size_t k = 0; k < states_.size(); ++k) {
    if (const int error = states_[k].error - OdometryErrors::kCount;
        error >= 0 && error < LandmarkErrors::kCount) {
      lin.jacobian.col(static_cast<Index>(3 + k)) = full->jacobian.col(3 + error);
    }
  }
  return lin;
}

}  // namespace locfuse
