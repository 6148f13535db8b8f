// SPDX-License-Identifier: Apache-2.0
// Built-in shapes, as arrays.
#include <cmath>

#include "bindings/arrays.h"
#include "scene/shapes.h"

namespace tilegrad::python {

void BindShapes(py::module_& m);

namespace {

// positions (V, 3) float32, faces (F, 3) int32.
py::tuple ArraysOf(const Mesh& mesh) {
  py::array_t<float> positions({static_cast<py::ssize_t>(mesh.positions.size()), py::ssize_t{3}});
  float* p = positions.mutable_data();
  for (const glm::vec3& v : mesh.positions) {
    *p++ = v.x;
    *p++ = v.y;
    *p++ = v.z;
  }
  py::array_t<std::int32_t> faces({static_cast<py::ssize_t>(mesh.faces.size()), py::ssize_t{3}});
  std::int32_t* f = faces.mutable_data();
  for (const auto& face : mesh.faces) {
    for (const auto v : face) *f++ = static_cast<std::int32_t>(v);
  }
  return py::make_tuple(positions, faces);
}

}  // namespace

void BindShapes(py::module_& m) {
  m.def(
      "icosphere",
      [](int level, float radius) {
        if (level < 0 || level > 8) {
          throw py::value_error(fmt::format("icosphere: level is {}, must be in 0..8", level));
        }
        if (!(radius > 0 && std::isfinite(radius))) {
          throw py::value_error(
              fmt::format("icosphere: radius is {}, must be finite and > 0", radius));
        }
        return ArraysOf(Icosphere(level, radius));
      },
      py::arg("level"), py::arg("radius"), "(V, 3) float32, (F, 3) int32.");
}

}  // namespace tilegrad::python
