// SPDX-License-Identifier: Apache-2.0
#include "bindings.hpp"
#include "locfuse/maps/anchor_map.hpp"

namespace py = pybind11;
using locfuse::Anchor;
using locfuse::AnchorMap;

void bind_maps(py::module_& m) {
  py::class_<Anchor>(m, "Anchor",
                     "A fixed radio at `position` (3,) [m] in world; a range to it reads scale * "
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
      "The anchors, by id; immutable.\n\nRaises\n------\nValueError\n    On a duplicate id, a "
      "number "
      "that is not finite or a scale that is not positive.")
      .def(py::init<std::vector<Anchor>>(), py::arg("anchors"))
      .def_property_readonly("anchors", &AnchorMap::anchors, "All anchors in order of id.")
      .def("__len__", [](const AnchorMap& map) { return map.anchors().size(); })
      .def("__contains__",
           [](const AnchorMap& map, locfuse::Id id) { return map.find(id) != nullptr; })
      .def("__repr__", [](const AnchorMap& map) {
        return "AnchorMap(" + std::to_string(map.anchors().size()) + " anchors)";
      });
}
