// SPDX-License-Identifier: Apache-2.0
#define TINYGLTF_IMPLEMENTATION
#include "io/gltf_model.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>

#include "base/error.h"
#include "base/json_text.h"
#include "base/text.h"
#include "io/mesh_readers.h"

namespace tilegrad::io {
namespace {

template <class T>
T Read(const unsigned char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return value;
}

constexpr int kNone = -1;
// An accessor without a buffer view costs no bytes of its file.
constexpr std::size_t kMostZeros = std::size_t{1} << 24;
constexpr std::array<unsigned char, 16 * 8> kZeros = {};  // one element

using Names = std::span<const std::string_view>;

constexpr std::string_view kRead[] = {"KHR_mesh_quantization", "KHR_texture_transform",
                                      "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness"};
// Reads geometry that also exists uncompressed; else refuses the file when its bytes are requested.
constexpr std::string_view kCompressions[] = {"KHR_draco_mesh_compression",
                                              "EXT_meshopt_compression"};
// Images in other formats. A texture's own image is used instead if it has one.
constexpr std::string_view kImages[] = {"EXT_texture_webp", "KHR_texture_basisu",
                                        "EXT_texture_avif", "MSFT_texture_dds"};
// They do not change the picture at rest.
constexpr std::string_view kUnseen[] = {"KHR_materials_variants",
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
                                        "KHR_node_hoverability"};

bool IsIn(Names names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Reflectance and lights: the picture changes, but the object is the file's.
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

// The extension with which the JSON compresses geometry; empty if none.
std::string_view GltfCompression(std::string_view json) {
  for (const std::string_view extension : kCompressions) {
    if (json.find(extension) != std::string_view::npos) return extension;
  }
  return {};
}

// DataLoss if the file requires an extension without which it cannot be drawn. One warning names
// the other extensions that are ignored and would change the picture.
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
  warnings->push_back(
      fmt::format("the file uses {}, which is not read: other viewers may show it differently",
                  fmt::join(unread, ", ")));
  return {};
}

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
  return Has(*entries, i) ? &(*entries)[i] : nullptr;
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

Status RefuseGltfCompression(std::string_view extension, const std::string& place) {
  return DataLoss("{}: {} is not supported; save the file without compression", place, extension);
}

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

std::string GltfImageExtension(const tinygltf::Texture& texture) {
  if (texture.source >= 0) return {};
  for (const auto& [name, value] : texture.extensions) {
    if (IsIn(kImages, name)) return name;
  }
  return {};
}

Result<std::span<const unsigned char>> GltfViewBytes(const tinygltf::Model& model, int view,
                                                     const std::string& what) {
  if (!Has(model.bufferViews, view))
    return DataLoss("{}: buffer view {} does not exist", what, view);
  const tinygltf::BufferView& v = model.bufferViews[view];
  if (!Has(model.buffers, v.buffer))
    return DataLoss("{}: buffer {} does not exist", what, v.buffer);
  const auto& data = model.buffers[v.buffer].data;
  if (model.buffers[v.buffer].extensions.count("EXT_meshopt_compression") > 0)
    return RefuseGltfCompression("EXT_meshopt_compression", what);
  if (v.byteOffset > data.size() || v.byteLength > data.size() - v.byteOffset) {
    return DataLoss("{}: buffer view {} ({} bytes from {}) reaches beyond its buffer of {} bytes",
                    what, view, v.byteLength, v.byteOffset, data.size());
  }
  return std::span(data).subspan(v.byteOffset, v.byteLength);
}

// An accessor without its sparse part.
Result<GltfAccessor> GltfAccessor::OpenDense(const tinygltf::Model& model,
                                             const tinygltf::Accessor& a, const std::string& what) {
  const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(a.componentType));
  const int components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(a.type));
  if (size <= 0 || components <= 0)
    return DataLoss("{} has an invalid type or component type ({})", what, a.componentType);
  GltfAccessor out;
  out.count_ = a.count;
  out.size_ = static_cast<std::size_t>(size);
  out.components_ = components;
  out.type_ = a.componentType;
  out.normalized_ = a.normalized;
  if (a.bufferView != kNone) {
    TILEGRAD_TRY(out.OpenView(model, a, what));
  } else if (a.count > kMostZeros) {
    return ResourceExhausted("{} has {} elements, but no buffer view", what, a.count);
  } else {
    out.bytes_ = kZeros;  // with a stride of 0
  }
  return out;
}

Status GltfAccessor::OpenView(const tinygltf::Model& model, const tinygltf::Accessor& a,
                              const std::string& what) {
  TILEGRAD_ASSIGN(const auto view, GltfViewBytes(model, a.bufferView, what));
  const int stride = a.ByteStride(model.bufferViews[a.bufferView]);
  if (stride <= 0) return DataLoss("{} has an invalid stride", what);
  stride_ = static_cast<std::size_t>(stride);
  if (count_ > 0 && (a.byteOffset > view.size() || element() > view.size() - a.byteOffset ||
                     count_ - 1 > (view.size() - a.byteOffset - element()) / stride_)) {
    return DataLoss("{} ({} elements) reaches beyond its buffer view of {} bytes", what, count_,
                    view.size());
  }
  bytes_ = view.subspan(std::min(a.byteOffset, view.size()));
  return {};
}

