// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/mat/mat_file.h"

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
