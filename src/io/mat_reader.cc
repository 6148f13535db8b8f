// SPDX-License-Identifier: Apache-2.0
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "base/error.h"
#include "base/read_budget.h"
#include "base/text.h"
#include "io/mat_file.h"

namespace tilegrad::io {
namespace {

constexpr std::size_t kHeader = 128, kMaxMatDepth = 16, kMaxMatRank = 32, kMaxFields = 4096;
constexpr std::size_t kPiece = std::size_t{1} << 20;  // arrays grow by this as their bytes arrive
constexpr std::uint32_t kFirstNumeric = 6, kLastNumeric = 15;
constexpr std::uint32_t kComplexFlag = 0x800;

struct Tag {
  MatType type{};
  std::size_t size = 0;    // bytes of data
  std::size_t padded = 0;  // with what fills up to 8 bytes
  bool small = false;      // the data stand in the tag itself
  std::array<std::uint8_t, 4> data{};
};

std::uint32_t Word(const std::uint8_t* at) {
  std::uint32_t word;
  std::memcpy(&word, at, sizeof word);
  return word;
}

// Bytes one after the other: plain, or unpacked while they are read, so that what is packed never
// lies in memory as a whole.
class MatStream {
 public:
  MatStream(std::span<const std::uint8_t> bytes, bool packed)
      : left_(bytes), packed_(packed), works_(!packed || inflateInit(&zlib_) == Z_OK) {
    zlib_.next_in = const_cast<std::uint8_t*>(bytes.data());  // zlib does not write there
    zlib_.avail_in = static_cast<uInt>(bytes.size());
  }
  ~MatStream() {
    if (packed_) inflateEnd(&zlib_);
  }
  MatStream(const MatStream&) = delete;
  MatStream& operator=(const MatStream&) = delete;

  // All of `to`; false if there are fewer, or they cannot be unpacked.
  bool Read(std::span<std::uint8_t> to) {
    if (packed_) return Unpack(to);
    if (to.size() > left_.size()) return false;
    std::ranges::copy(left_.first(to.size()), to.begin());
    left_ = left_.subspan(to.size());
    return true;
  }

 private:
  bool Unpack(std::span<std::uint8_t> to) {
    if (!works_ || to.size() > UINT32_MAX) return false;
    zlib_.next_out = to.data();
    zlib_.avail_out = static_cast<uInt>(to.size());
    while (zlib_.avail_out > 0) {
      const int result = inflate(&zlib_, Z_NO_FLUSH);
      if (result == Z_STREAM_END) break;
      if (result != Z_OK) return works_ = false;
    }
    return zlib_.avail_out == 0;
  }

  std::span<const std::uint8_t> left_;  // plain
  z_stream zlib_{};
  bool packed_, works_;
};

// The arrays of one variable, from its bytes. `left_` counts what is left of the innermost array:
// nothing reads beyond the array that it is part of.
class Parser {
 public:
  Parser(MatStream& stream, const std::string& file) : stream_(stream), where_(file) {}

  // An element of type miMATRIX; its name goes to `name`.
  Status Matrix(MatArray* out, std::string* name) {
    Tag tag;
    left_ = kHeader;  // enough for the tag
    TILEGRAD_TRY(ReadTag(&tag));
    return Body(tag, out, name, 0);
  }

 private:
  template <class... A>
  Status Damaged(fmt::format_string<A...> format, A&&... args) const {
    return DataLoss("{}: {}", where_, fmt::format(format, std::forward<A>(args)...));
  }

  Status Take(std::span<std::uint8_t> to) {
    if (to.size() > left_) return Damaged("an element is longer than the array that it is part of");
    if (!stream_.Read(to)) return Damaged("cut off, or its packed bytes are damaged");
    left_ -= to.size();
    return {};
  }

  Status ReadTag(Tag* tag) {
    std::array<std::uint8_t, 8> bytes;
    TILEGRAD_TRY(Take(bytes));
    const std::uint32_t first = Word(bytes.data()), second = Word(bytes.data() + 4);
    tag->small = first >> 16 != 0;
    tag->type = static_cast<MatType>(tag->small ? first & 0xFFFF : first);
    tag->size = tag->small ? first >> 16 : second;
    std::copy(bytes.begin() + 4, bytes.end(), tag->data.begin());
    tag->padded = tag->small ? 0 : (tag->size + 7) / 8 * 8;
    if (tag->small && tag->size > 4)
      return Damaged("a short element of {} bytes, where 4 are the most", tag->size);
    return {};
  }

  // The bytes of an element, of which `bytes` grows only as they arrive.
  Status Data(const Tag& tag, std::vector<std::uint8_t>* bytes) {
    bytes->clear();
    if (tag.small) {
      bytes->assign(tag.data.begin(), tag.data.begin() + static_cast<std::ptrdiff_t>(tag.size));
      return {};
    }
    if (tag.size > left_) return Damaged("an element is longer than the array that it is part of");
    while (bytes->size() < tag.size) {
      const std::size_t more = std::min(kPiece, tag.size - bytes->size()), at = bytes->size();
      TILEGRAD_TRY(ReadBudget::Take(more, where_));
      bytes->resize(at + more);
      TILEGRAD_TRY(Take(std::span(*bytes).subspan(at)));
    }
    return Padding(tag);
  }

