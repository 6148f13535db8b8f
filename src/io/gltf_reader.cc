// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <glm/mat4x4.hpp>
#include <optional>

#include "base/error.h"
#include "io/gltf_model.h"
#include "io/image_file.h"
#include "io/mesh_readers.h"
#include "scene/shapes.h"
#include "scene/srgb.h"

namespace tilegrad::io {
namespace {

constexpr int kMaxNodeDepth = 256;   // the walk is recursive
constexpr int kMaxJsonNesting = 64;  // so is tinygltf's reading of "extras"

// Side files of a glTF are names relative to it.
struct SideFiles {
  const FileSource& source;
  std::string folder;  // with a trailing slash, or empty
};

bool SideExists(const std::string& name, void* user) {
  return static_cast<SideFiles*>(user)->source.Exists(name);
}
std::string SideExpand(const std::string& name, void*) { return name; }
bool SideRead(std::vector<unsigned char>* out, std::string* error, const std::string& name,
              void* user) {
  auto bytes = static_cast<SideFiles*>(user)->source.Read(name);
  if (!bytes.ok()) {
    *error += bytes.status().message();
    return false;
  }
  *out = std::move(bytes).value();
  return true;
}
bool SideWrite(std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
  return false;
}

// Keeps the encoded bytes of data URIs; images are decoded when a material asks for one. An image
// in a buffer view comes with a place that tinygltf has not checked: it is left alone until then.
bool KeepEncoded(tinygltf::Image* image, const int, std::string*, std::string*, int, int,
                 const unsigned char* bytes, int size, void*) {
  if (image->bufferView < 0) image->image.assign(bytes, bytes + size);
  return true;
}

struct GltfWalk {
  const tinygltf::Model& model;
  const FileSource& source;
  std::string name, place;
  LoadedMesh out;
  std::vector<std::optional<int>> textures;  // by glTF image
  std::vector<bool> visited;                 // by node

