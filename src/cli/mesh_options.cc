// SPDX-License-Identifier: Apache-2.0
#include "cli/mesh_options.h"

#include "base/error.h"
#include "io/image_file.h"

namespace tilegrad::cli {

void AddUpOption(Command* command, UpAxis* up) {
  command->Add("--up", Choice(up, {{"y", UpAxis::kY}, {"z", UpAxis::kZ}, {"x", UpAxis::kX}}),
               "up axis of the mesh: y (default), z or x");
}

void AddTextureOption(Command* command, std::string* file) {
  command->Add("--texture", file, "texture image for the materials that have none");
}

Status TakeTexture(const std::string& file, io::LoadedMesh* loaded) {
  if (file.empty()) return {};
  Mesh& mesh = loaded->mesh;
  if (mesh.corner_uvs.empty())
    return InvalidArgument("--texture {}: the mesh has no texture coordinates", file);
  TILEGRAD_ASSIGN(ImageU8 image, io::LoadImage(file));
  if (mesh.materials.empty()) mesh.materials.emplace_back();
  const auto index = static_cast<int>(mesh.textures.size());
  bool taken = false;
  for (Material& material : mesh.materials) {
    if (material.base_color_texture >= 0) continue;
    material.base_color_texture = index;
    material.base_color = {1, 1, 1, material.base_color.a};
    taken = true;
  }
  if (!taken)
    return InvalidArgument("--texture {}: every material of the mesh has a texture already", file);
  mesh.textures.push_back({file, io::ToColor(std::move(image))});
  loaded->files.emplace_back(file);
  return {};
}

}  // namespace tilegrad::cli
