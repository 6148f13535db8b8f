// SPDX-License-Identifier: Apache-2.0
// MATLAB's files of version 5 (what `save` writes up to -v6 and -v7, and scipy.io.savemat), as the
// annotations of CUB-200 and PASCAL3D+ come: in and out. Source: MathWorks, "MAT-File Format",
// R2019b, section "Level 5 MAT-File Format".
//
// The reader is ours because of memory: libmatio (1.5.23, which survived 10,000 damaged files)
// unpacks whatever a file declares, with no limit, and holds the 5,964 masks of CUB as bytes, 1.1
// GB. Here masks take a bit a pixel, and every array asks base/read_budget.h first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/file.h"
#include "io/stored_number.h"

namespace tilegrad::io {

// The "mi" types of the format.
enum class MatType : std::uint32_t {
  kInt8 = 1,
  kUint8 = 2,
  kInt16 = 3,
  kUint16 = 4,
  kInt32 = 5,
  kUint32 = 6,
  kSingle = 7,
  kDouble = 9,
  kInt64 = 12,
  kUint64 = 13,
  kMatrix = 14,
  kCompressed = 15,
  kUtf8 = 16,
  kUtf16 = 17,
  kUtf32 = 18
};
// Nothing for what is no number. Arrays of doubles are often stored as small integers.
std::optional<StoredType> NumberTypeOf(MatType type);

// Numbers as they are stored. Bytes that are all 0 or 1, as masks are, take a bit each.
class MatNumbers {
 public:
  MatNumbers() = default;
  MatNumbers(StoredType type, std::vector<std::uint8_t> stored);  // whole numbers of that type
  explicit MatNumbers(std::span<const double> numbers);
  std::size_t size() const { return count_; }
  double operator[](std::size_t i) const;

 private:
  StoredType type_ = StoredType::kF64;
  bool bits_ = false;
  std::size_t count_ = 0;
  std::vector<std::uint8_t> stored_;
};

enum class MatKind { kNumbers, kText, kStruct, kCell };

struct MatArray {
  MatKind kind = MatKind::kNumbers;
  bool logical = false;
  std::vector<std::size_t> dims = {0, 0};  // the first varies fastest in memory
  MatNumbers numbers;
  std::string text;                 // UTF-8; rows of a matrix of text one after the other
  std::vector<std::string> fields;  // kStruct
  // kCell: one for each place; kStruct: for each place its fields, in their order.
  std::vector<MatArray> elements;

  std::size_t places() const;  // the product of dims

  static MatArray Number(double value) { return Numbers({1, 1}, std::vector<double>{value}); }
  static MatArray Numbers(std::vector<std::size_t> dims, std::span<const double> values);
  static MatArray Mask(std::size_t rows, std::size_t columns, std::vector<std::uint8_t> values);
  static MatArray Text(std::string_view text);
  // [1, n] of structs with these fields; `elements` as above.
  static MatArray Structs(std::vector<std::string> fields, std::vector<MatArray> elements);
};

using MatVariables = std::vector<std::pair<std::string, MatArray>>;

// Classes and a flag of arrays, as files number them.
inline constexpr std::uint32_t kCellClass = 1, kStructClass = 2, kCharClass = 4,
                               kLogicalFlag = 0x200;

struct MatFile {
  std::string name;  // for messages
  MatVariables variables;
};

// Numbers, text, structs and cells of any depth up to 16; other variables (sparse, objects,
// functions) and complex numbers are errors, as are version 4 and 7.3 (HDF5), big-endian files and
// everything that is cut off, longer than it says or not finished. Errors name `name` and the
// variable. Whatever the bytes, nothing crashes.
Result<MatFile> ReadMat(std::span<const std::uint8_t> bytes, const std::string& name);
Result<MatFile> LoadMat(const Path& path);

enum class MatPacking { kPlain, kCompressed };
// A file of variables whose elements fit their dims. Numbers are stored as doubles, logical ones as
// bytes.
Bytes EncodeMat(const MatVariables& variables, MatPacking packing = MatPacking::kCompressed);
Status SaveMat(const Path& path, const MatVariables& variables);

// A place in a file, for who wants to know what is there. Errors name file and place:
// "anno_train.mat: sfm_anno(12).trans: expected 2 numbers, got 3".
class MatPlace {
 public:
  static Result<MatPlace> Variable(const MatFile& file, const std::string& name);

  // Of the array itself.
  std::size_t places() const { return array_->places(); }
  const MatArray& array() const { return *array_; }
  const std::string& where() const { return where_; }

  // Field `name` of place `index` of a struct.
  Result<MatPlace> Field(std::size_t index, const std::string& name) const;
  bool HasField(const std::string& name) const;
  // All of its numbers, which are finite; `count`: how many are expected.
  Result<std::vector<double>> Numbers(std::size_t count) const;
  Result<double> Number() const;
  Result<std::string> Text() const;  // not empty
  // A struct, of however many places.
  Status ExpectStruct() const;
  Status ExpectSize(std::size_t rows, std::size_t columns) const;

 private:
  MatPlace(const MatArray* array, std::string where) : array_(array), where_(std::move(where)) {}
  const MatArray* array_;
  std::string where_;
};

}  // namespace tilegrad::io
