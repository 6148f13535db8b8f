// SPDX-License-Identifier: Apache-2.0
// MATLAB files of versions 5 (written by `save` up to -v6 and -v7, and by scipy.io.savemat) and 7.3
// (HDF5), the format of the annotations of CUB-200 and PASCAL3D+. Read by libmatio in a child
// process (guarded_process.h); also written.
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

// Arrays of only 0 and 1, such as masks, take one bit per number: CUB-200 has 5,964 masks in one
// file.
struct MatNumbers {
  std::uint64_t count = 0;
  std::vector<double> values;      // all numbers, or
  std::vector<std::uint8_t> bits;  // eight per byte, lowest bit first

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
  std::uint8_t logical = 0;                  // 1: logical (boolean) numbers
  std::vector<std::uint64_t> dims = {0, 0};  // the first dimension varies fastest
  MatNumbers numbers;
  std::string text;                 // UTF-8; rows of a text matrix are concatenated
  std::vector<std::string> fields;  // kStruct
  // kCell: one per place; kStruct: for each place its fields, in their order.
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

// Numbers, text, structs and cells nested up to 16 deep; other variables (sparse, objects,
// functions), complex numbers, version 4 and truncated files are errors, which name the file and,
// if known, the variable. Numbers missing from a damaged file may be arbitrary. No file makes it
// crash.
Result<MatFile> LoadMat(const Path& path);
// Decodes the child's output, which is untrusted: the library may have misbehaved.
Result<MatVariables> MatFromReader(std::span<const std::uint8_t> bytes);
Bytes MatForReader(const Result<MatVariables>& variables);

// Writes a compressed file of version 5 from variables whose elements match their dims; atomic.
// Stores numbers as doubles, logical ones as bytes.
Status SaveMat(const Path& path, const MatVariables& variables);

// A cursor in a file, for reading with checks. Errors name file and place: "anno_train.mat:
// sfm_anno(12).trans: expected 2 numbers, got 3".
class MatPlace {
 public:
  static Result<MatPlace> Variable(const MatFile& file, const std::string& name);

  // The array itself.
  std::size_t places() const { return array_->places(); }
  const MatArray& array() const { return *array_; }
  const std::string& where() const { return where_; }

  // Field `name` of place `index` of a struct.
  Result<MatPlace> Field(std::size_t index, const std::string& name) const;
  bool HasField(const std::string& name) const;
  // All numbers, which must be finite; `count` is the expected number.
  Result<std::vector<double>> Numbers(std::size_t count) const;
  Result<double> Number() const;
  Result<std::string> Text() const;  // not empty
  // OK for a struct with any number of places.
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
