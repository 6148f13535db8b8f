// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <unordered_map>

#include "base/error.h"
#include "base/json_text.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/mesh_readers.h"
#include "scene/image.h"

namespace tilegrad::io {
namespace {

using Json = nlohmann::ordered_json;

// The binary chunk and the JSON that describes it.
struct GlbBuilder {
  static constexpr int kFloat = 5126, kUnsignedInt = 5125, kArrayBuffer = 34962,
                       kElementBuffer = 34963;

  Bytes binary;
  Json json = {{"asset", {{"version", "2.0"}, {"generator", "tilegrad"}}}};

  int AddView(const void* data, std::size_t bytes, int target) {
    while (binary.size() % 4 != 0) binary.push_back(0);
    Json view = {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes}};
    if (target != 0) view["target"] = target;
    const auto* begin = static_cast<const std::uint8_t*>(data);
    binary.insert(binary.end(), begin, begin + bytes);
    json["bufferViews"].push_back(std::move(view));
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }

  template <class Vec>
  int AddVectors(const std::vector<Vec>& values) {
    const int view = AddView(values.data(), values.size() * sizeof(Vec), kArrayBuffer);
    json["accessors"].push_back({{"bufferView", view},
                                 {"componentType", kFloat},
                                 {"count", values.size()},
                                 {"type", fmt::format("VEC{}", Vec::length())}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  int AddIndices(const std::vector<std::uint32_t>& values) {
    const int view = AddView(values.data(), values.size() * sizeof(std::uint32_t), kElementBuffer);
    json["accessors"].push_back({{"bufferView", view},
                                 {"componentType", kUnsignedInt},
                                 {"count", values.size()},
                                 {"type", "SCALAR"}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }
};

void AppendChunk(Bytes& out, const char type[5], const std::uint8_t* data, std::size_t size,
                 std::uint8_t padding) {
  const auto padded = static_cast<std::uint32_t>((size + 3) / 4 * 4);
  const auto* length = reinterpret_cast<const std::uint8_t*>(&padded);
  out.insert(out.end(), length, length + 4);
  out.insert(out.end(), type, type + 4);
  out.insert(out.end(), data, data + size);
  out.resize(out.size() + padded - size, padding);
}

// The file. ResourceExhausted beyond 4 GiB.
Result<Bytes> AssembleGlb(GlbBuilder& glb) {
  glb.json["buffers"] = Json::array({{{"byteLength", glb.binary.size()}}});
  // Names come from files and may not be UTF-8: replace what is not.
  const std::string text = DumpJson(glb.json);
  const std::size_t total =
      12 + 8 + (text.size() + 3) / 4 * 4 + 8 + (glb.binary.size() + 3) / 4 * 4;
  if (total > 0xFFFFFFFFu)
    return ResourceExhausted("a GLB file holds at most 4 GiB, this mesh needs {}", total);
  Bytes out = {'g', 'l', 'T', 'F', 2, 0, 0, 0};
  out.reserve(total);
  const auto total32 = static_cast<std::uint32_t>(total);
  const auto* length = reinterpret_cast<const std::uint8_t*>(&total32);
  out.insert(out.end(), length, length + 4);
  AppendChunk(out, "JSON", reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), ' ');
  AppendChunk(out, "BIN\0", glb.binary.data(), glb.binary.size(), 0);
  return out;
}

// The vertices of one primitive: corners with equal attributes share one.
struct Primitive {
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> colors;
  std::vector<glm::vec2> uvs;
  std::vector<std::uint32_t> indices;
};

class PrimitiveBuilder {
 public:
  explicit PrimitiveBuilder(const Mesh& mesh) : mesh_(mesh) {}

  void AddCorner(std::size_t face, int k) {
    const std::size_t corner = 3 * face + static_cast<std::size_t>(k);
    const std::int32_t vertex = mesh_.faces[face][static_cast<std::size_t>(k)];
    std::string key(reinterpret_cast<const char*>(&vertex), sizeof(vertex));
    if (!mesh_.corner_uvs.empty())
      key.append(reinterpret_cast<const char*>(&mesh_.corner_uvs[corner]), sizeof(glm::vec2));
    if (!mesh_.corner_normals.empty())
      key.append(reinterpret_cast<const char*>(&mesh_.corner_normals[corner]), sizeof(glm::vec3));
    if (!mesh_.corner_colors.empty())
      key.append(reinterpret_cast<const char*>(&mesh_.corner_colors[corner]), sizeof(glm::vec4));
    const auto [it, added] =
        seen_.try_emplace(std::move(key), static_cast<std::uint32_t>(out_.positions.size()));
    if (added) AddVertex(corner, vertex);
    out_.indices.push_back(it->second);
  }
  Primitive Take() { return std::move(out_); }

 private:
  void AddVertex(std::size_t corner, std::int32_t vertex) {
    out_.positions.push_back(mesh_.positions[vertex]);
    if (!mesh_.colors.empty()) out_.colors.push_back(SrgbToLinear(mesh_.colors[vertex]));
    if (!mesh_.corner_colors.empty())
      out_.colors.push_back(SrgbToLinear(mesh_.corner_colors[corner]));
    if (!mesh_.corner_normals.empty())
      out_.normals.push_back(mesh_.corner_normals[corner]);
    else if (!mesh_.normals.empty())
      out_.normals.push_back(mesh_.normals[vertex]);
    if (!mesh_.corner_uvs.empty())
      out_.uvs.emplace_back(mesh_.corner_uvs[corner].x, 1.0f - mesh_.corner_uvs[corner].y);
  }
  const Mesh& mesh_;
  Primitive out_;
  std::unordered_map<std::string, std::uint32_t> seen_;
};

std::vector<Primitive> SplitByMaterial(const Mesh& mesh) {
  const std::size_t count = std::max<std::size_t>(mesh.materials.size(), 1);
  std::vector<PrimitiveBuilder> builders(count, PrimitiveBuilder(mesh));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const std::size_t m =
        mesh.face_materials.empty() ? 0 : static_cast<std::size_t>(mesh.face_materials[f]);
    for (int k = 0; k < 3; ++k) builders[m].AddCorner(f, k);
  }
  std::vector<Primitive> out;
  for (auto& builder : builders) out.push_back(builder.Take());
  return out;
}

Json AddPrimitive(GlbBuilder& glb, const Primitive& p) {
  Json attributes;
  attributes["POSITION"] = glb.AddVectors(p.positions);
  glm::vec3 low = p.positions[0], high = low;
  for (const glm::vec3& q : p.positions) {
    low = glm::min(low, q);
    high = glm::max(high, q);
  }
  Json& accessor = glb.json["accessors"].back();
  accessor["min"] = {low.x, low.y, low.z};
  accessor["max"] = {high.x, high.y, high.z};
  if (!p.normals.empty()) attributes["NORMAL"] = glb.AddVectors(p.normals);
  if (!p.colors.empty()) attributes["COLOR_0"] = glb.AddVectors(p.colors);
  if (!p.uvs.empty()) attributes["TEXCOORD_0"] = glb.AddVectors(p.uvs);
  return {{"attributes", attributes}, {"indices", glb.AddIndices(p.indices)}};
}

// A glTF texture: an image and its sampler.
struct TextureUse {
  int image = 0;
  std::array<TextureWrap, 2> wrap = {TextureWrap::kRepeat, TextureWrap::kRepeat};  // as Material
  bool nearest = false;
  bool operator==(const TextureUse&) const = default;
};

TextureUse UseOf(const Material& m) { return {m.base_color_texture, m.wrap, m.nearest}; }

// One per image, as its first material uses it, then other uses of the same image.
std::vector<TextureUse> TextureUses(const Mesh& mesh) {
  std::vector<TextureUse> uses;
  for (int i = 0; i < static_cast<int>(mesh.textures.size()); ++i) {
    const auto user = std::find_if(mesh.materials.begin(), mesh.materials.end(),
                                   [i](const Material& m) { return m.base_color_texture == i; });
    uses.push_back(user == mesh.materials.end() ? TextureUse{.image = i} : UseOf(*user));
  }
  for (const Material& m : mesh.materials) {
    if (m.base_color_texture >= 0 && std::find(uses.begin(), uses.end(), UseOf(m)) == uses.end())
      uses.push_back(UseOf(m));
  }
  return uses;
}

const char* AlphaModeName(const Material& m) {
  if (m.alpha_mode == AlphaMode::kMask) return "MASK";
  return m.alpha_mode == AlphaMode::kBlend || m.base_color.a < 1 ? "BLEND" : "OPAQUE";
}

Json MaterialJson(const Material& m, const std::vector<TextureUse>& uses) {
  const glm::vec4 factor = SrgbToLinear(m.base_color);
  Json pbr = {{"baseColorFactor", {factor.r, factor.g, factor.b, factor.a}},
              {"metallicFactor", 0.0},
              {"roughnessFactor", 1.0}};
  if (m.base_color_texture >= 0) {
    const auto use = std::find(uses.begin(), uses.end(), UseOf(m));
    pbr["baseColorTexture"] = {{"index", use - uses.begin()}};
  }
  Json out = {{"name", m.name}, {"pbrMetallicRoughness", pbr}, {"doubleSided", m.double_sided}};
  if (const std::string mode = AlphaModeName(m); mode != "OPAQUE") out["alphaMode"] = mode;
  if (m.alpha_mode == AlphaMode::kMask) out["alphaCutoff"] = m.alpha_cutoff;
  if (m.unlit) out["extensions"] = {{"KHR_materials_unlit", Json::object()}};
  return out;
}

Status AddImages(GlbBuilder& glb, const Mesh& mesh) {
  for (const MeshTexture& texture : mesh.textures) {
    auto png = EncodePng(texture.image);
    if (!png.ok()) return png.status().Within("texture " + texture.name);
    const int view = glb.AddView(png->data(), png->size(), 0);
    glb.json["images"].push_back(
        {{"bufferView", view}, {"mimeType", "image/png"}, {"name", texture.name}});
  }
  return {};
}

Json SamplerJson(const TextureUse& use) {
  constexpr int kNearest = 9728, kLinear = 9729, kRepeat = 10497, kMirror = 33648, kClamp = 33071;
  const auto number = [](TextureWrap wrap) {
    return wrap == TextureWrap::kRepeat ? kRepeat : wrap == TextureWrap::kMirror ? kMirror : kClamp;
  };
  return {{"magFilter", use.nearest ? kNearest : kLinear},
          {"wrapS", number(use.wrap[0])},
          {"wrapT", number(use.wrap[1])}};
}

void AddTextures(GlbBuilder& glb, const std::vector<TextureUse>& uses) {
  for (const TextureUse& use : uses) {
    Json texture = {{"source", use.image}};
    if (use != TextureUse{.image = use.image}) {  // viewers' defaults suffice otherwise
      glb.json["samplers"].push_back(SamplerJson(use));
      texture["sampler"] = glb.json["samplers"].size() - 1;
    }
    glb.json["textures"].push_back(std::move(texture));
  }
}

void AddMaterials(GlbBuilder& glb, const Mesh& mesh) {
  const std::vector<TextureUse> uses = TextureUses(mesh);
  // Without a material viewers take glTF's default, which is metal: vertex colours would look
  // black.
  const Material plain{.name = "plain", .base_color = glm::vec4(1)};
  bool unlit = false;
  for (const Material& m : mesh.materials.empty() ? std::vector{plain} : mesh.materials) {
    glb.json["materials"].push_back(MaterialJson(m, uses));
    unlit |= m.unlit;
  }
  if (unlit) glb.json["extensionsUsed"] = {"KHR_materials_unlit"};
  AddTextures(glb, uses);
}

// Large numbers have no linear counterpart; JSON would write null, which readers take for white.
Status CheckLinearColors(const Mesh& mesh) {
  for (std::size_t m = 0; m < mesh.materials.size(); ++m) {
    if (IsFinite(SrgbToLinear(mesh.materials[m].base_color))) continue;
    return InvalidArgument("materials[{}] (\"{}\"): base_color is too large for a GLB file", m,
                           mesh.materials[m].name);
  }
  for (std::size_t v = 0; v < mesh.colors.size(); ++v) {
    if (IsFinite(SrgbToLinear(mesh.colors[v]))) continue;
    return InvalidArgument("colors[{}] is too large for a GLB file", v);
  }
  return {};
}

// A node whose z axis points to the sun: lights shine along -z. An illuminance of pi makes a white
// surface look white.
Status AddSun(GlbBuilder& glb, const glm::dvec3& sun) {
  if (!(glm::length(sun) > 0) || !std::isfinite(glm::length(sun)))
    return InvalidArgument("the direction of the sun is ({}, {}, {})", sun.x, sun.y, sun.z);
  const glm::dvec3 to = sun / glm::length(sun);
  // Half-way quaternion from (0, 0, 1); for the opposite direction half a turn about x.
  glm::dvec4 q(-to.y, to.x, 0, 1 + to.z);
  q = glm::dot(q, q) < 1e-12 ? glm::dvec4(1, 0, 0, 0) : q / glm::length(q);
  const Json light = {{"type", "directional"}, {"intensity", std::numbers::pi}, {"name", "sun"}};
  glb.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({light});
  glb.json["extensionsUsed"].push_back("KHR_lights_punctual");
  glb.json["nodes"].push_back({{"name", "sun"},
                               {"rotation", {q.x, q.y, q.z, q.w}},
                               {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  glb.json["scenes"][0]["nodes"].push_back(1);
  return {};
}

Status AddScene(GlbBuilder& glb, const Mesh& mesh, const glm::dvec3& origin) {
  TILEGRAD_TRY(Validate(mesh));
  TILEGRAD_TRY(CheckLinearColors(mesh));
  if (mesh.faces.empty()) return InvalidArgument("the mesh has no faces");
  glb.json["scene"] = 0;
  glb.json["scenes"] = Json::array({{{"nodes", {0}}}});
  glb.json["nodes"] = Json::array({{{"mesh", 0}}});
  if (origin != glm::dvec3(0)) glb.json["nodes"][0]["translation"] = {origin.x, origin.y, origin.z};
  Json primitives = Json::array();
  const std::vector<Primitive> parts = SplitByMaterial(mesh);
  for (std::size_t m = 0; m < parts.size(); ++m) {
    if (parts[m].indices.empty()) continue;
    Json primitive = AddPrimitive(glb, parts[m]);
    primitive["material"] = m;
    primitives.push_back(std::move(primitive));
  }
  glb.json["meshes"] = Json::array({{{"primitives", primitives}}});
  AddMaterials(glb, mesh);
  return AddImages(glb, mesh);
}

}  // namespace

Result<Bytes> EncodeGlb(const Mesh& mesh, const GlbOptions& options) {
  GlbBuilder glb;
  TILEGRAD_TRY(AddScene(glb, mesh, options.origin));
  if (options.sun) TILEGRAD_TRY(AddSun(glb, *options.sun));
  return AssembleGlb(glb);
}

Status SaveGlb(const Path& path, const Mesh& mesh, const GlbOptions& options) {
  TILEGRAD_ASSIGN(const Bytes bytes, EncodeGlb(mesh, options));
  return WriteFileAtomic(path, bytes);
}

}  // namespace tilegrad::io
