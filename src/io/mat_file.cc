// SPDX-License-Identifier: Apache-2.0
#include "io/mat_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>

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

}  // namespace

std::optional<StoredType> NumberTypeOf(MatType type) {
  static constexpr std::pair<MatType, StoredType> kTypes[] = {
      {MatType::kInt8, StoredType::kI8},    {MatType::kUint8, StoredType::kU8},
      {MatType::kInt16, StoredType::kI16},  {MatType::kUint16, StoredType::kU16},
      {MatType::kInt32, StoredType::kI32},  {MatType::kUint32, StoredType::kU32},
      {MatType::kInt64, StoredType::kI64},  {MatType::kUint64, StoredType::kU64},
      {MatType::kSingle, StoredType::kF32}, {MatType::kDouble, StoredType::kF64}};
  const auto* row = std::ranges::find(kTypes, type, &std::pair<MatType, StoredType>::first);
  return row == std::end(kTypes) ? std::nullopt : std::optional(row->second);
}

MatNumbers::MatNumbers(StoredType type, std::vector<std::uint8_t> stored)
    : type_(type), count_(stored.size() / RowOf(type).size), stored_(std::move(stored)) {
  bits_ = RowOf(type).size == 1 && count_ > 0 &&
          std::ranges::all_of(stored_, [](std::uint8_t b) { return b <= 1; });
  if (!bits_) return;
  std::vector<std::uint8_t> packed((count_ + 7) / 8);
  for (std::size_t i = 0; i < count_; ++i)
    packed[i / 8] = static_cast<std::uint8_t>(packed[i / 8] | (stored_[i] << (i % 8)));
  stored_ = std::move(packed);
}

MatNumbers::MatNumbers(std::span<const double> numbers)
    : count_(numbers.size()), stored_(numbers.size_bytes()) {
  if (!numbers.empty()) std::memcpy(stored_.data(), numbers.data(), numbers.size_bytes());
}

double MatNumbers::operator[](std::size_t i) const {
  if (bits_) return (stored_[i / 8] >> (i % 8)) & 1;
  const StoredTypeRow& row = RowOf(type_);
  return row.load(stored_.data() + i * row.size);
}

std::size_t MatArray::places() const {
  std::size_t product = 1;
  for (const std::size_t extent : dims) product *= extent;
  return product;
}

MatArray MatArray::Numbers(std::vector<std::size_t> dims, std::span<const double> values) {
  MatArray out;
  out.dims = std::move(dims);
  out.numbers = MatNumbers(values);
  return out;
}

MatArray MatArray::Mask(std::size_t rows, std::size_t columns, std::vector<std::uint8_t> values) {
  MatArray out;
  out.logical = true;
  out.dims = {rows, columns};
  out.numbers = MatNumbers(StoredType::kU8, std::move(values));
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
    return InvalidArgument("{}: {} elements, but element {} is wanted", where_, array_->places(),
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
  if (array_->kind == MatKind::kNumbers && array_->dims == std::vector{rows, columns}) return {};
  std::string dims;
  for (const std::size_t extent : array_->dims)
    dims += fmt::format("{}{}", dims.empty() ? "" : " x ", extent);
  return InvalidArgument("{}: expected {} x {} numbers, got {} of {}", where_, rows, columns,
                         KindName(array_->kind), dims);
}

}  // namespace tilegrad::io
