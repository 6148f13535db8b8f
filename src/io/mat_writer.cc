// SPDX-License-Identifier: Apache-2.0
#include <zlib.h>

#include <algorithm>
#include <cstring>

#include "io/mat_file.h"

namespace tilegrad::io {
namespace {

constexpr std::uint32_t kDouble = 6, kUint8 = 9;

class MatWriter {
 public:
  void Word(std::uint32_t word) { Append({reinterpret_cast<std::uint8_t*>(&word), sizeof word}); }
  void Element(MatType type, std::span<const std::uint8_t> data) {
    Word(static_cast<std::uint32_t>(type));
    Word(static_cast<std::uint32_t>(data.size()));
    Append(data);
    bytes.resize((bytes.size() + 7) / 8 * 8);
  }
  template <class T>
  void Elements(MatType type, std::span<const T> values) {
    Element(type, {reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()});
  }
  void Matrix(const MatArray& array, const std::string& name);

  Bytes bytes;

 private:
  void Append(std::span<const std::uint8_t> data) {
    bytes.insert(bytes.end(), data.begin(), data.end());
  }
  void Content(const MatArray& array);
  void FieldNames(const std::vector<std::string>& fields);
};

std::uint32_t ClassOf(const MatArray& array) {
  switch (array.kind) {
    case MatKind::kCell:
      return kCellClass;
    case MatKind::kStruct:
      return kStructClass;
    case MatKind::kText:
      return kCharClass;
    default:
      return array.logical ? kUint8 | kLogicalFlag : kDouble;
  }
}

void MatWriter::Matrix(const MatArray& array, const std::string& name) {
  Word(static_cast<std::uint32_t>(MatType::kMatrix));
  const std::size_t size_at = bytes.size();
  Word(0);
  const std::uint32_t flags[] = {ClassOf(array), 0};
  Elements(MatType::kUint32, std::span<const std::uint32_t>(flags));
  std::vector<std::int32_t> dims(array.dims.begin(), array.dims.end());
  Elements(MatType::kInt32, std::span<const std::int32_t>(dims));
  Elements(MatType::kInt8, std::span<const char>(name));
  Content(array);
  const auto size = static_cast<std::uint32_t>(bytes.size() - size_at - 4);
  std::memcpy(&bytes[size_at], &size, sizeof size);
}

void MatWriter::FieldNames(const std::vector<std::string>& fields) {
  std::size_t longest = 0;
  for (const std::string& field : fields) longest = std::max(longest, field.size());
  const std::int32_t length = static_cast<std::int32_t>(longest) + 1;
  Elements(MatType::kInt32, std::span<const std::int32_t>(&length, 1));
  std::string names;
  for (const std::string& field : fields) {
    names += field;
    names.append(static_cast<std::size_t>(length) - field.size(), '\0');
  }
  Elements(MatType::kInt8, std::span<const char>(names));
}

void MatWriter::Content(const MatArray& array) {
  if (array.kind == MatKind::kText) {
    std::vector<std::uint16_t> units;  // MATLAB's own characters; of ASCII the same as UTF-8
    for (const char c : array.text) units.push_back(static_cast<std::uint8_t>(c));
    return Elements(MatType::kUint16, std::span<const std::uint16_t>(units));
  }
  if (array.kind == MatKind::kStruct) FieldNames(array.fields);
  if (array.kind != MatKind::kNumbers) {
    for (const MatArray& element : array.elements) Matrix(element, "");
    return;
  }
  std::vector<double> numbers(array.numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = array.numbers[i];
  if (!array.logical) return Elements(MatType::kDouble, std::span<const double>(numbers));
  std::vector<std::uint8_t> flags(numbers.size());
  std::ranges::transform(numbers, flags.begin(), [](double x) { return x != 0 ? 1 : 0; });
  Elements(MatType::kUint8, std::span<const std::uint8_t>(flags));
}

Bytes Deflated(std::span<const std::uint8_t> bytes) {
  uLongf size = compressBound(bytes.size());
  Bytes out(size);
  // Cannot fail: the buffer is as large as it may get, and memory is the process's.
  compress2(out.data(), &size, bytes.data(), bytes.size(), Z_BEST_SPEED);
  out.resize(size);
  return out;
}

Bytes WriteHeader() {
  constexpr std::string_view kText = "MATLAB 5.0 MAT-file, written by tilegrad";
  Bytes header(128, ' ');
  std::ranges::copy(kText, header.begin());
  std::fill(header.begin() + 116, header.begin() + 124, std::uint8_t{0});
  header[124] = 0;
  header[125] = 1;
  header[126] = 'I';
  header[127] = 'M';
  return header;
}

}  // namespace

Bytes EncodeMat(const MatVariables& variables, MatPacking packing) {
  MatWriter file;
  file.bytes = WriteHeader();
  for (const auto& [name, array] : variables) {
    if (packing == MatPacking::kPlain) {
      file.Matrix(array, name);
      continue;
    }
    MatWriter variable;
    variable.Matrix(array, name);
    const Bytes packed = Deflated(variable.bytes);
    file.Word(static_cast<std::uint32_t>(MatType::kCompressed));
    file.Word(static_cast<std::uint32_t>(packed.size()));
    file.bytes.insert(file.bytes.end(), packed.begin(), packed.end());
  }
  return file.bytes;
}

Status SaveMat(const Path& path, const MatVariables& variables) {
  return WriteFileAtomic(path, EncodeMat(variables));
}

}  // namespace tilegrad::io
