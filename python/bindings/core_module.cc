// SPDX-License-Identifier: Apache-2.0
// tilegrad._core: the renderer of the public interface, and the kernels behind tilegrad.compat.
#include <pybind11/pybind11.h>

#include <cmath>

#include "base/simd_target.h"
#include "bindings/to_python.h"
#include "scene/shapes.h"
#include "tilegrad/version.h"

namespace tilegrad::python {

void BindRenderer(py::module_& m);
void BindCamera(py::module_& m);
void BindKaolin(py::module_& m);
void BindNvdiffrast(py::module_& m);
void BindPytorch3d(py::module_& m);

namespace {

py::tuple IcosphereArrays(int level, float radius) {
  if (level < 0 || level > 8)
    throw py::value_error(fmt::format("icosphere: level is {}, must be in 0..8", level));
  if (!(radius > 0 && std::isfinite(radius)))
    throw py::value_error(fmt::format("icosphere: radius is {}, must be finite and > 0", radius));
  Mesh mesh = Icosphere(level, radius);
  const auto vertices = static_cast<py::ssize_t>(mesh.positions.size()),
             faces = static_cast<py::ssize_t>(mesh.faces.size());
  return py::make_tuple(OwnedArray<float>(std::move(mesh.positions), {vertices, 3}),
                        OwnedArray<std::int32_t>(std::move(mesh.faces), {faces, 3}));
}

}  // namespace
}  // namespace tilegrad::python

PYBIND11_MODULE(_core, m) {
  using namespace tilegrad;          // NOLINT: of this function only
  using namespace tilegrad::python;  // NOLINT
  m.doc() = "The renderer of tilegrad in C++; use it through the package tilegrad.";
  m.attr("__version__") = TILEGRAD_VERSION;
  ThrowIfError(ForceTargetFromEnvironment());
  m.def("simd_target", &ActiveTarget,
        "The instruction set that kernels use: AVX2, say. TILEGRAD_TARGET in the environment\n"
        "forces one.");
  BindRenderer(m);
  BindCamera(m);
  m.def("icosphere", &IcosphereArrays, "(V, 3) float32, (F, 3) int32.");
  BindKaolin(m);
  BindNvdiffrast(m);
  BindPytorch3d(m);
}
