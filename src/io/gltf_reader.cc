// SPDX-License-Identifier: Apache-2.0
#include <cstring>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <glm/mat4x4.hpp>
#include <optional>

#include "base/error.h"
#include "io/image_file.h"
#include "io/mesh_readers.h"
#include "scene/shapes.h"

// Compiled in here: the layout of its classes depends on macros, and Debian's shared library was
// built with others.
#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <tiny_gltf.h>
#pragma GCC diagnostic pop

namespace tilegrad::io {
namespace {

constexpr int kMaxNodeDepth = 256;  // deeper is a cycle or an attack

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

// Keeps the encoded bytes; images are decoded when a material asks for one.
bool KeepEncoded(tinygltf::Image* image, const int, std::string*, std::string*, int, int,
                 const unsigned char* bytes, int size, void*) {
  image->image.assign(bytes, bytes + size);
  return true;
}

// The elements of an accessor, converted to float; every read is checked against the buffer before.
class Accessor {
 public:
  static Result<Accessor> Open(const tinygltf::Model& model, int index, int components,
                               const std::string& what) {
    if (index < 0 || index >= static_cast<int>(model.accessors.size()))
      return DataLoss("{}: accessor {} does not exist", what, index);
    const tinygltf::Accessor& a = model.accessors[index];
    if (a.sparse.isSparse)
      return DataLoss("{}: sparse accessors are not supported; save the file without them", what);
    const int got = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(a.type));
    if (components > 0 && got != components)
      return DataLoss("{}: expected {} numbers an element, got {}", what, components, got);
    if (a.bufferView < 0 || a.bufferView >= static_cast<int>(model.bufferViews.size())) {
      return DataLoss("{}: accessor {} has no buffer view", what, index);
    }
    const tinygltf::BufferView& view = model.bufferViews[a.bufferView];
    if (view.buffer < 0 || view.buffer >= static_cast<int>(model.buffers.size()))
      return DataLoss("{}: buffer {} does not exist", what, view.buffer);
    const auto& buffer = model.buffers[view.buffer].data;
    const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(a.componentType));
    const int stride = a.ByteStride(view);
    if (size <= 0 || got <= 0 || stride <= 0)
      return DataLoss("{}: component type {} is not valid", what, a.componentType);
    const std::size_t element = static_cast<std::size_t>(size) * got,
                      begin = a.byteOffset + view.byteOffset;
    std::size_t span = 0, end = 0;
    if (a.count > 0 &&
        (__builtin_mul_overflow(a.count - 1, static_cast<std::size_t>(stride), &span) ||
         __builtin_add_overflow(span, begin + element, &end) || end > buffer.size())) {
      return DataLoss("{}: accessor {} reaches beyond its buffer of {} bytes", what, index,
                      buffer.size());
    }
    return Accessor{buffer.data() + begin, a.count,     stride, size, got,
                    a.componentType,       a.normalized};
  }

  std::size_t count() const { return count_; }
  int components() const { return components_; }

  float Float(std::size_t element, int component) const {
    const unsigned char* at =
        data_ + element * stride_ + static_cast<std::size_t>(component) * size_;
    switch (type_) {
      case TINYGLTF_COMPONENT_TYPE_FLOAT:
        return Read<float>(at);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return Scaled(*at, 255);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return Scaled(Read<std::uint16_t>(at), 65535);
      case TINYGLTF_COMPONENT_TYPE_BYTE:
        return std::max(-1.0f, Scaled(Read<std::int8_t>(at), 127));
      case TINYGLTF_COMPONENT_TYPE_SHORT:
        return std::max(-1.0f, Scaled(Read<std::int16_t>(at), 32767));
      default:
        return static_cast<float>(Integer(element));
    }
  }

  std::uint64_t Integer(std::size_t element) const {
    const unsigned char* at = data_ + element * stride_;
    switch (type_) {
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return *at;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return Read<std::uint16_t>(at);
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        return Read<std::uint32_t>(at);
      default:
        return ~std::uint64_t{0};  // not an index type: out of range for every mesh
    }
  }

 private:
  Accessor(const unsigned char* data, std::size_t count, int stride, int size, int components,
           int type, bool normalized)
      : data_(data),
        count_(count),
        stride_(static_cast<std::size_t>(stride)),
        size_(static_cast<std::size_t>(size)),
        components_(components),
        type_(type),
        normalized_(normalized) {}

  template <class T>
  static T Read(const unsigned char* at) {
    T value;
    std::memcpy(&value, at, sizeof(T));
    return value;
  }
  float Scaled(float value, float largest) const { return normalized_ ? value / largest : value; }

  const unsigned char* data_;
  std::size_t count_, stride_, size_;
  int components_, type_;
  bool normalized_;
};

struct GltfWalk {
  const tinygltf::Model& model;
  const FileSource& source;
  std::string name, place;
  LoadedMesh out;
  std::vector<std::optional<int>> textures;  // by glTF image

  Result<std::vector<std::uint32_t>> Indices(const tinygltf::Primitive& p, std::size_t vertices,
                                             const std::string& what);
  Result<Mesh> Convert(const tinygltf::Primitive& p, const std::string& what);
  Status AddPrimitive(const tinygltf::Primitive& p, const glm::mat4& m, const std::string& what);
  Material ConvertMaterial(int index);
  int ImageTexture(int texture);
  Status Visit(int node, const glm::mat4& parent, int depth);
};

int AttributeIndex(const tinygltf::Primitive& p, const char* key) {
  const auto it = p.attributes.find(key);
  return it == p.attributes.end() ? -1 : it->second;
}

