// SPDX-License-Identifier: Apache-2.0
#include "io/npz.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "base/half.h"
#include "base/read_budget.h"
#include "io/archive.h"

namespace tilegrad::io {
namespace {

struct TypeRow {
  NpyType type;
  const char* code;  // after the byte-order character
  std::size_t size;
  const char* name;
};
constexpr std::array<TypeRow, 11> kTypes = {{{NpyType::kBool, "b1", 1, "bool"},
                                             {NpyType::kU8, "u1", 1, "uint8"},
                                             {NpyType::kI8, "i1", 1, "int8"},
                                             {NpyType::kU16, "u2", 2, "uint16"},
                                             {NpyType::kI16, "i2", 2, "int16"},
                                             {NpyType::kU32, "u4", 4, "uint32"},
                                             {NpyType::kI32, "i4", 4, "int32"},
                                             {NpyType::kU64, "u8", 8, "uint64"},
                                             {NpyType::kI64, "i8", 8, "int64"},
                                             {NpyType::kF32, "f4", 4, "float32"},
                                             {NpyType::kF64, "f8", 8, "float64"}}};

const TypeRow& Row(NpyType type) { return kTypes[static_cast<std::size_t>(type)]; }

constexpr std::string_view kNpyMagic = "\x93NUMPY";
constexpr std::size_t kMaxNpyRank = 8;

// What the Python dictionary in the header says.
struct NpyHeader {
  std::string descr;
  bool fortran = false;
  std::vector<std::size_t> shape;
};

// The text after 'key': in a dictionary literal, for any spacing.
std::optional<std::string_view> HeaderValue(std::string_view dictionary, std::string_view key) {
  for (const char quote : {'\'', '"'}) {
    const std::string quoted = quote + std::string(key) + quote;
    const auto at = dictionary.find(quoted);
    if (at == std::string_view::npos) continue;
    auto rest = dictionary.substr(at + quoted.size());
    rest.remove_prefix(std::min(rest.find_first_not_of(" :"), rest.size()));
    return rest;
  }
  return std::nullopt;
}

std::optional<std::vector<std::size_t>> ParseShape(std::string_view text) {
  if (text.empty() || text.front() != '(') return std::nullopt;
  const auto end = text.find(')');
  if (end == std::string_view::npos) return std::nullopt;
  std::vector<std::size_t> shape;
  const char* at = text.data() + 1;
  const char* last = text.data() + end;
  while (at < last) {
    if (*at == ' ' || *at == ',') {
      ++at;
      continue;
    }
    std::size_t value = 0;
    const auto [next, error] = std::from_chars(at, last, value);
    if (error != std::errc() || shape.size() == kMaxNpyRank) return std::nullopt;
    shape.push_back(value);
    at = next;
  }
  return shape;
}

std::optional<NpyHeader> ParseHeader(std::string_view text) {
  const auto descr = HeaderValue(text, "descr"), order = HeaderValue(text, "fortran_order"),
             shape = HeaderValue(text, "shape");
  if (!descr || !order || !shape || descr->empty()) return std::nullopt;
  const auto close = descr->find(descr->front(), 1);
  const auto dims = ParseShape(*shape);
  const bool fortran = order->starts_with("True");
  if (close == std::string_view::npos || !dims || !(fortran || order->starts_with("False")))
    return std::nullopt;
  return NpyHeader{std::string(descr->substr(1, close - 1)), fortran, *dims};
}

// Splits off magic, version and header length; returns the header text and the offset of the data.
std::optional<std::pair<std::string_view, std::size_t>> SplitHeader(
    std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (bytes.size() < 12 || !text.starts_with(kNpyMagic)) return std::nullopt;
  const int version = bytes[6];
  if (version < 1 || version > 3) return std::nullopt;
  const std::size_t fixed = version == 1 ? 10 : 12;
  std::size_t length = bytes[8] | bytes[9] << 8;
  if (version > 1)
    length |= static_cast<std::size_t>(bytes[10]) << 16 | static_cast<std::size_t>(bytes[11]) << 24;
  if (length > bytes.size() - fixed) return std::nullopt;
  return std::pair(text.substr(fixed, length), fixed + length);
}

Result<NpyType> FindType(const std::string& descr, const std::string& name) {
  if (descr.size() == 3) {
    const bool single_byte = descr[2] == '1';
    for (const TypeRow& row : kTypes) {
      if (descr.substr(1) != row.code) continue;
      if (descr[0] == '<' || descr[0] == '|' || (descr[0] == '>' && single_byte)) return row.type;
      return DataLoss("{}: big-endian data ({}); save it again as little-endian", name, descr);
    }
  }
  return DataLoss(
      "{}: element type \"{}\" is not supported (bool, integers, float16, float32, float64 are)",
      name, descr);
}

// Product of the shape times the element size; nullopt on overflow.
std::optional<std::size_t> ByteCount(const std::vector<std::size_t>& shape, std::size_t element) {
  std::size_t bytes = element;
  for (std::size_t n : shape) {
    if (__builtin_mul_overflow(bytes, n, &bytes)) return std::nullopt;
  }
  return bytes;
}

Bytes FortranToC(std::span<const std::uint8_t> data, const std::vector<std::size_t>& shape,
                 std::size_t element) {
  Bytes out(data.size());
  std::vector<std::size_t> index(shape.size(), 0);
  for (std::size_t to = 0; to < out.size(); to += element) {
    std::size_t from = 0;
    for (std::size_t k = shape.size(); k-- > 0;) from = from * shape[k] + index[k];
    std::copy_n(data.data() + from * element, element, out.data() + to);
    for (std::size_t k = shape.size(); k-- > 0 && ++index[k] == shape[k];) index[k] = 0;
  }
  return out;
}

NpyArray WithoutHalves(NpyArray halves) {
  std::vector<float> values(halves.data.size() / 2);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] =
        FromHalf(static_cast<std::uint16_t>(halves.data[2 * i] | halves.data[2 * i + 1] << 8));
  return MakeNpy<float>(std::move(halves.shape), values);
}

std::string EntryName(const std::string& array) { return array + ".npy"; }

constexpr std::size_t kMostNameBytes = 65535;  // of a zip entry: its length has 16 bits

// A zip entry's name ends at a NUL, and readers look for "a/b" if a name is "a/./b": such an array
// would be lost, as would one with a truncated name.
Status CheckArrayName(const std::string& name, const Path& path) {
  const std::size_t bytes = EntryName(name).size();
  if (bytes > kMostNameBytes) {
    return InvalidArgument(
        "{}: an array's name in an .npz has {} bytes at most; that of {} bytes begins with \"{}\"",
        path.string(), kMostNameBytes - EntryName("").size(), name.size(), name.substr(0, 40));
  }
  const bool ends = name.find('\0') != std::string::npos;
  if (!ends && NormalizeName(EntryName(name)) == EntryName(name)) return {};
  return InvalidArgument(
      "{}: \"{}\" cannot be the name of an array in an .npz: it has a NUL or a backslash, or is a "
      "path out of it",
      path.string(), name.substr(0, name.find('\0')));
}

}  // namespace

