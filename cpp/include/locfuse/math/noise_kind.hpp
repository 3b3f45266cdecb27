// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace locfuse {

/// What noise looks like beyond its sigma.
enum class NoiseKind : std::uint8_t {
  kGaussian,  ///< as its sigma says
  kOneSided,  ///< a share of the measurements is too long, by anything; of one row only
  kStudentT,  ///< with tails of some degrees of freedom, to both sides
  kCauchy,    ///< the same with one degree of freedom
};

}  // namespace locfuse
