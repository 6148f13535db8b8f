// SPDX-License-Identifier: Apache-2.0
// MATLAB's files of versions 5 (what `save` writes up to -v6 and -v7, and scipy.io.savemat) and 7.3
// (HDF5), as the annotations of CUB-200 and PASCAL3D+ come: in by libmatio, which runs in a process
// of its own (guarded_process.h), and out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

// Numbers that are all 0 or 1, as masks are, take a bit each: CUB-200 has 5,964 masks in one file.
struct MatNumbers {
  std::uint64_t count = 0;
  std::vector<double> values;      // of all, or
  std::vector<std::uint8_t> bits;  // eight in each, the first the lowest

  template <class Number>
  static MatNumbers Of(std::span<const Number> numbers);
  std::size_t size() const { return count; }
  double operator[](std::size_t i) const {
    return bits.empty() ? values[i] : (bits[i / 8] >> (i % 8)) & 1;
  }
};

enum class MatKind : std::uint8_t { kNumbers, kText, kStruct, kCell };

struct MatArray {
  MatKind kind = MatKind::kNumbers;
  std::uint8_t logical = 0;                  // 1: its numbers are truth values
  std::vector<std::uint64_t> dims = {0, 0};  // the first varies fastest in memory
  MatNumbers numbers;
  std::string text;                 // UTF-8; rows of a matrix of text one after the other
  std::vector<std::string> fields;  // kStruct
  // kCell: one for each place; kStruct: for each place its fields, in their order.
  std::vector<MatArray> elements;

  std::size_t places() const;  // the product of dims

  static MatArray Number(double value) { return Numbers({1, 1}, std::vector<double>{value}); }
  static MatArray Numbers(std::vector<std::uint64_t> dims, std::span<const double> values);
  static MatArray Mask(std::size_t rows, std::size_t columns,
                       const std::vector<std::uint8_t>& values);
  static MatArray Text(std::string_view text);
  // [1, n] of structs with these fields; `elements` as above.
  static MatArray Structs(std::vector<std::string> fields, std::vector<MatArray> elements);
};

using MatVariable = std::pair<std::string, MatArray>;
using MatVariables = std::vector<MatVariable>;

struct MatFile {
  std::string name;  // for messages
  MatVariables variables;
};

// Numbers, text, structs and cells of any depth up to 16; other variables (sparse, objects,
// functions) and complex numbers are errors, as are version 4 and everything that is cut off.
// Errors name the file, and the variable where it is known. Numbers that a damaged file announces
// and lacks may be any. Whatever the file, nothing crashes.
Result<MatFile> LoadMat(const Path& path);
// Between that process and this one. What comes is untrusted: the library may have gone wrong.
Result<MatVariables> MatFromReader(std::span<const std::uint8_t> bytes);
Bytes MatForReader(const Result<MatVariables>& variables);

// A file of version 5, packed, of variables whose elements fit their dims; whole or not at all.
// Numbers are stored as doubles, logical ones as bytes.
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

template <class Number>
MatNumbers MatNumbers::Of(std::span<const Number> numbers) {
  MatNumbers out;
  out.count = numbers.size();
  bool truths = true;
  for (const Number n : numbers) truths = truths && (n == Number(0) || n == Number(1));
  if (!truths) {
    out.values.assign(numbers.begin(), numbers.end());
    return out;
  }
  out.bits.resize((numbers.size() + 7) / 8);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const int bit = numbers[i] == Number(1) ? 1 << (i % 8) : 0;
    out.bits[i / 8] = static_cast<std::uint8_t>(out.bits[i / 8] | bit);
  }
  return out;
}

}  // namespace tilegrad::io
