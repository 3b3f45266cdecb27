// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/calibration.hpp"

#include <cmath>
#include <stdexcept>

namespace locfuse {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int kTurnBias = 3;
constexpr const char* kNames[] = {"scale",       "direction", "turn scale",     "turn bias",
                                  "sensor x",    "sensor y",  "sensor heading", "range offset",
                                  "range scale", "delay"};

double checked(const char* name, double sigma) {
  if (!(std::isfinite(sigma) && sigma >= 0.0)) {
    throw std::invalid_argument(std::string("calibration.") + name + " is " +
                                std::to_string(sigma) + ", expected a finite number >= 0");
  }
  return sigma;
}

Matrix<1, 1> variance_of(double sigma) { return Matrix<1, 1>(sigma * sigma); }

}  // namespace

Calibration::Calibration(const Config& config)
    : wander_(std::pow(
          checked("sigma_turn_bias_radps_per_sqrt_s", config.sigma_turn_bias_radps_per_sqrt_s),
          2)) {
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
      states_.push_back({error, sigmas[error]});
      slots_.push_back({static_cast<int>(states_.size())});
    }
  }
}

void Calibration::add_to(GaussianBelief& belief) const {
  for (const State& state : states_) {
    belief.add(kNames[state.error], SlotKind::kScalar, Vector<1>(0.0), variance_of(state.sigma));
  }
}

std::vector<CalibratedError> Calibration::errors(const GaussianBelief& belief) const {
  std::vector<CalibratedError> all;
  for (std::size_t k = 0; k < states_.size(); ++k) {
    const int row = belief.offset(slots_[k + 1]);
    all.push_back({kNames[states_[k].error], belief.x(row), std::sqrt(belief.P(row, row))});
  }
  return all;
}

std::array<double, Calibration::kCount> Calibration::values(const GaussianBelief& belief) const {
  std::array<double, kCount> values{};
  for (std::size_t k = 0; k < states_.size(); ++k) {
    values[static_cast<std::size_t>(states_[k].error)] = belief.x(belief.offset(slots_[k + 1]));
  }
  return values;
}

Propagation<Eigen::VectorXd, Eigen::Dynamic> Calibration::propagate(const GaussianBelief& belief,
                                                                    const OdometryMotion& model,
                                                                    const Pose2& motion,
                                                                    double seconds) const {
  const std::array<double, kCount> e = values(belief);
  const OdometryMotion::Corrected corrected =
      model.propagate(belief.pose(slots_[0]), motion, seconds, {e[0], e[1], e[2], e[3]});
  const auto size = static_cast<Index>(3 + states_.size());
  Propagation<Eigen::VectorXd, Eigen::Dynamic> step{
      belief.mean(slots_), MatrixXd::Identity(size, size), MatrixXd::Zero(size, size)};
  const Pose2& moved = corrected.step.moved;
  step.moved.head<3>() << moved.x, moved.y, moved.heading;
  step.jacobian.topLeftCorner<3, 3>() = corrected.step.jacobian;
  step.noise.topLeftCorner<3, 3>() = corrected.step.noise;
  for (std::size_t k = 0; k < states_.size() && states_[k].error < OdometryErrors::kCount; ++k) {
    const auto column = static_cast<Index>(3 + k);
    step.jacobian.block<3, 1>(0, column) = corrected.by_errors.col(states_[k].error);
    if (states_[k].error == kTurnBias) {
      step.noise(column, column) = wander_ * seconds;
    }
  }
  return step;
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
    if (const int error = states_[k].error - OdometryErrors::kCount; error >= 0) {
      lin.jacobian.col(static_cast<Index>(3 + k)) = full->jacobian.col(3 + error);
    }
  }
  return lin;
}

}  // namespace locfuse
