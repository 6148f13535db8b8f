// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_document.h"

#include <cctype>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/error.h"
#include "base/json_nesting.h"
#include "io/gltf/gltf_extensions.h"

namespace tilegrad::io {
namespace {

constexpr int kMaxJsonNesting = 64;  // tinygltf's reading of "extras" is recursive

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

// The JSON text: the whole of a .gltf, the first chunk of a GLB whose length tinygltf checks.
std::string_view JsonPart(const Bytes& bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  constexpr std::size_t kGlbHeader = 20;
  if (!text.starts_with("glTF") || text.size() < kGlbHeader) return text;
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 12, sizeof(length));
  return text.substr(kGlbHeader, length);
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

using ParsedJson = nlohmann::json;

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

std::uint64_t CountOf(const ParsedJson& object, const char* key) {
  const auto count = object.find(key);
  return count != object.end() && count->is_number_unsigned() ? count->get<std::uint64_t>() : 0;
}

// tinygltf takes the address of an image's first byte in its buffer before it asks KeepEncoded,
// also where the buffer ends before: a standard library that checks indices ends the program there.
// Whatever else is wrong is left to tinygltf, which finds it before.
Status CheckImages(std::string_view text, const std::string& place) {
  if (text.find("images") == std::string_view::npos) return {};
  const ParsedJson document = ParsedJson::parse(text, nullptr, /*allow_exceptions=*/false);
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
  const auto slash = name.find_last_of('/');
  SideFiles side{source, slash == std::string::npos ? "" : name.substr(0, slash)};
  TILEGRAD_TRY(CheckNesting(JsonPart(bytes), place));
  TILEGRAD_TRY(CheckImages(JsonPart(bytes), place));
  GltfDocument document;
  try {
    TILEGRAD_TRY(Parse(bytes, side, place, &document.model));
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
