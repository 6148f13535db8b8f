// SPDX-License-Identifier: Apache-2.0
#include "io/mat_file.h"

#include <matio.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace tilegrad::io {
namespace {

const char* KindName(MatKind kind) {
  switch (kind) {
    case MatKind::kText:
      return "text";
    case MatKind::kStruct:
      return "a struct";
    case MatKind::kCell:
      return "cells";
    default:
      return "numbers";
  }
}

matvar_t* NewVariable(const char* name, const MatArray& array);

// The library owns its arguments.
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
  std::string text = array.text;  // older versions of the library require non-const
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

// The library writes only to files, and closes them without fsync.
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

std::size_t MatArray::places() const {
  std::size_t product = 1;
  for (const std::size_t extent : dims) product *= extent;
  return product;
}

MatArray MatArray::Numbers(std::vector<std::uint64_t> dims, std::span<const double> values) {
  MatArray out;
  out.dims = std::move(dims);
  out.numbers = MatNumbers::Of(values);
  return out;
}

MatArray MatArray::Mask(std::size_t rows, std::size_t columns,
                        const std::vector<std::uint8_t>& values) {
  MatArray out;
  out.logical = 1;
  out.dims = {rows, columns};
  out.numbers = MatNumbers::Of<std::uint8_t>(values);
  return out;
}

MatArray MatArray::Text(std::string_view text) {
  MatArray out;
  out.kind = MatKind::kText;
  out.dims = {1, text.size()};
  out.text = text;
  return out;
}

MatArray MatArray::Structs(std::vector<std::string> fields, std::vector<MatArray> elements) {
  MatArray out;
  out.kind = MatKind::kStruct;
  out.dims = {1, fields.empty() ? 0 : elements.size() / fields.size()};
  out.fields = std::move(fields);
  out.elements = std::move(elements);
  return out;
}

Result<MatPlace> MatPlace::Variable(const MatFile& file, const std::string& name) {
  std::string there;
  for (const auto& [variable, array] : file.variables) {
    if (variable == name) return MatPlace(&array, file.name + ": " + name);
    there += (there.empty() ? "" : ", ") + variable;
  }
  return InvalidArgument("{}: no variable \"{}\"; it has: {}", file.name, name,
                         there.empty() ? "none" : there);
}

Status MatPlace::ExpectStruct() const {
  if (array_->kind == MatKind::kStruct) return {};
  return InvalidArgument("{}: expected a struct, found {}", where_, KindName(array_->kind));
}

bool MatPlace::HasField(const std::string& name) const {
  return std::ranges::find(array_->fields, name) != array_->fields.end();
}

Result<MatPlace> MatPlace::Field(std::size_t index, const std::string& name) const {
  TILEGRAD_TRY(ExpectStruct());
  const auto found = std::ranges::find(array_->fields, name);
  if (found == array_->fields.end())
    return InvalidArgument("{}: no field \"{}\" in it", where_, name);
  if (index >= array_->places())
    return InvalidArgument("{}: {} elements, but element {} is needed", where_, array_->places(),
                           index + 1);
  const auto field = static_cast<std::size_t>(found - array_->fields.begin());
  std::string where = where_;
  if (array_->places() > 1) where += fmt::format("({})", index + 1);
  return MatPlace(&array_->elements[index * array_->fields.size() + field], where + "." + name);
}

Result<std::vector<double>> MatPlace::Numbers(std::size_t count) const {
  if (array_->kind != MatKind::kNumbers)
    return InvalidArgument("{}: expected numbers, found {}", where_, KindName(array_->kind));
  if (array_->numbers.size() != count)
    return InvalidArgument("{}: expected {} numbers, got {}", where_, count,
                           array_->numbers.size());
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    out[i] = array_->numbers[i];
    if (!std::isfinite(out[i]))
      return InvalidArgument("{}: number {} is not finite", where_, i + 1);
  }
  return out;
}

Result<double> MatPlace::Number() const {
  TILEGRAD_ASSIGN(const auto numbers, Numbers(1));
  return numbers[0];
}

Result<std::string> MatPlace::Text() const {
  if (array_->kind != MatKind::kText)
    return InvalidArgument("{}: expected text, found {}", where_, KindName(array_->kind));
  if (array_->text.empty()) return InvalidArgument("{}: empty text", where_);
  return array_->text;
}

Status MatPlace::ExpectSize(std::size_t rows, std::size_t columns) const {
  if (array_->kind == MatKind::kNumbers &&
      array_->dims == std::vector<std::uint64_t>{rows, columns})
    return {};
  std::string dims;
  for (const std::size_t extent : array_->dims)
    dims += fmt::format("{}{}", dims.empty() ? "" : " x ", extent);
  return InvalidArgument("{}: expected {} x {} numbers, got {} of {}", where_, rows, columns,
                         KindName(array_->kind), dims);
}

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
