// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/functional.h>

#include <functional>
#include <optional>

/// A callback from Python that is called while the GIL is released; empty without one. It refers to
/// `progress`.
inline std::function<void(double)> with_gil(
    const std::optional<std::function<void(double)>>& progress) {
  if (!progress) {
    return {};
  }
  return [&progress](double share) {
    const pybind11::gil_scoped_acquire acquire;
    (*progress)(share);
  };
}