std::size_t NpyTypeSize(NpyType type) { return Row(type).size; }
const char* NpyTypeName(NpyType type) { return Row(type).name; }

Result<NpyArray> DecodeNpy(std::span<const std::uint8_t> bytes, const std::string& name) {
  const auto split = SplitHeader(bytes);
  if (!split) return DataLoss("{}: not a .npy array (bad magic, version or header length)", name);
  const auto header = ParseHeader(split->first);
  if (!header) return DataLoss("{}: the .npy header cannot be read: {}", name, split->first);
  const bool halves = header->descr == "<f2";  // validated as the type of the same size
  TILEGRAD_ASSIGN(const NpyType type, FindType(halves ? "<u2" : header->descr, name));
  const auto data = bytes.subspan(split->second);
  const auto wanted = ByteCount(header->shape, NpyTypeSize(type));
  if (!wanted || *wanted != data.size()) {
    return DataLoss("{}: the header declares {} bytes of data, the file has {}", name,
                    wanted ? std::to_string(*wanted) : "more than 2^64", data.size());
  }
  NpyArray array{type, header->shape, {}};
  array.data = header->fortran && header->shape.size() > 1
                   ? FortranToC(data, header->shape, NpyTypeSize(type))
                   : Bytes(data.begin(), data.end());
  if (halves) {
    TILEGRAD_TRY(ReadBudget::Take(2 * array.data.size(), name));
    return WithoutHalves(std::move(array));
  }
  return array;
}

