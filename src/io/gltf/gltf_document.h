// SPDX-License-Identifier: Apache-2.0
// Internal to io: a glTF or GLB file as tinygltf's model.
#pragma once

#include <string>
#include <vector>

#include "io/gltf/gltf_model.h"
#include "io/mesh_file.h"

namespace tilegrad::io {

struct GltfDocument {
  tinygltf::Model model;              // images encoded: bytes of data URIs, or a buffer view
  std::vector<std::string> warnings;  // extensions that are not read
};

// The file `name` with its side files. DataLoss for what is not glTF 2, nested too deep or
// compressed; ResourceExhausted above 4 GiB. The numbers in the model are not checked yet.
Result<GltfDocument> ReadGltfDocument(const FileSource& source, const std::string& name);

}  // namespace tilegrad::io
