// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/numpy.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/// Column of numbers from Python, made contiguous and of this type.
template <class T>
using Column = pybind11::array_t<T, pybind11::array::c_style | pybind11::array::forcecast>;

/// Throws std::invalid_argument unless `column` has shape (rows,) or (rows, width).
inline void expect_shape(const char* name, const pybind11::array& column, pybind11::ssize_t rows,
                         pybind11::ssize_t width = 0) {
  const bool fits = width == 0
                        ? column.ndim() == 1 && column.shape(0) == rows
                        : column.ndim() == 2 && column.shape(0) == rows && column.shape(1) == width;
  if (!fits) {
    std::string shape;
    for (pybind11::ssize_t i = 0; i < column.ndim(); ++i) {
      shape += (i > 0 ? ", " : "") + std::to_string(column.shape(i));
    }
    shape += column.ndim() == 1 ? "," : "";
    throw std::invalid_argument(std::string(name) + " has shape (" + shape + "), expected (" +
                                std::to_string(rows) +
                                (width == 0 ? ",)" : ", " + std::to_string(width) + ")"));
  }
}

/// Hands a vector to numpy without copying it.
template <class T>
pybind11::array_t<T> to_numpy(std::vector<T>&& values, std::vector<pybind11::ssize_t> shape) {
  auto owner = std::make_unique<std::vector<T>>(std::move(values));
  T* data = owner->data();
  const pybind11::capsule free(owner.release(),
                               [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return pybind11::array_t<T>(std::move(shape), data, free);
}
