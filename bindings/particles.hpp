// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/numpy.h>

#include <cmath>
#include <vector>

#include "locfuse/particles/mcl.hpp"
#include "numpy.hpp"

inline pybind11::array_t<double> particles_of(const locfuse::Mcl& mcl) {
  const locfuse::ParticleBelief& belief = mcl.belief();
  const locfuse::OccupancyGrid& grid = mcl.grid();
  std::vector<double> rows;
  rows.reserve(4 * static_cast<std::size_t>(belief.size));
  for (std::size_t k = 0; k < static_cast<std::size_t>(belief.size); ++k) {
    const locfuse::Vector<2> p = grid.to_world({belief.x[k], belief.y[k]});
    const double heading =
        std::atan2(static_cast<double>(belief.s[k]), static_cast<double>(belief.c[k]));
    rows.insert(rows.end(), {p.x(), p.y(), locfuse::wrap_angle(heading + grid.origin().heading),
                             static_cast<double>(belief.weight[k])});
  }
  return to_numpy(std::move(rows), {belief.size, 4});
}

/// Binds what a localizer on a map says of itself; `mcl_of` gives the particles.
template <class T, class MclOf>
void bind_state(pybind11::class_<T>& bound, const MclOf& mcl_of) {
  bound
      .def(
          "estimate", [=](const T& t) { return mcl_of(t).estimate(); },
          "PoseEstimate of the likeliest cluster, propagated to the end of the latest odometry.")
      .def_property_readonly(
          "hypotheses", [=](const T& t) { return mcl_of(t).hypotheses(); },
          "Clusters of particles as a list of PoseHypothesis, likeliest first.")
      .def(
          "health", [=](const T& t) { return mcl_of(t).health(); },
          "HealthReport of the estimate; docs/health.md.")
      .def(
          "watched", [=](const T& t) { return mcl_of(t).watched(); },
          "WatchReport of the poses that it watches, or None unless it watches poses.")
      .def_property_readonly(
          "sources", [=](const T& t) { return mcl_of(t).sources(); },
          "One SourceStatus per source that weights particles.")
      .def_property_readonly(
          "ready", [=](const T& t) { return mcl_of(t).ready(); },
          "Whether one cluster is almost certain.")
      .def_property_readonly(
          "particles", [=](const T& t) { return particles_of(mcl_of(t)); },
          "float64 (n, 4): x, y [m], heading [rad] in world, weight.");
}
