// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_material.h"

#include <cmath>

#include "base/error.h"

namespace tilegrad::io {
namespace {

// A number of an extension, or one of an array of them.
double NumberOf(const tinygltf::Value& object, const char* key, std::size_t index,
                double fallback) {
  if (!object.IsObject() || !object.Has(key)) return fallback;
  const tinygltf::Value& value = object.Get(key);
  const tinygltf::Value& number = value.IsArray() ? value.Get(index) : value;
  return number.IsNumber() ? number.GetNumberAsDouble() : fallback;
}

int IndexOf(const tinygltf::Value& object, const char* key, int fallback) {
  const double index = NumberOf(object, key, 0, fallback);
  return index >= 0 && index < 0x1p31 ? static_cast<int>(index) : fallback;
}

void ReadTransform(const tinygltf::Value& t, GltfUvUse* use) {
  use->set = IndexOf(t, "texCoord", use->set);
  use->offset = {NumberOf(t, "offset", 0, 0), NumberOf(t, "offset", 1, 0)};
  use->scale = {NumberOf(t, "scale", 0, 1), NumberOf(t, "scale", 1, 1)};
  use->rotation = NumberOf(t, "rotation", 0, 0);
}

constexpr const char* kTransform = "KHR_texture_transform";

GltfBaseColor OfMetallicRoughness(const tinygltf::PbrMetallicRoughness& pbr) {
  GltfBaseColor out;
  for (std::size_t c = 0; c < 4 && c < pbr.baseColorFactor.size(); ++c)
    out.factor[static_cast<int>(c)] = pbr.baseColorFactor[c];
  out.texture = pbr.baseColorTexture.index;
  out.uv.set = pbr.baseColorTexture.texCoord;
  const auto found = pbr.baseColorTexture.extensions.find(kTransform);
  if (found != pbr.baseColorTexture.extensions.end()) ReadTransform(found->second, &out.uv);
  return out;
}

GltfBaseColor OfSpecularGlossiness(const tinygltf::Value& pbr) {
  GltfBaseColor out;
  for (int c = 0; c < 4; ++c)
    out.factor[c] = NumberOf(pbr, "diffuseFactor", static_cast<std::size_t>(c), 1);
  if (!pbr.IsObject() || !pbr.Has("diffuseTexture")) return out;
  const tinygltf::Value& texture = pbr.Get("diffuseTexture");
  out.texture = IndexOf(texture, "index", -1);
  out.uv.set = IndexOf(texture, "texCoord", 0);
  if (!texture.IsObject() || !texture.Has("extensions")) return out;
  const tinygltf::Value& extensions = texture.Get("extensions");
  if (extensions.IsObject() && extensions.Has(kTransform))
    ReadTransform(extensions.Get(kTransform), &out.uv);
  return out;
}

}  // namespace

std::string GltfUvUse::Key() const { return fmt::format("TEXCOORD_{}", set); }

glm::vec2 GltfUvUse::operator()(glm::vec2 uv) const {
  const double c = std::cos(rotation), s = std::sin(rotation);
  const glm::dvec2 p = scale * glm::dvec2(uv);
  return offset + glm::dvec2(c * p.x + s * p.y, c * p.y - s * p.x);
}

GltfBaseColor GltfBaseColorOf(const tinygltf::Model& model, int material) {
  if (material < 0 || material >= static_cast<int>(model.materials.size())) return {};
  const tinygltf::Material& from = model.materials[material];
  const auto glossy = from.extensions.find("KHR_materials_pbrSpecularGlossiness");
  return glossy == from.extensions.end() ? OfMetallicRoughness(from.pbrMetallicRoughness)
                                         : OfSpecularGlossiness(glossy->second);
}

}  // namespace tilegrad::io
