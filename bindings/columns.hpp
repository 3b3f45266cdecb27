// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "bindings.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "numpy.hpp"

/// Columns of results.

inline pybind11::array_t<double> poses_of(const std::vector<locfuse::PoseEstimate>& estimates) {
  std::vector<double> rows;
  rows.reserve(3 * estimates.size());
  for (const locfuse::PoseEstimate& e : estimates) {
    rows.insert(rows.end(), {e.pose.x, e.pose.y, e.pose.heading});
  }
  return to_numpy(std::move(rows), {static_cast<pybind11::ssize_t>(estimates.size()), 3});
}

inline pybind11::array_t<double> covariances_of(
    const std::vector<locfuse::PoseEstimate>& estimates) {
  std::vector<double> rows;
  rows.reserve(9 * estimates.size());
  for (const locfuse::PoseEstimate& e : estimates) {
    rows.insert(rows.end(), e.covariance.data(), e.covariance.data() + 9);
  }
  return to_numpy(std::move(rows), {static_cast<pybind11::ssize_t>(estimates.size()), 3, 3});
}

template <class T, class Items, class Field>
pybind11::array_t<T> column_of(const Items& items, const Field& field) {
  pybind11::array_t<T> column(static_cast<pybind11::ssize_t>(items.size()));
  std::transform(items.begin(), items.end(), column.mutable_data(), field);
  return column;
}

inline pybind11::array_t<std::uint8_t> verdicts_of(const std::vector<locfuse::Outcome>& outcomes) {
  return column_of<std::uint8_t>(
      outcomes, [](const locfuse::Outcome& o) { return static_cast<std::uint8_t>(o.verdict); });
}

inline pybind11::array_t<std::uint8_t> reasons_of(const std::vector<locfuse::Outcome>& outcomes) {
  return column_of<std::uint8_t>(
      outcomes, [](const locfuse::Outcome& o) { return static_cast<std::uint8_t>(o.reason); });
}

/// Binds what became of each message.
template <class Run>
void bind_outcome_columns(pybind11::class_<Run>& bound) {
  bound
      .def_property_readonly(
          "verdict", [](const Run& r) { return verdicts_of(r.outcomes); },
          "Index into Verdict, one per message in order of arrival.")
      .def_property_readonly(
          "reason", [](const Run& r) { return reasons_of(r.outcomes); },
          "Index into Reason, why it was not fused.")
      .def_property_readonly(
          "limit",
          [](const Run& r) {
            return column_of<double>(r.outcomes, [](const auto& o) { return o.limit; });
          },
          "Largest `nis` that the gate passes, or distance that conditioning allows [m].")
      .def_property_readonly("residual",
                             [](const Run& r) {
                               return column_of<double>(r.outcomes,
                                                        [](const auto& o) { return o.residual; });
                             })
      .def_property_readonly("dof",
                             [](const Run& r) {
                               return column_of<std::int64_t>(r.outcomes,
                                                              [](const auto& o) { return o.dof; });
                             })
      .def_property_readonly("nis",
                             [](const Run& r) {
                               return column_of<double>(r.outcomes,
                                                        [](const auto& o) { return o.nis; });
                             })
      .def_property_readonly("log_likelihood", [](const Run& r) {
        return column_of<double>(r.outcomes, [](const auto& o) { return o.log_likelihood(); });
      });
}

/// Binds estimates: `of` gives those of a run.
template <class Run, class Of>
void bind_estimate_columns(pybind11::class_<Run>& bound, const Of& of) {
  bound
      .def_property_readonly(
          "stamp_ns",
          [of](const Run& r) {
            return column_of<locfuse::Stamp>(of(r), [](const auto& e) { return e.stamp; });
          },
          "Stamps of the estimates, (n,).")
      .def_property_readonly(
          "poses", [of](const Run& r) { return poses_of(of(r)); }, "x, y, heading, (n, 3).")
      .def_property_readonly(
          "covariances", [of](const Run& r) { return covariances_of(of(r)); }, "(n, 3, 3).");
}
