// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "checks.hpp"
#include "locfuse/recovery/health.hpp"

namespace locfuse::fuzz {

template <class Io>
void code(Io& io, Health::Config& c) {
  bool as_usual = true;
  code(io, as_usual);
  if (as_usual) {
    return;
  }
  code(io,
       {&c.risk, &c.wrong_share, &c.chance_share, &c.faulty_share, &c.faulty_share_unnamed,
        &c.exclude_above, &c.probability_lost, &c.probability_found},
       0.0, 1.0);
  code(io, {&c.mean_s_between_losses, &c.faulty_s, &c.doubt_s, &c.aiding_lost_s, &c.invalid_s}, 0.0,
       100.0);
  code(io, c.limit_m, 0.0, 10.0);
  code(io, c.wrong_span_m, 0.0, 100.0);
}

inline void require_probability(double value, const char* claim) {
  require(value >= 0.0 && value <= 1.0, claim);
}

inline void require_sound(const HealthReport& report) {
  require_probability(report.wrong, "the probability of a wrong pose is in [0, 1]");
  require_probability(report.within, "the probability of an error within the limit is in [0, 1]");
  require(report.inflation >= 1.0, "a covariance is never deflated");
  require(report.protection.minCoeff() >= 0.0, "protection levels are not negative");
  require((report.state == HealthState::kOk) == (report.reason == HealthReason::kNone),
          "a state other than OK has a reason");
}

inline void require_sound(const std::vector<SourceStatus>& sources) {
  for (const SourceStatus& status : sources) {
    require_probability(status.faulty, "the probability of a faulty source is in [0, 1]");
    require_probability(status.accepted, "the accepted fraction is in [0, 1]");
    require(status.nis >= 0.0 && std::isfinite(status.nis), "a mean NIS is finite");
    require(status.interval >= 0.0, "intervals between messages are not negative");
    require(!status.fused || *status.fused <= status.last_received,
            "a message was received before it was fused");
  }
}

}  // namespace locfuse::fuzz
