// SPDX-License-Identifier: Apache-2.0
#include "cli/mesh_options.h"

#include <map>

#include "base/error.h"
#include "cli/option_checks.h"
#include "io/image_file.h"

namespace tilegrad::cli {

void AddUpOption(CLI::App* command, UpAxis* up) {
  static const std::map<std::string, UpAxis> axes = {
      {"y", UpAxis::kY}, {"z", UpAxis::kZ}, {"x", UpAxis::kX}};
  command->add_option("--up", *up, "the axis of the mesh that points up: y (default), z or x")
      ->transform(OneOf(axes))
      ->type_name("TEXT");
}

void AddTextureOption(CLI::App* command, std::string* file) {
  command->add_option("--texture", *file,
                      "an image for those materials of the mesh that have no texture");
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
