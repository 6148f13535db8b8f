// SPDX-License-Identifier: Apache-2.0
// Internal to io: what is made of a glTF file's extensions.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "io/gltf/gltf_model.h"

namespace tilegrad::io {

// The extension by which the JSON compresses geometry, else nothing.
std::string_view GltfCompression(std::string_view json);

// DataLoss: the file cannot be read because of that extension.
Status RefuseGltfCompression(std::string_view extension, const std::string& place);

// DataLoss if the file requires what it cannot be drawn without. One warning names the others that
// are used, are not read and change what viewers draw.
Status CheckGltfExtensions(const tinygltf::Model& model, const std::string& place,
                           std::vector<std::string>* warnings);

// Of a texture that has no image but one of a format that is not read: the extension that has it.
std::string GltfImageExtension(const tinygltf::Texture& texture);

}  // namespace tilegrad::io
