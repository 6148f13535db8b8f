// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_primitive.h"

#include <cmath>
#include <utility>
#include <vector>

#include "base/error.h"
#include "scene/srgb.h"

namespace tilegrad::io {
namespace {

int AttributeIndex(const tinygltf::Primitive& p, const std::string& key) {
  const auto it = p.attributes.find(key);
  return it == p.attributes.end() ? -1 : it->second;
}

// Lists, strips and fans of triangles become lists.
std::vector<Face> Triangles(int mode, const std::vector<std::uint32_t>& indices) {
  std::vector<Face> faces;
  const auto at = [&](std::size_t i) { return static_cast<std::int32_t>(indices[i]); };
  const std::size_t n = indices.size();
  if (mode == TINYGLTF_MODE_TRIANGLES || mode == -1) {
    for (std::size_t i = 0; i + 2 < n; i += 3) faces.push_back({at(i), at(i + 1), at(i + 2)});
  } else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
    for (std::size_t i = 0; i + 2 < n; ++i)
      faces.push_back({at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)});
  } else if (mode == TINYGLTF_MODE_TRIANGLE_FAN) {
    for (std::size_t i = 1; i + 1 < n; ++i) faces.push_back({at(0), at(i), at(i + 1)});
  }
  return faces;
}

Result<std::vector<std::uint32_t>> ReadIndices(const tinygltf::Model& model,
                                               const tinygltf::Primitive& p, std::size_t vertices,
                                               const std::string& what) {
  std::vector<std::uint32_t> indices;
  if (p.indices < 0) {
    for (std::size_t i = 0; i < vertices; ++i) indices.push_back(static_cast<std::uint32_t>(i));
    return indices;
  }
  TILEGRAD_ASSIGN(const GltfAccessor accessor,
                  GltfAccessor::OpenIndices(model, p.indices, what + ": indices"));
  for (std::size_t i = 0; i < accessor.count(); ++i) {
    const std::uint32_t index = accessor.Index(i);
    if (index >= vertices)
      return DataLoss("{}: index {} is {}, but there are {} vertices", what, i, index, vertices);
    indices.push_back(index);
  }
  return indices;
}

// An attribute that the primitive may lack: then nothing.
template <class Vec>
Result<std::vector<Vec>> ReadAttribute(const tinygltf::Model& model, const tinygltf::Primitive& p,
                                       const std::string& key, const std::string& what) {
  std::vector<Vec> out;
  const int index = AttributeIndex(p, key);
  if (index < 0) return out;
  TILEGRAD_ASSIGN(const GltfAccessor from,
                  GltfAccessor::OpenAttribute(model, index, Vec::length(), what + ": " + key));
  out.resize(from.count());
  for (std::size_t i = 0; i < out.size(); ++i) {
    for (int c = 0; c < Vec::length(); ++c) out[i][c] = from.Float(i, c);
  }
  return out;
}

// COLOR_0 has three or four components; alpha is 1 where there is none.
Result<std::vector<glm::vec4>> ReadColors(const tinygltf::Model& model,
                                          const tinygltf::Primitive& p, const std::string& what) {
  std::vector<glm::vec4> out;
  const int index = AttributeIndex(p, "COLOR_0");
  if (index < 0) return out;
  TILEGRAD_ASSIGN(const GltfAccessor from,
                  GltfAccessor::OpenAttribute(model, index, 0, what + ": COLOR_0"));
  if (from.components() < 3 || from.components() > 4)
    return DataLoss("{}: COLOR_0 has {} numbers an element, not 3 or 4", what, from.components());
  for (std::size_t i = 0; i < from.count(); ++i) {
    out.push_back(LinearToSrgb({from.Float(i, 0), from.Float(i, 1), from.Float(i, 2),
                                from.components() > 3 ? from.Float(i, 3) : 1.0f}));
  }
  return out;
}

double NumberOf(const tinygltf::Value& object, const char* key, std::size_t index,
                double fallback) {
  if (!object.IsObject() || !object.Has(key)) return fallback;
  const tinygltf::Value& value = object.Get(key);
  const tinygltf::Value& number = value.IsArray() ? value.Get(index) : value;
  return number.IsNumber() ? number.GetNumberAsDouble() : fallback;
}

// Where the material's texture is looked up: the uv set, and KHR_texture_transform on it, in
// glTF's own coordinates (v down).
struct UvUse {
  int set = 0;
  glm::dvec2 offset{0}, scale{1};
  double rotation = 0;  // radians

  std::string Key() const { return fmt::format("TEXCOORD_{}", set); }
  glm::vec2 operator()(glm::vec2 uv) const {
    const double c = std::cos(rotation), s = std::sin(rotation);
    const glm::dvec2 p = scale * glm::dvec2(uv);
    return offset + glm::dvec2(c * p.x + s * p.y, c * p.y - s * p.x);
  }
};

UvUse UvUseOf(const tinygltf::Model& model, int material) {
  UvUse use;
  if (material < 0 || material >= static_cast<int>(model.materials.size())) return use;
  const auto& texture = model.materials[material].pbrMetallicRoughness.baseColorTexture;
  use.set = texture.texCoord;
  const auto found = texture.extensions.find("KHR_texture_transform");
  if (found == texture.extensions.end()) return use;
  const tinygltf::Value& t = found->second;
  const double set = NumberOf(t, "texCoord", 0, use.set);
  if (set >= 0 && set <= 255) use.set = static_cast<int>(set);
  use.offset = {NumberOf(t, "offset", 0, 0), NumberOf(t, "offset", 1, 0)};
  use.scale = {NumberOf(t, "scale", 0, 1), NumberOf(t, "scale", 1, 1)};
  use.rotation = NumberOf(t, "rotation", 0, 0);
  return use;
}

}  // namespace

Result<Mesh> ConvertGltfPrimitive(const tinygltf::Model& model, const tinygltf::Primitive& p,
                                  const std::string& what) {
  Mesh mesh;
  const UvUse uv_use = UvUseOf(model, p.material);
  const std::string uv_key = uv_use.Key();
  if (AttributeIndex(p, "POSITION") < 0) return DataLoss("{}: no POSITION attribute", what);
  TILEGRAD_ASSIGN(mesh.positions, ReadAttribute<glm::vec3>(model, p, "POSITION", what));
  TILEGRAD_ASSIGN(mesh.normals, ReadAttribute<glm::vec3>(model, p, "NORMAL", what));
  TILEGRAD_ASSIGN(mesh.colors, ReadColors(model, p, what));
  TILEGRAD_ASSIGN(const auto uvs, ReadAttribute<glm::vec2>(model, p, uv_key, what));
  const std::size_t count = mesh.positions.size();
  for (const auto& [key, got] :
       {std::pair("NORMAL", mesh.normals.size()), std::pair("COLOR_0", mesh.colors.size()),
        std::pair(uv_key.c_str(), uvs.size())}) {
    if (AttributeIndex(p, key) >= 0 && got != count)
      return DataLoss("{}: {} has {} elements for {} vertices", what, key, got, count);
  }
  TILEGRAD_ASSIGN(const auto indices, ReadIndices(model, p, count, what));
  mesh.faces = Triangles(p.mode, indices);
  if (uvs.empty()) return mesh;
  for (const Face& face : mesh.faces) {  // glTF's v points down
    for (const std::int32_t v : face) {
      const glm::vec2 uv = uv_use(uvs[v]);
      mesh.corner_uvs.emplace_back(uv.x, 1.0f - uv.y);
    }
  }
  return mesh;
}

}  // namespace tilegrad::io
