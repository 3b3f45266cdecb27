// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/adaptive_noise.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace locfuse {
namespace {

constexpr double kMaxNisPerRow = 8.0;  // per degree of freedom; larger ones count as this
constexpr double kMinMemory =
    5.0;  // messages; a factor stays positive, and is not the last innovation alone

}  // namespace

AdaptiveNoise::AdaptiveNoise(const Config& config) : config_(config) {
  if (config.messages != 0.0 &&
      !(std::isfinite(config.messages) && config.messages >= kMinMemory)) {
    throw std::invalid_argument("adaptive.messages is " + std::to_string(config.messages) +
                                ", expected 0 for off, or at least 5");
  }
  if (!(config.least > 0.0 && config.least <= 1.0 && config.most >= 1.0 &&
        std::isfinite(config.most))) {
    throw std::invalid_argument("adaptive.least is " + std::to_string(config.least) +
                                " and adaptive.most is " + std::to_string(config.most) +
                                ", expected 0 < least <= 1 <= most");
  }
  factors_.fill(1.0);
}

void AdaptiveNoise::record(Source source, const Outcome& outcome, double variance) {
  const bool counts = outcome.verdict == Verdict::kFused && outcome.dof > 0;
  if (!counts || !std::isfinite(variance / outcome.scale + outcome.nis)) {
    return;
  }
  const double of_noise = std::min(variance / outcome.scale, 1.0);
  const double excess = std::min(outcome.nis / outcome.dof, kMaxNisPerRow) - 1.0;
  double& factor = factors_[index(source)];
  factor = std::clamp(factor * (1.0 + of_noise * excess / config_.messages), config_.least,
                      config_.most);
}

}  // namespace locfuse