Bytes EncodeNpy(const NpyArray& array) {
  std::string shape;
  for (std::size_t n : array.shape) shape += fmt::format("{},", n);
  const char order = NpyTypeSize(array.type) == 1 ? '|' : '<';
  std::string header = fmt::format("{{'descr': '{}{}', 'fortran_order': False, 'shape': ({}), }}",
                                   order, Row(array.type).code, shape);
  constexpr std::size_t kFixed = 10, kAlign = 64;  // data starts at a multiple of 64
  header.resize((kFixed + header.size() + 1 + kAlign - 1) / kAlign * kAlign - kFixed - 1, ' ');
  header += '\n';
  std::string prefix(kNpyMagic);
  prefix += {1, 0, static_cast<char>(header.size()), static_cast<char>(header.size() >> 8)};
  prefix += header;
  Bytes out(prefix.begin(), prefix.end());
  out.insert(out.end(), array.data.begin(), array.data.end());
  return out;
}

Result<std::vector<double>> NumbersOf(const NpyArray& array, const std::string& name) {
  if (array.type == NpyType::kF32) {
    TILEGRAD_ASSIGN(const std::vector<float> values, array.As<float>());
    return std::vector<double>(values.begin(), values.end());
  }
  auto values = array.As<double>();
  if (!values.ok()) return values.status().Within(name);
  return values;
}

Result<NpyArray> LoadNpy(const Path& path) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  return DecodeNpy(bytes, path.string());
}

Result<NpzArrays> LoadNpz(const Path& path) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const auto names, ListZip(path));
  TILEGRAD_ASSIGN(const auto zip, OpenZip(path));
  NpzArrays arrays;
  for (const std::string& name : names) {
    if (!name.ends_with(".npy")) continue;
    TILEGRAD_ASSIGN(const Bytes bytes, zip->Read(name));
    TILEGRAD_ASSIGN(arrays[name.substr(0, name.size() - 4)], DecodeNpy(bytes, zip->Describe(name)));
  }
  return arrays;
}

Result<NpyArray> LoadNpzArray(const Path& path, const std::string& name) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const auto zip, OpenZip(path));
  if (!zip->Exists(EntryName(name))) {
    std::string there;
    TILEGRAD_ASSIGN(const auto names, ListZip(path));
    for (const auto& other : names) there += (there.empty() ? "" : ", ") + other;
    return DataLoss("{}: no array \"{}\"; it has: {}", path.string(), name, there);
  }
  TILEGRAD_ASSIGN(const Bytes bytes, zip->Read(EntryName(name)));
  return DecodeNpy(bytes, zip->Describe(EntryName(name)));
}

Result<NpyArray> DecodeNpzArray(const Bytes& npz, const std::string& place,
                                const std::string& name) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFromZip(npz, place, EntryName(name)));
  return DecodeNpy(bytes, place + ": " + EntryName(name));
}

Status SaveNpz(const Path& path, const NpzArrays& arrays) {
  if (arrays.empty()) return InvalidArgument("{}: no array to write into it", path.string());
  std::vector<std::pair<std::string, Bytes>> entries;
  for (const auto& [name, array] : arrays) {
    TILEGRAD_TRY(CheckArrayName(name, path));
    const auto wanted = ByteCount(array.shape, NpyTypeSize(array.type));
    if (wanted != array.data.size()) {
      return InvalidArgument("{}: array \"{}\" has a shape of {} bytes, but data of {}",
                             path.string(), name, wanted.value_or(0), array.data.size());
    }
    entries.emplace_back(EntryName(name), EncodeNpy(array));
  }
  return WriteZip(path, entries);
}

}  // namespace tilegrad::io
