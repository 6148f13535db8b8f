// SPDX-License-Identifier: Apache-2.0
#include "nn/serialize.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "base/error.h"
#include "base/half.h"
#include "base/json_text.h"
#include "base/text.h"

static_assert(std::endian::native == std::endian::little, "safetensors data is little endian");

namespace tilegrad::nn {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kLengthBytes = 8;
constexpr std::size_t kMaxHeader = 100u << 20;  // the format's own limit
constexpr const char* kMetadata = "__metadata__";

constexpr const char* kHalfName = "F16";  // in files only: read as F32

std::optional<DType> DTypeNamed(const std::string& name) {
  if (name == kHalfName) return DType::kF32;
  for (DType dtype : {DType::kF32, DType::kF64, DType::kU8, DType::kI32, DType::kI64}) {
    if (name == NameOf(dtype)) return dtype;
  }
  return std::nullopt;
}

// A tensor's entry in the header, checked against the size of the data.
struct Entry {
  DType dtype = DType::kF32;
  Shape shape;
  std::size_t begin = 0;  // in the data
  bool half = false;      // stored as F16

  std::size_t Size() const {
    const std::size_t each = half ? sizeof(std::uint16_t) : BytesOf(dtype);
    return static_cast<std::size_t>(shape.elements()) * each;
  }
};

Status BadEntry(const std::string& name, const char* why) {
  return DataLoss("safetensors: tensor \"{}\": {}", name, why);
}

bool IsCount(const Json& value) { return value.is_number_unsigned(); }

Result<Shape> ParseShape(const std::string& name, const Json& extents, std::size_t max_elements) {
  if (extents.size() > static_cast<std::size_t>(Shape::kMaxRank))
    return BadEntry(name, "more than five axes");
  Shape shape;
  for (const Json& extent : extents) {
    if (!IsCount(extent)) return BadEntry(name, "an extent is not a count");
    const auto e = extent.get<std::uint64_t>();
    if (e > static_cast<std::uint64_t>(Shape::kMostElements))
      return BadEntry(name, "its shape is larger than the file");
    shape.Append(static_cast<std::int64_t>(e));
  }
  // [0, 3] has more columns than a file without data has bytes.
  if (shape.IsPossible() && static_cast<std::uint64_t>(shape.elements()) <= max_elements)
    return shape;
  return BadEntry(name, "its shape is larger than the file");
}

Result<Entry> ParseEntry(const std::string& name, const Json& json, std::size_t data_bytes) {
  const bool complete = json.is_object() && json.contains("dtype") && json["dtype"].is_string() &&
                        json.contains("shape") && json["shape"].is_array() &&
                        json.contains("data_offsets") && json["data_offsets"].is_array();
  if (!complete) return BadEntry(name, "dtype, shape or data_offsets is missing");
  const Json& offsets = json["data_offsets"];
  if (offsets.size() != 2 || !IsCount(offsets[0]) || !IsCount(offsets[1]))
    return BadEntry(name, "data_offsets are not two counts");
  const auto stored = json["dtype"].get<std::string>();
  const std::optional<DType> dtype = DTypeNamed(stored);
  if (!dtype) return BadEntry(name, "its dtype is none of F32, F64, F16, U8, I32, I64");
  const auto begin = offsets[0].get<std::uint64_t>(), end = offsets[1].get<std::uint64_t>();
  if (begin > end || end > data_bytes) return BadEntry(name, "its data lies beyond the file's end");
  Entry entry{*dtype, {}, static_cast<std::size_t>(begin), stored == kHalfName};
  TILEGRAD_ASSIGN(entry.shape, ParseShape(name, json["shape"], data_bytes));
  if (entry.Size() != end - begin) return BadEntry(name, "its shape and its data differ in size");
  return entry;
}

// Records the names of an object's entries in order, including duplicates. (Parsers that keep the
// order, ordered_json or a callback, search all entries at each.)
class EntryNames : public nlohmann::json_sax<Json> {
 public:
  std::vector<std::string> names;

  bool start_object(std::size_t) override { return ++depth_ > 0; }
  bool end_object() override { return depth_-- > 0; }
  bool start_array(std::size_t) override { return ++depth_ > 0; }
  bool end_array() override { return depth_-- > 0; }
  bool key(string_t& name) override {
    if (depth_ == 1) names.push_back(name);
    return true;
  }
  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool parse_error(std::size_t, const std::string&, const Json::exception&) override {
    return false;
  }

