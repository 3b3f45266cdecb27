// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <sstream>

#include "bindings.hpp"
#include "locfuse/maps/anchor_map.hpp"
#include "locfuse/maps/distance_field.hpp"
#include "locfuse/maps/landmark_map.hpp"
#include "locfuse/maps/ray_caster.hpp"
#include "numpy.hpp"

namespace py = pybind11;
using locfuse::Anchor;
using locfuse::AnchorMap;
using locfuse::Cell;
using locfuse::DistanceField;
using locfuse::Landmark;
using locfuse::LandmarkMap;
using locfuse::OccupancyGrid;
using locfuse::Pose2;
using locfuse::RayCaster;

namespace {

std::shared_ptr<OccupancyGrid> grid_from(const Integers<std::int8_t>& given, double resolution,
                                         const Pose2& origin) {
  const Column<std::int8_t> cells =
      checked("cells", given, "0 (free), 100 (occupied) or -1 (unknown)");
  if (cells.ndim() != 2) {
    throw std::invalid_argument("cells has " + std::to_string(cells.ndim()) +
                                " dimensions, expected 2: (height, width)");
  }
  std::vector<Cell> values(static_cast<std::size_t>(cells.size()));
  const std::int8_t* const data = cells.data();
  std::transform(data, data + cells.size(), values.begin(),
                 [](std::int8_t value) { return static_cast<Cell>(value); });
  return std::make_shared<OccupancyGrid>(static_cast<int>(cells.shape(1)),
                                         static_cast<int>(cells.shape(0)), resolution, origin,
                                         std::move(values));
}

/// Evaluates `answer(i)` for points (n, 2); shape (n,).
template <class Answer>
py::array_t<double> for_points(const Column<double>& points, const Answer& answer) {
  expect_shape("points", points, points.ndim() > 0 ? points.shape(0) : 0, 2);
  const double* const data = points.data();
  std::vector<double> found(static_cast<std::size_t>(points.shape(0)));
  {
    const py::gil_scoped_release unlocked;
    for (std::size_t i = 0; i < found.size(); ++i) {
      found[i] = answer(locfuse::Vector<2>(data[2 * i], data[2 * i + 1]), i);
    }
  }
  return to_numpy(std::move(found), {points.shape(0)});
}

void bind_landmark_map(py::module_& m) {
  py::class_<Landmark>(m, "Landmark",
                       "Landmark with its centre at `position` (2,) in world, its `radius` and, "
                       "for an AirEkf, its `height` [m].")
      .def(py::init([](locfuse::Id id, const locfuse::Vector<2>& position, double radius,
                       double height) {
             return Landmark{id, position, radius, height};
           }),
           py::arg("id"), py::arg("position"), py::arg("radius") = Landmark{}.radius,
           py::arg("height") = Landmark{}.height)
      .def_readonly("id", &Landmark::id)
      .def_readonly("position", &Landmark::position)
      .def_readonly("radius", &Landmark::radius)
      .def_readonly("height", &Landmark::height)
      .def("__repr__",
           [](const Landmark& l) { return "Landmark(id=" + std::to_string(l.id) + ")"; });
  py::class_<LandmarkMap, std::shared_ptr<LandmarkMap>>(
      m, "LandmarkMap",
      "Immutable map of landmarks by id.\n\nRaises\n------\nValueError\n    On a duplicate id, a "
      "number that is not finite or a negative radius.")
      .def(py::init<std::vector<Landmark>>(), py::arg("landmarks"))
      .def_property_readonly("landmarks", &LandmarkMap::landmarks, "All landmarks in order of id.")
      .def("__len__", [](const LandmarkMap& map) { return map.landmarks().size(); })
      .def("__contains__",
           [](const LandmarkMap& map, locfuse::Id id) { return map.find(id) != nullptr; })
      .def("__repr__", [](const LandmarkMap& map) {
        return "LandmarkMap(" + std::to_string(map.landmarks().size()) + " landmarks)";
      });
}

void bind_grid(py::module_& m) {
  py::class_<OccupancyGrid, std::shared_ptr<OccupancyGrid>>(
      m, "OccupancyGrid", R"(Immutable occupancy grid of square cells: free, occupied or unknown.

Parameters
----------
cells : integer array, shape (height, width)
    0 free, 100 occupied, -1 unknown; row 0 has the lowest y.
resolution : float
    Metres per cell.
origin : Pose2
    T_world_grid: lower left corner of the grid.

Raises
------
ValueError
    On other cell values, an empty grid, or numbers that are not finite.
TypeError
    On cells that are not integers.

Examples
--------
>>> import numpy as np
>>> from locfuse import OccupancyGrid, Pose2
>>> OccupancyGrid(np.zeros((3, 4), dtype=np.int8), 0.05, Pose2(-1, -1, 0))
OccupancyGrid(4 x 3 cells of 0.05 m)
)")
      .def(py::init(&grid_from), py::arg("cells"), py::arg("resolution"),
           py::arg("origin") = Pose2{})
      .def_property_readonly("width", &OccupancyGrid::width)
      .def_property_readonly("height", &OccupancyGrid::height)
      .def_property_readonly("resolution", &OccupancyGrid::resolution, "Metres per cell.")
      .def_property_readonly("origin", &OccupancyGrid::origin, "T_world_grid.")
      .def_property_readonly(
          "cells",
          [](const py::object& self) {
            const auto& grid = self.cast<const OccupancyGrid&>();
            py::array_t<std::int8_t> view({grid.height(), grid.width()},
                                          reinterpret_cast<const std::int8_t*>(grid.cells().data()),
                                          self);
            view.attr("flags").attr("writeable") = false;
            return view;
          },
          "int8 (height, width), a read-only view.")
      .def("contains",
           py::overload_cast<const locfuse::Vector<2>&>(&OccupancyGrid::contains, py::const_),
           py::arg("point"), "Whether a point (2,) in world lies on the grid.")
      .def("center", &OccupancyGrid::center, py::arg("column"), py::arg("row"),
           "Centre (2,) of a cell in world [m].")
      .def("__repr__", [](const OccupancyGrid& grid) {
        std::ostringstream text;
        text << "OccupancyGrid(" << grid.width() << " x " << grid.height() << " cells of "
             << grid.resolution() << " m)";
        return text.str();
      });
  py::class_<DistanceField>(
      m, "DistanceField",
      R"(Distances to the nearest occupied cell, precomputed for a map and a margin.

Parameters
----------
grid : OccupancyGrid
margin : float
    How far the field reaches beyond the map [m].

Raises
------
ValueError
    If there is no map, or no cell of it is occupied.
)")
      .def(py::init<std::shared_ptr<OccupancyGrid>, double>(), py::arg("grid"),
           py::arg("margin") = 1.0)
      .def(
          "distance",
          [](const DistanceField& field, const Column<double>& points) {
            return for_points(points, [&](const locfuse::Vector<2>& p, std::size_t) {
              return field.distance(p);
            });
          },
          py::arg("points"),
          "Distances (n,) [m] for points (n, 2) in world by table lookup: from the centre of the "
          "cell of the point to the centre of the nearest occupied cell.")
      .def(
          "nearest_distance",
          [](const DistanceField& field, const Column<double>& points) {
            return for_points(points, [&](const locfuse::Vector<2>& p, std::size_t) {
              return field.nearest(p).distance;
            });
          },
          py::arg("points"),
          "Exact distances (n,) [m] from points (n, 2) in world to the centre of the nearest "
          "occupied cell.");
}

void bind_ray_caster(py::module_& m) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  py::class_<RayCaster>(m, "RayCaster",
                        R"(Exact ranges of beams on a map to the first occupied cell.

The range from an occupied cell is 0. Beams pass through free cells and outside the map, so they may
start outside.

Parameters
----------
grid : OccupancyGrid
unknown_stops : bool
    Whether unknown cells stop beams like occupied ones.

Raises
------
ValueError
    If there is no map.

Examples
--------
>>> import numpy as np
>>> from locfuse.core import OccupancyGrid, Pose2, RayCaster
>>> cells = np.zeros((20, 40), dtype=np.int8)
>>> cells[:, 30] = 100
>>> caster = RayCaster(OccupancyGrid(cells, 0.1))
>>> caster.scan(Pose2(1, 1, 0), angle_min=0.0, angle_increment=0.1, count=3).round(3).tolist()
[2.0, 2.01, 2.041]
)")
      .def(py::init<std::shared_ptr<OccupancyGrid>, bool>(), py::arg("grid"),
           py::arg("unknown_stops") = false)
      .def(
          "scan",
          [](const RayCaster& caster, const Pose2& pose, double angle_min, double angle_increment,
             int count, double max_range) {
            std::vector<double> ranges;
            {
              const py::gil_scoped_release unlocked;
              ranges = caster.scan(pose, angle_min, angle_increment, count, max_range);
            }
            return to_numpy(std::move(ranges), {count});
          },
          py::arg("pose"), py::arg("angle_min"), py::arg("angle_increment"), py::arg("count"),
          py::arg("max_range") = kInfinity,
          R"(Ranges of the beams of a laser.

Parameters
----------
pose : Pose2
    T_world_laser.
angle_min, angle_increment : float
    Beam i points at angle_min + i * angle_increment in the laser's frame [rad].
count : int
    Number of beams.
max_range : float
    Maximum range [m].

Returns
-------
float64 array, shape (count,)
    Metres; infinite where nothing is hit.

Raises
------
ValueError
    On numbers that are not finite, a start 1e9 cells or more from the map, a negative `count` or
    `max_range`.
)")
      .def(
          "cast",
          [](const RayCaster& caster, const Column<double>& points, const Column<double>& headings,
             double max_range) {
            expect_shape("headings", headings, points.ndim() > 0 ? points.shape(0) : 0);
            const double* const heading = headings.data();
            return for_points(points, [&](const locfuse::Vector<2>& p, std::size_t i) {
              return caster.cast(p, heading[i], max_range);
            });
          },
          py::arg("points"), py::arg("headings"), py::arg("max_range") = kInfinity,
          R"(Ranges of single beams.

Parameters
----------
points : float64 array, shape (n, 2)
    Start points in world [m].
headings : float64 array, shape (n,)
    Directions in world [rad].
max_range : float
    Maximum range [m].

Returns
-------
float64 array, shape (n,)
    Metres; infinite where nothing is hit.

Raises
------
ValueError
    On other shapes, numbers that are not finite, a start 1e9 cells or more from the map, a
    negative `max_range`.
)");
}

}  // namespace

