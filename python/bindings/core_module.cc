// SPDX-License-Identifier: Apache-2.0
// tilegrad._core: the renderer of the public interface, and the kernels behind tilegrad.compat.
#include <pybind11/pybind11.h>

#include "base/simd_target.h"
#include "bindings/arrays.h"
#include "tilegrad/version.h"

namespace tilegrad::python {

void BindRenderer(py::module_& m);
void BindCamera(py::module_& m);
void BindShapes(py::module_& m);
void BindKaolin(py::module_& m);
void BindNvdiffrast(py::module_& m);
void BindPytorch3d(py::module_& m);

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
  BindShapes(m);
  BindKaolin(m);
  BindNvdiffrast(m);
  BindPytorch3d(m);
}
