// SPDX-License-Identifier: Apache-2.0
// tilegrad._tools: meshes, images, checkpoints, datasets, metrics of surfaces.
#include <pybind11/pybind11.h>

#include "base/simd_target.h"
#include "bindings/arrays.h"
#include "tilegrad/version.h"

namespace tilegrad::python {

void BindMeshes(py::module_& m);
void BindArrayFiles(py::module_& m);
void BindCameraFiles(py::module_& m);
void BindPredictor(py::module_& m);
void BindDataset(py::module_& m);
void BindSurfaces(py::module_& m);
void BindLosses(py::module_& m);
void BindRuns(py::module_& m);

}  // namespace tilegrad::python

PYBIND11_MODULE(_tools, m) {
  using namespace tilegrad;          // NOLINT: of this function only
  using namespace tilegrad::python;  // NOLINT
  m.doc() =
      "Files, datasets and networks of tilegrad in C++; use them through the package tilegrad.";
  m.attr("__version__") = TILEGRAD_VERSION;
  ThrowIfError(ForceTargetFromEnvironment());
  BindMeshes(m);
  BindArrayFiles(m);
  BindCameraFiles(m);
  BindPredictor(m);
  BindDataset(m);
  BindSurfaces(m);
  BindLosses(m);
  BindRuns(m);
}
