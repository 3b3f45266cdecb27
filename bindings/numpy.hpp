// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/numpy.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/// Numbers from Python, converted to a contiguous array of type T.
template <class T>
using Column = pybind11::array_t<T, pybind11::array::c_style | pybind11::array::forcecast>;

/// Integers from Python, not converted yet: a conversion to T would truncate silently.
template <class T>
struct Integers {
  pybind11::array as_given;
};

namespace pybind11::detail {
template <class T>
struct type_caster<Integers<T>> {
  PYBIND11_TYPE_CASTER(Integers<T>, make_caster<Column<T>>::name);
  bool load(handle source, bool) {
    value.as_given = array::ensure(source);
    return static_cast<bool>(value.as_given);
  }
};
}  // namespace pybind11::detail

/// Converts `integers` to type T. Throws pybind11::type_error unless they are integers, and
/// std::invalid_argument for the first value that T cannot represent.
template <class T>
Column<T> checked(const char* name, const Integers<T>& integers, const char* expected) {
  const pybind11::array& given = integers.as_given;
  if (pybind11::isinstance<pybind11::array_t<T>>(given)) {
    return Column<T>(given);
  }
  const char kind = given.dtype().kind();
  if (given.size() > 0 && kind != 'i' && kind != 'u') {  // an empty list has no type
    throw pybind11::type_error(std::string(name) + " holds " +
                               std::string(pybind11::str(given.dtype())) + ", expected integers");
  }
  Column<T> column(given);
  const pybind11::array wrong =
      given.attr("__ne__")(column).attr("ravel")().attr("nonzero")()[pybind11::int_(0)];
  if (wrong.size() > 0) {
    const auto first = wrong.attr("item")(0).template cast<pybind11::ssize_t>();
    const pybind11::ssize_t rows = given.ndim() > 0 ? given.shape(0) : 1;
    throw std::invalid_argument(
        "row " + std::to_string(first / (given.size() / rows)) + ": " + name + " holds " +
        std::string(pybind11::str(given.attr("item")(first))) + ", expected " + expected);
  }
  return column;
}

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

/// Moves a vector into a numpy array without copying.
template <class T>
pybind11::array_t<T> to_numpy(std::vector<T>&& values, std::vector<pybind11::ssize_t> shape) {
  auto owner = std::make_unique<std::vector<T>>(std::move(values));
  T* data = owner->data();
  const pybind11::capsule free(owner.release(),
                               [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return pybind11::array_t<T>(std::move(shape), data, free);
}
