// SPDX-License-Identifier: Apache-2.0
// Meshes as dicts of arrays, the form in which tilegrad/meshes.py and these bindings exchange them.
// None or absent: the mesh has none.
//
//   positions [V,3] float32, faces [F,3] int32, normals [V,3], colors [V,4], corner_uvs [F,3,2],
//   corner_normals [F,3,3], corner_colors [F,3,4], face_materials [F] int32,
//   materials: dicts with the members of Material, enumerations as strings
//   textures: dicts of "name" and "image" [height,width,3 or 4] uint8
#pragma once

#include "bindings/arrays.h"
#include "scene/mesh.h"

namespace tilegrad::python {

// `pixels`: [height,width,channels] uint8. Errors: as SpanOf.
ImageU8 ImageFromPython(const char* function, const char* argument, const py::object& pixels);

py::dict MeshToDict(Mesh mesh);

// ValueError or TypeError, naming `function`, if an array has another shape or dtype or a material
// has an unknown value. Validate (scene/mesh.h) checks the rest.
Mesh MeshFromDict(const char* function, const py::dict& dict);

}  // namespace tilegrad::python
