// SPDX-License-Identifier: Apache-2.0
// Converts primitives of glTF files to meshes; finds their base colour.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/json_text.h"
#include "base/text.h"
#include "io/gltf_model.h"
#include "io/mesh_readers.h"

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
    if (from.count() != to.values->size()) {
      return DataLoss("{} has {} elements for {} vertices", place, from.count(), to.values->size());
    }
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
  return p.extensions.count("KHR_draco_mesh_compression") > 0 && at >= 0 &&
         at < static_cast<int>(model.accessors.size()) && model.accessors[at].bufferView < 0;
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
  if (material < 0 || material >= static_cast<int>(model.materials.size())) return {};
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

// Reads a glTF or GLB file, with its buffers, as tinygltf's model.

namespace {

constexpr int kMaxJsonNesting = 64;  // tinygltf's reading of "extras" is recursive

using ParsedJson = nlohmann::json;

std::uint64_t CountOf(const ParsedJson& object, const char* key) {
  const auto count = object.find(key);
  return count != object.end() && count->is_number_unsigned() ? count->get<std::uint64_t>() : 0;
}

// The buffers of a glTF in separate files. tinygltf decodes names by its own rules ("+" means a
// space) and refuses a file longer than its buffer; so it gets the files in the order in which it
// requests them, which is that of the buffers.
class BufferFiles {
 public:
  BufferFiles(const FileSource& source, const std::string& gltf_name, const ParsedJson& document)
      : source_(source), gltf_name_(gltf_name) {
    const auto buffers = document.find("buffers");
    if (buffers == document.end() || !buffers->is_array()) return;
    for (const ParsedJson& buffer : *buffers) {
      const auto uri = buffer.find("uri");
      if (uri == buffer.end() || !uri->is_string()) continue;
      const auto& text = uri->get_ref<const std::string&>();
      if (text.empty() || tinygltf::IsDataURI(text)) continue;  // it reads those itself
      files_.push_back({text, CountOf(buffer, "byteLength")});
    }
  }

  tinygltf::FsCallbacks Callbacks() { return {Exists, Expand, Read, Write, this}; }
  // Why the last file could not be read.
  const Status& status() const { return status_; }

 private:
  struct File {
    std::string uri;
    std::uint64_t length;  // of the buffer
  };

  Result<Bytes> Next() {
    if (next_ == files_.size()) return InternalError("tinygltf asks for a file that nobody named");
    const File& file = files_[next_++];
    const auto name = FindByUri(source_, gltf_name_, file.uri);
    if (!name) return NotFound("there is no file \"{}\"", DecodePercent(file.uri.substr(0, 200)));
    TILEGRAD_ASSIGN(Bytes bytes, source_.Read(*name));
    if (bytes.size() < file.length) {
      return DataLoss("{} has {} bytes, its buffer {}", source_.Describe(*name), bytes.size(),
                      file.length);
    }
    bytes.resize(file.length);
    return bytes;
  }

  static bool Exists(const std::string&, void*) { return true; }
  static std::string Expand(const std::string& name, void*) { return name; }
  static bool Read(std::vector<unsigned char>* out, std::string*, const std::string&, void* user) {
    auto& files = *static_cast<BufferFiles*>(user);
    auto bytes = files.Next();
    files.status_ = bytes.status();
    if (bytes.ok()) *out = std::move(bytes).value();
    return bytes.ok();
  }
  static bool Write(std::string*, const std::string&, const std::vector<unsigned char>&, void*) {
    return false;
  }