 private:
  std::size_t depth_ = 0;
};

// Of two tensors that share bytes one would be a copy: with many, a small file would fill the
// memory. `ranges`: first byte, end and name of each tensor.
Status CheckApart(std::vector<std::tuple<std::size_t, std::size_t, std::string>> ranges) {
  std::sort(ranges.begin(), ranges.end());
  std::size_t last_end = 0;
  std::string_view last;  // the tensor that reaches there
  for (const auto& [begin, end, name] : ranges) {
    if (begin == end) continue;
    if (begin < last_end)
      return BadEntry(name, fmt::format("its data overlaps that of \"{}\"", last).c_str());
    last_end = end;
    last = name;
  }
  return {};
}

struct Header {
  Json json;
  std::vector<std::string> names;  // as they come
};

Result<Header> ParseHeader(std::span<const std::uint8_t> bytes) {
  std::uint64_t length = 0;
  if (bytes.size() < kLengthBytes)
    return DataLoss("safetensors: {} bytes are too few for a file", bytes.size());
  std::memcpy(&length, bytes.data(), kLengthBytes);
  if (length > kMaxHeader || length > bytes.size() - kLengthBytes)
    return DataLoss(
        "safetensors: a header of {} bytes in a file of {}: cut short, or not a safetensors file",
        length, bytes.size());
  const char* begin = reinterpret_cast<const char*>(bytes.data()) + kLengthBytes;
  const std::string_view text(begin, length);
  Header header{ParseJsonOrDiscard(text), {}};
  if (!header.json.is_object()) return DataLoss("safetensors: the header is not a JSON object");
  EntryNames entries;
  Json::sax_parse(text, &entries);
  header.names = std::move(entries.names);
  if (header.json.size() != header.names.size())
    return DataLoss("safetensors: the header has a name twice");
  return header;
}

Status ParseMetadata(const Json& json, std::map<std::string, std::string>& metadata) {
  if (!json.is_object()) return DataLoss("safetensors: __metadata__ is not an object");
  for (const auto& [key, value] : json.items()) {
    if (!value.is_string())
      return DataLoss("safetensors: __metadata__ \"{}\" is not a string", key);
    metadata[key] = value.get<std::string>();
  }
  return {};
}

Tensor TensorOf(const Context& context, const Entry& entry, std::span<const std::uint8_t> data) {
  Tensor tensor = context.Empty(entry.shape, entry.dtype);
  const std::uint8_t* from = data.data() + entry.begin;
  if (!entry.half) {
    if (tensor.bytes() != 0) std::memcpy(tensor.raw(), from, tensor.bytes());
    return tensor;
  }
  for (float& value : tensor.span<float>()) {
    std::uint16_t half = 0;
    std::memcpy(&half, from, sizeof half);
    value = FromHalf(half);
    from += sizeof half;
  }
  return tensor;
}

void AppendMember(const std::string& name, const std::string& json, std::string* text) {
  if (text->size() > 1) *text += ',';
  *text += DumpJson(Json(name)) + ':' + json;
}

// A tensor as stored in the file.
struct StoredTensor {
  const char* dtype;
  std::span<const std::uint8_t> data;
  Bytes halves;  // `data`, where it is not the tensor's own
};

Result<Bytes> HalvesOf(const NamedTensor& t) {
  Bytes bytes(t.value.elements() * sizeof(std::uint16_t));
  std::uint8_t* to = bytes.data();
  for (const float value : t.value.span<float>()) {
    const std::uint16_t half = ToHalf(value);
    if ((half & kHalfInfinity) == kHalfInfinity)
      return InvalidArgument("safetensors: tensor \"{}\": {} is no number of float16 (at most {})",
                             t.name, value, kLargestHalf);
    std::memcpy(to, &half, sizeof half);
    to += sizeof half;
  }
  return bytes;
}

Result<StoredTensor> StoredOf(const NamedTensor& t, StoredFloats floats) {
  StoredTensor out{NameOf(t.value.dtype()), {}, {}};
  if (floats == StoredFloats::kHalf && t.value.dtype() == DType::kF32) {
    TILEGRAD_ASSIGN(out.halves, HalvesOf(t));
    out.dtype = kHalfName;
    out.data = out.halves;
  } else {
    out.data = {reinterpret_cast<const std::uint8_t*>(t.value.raw()), t.value.bytes()};
  }
  return out;
}

std::string EntryJson(const StoredTensor& stored, const Shape& shape, std::size_t begin) {
  std::vector<std::int64_t> extents;
  for (int axis = 0; axis < shape.rank(); ++axis) extents.push_back(shape[axis]);
  return fmt::format(R"({{"dtype":"{}","shape":[{}],"data_offsets":[{},{}]}})", stored.dtype,
                     fmt::join(extents, ","), begin, begin + stored.data.size());
}

Status CheckTexts(const TensorFile& file) {
  for (const auto& [key, value] : file.metadata) {
    if (!IsUtf8(key) || !IsUtf8(value))
      return InvalidArgument("safetensors: the metadata is not UTF-8");
  }
  std::unordered_set<std::string> names = {kMetadata};
  for (const NamedTensor& t : file.tensors) {
    if (t.value.empty() || !names.insert(t.name).second)
      return InvalidArgument("safetensors: tensor \"{}\" is empty, or its name is taken", t.name);
    if (!IsUtf8(t.name)) return InvalidArgument("safetensors: a tensor's name is not UTF-8");
  }
  return {};
}

// A file ready to be written.
struct EncodedFile {
  std::string header;  // its length included
  std::vector<StoredTensor> tensors;
};

std::string HeaderOf(const std::string& text) {
  const std::uint64_t length = text.size();
  std::string header(kLengthBytes, '\0');
  std::memcpy(header.data(), &length, kLengthBytes);
  return header + text;
}

Result<EncodedFile> Encode(const TensorFile& file, StoredFloats floats) {
  TILEGRAD_TRY(CheckTexts(file));
  EncodedFile out;
  std::string text = "{";
  if (!file.metadata.empty()) AppendMember(kMetadata, DumpJson(Json(file.metadata)), &text);
  std::size_t end = 0;
  for (const NamedTensor& t : file.tensors) {
    TILEGRAD_ASSIGN(StoredTensor stored, StoredOf(t, floats));
    AppendMember(t.name, EntryJson(stored, t.value.shape(), end), &text);
    end += stored.data.size();
    out.tensors.push_back(std::move(stored));
  }
  text += '}';
  text.resize((text.size() + 7) / 8 * 8, ' ');  // the format allows spaces: data stays aligned
  if (text.size() > kMaxHeader)
    return InvalidArgument("safetensors: names and metadata make a header of {} bytes, {} at most",
                           text.size(), kMaxHeader);
  out.header = HeaderOf(text);
  return out;
}

// The file: `header`, then the data.
std::vector<std::span<const std::uint8_t>> PiecesOf(const EncodedFile& file) {
  const auto* header = reinterpret_cast<const std::uint8_t*>(file.header.data());
  std::vector<std::span<const std::uint8_t>> pieces = {{header, file.header.size()}};
  for (const StoredTensor& t : file.tensors) pieces.push_back(t.data);
  return pieces;
}

}  // namespace

