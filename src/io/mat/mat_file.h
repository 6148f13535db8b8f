// SPDX-License-Identifier: Apache-2.0
// MATLAB's files of version 5 (what `save` writes up to -v6 and -v7, and scipy.io.savemat), as the
// annotations of CUB-200 and PASCAL3D+ come: in and out. Source: MathWorks, "MAT-File Format",
// R2019b, section "Level 5 MAT-File Format".
//
// The reader is ours because of memory: libmatio (1.5.23, which survived 10,000 damaged files)
// unpacks whatever a file declares, with no limit, and holds the 5,964 masks of CUB as bytes, 1.1
// GB. Here masks take a bit a pixel, and every array asks base/read_budget.h first.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "io/mat/mat_array.h"

namespace tilegrad::io {

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
