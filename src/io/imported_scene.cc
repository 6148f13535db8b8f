// SPDX-License-Identifier: Apache-2.0
#include "io/imported_scene.h"

#include "base/error.h"
#include "io/child_record.h"

namespace tilegrad::io {

template <>
inline constexpr auto kFieldsOf<ImportedPart> = std::tuple(
    &ImportedPart::name, &ImportedPart::material, &ImportedPart::positions, &ImportedPart::normals,
    &ImportedPart::uvs, &ImportedPart::colors, &ImportedPart::triangles);
template <>
inline constexpr auto kFieldsOf<ImportedMaterial> = std::tuple(&ImportedMaterial::name,
                                                               &ImportedMaterial::color,
                                                               &ImportedMaterial::image,
                                                               &ImportedMaterial::embedded,
                                                               &ImportedMaterial::not_read);
template <>
inline constexpr auto kFieldsOf<ImportedImage> = std::tuple(&ImportedImage::name,
                                                            &ImportedImage::bytes);
template <>
inline constexpr auto kFieldsOf<ImportedScene> = std::tuple(&ImportedScene::parts,
                                                            &ImportedScene::materials,
                                                            &ImportedScene::images,
                                                            &ImportedScene::instances,
                                                            &ImportedScene::warnings);

namespace {

Status CheckPart(const ImportedPart& part) {
  const std::size_t vertices = part.positions.size();
  for (const std::size_t count : {part.normals.size(), part.uvs.size(), part.colors.size()}) {
    if (count != 0 && count != vertices)
      return DataLoss("part \"{}\": {} attributes for {} vertices", part.name, count, vertices);
  }
  for (std::size_t f = 0; f < part.triangles.size(); ++f) {
    for (const std::uint32_t v : part.triangles[f]) {
      if (v >= vertices)
        return DataLoss("part \"{}\": face {} uses vertex {} of {}", part.name, f, v, vertices);
    }
  }
  return {};
}

Status CheckScene(const ImportedScene& scene) {
  for (const ImportedPart& part : scene.parts) TILEGRAD_TRY(CheckPart(part));
  for (const ImportedInstance& instance : scene.instances) {
    if (instance.part >= scene.parts.size())
      return DataLoss("part {} of {} is placed", instance.part, scene.parts.size());
  }
  for (const ImportedMaterial& material : scene.materials) {
    if (material.embedded < -1 || material.embedded >= std::ssize(scene.images)) {
      return DataLoss("material \"{}\" uses image {} of {}", material.name, material.embedded,
                      scene.images.size());
    }
  }
  return {};
}

}  // namespace

Bytes EncodeScene(const Result<ImportedScene>& scene) { return EncodeRecord(scene); }

Result<ImportedScene> DecodeScene(std::span<const std::uint8_t> bytes) {
  TILEGRAD_ASSIGN(ImportedScene scene, DecodeRecord<ImportedScene>(bytes));
  TILEGRAD_TRY(CheckScene(scene));
  return scene;
}

}  // namespace tilegrad::io
