// SPDX-License-Identifier: Apache-2.0
// An array as MATLAB's files of version 5 hold it: numbers, text, a struct or cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tilegrad::io {

// How numbers are stored ("mi" types of the format). Arrays of doubles are often stored as small
// integers.
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
std::size_t SizeOfType(MatType type);  // bytes of one number; 0 of what is no number

// Numbers as they are stored. Bytes that are all 0 or 1, as masks are, take a bit each.
class MatNumbers {
 public:
  MatNumbers() = default;
  MatNumbers(MatType type, std::vector<std::uint8_t> stored);  // whole numbers of that type
  explicit MatNumbers(std::span<const double> numbers);
  std::size_t size() const { return count_; }
  double operator[](std::size_t i) const;

 private:
  MatType type_ = MatType::kDouble;
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

}  // namespace tilegrad::io