  const FileSource& source_;
  const std::string& gltf_name_;
  std::vector<File> files_;
  std::size_t next_ = 0;
  Status status_;
};

// Keeps the encoded bytes of data URIs; images are decoded when a material needs them. tinygltf has
// not checked the position of an image in a buffer view: it is left alone until then.
bool KeepEncoded(tinygltf::Image* image, const int, std::string*, std::string*, int, int,
                 const unsigned char* bytes, int size, void*) {
  if (image->bufferView < 0) image->image.assign(bytes, bytes + size);
  return true;
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

Status Parse(const Bytes& bytes, BufferFiles& files, const std::string& place,
             tinygltf::Model* model) {
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(files.Callbacks());
  loader.SetImageLoader(KeepEncoded, nullptr);
  std::string error, warning;
  const bool binary = bytes.size() >= 4 && std::memcmp(bytes.data(), "glTF", 4) == 0;
  const auto size = static_cast<unsigned>(bytes.size());
  const bool ok =
      binary ? loader.LoadBinaryFromMemory(model, &error, &warning, bytes.data(), size)
             : loader.LoadASCIIFromString(model, &error, &warning,
                                          reinterpret_cast<const char*>(bytes.data()), size, "");
  if (ok) return {};
  TILEGRAD_TRY(files.status().Within(place + ": a buffer"));
  // Accessors of compressed geometry have no buffer view, about which tinygltf complains.
  const std::string_view compression = GltfCompression(JsonPart(bytes));
  if (!compression.empty()) return RefuseGltfCompression(compression, place);
  while (!error.empty() && std::isspace(static_cast<unsigned char>(error.back()))) error.pop_back();
  constexpr std::size_t kMost = 300;  // it may quote a whole buffer
  if (error.size() > kMost) error.replace(kMost, std::string::npos, "...");
  return DataLoss("{}: not valid glTF: {}", place, error.empty() ? "no reason given" : error);
}

Status CheckNesting(std::string_view json, const std::string& place) {
  const std::size_t at = FirstNestedDeeper(json, kMaxJsonNesting);
  if (at == std::string_view::npos) return {};
  return DataLoss("{}: byte {} of its JSON: nested more than {} deep", place, at, kMaxJsonNesting);
}

// The members of `list` in the document that an index of `object` names; null if there is none.
const ParsedJson* Referred(const ParsedJson& document, const char* list, const ParsedJson& object,
                           const char* key) {
  const auto index = object.find(key);
  const auto entries = document.find(list);
  if (index == object.end() || !index->is_number_integer() || entries == document.end() ||
      !entries->is_array()) {
    return nullptr;
  }
  const int i = static_cast<int>(index->get<std::int64_t>());  // as tinygltf takes it
  return i >= 0 && static_cast<std::size_t>(i) < entries->size() ? &(*entries)[i] : nullptr;
}

// tinygltf takes the address of an image's first byte in its buffer before it calls KeepEncoded,
// even if the buffer ends earlier: a standard library with index checks aborts there. tinygltf
// finds all other errors before.
Status CheckImages(const ParsedJson& document, const std::string& place) {
  const auto images = document.find("images");
  if (images == document.end() || !images->is_array()) return {};
  for (std::size_t i = 0; i < images->size(); ++i) {
    const ParsedJson* const view = Referred(document, "bufferViews", (*images)[i], "bufferView");
    const ParsedJson* const buffer =
        view ? Referred(document, "buffers", *view, "buffer") : nullptr;
    if (buffer == nullptr) continue;
    const std::uint64_t begin = CountOf(*view, "byteOffset"), size = CountOf(*buffer, "byteLength");
    if (begin >= size) {
      return DataLoss("{}: image {}: its buffer view begins at byte {} of a buffer of {} bytes",
                      place, i, begin, size);
    }
  }
  return {};
}

Status CheckVersion(const std::string& place, const tinygltf::Model& model) {
  // A reader of 2.0 reads all 2.x files unless they say that 2.0 is not enough.
  const std::string& least = model.asset.minVersion;
  if (!model.asset.version.starts_with("2.") || (!least.empty() && least != "2.0")) {
    return DataLoss("{}: glTF version \"{}\"; 2.0 is read", place,
                    least.empty() ? model.asset.version : least);
  }
  return {};
}

}  // namespace

Result<GltfDocument> ReadGltfDocument(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  const std::string place = source.Describe(name);
  if (bytes.size() > 0xFFFFFFFFu) return ResourceExhausted("{}: a glTF file above 4 GiB", place);
  const std::string_view text = JsonPart(bytes);
  TILEGRAD_TRY(CheckNesting(text, place));
  GltfDocument document;
  try {
    const ParsedJson json = ParseJsonOrDiscard(text);
    TILEGRAD_TRY(CheckImages(json, place));
    BufferFiles files(source, name, json);
    TILEGRAD_TRY(Parse(bytes, files, place, &document.model));
  } catch (const std::bad_alloc&) {
    throw;                                 // not the file's fault
  } catch (const std::exception& error) {  // the JSON library throws on some type errors
    return DataLoss("{}: not valid glTF: {}", place, error.what());
  }
  TILEGRAD_TRY(CheckVersion(place, document.model));
  TILEGRAD_TRY(CheckGltfExtensions(document.model, place, &document.warnings));
  return document;
}

}  // namespace tilegrad::io