void bind_maps(py::module_& m) {
  py::class_<Anchor>(m, "Anchor",
                     "Fixed radio at `position` (3,) [m] in world; a range to it reads scale * "
                     "distance + offset [m].")
      .def(py::init(
               [](locfuse::Id id, const locfuse::Vector<3>& position, double offset, double scale) {
                 return Anchor{id, position, offset, scale};
               }),
           py::arg("id"), py::arg("position"), py::arg("offset") = Anchor{}.offset,
           py::arg("scale") = Anchor{}.scale)
      .def_readonly("id", &Anchor::id)
      .def_readonly("position", &Anchor::position)
      .def_readonly("offset", &Anchor::offset)
      .def_readonly("scale", &Anchor::scale)
      .def("__repr__", [](const Anchor& a) { return "Anchor(id=" + std::to_string(a.id) + ")"; });
  py::class_<AnchorMap, std::shared_ptr<AnchorMap>>(
      m, "AnchorMap",
      "Immutable map of anchors by id.\n\nRaises\n------\nValueError\n    On a duplicate id, a "
      "number that is not finite or a scale that is not positive.")
      .def(py::init<std::vector<Anchor>>(), py::arg("anchors"))
      .def_property_readonly("anchors", &AnchorMap::anchors, "All anchors in order of id.")
      .def("__len__", [](const AnchorMap& map) { return map.anchors().size(); })
      .def("__contains__",
           [](const AnchorMap& map, locfuse::Id id) { return map.find(id) != nullptr; })
      .def("__repr__", [](const AnchorMap& map) {
        return "AnchorMap(" + std::to_string(map.anchors().size()) + " anchors)";
      });
  bind_landmark_map(m);
  bind_grid(m);
  bind_ray_caster(m);
}
