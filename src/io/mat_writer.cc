// SPDX-License-Identifier: Apache-2.0
#include <matio.h>

#include "base/error.h"
#include "io/mat_file.h"

namespace tilegrad::io {
namespace {

matvar_t* NewVariable(const char* name, const MatArray& array);

// The library owns what it is given.
matvar_t* NewCells(const char* name, const MatArray& array, std::vector<std::size_t> dims) {
  std::vector<matvar_t*> elements;
  for (const MatArray& element : array.elements) elements.push_back(NewVariable(nullptr, element));
  return Mat_VarCreate(name, MAT_C_CELL, MAT_T_CELL, static_cast<int>(dims.size()), dims.data(),
                       elements.data(), 0);
}

matvar_t* NewStructs(const char* name, const MatArray& array, std::vector<std::size_t> dims) {
  std::vector<const char*> names;
  for (const std::string& field : array.fields) names.push_back(field.c_str());
  matvar_t* const out = Mat_VarCreateStruct(name, static_cast<int>(dims.size()), dims.data(),
                                            names.data(), static_cast<unsigned>(names.size()));
  for (std::size_t i = 0; i < array.elements.size(); ++i) {
    const std::size_t field = i % names.size(), place = i / names.size();
    Mat_VarSetStructFieldByIndex(out, field, place, NewVariable(names[field], array.elements[i]));
  }
  return out;
}

matvar_t* NewNumbers(const char* name, const MatArray& array, std::vector<std::size_t> dims) {
  const int rank = static_cast<int>(dims.size());
  std::vector<double> numbers(array.numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = array.numbers[i];
  if (array.logical == 0)
    return Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, rank, dims.data(), numbers.data(), 0);
  std::vector<std::uint8_t> truths(numbers.begin(), numbers.end());
  return Mat_VarCreate(name, MAT_C_UINT8, MAT_T_UINT8, rank, dims.data(), truths.data(),
                       MAT_F_LOGICAL);
}

matvar_t* NewVariable(const char* name, const MatArray& array) {
  std::vector<std::size_t> dims(array.dims.begin(), array.dims.end());
  std::string text = array.text;  // older versions of the library want it writable
  switch (array.kind) {
    case MatKind::kCell:
      return NewCells(name, array, dims);
    case MatKind::kStruct:
      return NewStructs(name, array, dims);
    case MatKind::kText:
      return Mat_VarCreate(name, MAT_C_CHAR, MAT_T_UTF8, static_cast<int>(dims.size()), dims.data(),
                           text.data(), 0);
    default:
      return NewNumbers(name, array, dims);
  }
}

// The library writes to files alone, and closes them without a sync.
Status WriteByLibrary(const Path& path, const MatVariables& variables) {
  mat_t* const file =
      Mat_CreateVer(path.c_str(), "MATLAB 5.0 MAT-file, written by tilegrad", MAT_FT_MAT5);
  if (file == nullptr) return IoError("the file cannot be made");
  bool good = true;
  for (const auto& [name, array] : variables) {
    matvar_t* const variable = NewVariable(name.c_str(), array);
    good = good && Mat_VarWrite(file, variable, MAT_COMPRESSION_ZLIB) == 0;
    Mat_VarFree(variable);
  }
  good = Mat_Close(file) == 0 && good;
  return good ? Status() : IoError("the file cannot be written");
}

}  // namespace

Status SaveMat(const Path& path, const MatVariables& variables) {
  TILEGRAD_TRY(MakeFolder(path.parent_path()));
  const Path draft = TemporaryOf(path);
  const Status written = WriteByLibrary(draft, variables);
  const auto bytes = written.ok() ? ReadFile(draft) : Result<Bytes>(written);
  TILEGRAD_TRY(RemoveFiles({&draft, 1}));
  if (!bytes.ok()) return bytes.status().Within(path.string());
  return WriteFileAtomic(path, *bytes);
}

}  // namespace tilegrad::io
