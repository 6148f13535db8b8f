// SPDX-License-Identifier: Apache-2.0
// Converts primitives of glTF files to meshes; finds their base colour.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/gltf_model.h"

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

// An attribute that the primitive may lack: then empty.
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

// COLOR_0 has three or four components; alpha defaults to 1.
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
    out.emplace_back(from.Float(i, 0), from.Float(i, 1), from.Float(i, 2),
                     from.components() > 3 ? from.Float(i, 3) : 1.0f);
  }
  return out;
}

template <class Vec>
struct MorphedAttribute {
  std::string key;
  std::vector<Vec>* values;
  const std::string& what;
};

// Adds the weighted morph targets to one attribute: linear colours included.
template <class Vec>
Status Morph(const tinygltf::Model& model, const tinygltf::Primitive& p,
             std::span<const double> weights, const MorphedAttribute<Vec>& to) {
  if (to.values->empty()) return {};
  for (std::size_t t = 0; t < p.targets.size() && t < weights.size(); ++t) {
    const auto found = p.targets[t].find(to.key);
    if (weights[t] == 0 || found == p.targets[t].end()) continue;
    const std::string place = fmt::format("{}: target {}: {}", to.what, t, to.key);
    TILEGRAD_ASSIGN(const GltfAccessor from,
                    GltfAccessor::OpenAttribute(model, found->second, 0, place));
    const int length = std::min(from.components(), static_cast<int>(Vec::length()));
    if (from.count() != to.values->size())
      return DataLoss("{} has {} elements for {} vertices", place, from.count(), to.values->size());
    for (std::size_t i = 0; i < from.count(); ++i) {
      for (int c = 0; c < length; ++c)
        (*to.values)[i][c] +=
            static_cast<float>(weights[t] * static_cast<double>(from.Float(i, c)));
    }
  }
  return {};
}

// Geometry whose uncompressed copy was omitted from the file.
bool IsCompressed(const tinygltf::Model& model, const tinygltf::Primitive& p) {
  const int at = AttributeIndex(p, "POSITION");
  return p.extensions.count("KHR_draco_mesh_compression") > 0 && Has(model.accessors, at) &&
         model.accessors[at].bufferView < 0;
}

// The attributes of a primitive, morphed.
struct Attributes {
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> colors;  // as in the file, as uvs
  std::vector<glm::vec2> uvs;
};

Result<Attributes> ReadAttributes(const tinygltf::Model& model, const tinygltf::Primitive& p,
                                  const std::string& uv_key, const std::string& what) {
  Attributes out;
  if (AttributeIndex(p, "POSITION") < 0) return DataLoss("{}: no POSITION attribute", what);
  TILEGRAD_ASSIGN(out.positions, ReadAttribute<glm::vec3>(model, p, "POSITION", what));
  TILEGRAD_ASSIGN(out.normals, ReadAttribute<glm::vec3>(model, p, "NORMAL", what));
  TILEGRAD_ASSIGN(out.colors, ReadColors(model, p, what));
  TILEGRAD_ASSIGN(out.uvs, ReadAttribute<glm::vec2>(model, p, uv_key, what));
  const std::size_t count = out.positions.size();
  for (const auto& [key, got] :
       {std::pair("NORMAL", out.normals.size()), std::pair("COLOR_0", out.colors.size()),
        std::pair(uv_key.c_str(), out.uvs.size())}) {
    if (AttributeIndex(p, key) >= 0 && got != count)
      return DataLoss("{}: {} has {} elements for {} vertices", what, key, got, count);
  }
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
  if (!Has(model.materials, material)) return {};
  const tinygltf::Material& from = model.materials[material];
  const auto glossy = from.extensions.find("KHR_materials_pbrSpecularGlossiness");
  return glossy == from.extensions.end() ? OfMetallicRoughness(from.pbrMetallicRoughness)
                                         : OfSpecularGlossiness(glossy->second);
}

Result<Mesh> ConvertGltfPrimitive(const tinygltf::Model& model, const tinygltf::Primitive& p,
                                  std::span<const double> weights, const std::string& what) {
  if (IsCompressed(model, p)) return RefuseGltfCompression("KHR_draco_mesh_compression", what);
  const GltfUvUse uv_use = GltfBaseColorOf(model, p.material).uv;
  const std::string uv_key = uv_use.Key();
  TILEGRAD_ASSIGN(Attributes read, ReadAttributes(model, p, uv_key, what));
  TILEGRAD_TRY(Morph<glm::vec3>(model, p, weights, {"POSITION", &read.positions, what}));
  TILEGRAD_TRY(Morph<glm::vec3>(model, p, weights, {"NORMAL", &read.normals, what}));
  TILEGRAD_TRY(Morph<glm::vec4>(model, p, weights, {"COLOR_0", &read.colors, what}));
  TILEGRAD_TRY(Morph<glm::vec2>(model, p, weights, {uv_key, &read.uvs, what}));
  Mesh mesh;
  TILEGRAD_ASSIGN(const auto indices, ReadIndices(model, p, read.positions.size(), what));
  mesh.faces = Triangles(p.mode, indices);
  mesh.positions = std::move(read.positions);
  mesh.normals = std::move(read.normals);
  mesh.colors = std::move(read.colors);
  if (read.uvs.empty()) return mesh;
  for (const Face& face : mesh.faces) {  // glTF's v points down
    for (const std::int32_t v : face) {
      const glm::vec2 uv = uv_use(read.uvs[v]);
      mesh.corner_uvs.emplace_back(uv.x, 1.0f - uv.y);
    }
  }
  return mesh;
}

}  // namespace tilegrad::io