Result<TensorFile> DecodeSafetensors(Context& context, std::span<const std::uint8_t> bytes) {
  TILEGRAD_ASSIGN(const Header header, ParseHeader(bytes));
  std::uint64_t length = 0;
  std::memcpy(&length, bytes.data(), kLengthBytes);
  const auto data = bytes.subspan(kLengthBytes + static_cast<std::size_t>(length));
  TensorFile file;
  std::vector<std::pair<std::string, Entry>> entries;
  std::vector<std::tuple<std::size_t, std::size_t, std::string>> ranges;
  for (const std::string& name : header.names) {
    const Json& json = header.json[name];
    if (name == kMetadata) {
      TILEGRAD_TRY(ParseMetadata(json, file.metadata));
      continue;
    }
    TILEGRAD_ASSIGN(const Entry entry, ParseEntry(name, json, data.size()));
    ranges.emplace_back(entry.begin, entry.begin + entry.Size(), name);
    entries.emplace_back(name, entry);
  }
  TILEGRAD_TRY(CheckApart(std::move(ranges)));
  for (const auto& [name, entry] : entries)
    file.tensors.push_back({name, TensorOf(context, entry, data)});
  return file;
}

Result<std::map<std::string, std::string>> SafetensorsMetadata(
    std::span<const std::uint8_t> bytes) {
  TILEGRAD_ASSIGN(const Header header, ParseHeader(bytes));
  std::map<std::string, std::string> metadata;
  if (header.json.contains(kMetadata))
    TILEGRAD_TRY(ParseMetadata(header.json[kMetadata], metadata));
  return metadata;
}

Result<TensorFile> ReadSafetensors(Context& context, const Path& path) {
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  auto file = DecodeSafetensors(context, bytes);
  if (!file.ok()) return file.status().Within(path.string());
  return file;
}

Result<Bytes> EncodeSafetensors(const TensorFile& file, StoredFloats floats) {
  TILEGRAD_ASSIGN(const EncodedFile encoded, Encode(file, floats));
  Bytes bytes;
  for (const auto& piece : PiecesOf(encoded)) bytes.insert(bytes.end(), piece.begin(), piece.end());
  return bytes;
}

Status WriteSafetensors(const Path& path, const TensorFile& file, StoredFloats floats) {
  TILEGRAD_ASSIGN(const EncodedFile encoded, Encode(file, floats));
  return WriteFileAtomic(path, PiecesOf(encoded));
}

}  // namespace tilegrad::nn
