// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Height of an altimeter on the body: h(x) = height + altimeter; docs/air.md eq. (1).
class AltitudeModel {
 public:
  struct Config {
    double altimeter_up_m = 0.0;  ///< height above the body's origin [m]
    double sigma_m = 0.1;         ///< of an altitude without a sigma of its own [m]
    double gate = 0.999;          ///< probability that a good one passes; 1: no gate
  };

  AltitudeModel() = default;

  /// Throws std::invalid_argument if the mount is not finite or the sigma not positive.
  explicit AltitudeModel(const Config& config);

  /// Expected measurement [m].
  [[nodiscard]] double predict(double height) const { return height + altimeter_up_; }

  /// Jacobian with respect to the height of the body above z = 0 [m]: 1.
  [[nodiscard]] Linearization<1, 1> linearize(double height, const Altitude& z) const {
    Linearization<1, 1> lin;
    lin.residual(0) = z.height - predict(height);
    lin.jacobian(0) = 1.0;
    const double sigma = z.sigma.value_or(sigma_);
    lin.noise(0) = sigma * sigma;
    return lin;
  }

 private:
  double sigma_ = Config{}.sigma_m;
  double altimeter_up_ = 0.0;
};

}  // namespace locfuse
