// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_extensions.h"

#include <algorithm>
#include <array>
#include <span>

#include "base/error.h"

namespace tilegrad::io {
namespace {

using Names = std::span<const std::string_view>;

constexpr auto kRead =
    std::to_array<std::string_view>({"KHR_mesh_quantization", "KHR_texture_transform",
                                     "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness"});
// Geometry is read where it is there uncompressed, too; else the file is refused where its bytes
// are asked for.
constexpr auto kCompressions =
    std::to_array<std::string_view>({"KHR_draco_mesh_compression", "EXT_meshopt_compression"});
// Images in other formats. A texture's own image is drawn instead where it has one.
constexpr auto kImages = std::to_array<std::string_view>(
    {"EXT_texture_webp", "KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds"});
// They do not change what is drawn at rest.
constexpr auto kUnseen = std::to_array<std::string_view>({"KHR_materials_variants",
                                                          "KHR_animation_pointer",
                                                          "KHR_xmp",
                                                          "KHR_xmp_json_ld",
                                                          "EXT_mesh_features",
                                                          "EXT_instance_features",
                                                          "EXT_feature_metadata",
                                                          "EXT_structural_metadata",
                                                          "EXT_mesh_manifold",
                                                          "EXT_mesh_polygon",
                                                          "FB_geometry_metadata",
                                                          "AGI_articulations",
                                                          "AGI_stk_metadata",
                                                          "MSFT_lod",
                                                          "KHR_audio",
                                                          "KHR_audio_emitter",
                                                          "MSFT_audio_emitter",
                                                          "KHR_physics_rigid_bodies",
                                                          "KHR_implicit_shapes",
                                                          "KHR_interactivity",
                                                          "KHR_node_selectability",
                                                          "KHR_node_hoverability"});

bool IsIn(Names names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// How a surface shines, and lights: the picture is another, but the object is the file's.
bool ChangesLightOnly(std::string_view name) {
  return name.starts_with("KHR_materials_") || name.starts_with("KHR_lights_") ||
         name.starts_with("EXT_lights_");
}

bool HasOtherImages(const tinygltf::Model& model, const std::string& extension) {
  return std::all_of(model.textures.begin(), model.textures.end(), [&](const auto& texture) {
    return texture.source >= 0 || texture.extensions.count(extension) == 0;
  });
}

Status CheckRequired(const tinygltf::Model& model, const std::string& name,
                     const std::string& place) {
  if (IsIn(kCompressions, name)) return RefuseGltfCompression(name, place);
  if (IsIn(kRead, name) || IsIn(kUnseen, name) || ChangesLightOnly(name)) return {};
  if (!IsIn(kImages, name)) {
    return DataLoss("{}: it requires the extension {}, which is not read; save it without", place,
                    name);
  }
  if (HasOtherImages(model, name)) return {};
  return DataLoss("{}: its images need {}, which is not read; save them as PNG or JPEG", place,
                  name);
}

}  // namespace

std::string_view GltfCompression(std::string_view json) {
  for (const std::string_view extension : kCompressions) {
    if (json.find(extension) != std::string_view::npos) return extension;
  }
  return {};
}

Status RefuseGltfCompression(std::string_view extension, const std::string& place) {
  return DataLoss("{}: {} is not supported; save the file without compression", place, extension);
}

Status CheckGltfExtensions(const tinygltf::Model& model, const std::string& place,
                           std::vector<std::string>* warnings) {
  for (const std::string& name : model.extensionsRequired)
    TILEGRAD_TRY(CheckRequired(model, name, place));
  std::vector<std::string> unread;
  for (const auto* names : {&model.extensionsUsed, &model.extensionsRequired}) {
    for (const std::string& name : *names) {
      const bool known = IsIn(kRead, name) || IsIn(kUnseen, name) || IsIn(kCompressions, name) ||
                         IsIn(kImages, name);
      if (!known && std::find(unread.begin(), unread.end(), name) == unread.end())
        unread.push_back(name);
    }
  }
  if (unread.empty()) return {};
  warnings->push_back(fmt::format("the file uses {}, not read: viewers that do draw it otherwise",
                                  fmt::join(unread, ", ")));
  return {};
}

std::string GltfImageExtension(const tinygltf::Texture& texture) {
  if (texture.source >= 0) return {};
  for (const auto& [name, value] : texture.extensions) {
    if (IsIn(kImages, name)) return name;
  }
  return {};
}

}  // namespace tilegrad::io
