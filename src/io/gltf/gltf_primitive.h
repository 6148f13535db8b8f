// SPDX-License-Identifier: Apache-2.0
// Internal to io: a primitive of a glTF file as a mesh.
#pragma once

#include <span>
#include <string>

#include "io/gltf/gltf_model.h"
#include "scene/mesh.h"

namespace tilegrad::io {

// Lists, strips and fans of triangles as faces, with normals, colours (as in the file) and the uv
// of the material's texture (v up) where the primitive has them; no faces for other modes.
// `weights`: of its morph targets, which are added to it; missing ones are 0. DataLoss names `what`
// and the attribute that is missing, has another length or points outside its buffer.
Result<Mesh> ConvertGltfPrimitive(const tinygltf::Model& model, const tinygltf::Primitive& p,
                                  std::span<const double> weights, const std::string& what);

}  // namespace tilegrad::io