  // The last element of an array may come without what fills it up.
  Status Padding(const Tag& tag) {
    std::array<std::uint8_t, 8> fill;
    return Take(std::span(fill).first(std::min(left_, tag.padded - tag.size)));
  }

  Status Expect(MatType type, std::size_t most, const char* what,
                std::vector<std::uint8_t>* bytes) {
    Tag tag;
    TILEGRAD_TRY(ReadTag(&tag));
    if (tag.type != type || tag.size > most)
      return Damaged("expected {}, found type {} of {} bytes", what,
                     static_cast<std::uint32_t>(tag.type), tag.size);
    return Data(tag, bytes);
  }

  Status Dims(MatArray* out) {
    std::vector<std::uint8_t> bytes;
    TILEGRAD_TRY(Expect(MatType::kInt32, 4 * kMaxMatRank, "dimensions", &bytes));
    if (bytes.size() < 8 || bytes.size() % 4 != 0)
      return Damaged("its dimensions are {} bytes", bytes.size());
    out->dims.clear();
    std::size_t product = 1;
    for (std::size_t i = 0; i < bytes.size(); i += 4) {
      const std::size_t extent = Word(bytes.data() + i);
      if (extent > INT32_MAX || (extent > 0 && product > (std::size_t{1} << 40) / extent))
        return Damaged("its dimensions are too large");
      product *= extent;
      out->dims.push_back(extent);
    }
    return {};
  }

  Status Body(const Tag& tag, MatArray* out, std::string* name, std::size_t depth) {
    if (tag.type != MatType::kMatrix || tag.small)
      return Damaged("expected an array, found type {}", static_cast<std::uint32_t>(tag.type));
    if (depth == kMaxMatDepth)
      return Damaged("arrays within arrays, more than {} deep", kMaxMatDepth);
    const std::size_t outside = depth == 0 ? 0 : left_;
    if (depth > 0 && tag.size > outside)
      return Damaged("an array is longer than the array that it is part of");
    left_ = tag.size;
    if (tag.size > 0) TILEGRAD_TRY(Content(out, name, depth));
    if (left_ > 0) return Damaged("{} bytes too many", left_);
    left_ = depth == 0 ? 0 : outside - tag.size;
    return {};
  }

  Status Content(MatArray* out, std::string* name, std::size_t depth) {
    std::vector<std::uint8_t> bytes;
    TILEGRAD_TRY(Expect(MatType::kUint32, 8, "the flags of an array", &bytes));
    if (bytes.size() != 8) return Damaged("its flags are {} bytes", bytes.size());
    const std::uint32_t flags = Word(bytes.data());
    TILEGRAD_TRY(Dims(out));
    TILEGRAD_TRY(Expect(MatType::kInt8, 4096, "a name", &bytes));
    name->assign(bytes.begin(), bytes.end());
    const std::size_t length = where_.size();
    if (!name->empty()) where_ += ": " + *name;
    TILEGRAD_TRY(OfClass(flags, out, depth));
    where_.resize(length);
    return {};
  }

  Status OfClass(std::uint32_t flags, MatArray* out, std::size_t depth) {
    const std::uint32_t of_class = flags & 0xFF;
    out->logical = (flags & kLogicalFlag) != 0;
    if ((flags & kComplexFlag) != 0) return Damaged("complex numbers, which nothing here needs");
    if (of_class == kCellClass) return Elements(MatKind::kCell, 1, out, depth);
    if (of_class == kStructClass) return Struct(out, depth);
    if (of_class == kCharClass) return Text(out);
    if (of_class >= kFirstNumeric && of_class <= kLastNumeric) return Numbers(out);
    return Damaged("an array of class {}: neither numbers, text, structs nor cells", of_class);
  }

  Status Numbers(MatArray* out) {
    Tag tag;
    TILEGRAD_TRY(ReadTag(&tag));
    const auto type = NumberTypeOf(tag.type);
    if (!type || tag.size != RowOf(*type).size * out->places())
      return Damaged("{} numbers, stored as {} bytes of type {}", out->places(), tag.size,
                     static_cast<std::uint32_t>(tag.type));
    std::vector<std::uint8_t> bytes;
    TILEGRAD_TRY(Data(tag, &bytes));
    out->numbers = MatNumbers(*type, std::move(bytes));
    return {};
  }

