// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/motion/constant_velocity.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace locfuse {
namespace {

double density_of(const std::string& name, double sigma) {
  if (!(sigma > 0.0 && sigma * sigma > 0.0 && std::isfinite(sigma * sigma))) {
    throw std::invalid_argument(name + " is " + std::to_string(sigma) +
                                ", expected a finite number > 0, its square as well");
  }
  return sigma * sigma;
}

/// Rows of a coordinate and its rate.
struct Axis {
  int coordinate;
  int rate;
  double density;
};

}  // namespace

ConstantVelocityMotion::ConstantVelocityMotion(const Config& config)
    : velocity_per_s_(density_of("constant_velocity.sigma_velocity_per_sqrt_s",
                                 config.sigma_velocity_per_sqrt_s)),
      climb_per_s_(
          density_of("constant_velocity.sigma_climb_per_sqrt_s", config.sigma_climb_per_sqrt_s)),
      heading_per_s_(density_of("constant_velocity.sigma_heading_per_sqrt_s",
                                config.sigma_heading_per_sqrt_s)) {}

PointMotion::PointMotion(const Config& config)
    : velocity_per_s_(
          density_of("motion.sigma_velocity_per_sqrt_s", config.sigma_velocity_per_sqrt_s)) {}

Propagation<Eigen::VectorXd, Eigen::Dynamic> ConstantVelocityMotion::propagate(
    const Eigen::VectorXd& state, double seconds) const {
  if (state.size() != kVariables) {
    throw std::invalid_argument("a body with a velocity has " + std::to_string(state.size()) +
                                " variables, expected 7");
  }
  const double T = seconds;
  Propagation<Eigen::VectorXd, Eigen::Dynamic> step{
      state, Eigen::MatrixXd::Identity(kVariables, kVariables),
      Eigen::MatrixXd::Zero(kVariables, kVariables)};
  for (const Axis& axis :
       {Axis{0, 4, velocity_per_s_}, Axis{1, 5, velocity_per_s_}, Axis{3, 6, climb_per_s_}}) {
    step.moved(axis.coordinate) += T * state(axis.rate);
    step.jacobian(axis.coordinate, axis.rate) = T;
    step.noise(axis.coordinate, axis.coordinate) = axis.density * T * T * T / 3.0;
    step.noise(axis.coordinate, axis.rate) = axis.density * T * T / 2.0;
    step.noise(axis.rate, axis.coordinate) = axis.density * T * T / 2.0;
    step.noise(axis.rate, axis.rate) = axis.density * T;
  }
  constexpr int kHeading = 2;
  step.noise(kHeading, kHeading) = heading_per_s_ * T;
  return step;
}

}  // namespace locfuse
