// SPDX-License-Identifier: Apache-2.0
// A glTF or GLB file, with its buffers, as tinygltf's model.
#include <cctype>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/error.h"
#include "base/json_text.h"
#include "base/text.h"
#include "io/gltf_model.h"
#include "io/mesh_readers.h"

namespace tilegrad::io {
namespace {

constexpr int kMaxJsonNesting = 64;  // tinygltf's reading of "extras" is recursive

using ParsedJson = nlohmann::json;

std::uint64_t CountOf(const ParsedJson& object, const char* key) {
  const auto count = object.find(key);
  return count != object.end() && count->is_number_unsigned() ? count->get<std::uint64_t>() : 0;
}

// The buffers of a glTF that are files of their own. tinygltf decodes names by rules of its own
// ("+" is a space to it) and refuses a file that is longer than its buffer; so it is given the
// files in the order in which it asks for them, which is that of the buffers.
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

// Keeps the encoded bytes of data URIs; images are decoded when a material asks for one. An image
// in a buffer view comes with a place that tinygltf has not checked: it is left alone until then.
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

// tinygltf takes the address of an image's first byte in its buffer before it asks KeepEncoded,
// also where the buffer ends before: a standard library that checks indices ends the program there.
// Whatever else is wrong is left to tinygltf, which finds it before.
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
  // Of 2.x, a reader of 2.0 reads what does not say that it is not enough.
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
    throw;                                 // no fault of the file
  } catch (const std::exception& error) {  // the JSON library throws on some type errors
    return DataLoss("{}: not valid glTF: {}", place, error.what());
  }
  TILEGRAD_TRY(CheckVersion(place, document.model));
  TILEGRAD_TRY(CheckGltfExtensions(document.model, place, &document.warnings));
  return document;
}

}  // namespace tilegrad::io
