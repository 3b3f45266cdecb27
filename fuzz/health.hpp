// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "checks.hpp"
#include "locfuse/estimators/health.hpp"

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

inline void require_share(double value, const char* claim) {
  require(value >= 0.0 && value <= 1.0, claim);
}

inline void require_sound(const HealthReport& report) {
  require_share(report.wrong, "the probability to be wrong is one");
  require_share(report.within, "the probability to be within the limit is one");
  require(report.inflation >= 1.0, "a covariance is not made smaller");
  require(report.protection.minCoeff() >= 0.0, "protection levels are not negative");
  require((report.state == HealthState::kOk) == (report.clue == HealthClue::kNone),
          "what is not ok has a clue");
}

inline void require_sound(const std::vector<SourceStatus>& sources) {
  for (const SourceStatus& status : sources) {
    require_share(status.faulty, "the probability that a source is wrong is one");
    require_share(status.accepted, "the share that is accepted is one");
    require(status.nis >= 0.0 && std::isfinite(status.nis), "a mean NIS is finite");
    require(status.interval >= 0.0, "time goes on between messages");
    require(!status.fused || *status.fused <= status.heard, "what was fused was heard");
  }
}

}  // namespace locfuse::fuzz
