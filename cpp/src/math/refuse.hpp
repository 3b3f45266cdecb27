// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

namespace locfuse::internal {

/// Throws std::invalid_argument with what is wrong and what is allowed.
[[noreturn]] inline void refuse(const std::string& what, double value,
                                const std::string& expected) {
  std::ostringstream text;
  text << what << " is " << value << ", expected " << expected;
  throw std::invalid_argument(text.str());
}

}  // namespace locfuse::internal