// Lists, strips and fans of triangles become lists.
Result<std::vector<Face>> Triangles(int mode, const std::vector<std::uint32_t>& indices) {
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
  TILEGRAD_ASSIGN(const Accessor accessor, Accessor::Open(model, p.indices, 1, what + ": indices"));
  for (std::size_t i = 0; i < accessor.count(); ++i) {
    const std::uint64_t index = accessor.Integer(i);
    if (index >= vertices)
      return DataLoss("{}: index {} is {}, but there are {} vertices", what, i, index, vertices);
    indices.push_back(static_cast<std::uint32_t>(index));
  }
  return indices;
}

Result<Mesh> GltfWalk::Convert(const tinygltf::Primitive& p, const std::string& what) {
  Mesh mesh;
  TILEGRAD_ASSIGN(const Accessor positions,
                  Accessor::Open(model, AttributeIndex(p, "POSITION"), 3, what + ": POSITION"));
  const std::size_t count = positions.count();
  for (std::size_t i = 0; i < count; ++i)
    mesh.positions.emplace_back(positions.Float(i, 0), positions.Float(i, 1),
                                positions.Float(i, 2));
  TILEGRAD_ASSIGN(const auto indices, Indices(p, count, what));
  TILEGRAD_ASSIGN(mesh.faces, Triangles(p.mode, indices));
  if (const int a = AttributeIndex(p, "NORMAL"); a >= 0) {
    TILEGRAD_ASSIGN(const Accessor normals, Accessor::Open(model, a, 3, what + ": NORMAL"));
    if (normals.count() != count)
      return DataLoss("{}: {} normals for {} vertices", what, normals.count(), count);
    for (std::size_t i = 0; i < count; ++i)
      mesh.normals.emplace_back(normals.Float(i, 0), normals.Float(i, 1), normals.Float(i, 2));
  }
  if (const int a = AttributeIndex(p, "COLOR_0"); a >= 0) {
    TILEGRAD_ASSIGN(const Accessor colors, Accessor::Open(model, a, 0, what + ": COLOR_0"));
    if (colors.count() != count || colors.components() < 3)
      return DataLoss("{}: COLOR_0 does not fit {} vertices", what, count);
    for (std::size_t i = 0; i < count; ++i) {
      mesh.colors.emplace_back(colors.Float(i, 0), colors.Float(i, 1), colors.Float(i, 2),
                               colors.components() > 3 ? colors.Float(i, 3) : 1.0f);
    }
  }
  if (const int a = AttributeIndex(p, "TEXCOORD_0"); a >= 0) {
    TILEGRAD_ASSIGN(const Accessor uvs, Accessor::Open(model, a, 2, what + ": TEXCOORD_0"));
    if (uvs.count() != count)
      return DataLoss("{}: {} uv for {} vertices", what, uvs.count(), count);
    for (const Face& face : mesh.faces) {  // glTF's v points down
      for (const std::int32_t v : face)
        mesh.corner_uvs.emplace_back(uvs.Float(v, 0), 1.0f - uvs.Float(v, 1));
    }
  }
  return mesh;
}

int GltfWalk::ImageTexture(int texture) {
  if (texture < 0 || texture >= static_cast<int>(model.textures.size())) return -1;
  const int image = model.textures[texture].source;
  if (image < 0 || image >= static_cast<int>(model.images.size())) return -1;
  if (!textures[image]) {
    const tinygltf::Image& from = model.images[image];
    const std::string label = !from.uri.empty()    ? from.uri
                              : !from.name.empty() ? from.name
                                                   : fmt::format("image {}", image);
    textures[image] = from.image.empty() ? AddTexture(source, name, label, out)
                                         : AddTexture(DecodeImage(from.image, label), label, out);
  }
  return *textures[image];
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
  if (from.alphaMode.empty() || from.alphaMode == "OPAQUE") material.base_color.a = 1;
  material.base_color_texture = ImageTexture(from.pbrMetallicRoughness.baseColorTexture.index);
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
  AppendWithMaterial(mesh, ConvertMaterial(p.material), out);
  return {};
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

Status GltfWalk::Visit(int index, const glm::mat4& parent, int depth) {
  if (depth > kMaxNodeDepth)
    return DataLoss("{}: nodes are nested more than {} deep (a cycle?)", place, kMaxNodeDepth);
  if (index < 0 || index >= static_cast<int>(model.nodes.size()))
    return DataLoss("{}: node {} does not exist", place, index);
  const tinygltf::Node& node = model.nodes[index];
  const glm::mat4 m = parent * LocalMatrix(node);
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
  while (!error.empty() && std::isspace(static_cast<unsigned char>(error.back()))) error.pop_back();
  return DataLoss("{}: not valid glTF: {}", place, error.empty() ? "no reason given" : error);
}

}  // namespace

Result<LoadedMesh> ReadGltf(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  const std::string place = source.Describe(name);
  if (bytes.size() > 0xFFFFFFFFu) return ResourceExhausted("{}: a glTF file above 4 GiB", place);
  const auto slash = name.find_last_of('/');
  SideFiles side{source, slash == std::string::npos ? "" : name.substr(0, slash)};
  tinygltf::Model model;
  try {
    TILEGRAD_TRY(Parse(bytes, side, place, &model));
  } catch (const std::exception& error) {  // the JSON library throws on some type errors
    return DataLoss("{}: not valid glTF: {}", place, error.what());
  }
  GltfWalk walk{model, source, name,
                place, {},     std::vector<std::optional<int>>(model.images.size())};
  for (const int root : RootNodes(model)) TILEGRAD_TRY(walk.Visit(root, glm::mat4(1), 0));
  return std::move(walk.out);
}

}  // namespace tilegrad::io