  Result<std::vector<std::uint32_t>> Indices(const tinygltf::Primitive& p, std::size_t vertices,
                                             const std::string& what);
  Result<Mesh> Convert(const tinygltf::Primitive& p, const std::string& what);
  Status AddPrimitive(const tinygltf::Primitive& p, const glm::mat4& m, const std::string& what);
  Material ConvertMaterial(int index);
  void AddCamera(const tinygltf::Node& node, const glm::mat4& m);
  void SetSampler(int texture, Material* material);
  int ImageTexture(int texture);
  int AddImage(const tinygltf::Image& image, int index);
  Status Visit(int node, const glm::mat4& parent, int depth);
};

// "my%20wood.png" -> "my wood.png"
std::string DecodePercent(const std::string& uri) {
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    int code = 0;
    const char* begin = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() &&
        std::from_chars(begin, begin + 2, code, 16).ptr == begin + 2) {
      out += static_cast<char>(code);
      i += 2;
    } else {
      out += uri[i];
    }
  }
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

Result<std::vector<std::uint32_t>> GltfWalk::Indices(const tinygltf::Primitive& p,
                                                     std::size_t vertices,
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

Result<Mesh> GltfWalk::Convert(const tinygltf::Primitive& p, const std::string& what) {
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
  TILEGRAD_ASSIGN(const auto indices, Indices(p, count, what));
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

int GltfWalk::ImageTexture(int texture) {
  if (texture < 0 || texture >= static_cast<int>(model.textures.size())) return -1;
  const int image = model.textures[texture].source;
  if (image < 0 || image >= static_cast<int>(model.images.size())) return -1;
  if (!textures[image]) textures[image] = AddImage(model.images[image], image);
  return *textures[image];
}

int GltfWalk::AddImage(const tinygltf::Image& image, int index) {
  std::string label = image.name.empty() ? fmt::format("image {}", index) : image.name;
  if (image.bufferView >= 0) {
    const auto bytes = GltfViewBytes(model, image.bufferView, label);
    return AddTexture(bytes.ok() ? DecodeImage(*bytes, label) : bytes.status(), label, out);
  }
  if (!image.image.empty()) return AddTexture(DecodeImage(image.image, label), label, out);
  return AddTexture(source, name, DecodePercent(image.uri), out);
}

void GltfWalk::SetSampler(int texture, Material* material) {
  if (texture < 0 || texture >= static_cast<int>(model.textures.size())) return;
  const int index = model.textures[texture].sampler;
  if (index < 0 || index >= static_cast<int>(model.samplers.size())) return;
  const tinygltf::Sampler& sampler = model.samplers[index];
  const int wrap = sampler.wrapS;
  if (wrap != sampler.wrapT) {
    out.warnings.push_back(fmt::format(
        "material \"{}\": its texture wraps differently in u and v; u's way is taken for both",
        material->name));
  }
  material->wrap = wrap == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? TextureWrap::kClamp
                   : wrap == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? TextureWrap::kMirror
                                                                   : TextureWrap::kRepeat;
  material->nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
}

Material GltfWalk::ConvertMaterial(int index) {
  Material material;
  material.base_color = glm::vec4(1);  // glTF's default
  if (index < 0 || index >= static_cast<int>(model.materials.size())) return material;
  const tinygltf::Material& from = model.materials[index];
  material.name = from.name;
  const auto& factor = from.pbrMetallicRoughness.baseColorFactor;
  for (std::size_t c = 0; c < 4 && c < factor.size(); ++c)
    material.base_color[static_cast<int>(c)] = static_cast<float>(factor[c]);
  material.base_color = LinearToSrgb(material.base_color);
  material.alpha_mode = from.alphaMode == "MASK"    ? AlphaMode::kMask
                        : from.alphaMode == "BLEND" ? AlphaMode::kBlend
                                                    : AlphaMode::kOpaque;
  if (material.alpha_mode == AlphaMode::kOpaque) material.base_color.a = 1;
  material.double_sided = from.doubleSided;
  material.unlit = from.extensions.count("KHR_materials_unlit") > 0;
  const tinygltf::TextureInfo& texture = from.pbrMetallicRoughness.baseColorTexture;
  material.base_color_texture = ImageTexture(texture.index);
  SetSampler(texture.index, &material);
  return material;
}

Status GltfWalk::AddPrimitive(const tinygltf::Primitive& p, const glm::mat4& m,
                              const std::string& what) {
  const bool triangles =
      p.mode == -1 || (p.mode >= TINYGLTF_MODE_TRIANGLES && p.mode <= TINYGLTF_MODE_TRIANGLE_FAN);
  if (!triangles) {
    out.warnings.push_back(fmt::format("{}: points or lines left out", what));
    return {};
  }
  TILEGRAD_ASSIGN(Mesh mesh, Convert(p, what));
  if (mesh.faces.empty()) return {};
  if (m != glm::mat4(1))
    Transform(mesh, {glm::vec3(m[0]), glm::vec3(m[1]), glm::vec3(m[2])}, glm::vec3(m[3]));
  const Status added = AppendWithMaterial(std::move(mesh), ConvertMaterial(p.material), out);
  return added.Within(what);
}

glm::mat4 LocalMatrix(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return glm::mat4(glm::make_mat4(node.matrix.data()));
  glm::dmat4 m(1);
  const auto& t = node.translation;
  const auto& r = node.rotation;
  const auto& s = node.scale;
  if (r.size() == 4) m = glm::mat4_cast(glm::normalize(glm::dquat(r[3], r[0], r[1], r[2])));
  if (s.size() == 3) {
    for (int c = 0; c < 3; ++c) m[c] *= s[static_cast<std::size_t>(c)];
  }
  if (t.size() == 3) m[3] = glm::dvec4(t[0], t[1], t[2], 1);
  return glm::mat4(m);
}

void GltfWalk::AddCamera(const tinygltf::Node& node, const glm::mat4& m) {
  if (node.camera < 0 || node.camera >= static_cast<int>(model.cameras.size())) return;
  const tinygltf::Camera& from = model.cameras[node.camera];
  const std::string label = from.name.empty() ? node.name : from.name;
  if (from.type != "perspective") {
    out.warnings.push_back(fmt::format("camera \"{}\" is orthographic: left out", label));
    return;
  }
  MeshFileCamera camera;
  camera.name = label;
  for (int i = 0; i < 16; ++i) camera.camera.node_to_world[i] = m[i % 4][i / 4];
  camera.camera.yfov = from.perspective.yfov;
  camera.camera.aspect_ratio = from.perspective.aspectRatio;
  camera.camera.znear = from.perspective.znear;
  out.cameras.push_back(std::move(camera));
}

Status GltfWalk::Visit(int index, const glm::mat4& parent, int depth) {
  if (depth > kMaxNodeDepth)
    return DataLoss("{}: nodes are nested more than {} deep", place, kMaxNodeDepth);
  if (index < 0 || index >= static_cast<int>(model.nodes.size()))
    return DataLoss("{}: node {} does not exist", place, index);
  // Nodes form trees: a second visit is a cycle, or shared children, whose number of paths may grow
  // without bound.
  if (visited[index])
    return DataLoss("{}: node {} is reached twice; nodes must form a tree", place, index);
  visited[index] = true;
  const tinygltf::Node& node = model.nodes[index];
  const glm::mat4 m = parent * LocalMatrix(node);
  AddCamera(node, m);
  if (node.mesh >= 0) {
    if (node.mesh >= static_cast<int>(model.meshes.size()))
      return DataLoss("{}: node {} names mesh {}, which does not exist", place, index, node.mesh);
    const auto& primitives = model.meshes[node.mesh].primitives;
    for (std::size_t i = 0; i < primitives.size(); ++i) {
      TILEGRAD_TRY(AddPrimitive(primitives[i], m,
                                fmt::format("{}: mesh {} primitive {}", place, node.mesh, i)));
    }
  }
  for (const int child : node.children) TILEGRAD_TRY(Visit(child, m, depth + 1));
  return {};
}

// The nodes of the default scene, or of the first one, or all that are nobody's child.
std::vector<int> RootNodes(const tinygltf::Model& model) {
  if (!model.scenes.empty()) {
    const bool valid =
        model.defaultScene >= 0 && model.defaultScene < static_cast<int>(model.scenes.size());
    return model.scenes[valid ? model.defaultScene : 0].nodes;
  }
  std::vector<bool> child(model.nodes.size(), false);
  for (const auto& node : model.nodes) {
    for (const int c : node.children) {
      if (c >= 0 && c < static_cast<int>(child.size())) child[c] = true;
    }
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < child.size(); ++i) {
    if (!child[i]) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

// The JSON text: the whole of a .gltf, the first chunk of a GLB whose length tinygltf checks.
std::string_view JsonPart(const Bytes& bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  constexpr std::size_t kGlbHeader = 20;
  if (!text.starts_with("glTF") || text.size() < kGlbHeader) return text;
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 12, sizeof(length));
  return text.substr(kGlbHeader, length);
}

constexpr std::array<std::string_view, 3> kRead = {"KHR_mesh_quantization", "KHR_texture_transform",
                                                   "KHR_materials_unlit"};
constexpr std::array<std::string_view, 2> kCompressions = {"KHR_draco_mesh_compression",
                                                           "EXT_meshopt_compression"};

Status Compressed(const std::string& place, std::string_view extension) {
  return DataLoss("{}: {} is not supported; save the file without compression", place, extension);
}

Status Parse(const Bytes& bytes, SideFiles& side, const std::string& place,
             tinygltf::Model* model) {
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks({SideExists, SideExpand, SideRead, SideWrite, &side});
  loader.SetImageLoader(KeepEncoded, nullptr);
  std::string error, warning;
  const bool binary = bytes.size() >= 4 && std::memcmp(bytes.data(), "glTF", 4) == 0;
  const auto size = static_cast<unsigned>(bytes.size());
  const bool ok =
      binary ? loader.LoadBinaryFromMemory(model, &error, &warning, bytes.data(), size, side.folder)
             : loader.LoadASCIIFromString(model, &error, &warning,
                                          reinterpret_cast<const char*>(bytes.data()), size,
                                          side.folder);
  if (ok) return {};
  // Accessors of compressed geometry have no buffer view, about which tinygltf complains.
  for (const std::string_view extension : kCompressions) {
    if (JsonPart(bytes).find(extension) != std::string_view::npos)
      return Compressed(place, extension);
  }
  while (!error.empty() && std::isspace(static_cast<unsigned char>(error.back()))) error.pop_back();
  return DataLoss("{}: not valid glTF: {}", place, error.empty() ? "no reason given" : error);
}

Status CheckNesting(std::string_view json, const std::string& place) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (quoted && c == '\\') {
      ++i;
    } else if (c == '"') {
      quoted = !quoted;
    } else if (!quoted && (c == '{' || c == '[')) {
      if (++depth > kMaxJsonNesting) {
        return DataLoss("{}: byte {} of its JSON: nested more than {} deep", place, i,
                        kMaxJsonNesting);
      }
    } else if (!quoted && (c == '}' || c == ']')) {
      --depth;
    }
  }
  return {};
}

// Compressed geometry is an error, other extensions that the file requires are warnings.
Status CheckVersion(const tinygltf::Model& model, const std::string& place, LoadedMesh& out) {
  if (!model.asset.version.starts_with("2."))
    return DataLoss("{}: glTF version \"{}\"; 2.x is read", place, model.asset.version);
  for (const std::string& name : model.extensionsRequired) {
    if (name == kCompressions[0] || name == kCompressions[1]) return Compressed(place, name);
    if (std::find(kRead.begin(), kRead.end(), name) == kRead.end())
      out.warnings.push_back(fmt::format("the extension {} is not read", name));
  }
  return {};
}

}  // namespace

Result<LoadedMesh> ReadGltf(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  const std::string place = source.Describe(name);
  if (bytes.size() > 0xFFFFFFFFu) return ResourceExhausted("{}: a glTF file above 4 GiB", place);
  const auto slash = name.find_last_of('/');
  SideFiles side{source, slash == std::string::npos ? "" : name.substr(0, slash)};
  TILEGRAD_TRY(CheckNesting(JsonPart(bytes), place));
  tinygltf::Model model;
  try {
    TILEGRAD_TRY(Parse(bytes, side, place, &model));
  } catch (const std::exception& error) {  // the JSON library throws on some type errors
    return DataLoss("{}: not valid glTF: {}", place, error.what());
  }
  GltfWalk walk{model,
                source,
                name,
                place,
                {},
                std::vector<std::optional<int>>(model.images.size()),
                std::vector<bool>(model.nodes.size())};
  TILEGRAD_TRY(CheckVersion(model, place, walk.out));
  for (const int root : RootNodes(model)) TILEGRAD_TRY(walk.Visit(root, glm::mat4(1), 0));
  return std::move(walk.out);
}

}  // namespace tilegrad::io