Status GltfAccessor::ApplySparse(const tinygltf::Model& model, const tinygltf::Accessor& a,
                                 const std::string& what) {
  const auto& sparse = a.sparse;
  const auto open = [&](int view, int offset, int type, int components) -> Result<GltfAccessor> {
    if (!Has(model.bufferViews, view))
      return DataLoss("{}: buffer view {} does not exist", what, view);
    tinygltf::Accessor part;
    part.bufferView = view;
    part.componentType = type;
    part.type = components;
    part.byteOffset = static_cast<std::size_t>(offset);  // a negative offset is beyond any view
    part.count = static_cast<std::size_t>(sparse.count);
    return OpenDense(model, part, what);
  };
  const auto& at = sparse.indices;
  TILEGRAD_ASSIGN(const GltfAccessor indices,
                  open(at.bufferView, at.byteOffset, at.componentType, TINYGLTF_TYPE_SCALAR));
  TILEGRAD_TRY(indices.CheckIndexType(what));
  TILEGRAD_ASSIGN(const GltfAccessor values,
                  open(sparse.values.bufferView, sparse.values.byteOffset, type_, a.type));
  auto own = std::make_shared<std::vector<unsigned char>>(count_ * element());
  for (std::size_t i = 0; i < count_; ++i)
    std::memcpy(own->data() + i * element(), bytes_.data() + i * stride_, element());
  for (std::size_t i = 0; i < indices.count(); ++i) {
    const std::size_t to = indices.Index(i);
    if (to >= count_) return DataLoss("{}: index {} is {} of {} elements", what, i, to, count_);
    std::memcpy(own->data() + to * element(), values.bytes_.data() + i * values.stride_, element());
  }
  stride_ = element();
  bytes_ = *own;
  own_ = std::move(own);
  return {};
}

Result<GltfAccessor> GltfAccessor::Open(const tinygltf::Model& model, int index,
                                        const std::string& what) {
  if (!Has(model.accessors, index)) return DataLoss("{}: accessor {} does not exist", what, index);
  const tinygltf::Accessor& a = model.accessors[index];
  const std::string place = fmt::format("{}: accessor {}", what, index);
  TILEGRAD_ASSIGN(GltfAccessor out, OpenDense(model, a, place));
  if (a.sparse.isSparse) TILEGRAD_TRY(out.ApplySparse(model, a, place + ", sparse"));
  return out;
}

Status GltfAccessor::CheckIndexType(const std::string& what) const {
  const bool is_unsigned = type_ == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
                           type_ == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
                           type_ == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  if (is_unsigned && components_ == 1) return {};
  return DataLoss("{}: indices must be unsigned scalars, got component type {}", what, type_);
}

Result<GltfAccessor> GltfAccessor::OpenAttribute(const tinygltf::Model& model, int index,
                                                 int components, const std::string& what) {
  TILEGRAD_ASSIGN(GltfAccessor out, Open(model, index, what));
  if (components > 0 && out.components_ != components) {
    return DataLoss("{}: expected {} numbers an element, got {}", what, components,
                    out.components_);
  }
  if (out.type_ != TINYGLTF_COMPONENT_TYPE_FLOAT && out.size_ > 2)
    return DataLoss("{}: component type {} is not allowed in an attribute", what, out.type_);
  return out;
}

Result<GltfAccessor> GltfAccessor::OpenIndices(const tinygltf::Model& model, int index,
                                               const std::string& what) {
  TILEGRAD_ASSIGN(GltfAccessor out, Open(model, index, what));
  TILEGRAD_TRY(out.CheckIndexType(what));
  return out;
}

float GltfAccessor::Float(std::size_t element, int component) const {
  const unsigned char* at =
      bytes_.data() + element * stride_ + static_cast<std::size_t>(component) * size_;
  const auto scaled = [this](float value, float largest) {
    return normalized_ ? std::max(-1.0f, value / largest) : value;
  };
  switch (type_) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return scaled(*at, 255);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return scaled(Read<std::uint16_t>(at), 65535);
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return scaled(Read<std::int8_t>(at), 127);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return scaled(Read<std::int16_t>(at), 32767);
    default:  // excluded by OpenAttribute
      return Read<float>(at);
  }
}

std::uint32_t GltfAccessor::Index(std::size_t element) const {
  const unsigned char* at = bytes_.data() + element * stride_;
  switch (type_) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *at;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return Read<std::uint16_t>(at);
    default:  // excluded by OpenIndices
      return Read<std::uint32_t>(at);
  }
}

}  // namespace tilegrad::io