  Status Text(MatArray* out) {
    out->kind = MatKind::kText;
    Tag tag;
    TILEGRAD_TRY(ReadTag(&tag));
    std::vector<std::uint8_t> bytes;
    TILEGRAD_TRY(Data(tag, &bytes));
    if (tag.type == MatType::kUtf8) {
      out->text.assign(bytes.begin(), bytes.end());
      return {};
    }
    const auto number = NumberTypeOf(tag.type);
    const std::size_t each = tag.type == MatType::kUtf16   ? 2
                             : tag.type == MatType::kUtf32 ? 4
                             : number                      ? RowOf(*number).size
                                                           : 0;
    if (each == 0 || each > 4 || bytes.size() % each != 0)
      return Damaged("text of type {}", static_cast<std::uint32_t>(tag.type));
    for (std::size_t i = 0; i < bytes.size(); i += each) {
      std::uint32_t c = 0;
      std::memcpy(&c, bytes.data() + i, each);
      AppendUtf8(c, &out->text);
    }
    return {};
  }

  Status Struct(MatArray* out, std::size_t depth) {
    std::vector<std::uint8_t> bytes;
    TILEGRAD_TRY(Expect(MatType::kInt32, 4, "the length of field names", &bytes));
    const std::size_t length = bytes.size() == 4 ? Word(bytes.data()) : 0;
    if (length == 0 || length > 256) return Damaged("field names of {} bytes", length);
    TILEGRAD_TRY(Expect(MatType::kInt8, kMaxFields * length, "the names of fields", &bytes));
    for (std::size_t at = 0; at + length <= bytes.size(); at += length) {
      const char* const name = reinterpret_cast<const char*>(bytes.data() + at);
      out->fields.emplace_back(name, strnlen(name, length));
    }
    return Elements(MatKind::kStruct, out->fields.size(), out, depth);
  }

  Status Elements(MatKind kind, std::size_t each, MatArray* out, std::size_t depth) {
    out->kind = kind;
    const std::size_t count = each * out->places();
    if (count > left_ / 8) return Damaged("{} elements in {} bytes", count, left_);
    std::string no_name;
    for (std::size_t i = 0; i < count; ++i) {
      TILEGRAD_TRY(ReadBudget::Take(sizeof(MatArray), where_));
      Tag tag;
      TILEGRAD_TRY(ReadTag(&tag));
      TILEGRAD_TRY(Body(tag, &out->elements.emplace_back(), &no_name, depth + 1));
    }
    return {};
  }

  MatStream& stream_;
  std::string where_;
  std::size_t left_ = 0;
};

Status CheckMatHeader(std::span<const std::uint8_t> bytes, const std::string& name) {
  constexpr std::uint8_t kHdf[] = {0x89, 'H', 'D', 'F'};
  if (bytes.size() >= 4 && std::equal(std::begin(kHdf), std::end(kHdf), bytes.begin()))
    return InvalidArgument("{}: a MATLAB file of version 7.3 (HDF5): save it with -v7", name);
  if (bytes.size() < kHeader)
    return DataLoss("{}: not a MATLAB file: {} bytes", name, bytes.size());
  const bool little = bytes[126] == 'I' && bytes[127] == 'M';
  const bool big = bytes[126] == 'M' && bytes[127] == 'I';
  if (big) return InvalidArgument("{}: a big-endian MATLAB file: save it on another machine", name);
  if (!little) return InvalidArgument("{}: not a MATLAB file of version 5", name);
  const unsigned version = bytes[124] | (bytes[125] << 8);
  if (version == 0x0200)
    return InvalidArgument("{}: a MATLAB file of version 7.3 (HDF5): save it with -v7", name);
  if (version != 0x0100)
    return InvalidArgument("{}: a MATLAB file of unknown version {:#06x}", name, version);
  return {};
}

}  // namespace

Result<MatFile> ReadMat(std::span<const std::uint8_t> bytes, const std::string& name) {
  const ReadBudget budget;
  TILEGRAD_TRY(CheckMatHeader(bytes, name));
  MatFile file{name, {}};
  std::size_t at = kHeader;
  while (at < bytes.size()) {
    if (bytes.size() - at < 8) return DataLoss("{}: cut off after {} bytes", name, at);
    const std::uint32_t type = Word(&bytes[at]);
    const std::size_t size = Word(&bytes[at + 4]);
    if (size > bytes.size() - at - 8)
      return DataLoss("{}: cut off: {} bytes of a variable, where {} are announced", name,
                      bytes.size() - at - 8, size);
    const bool packed = type == static_cast<std::uint32_t>(MatType::kCompressed);
    MatStream stream(packed ? bytes.subspan(at + 8, size) : bytes.subspan(at, size + 8), packed);
    auto& [variable, array] = file.variables.emplace_back();
    TILEGRAD_TRY(Parser(stream, name).Matrix(&array, &variable));
    // Plain variables are filled up to eight bytes, packed ones are not.
    at += 8 + (packed ? size : (size + 7) / 8 * 8);
  }
  return file;
}

Result<MatFile> LoadMat(const Path& path) {
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  return ReadMat(bytes, path.string());
}

}  // namespace tilegrad::io
