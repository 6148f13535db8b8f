// SPDX-License-Identifier: Apache-2.0
#include <matio.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/read_budget.h"
#include "base/text.h"
#include "io/child_record.h"
#include "io/guarded_process.h"
#include "io/mat_file.h"

namespace tilegrad::io {

template <>
inline constexpr auto kFieldsOf<MatNumbers> = std::tuple(&MatNumbers::count, &MatNumbers::values,
                                                         &MatNumbers::bits);
template <>
inline constexpr auto kFieldsOf<MatArray> = std::tuple(&MatArray::kind, &MatArray::logical,
                                                       &MatArray::dims, &MatArray::numbers,
                                                       &MatArray::text, &MatArray::fields,
                                                       &MatArray::elements);
template <>
inline constexpr auto kFieldsOf<MatVariable> = std::tuple(&MatVariable::first,
                                                          &MatVariable::second);

namespace {

constexpr int kMaxMatDepth = 16;
constexpr std::size_t kMostPlaces = std::size_t{1} << 40;

// The child -----------------------------------------------------------------------------------

struct MatFileEnd {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct MatVariableEnd {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};

std::string g_complaint;  // the library's first

// The type of the message differs between versions of the library.
constexpr auto kNoteComplaint = [](int level, auto* message) {
  if (level <= (MATIO_LOG_LEVEL_CRITICAL) && g_complaint.empty()) g_complaint = message;
};

// 0: too many.
std::size_t PlacesOf(const matvar_t& variable) {
  std::size_t product = 1;
  for (int i = 0; i < variable.rank; ++i) {
    const std::size_t extent = variable.dims[i];
    if (extent > 0 && product > kMostPlaces / extent) return 0;
    product *= extent;
  }
  return variable.rank == 0 ? 0 : product;
}

std::span<matvar_t* const> ElementsOf(const matvar_t& variable) {
  if (variable.data == nullptr) return {};
  return {static_cast<matvar_t* const*>(variable.data), variable.nbytes / sizeof(matvar_t*)};
}

bool HasElements(const matvar_t& variable) {
  return variable.class_type == MAT_C_STRUCT || variable.class_type == MAT_C_CELL;
}

// Memory of the variable once its data are read.
std::size_t BytesOfVariable(const matvar_t& variable) {
  std::size_t bytes = sizeof(MatArray);
  if (!HasElements(variable))
    return bytes + PlacesOf(variable) * Mat_SizeOfClass(variable.class_type);
  for (const matvar_t* element : ElementsOf(variable)) {
    if (element != nullptr) bytes += BytesOfVariable(*element);
  }
  return bytes;
}

template <class Number>
Status TakeNumbers(const matvar_t& variable, std::size_t count, MatArray* out) {
  if (variable.data == nullptr || variable.nbytes < count * sizeof(Number))
    return DataLoss("{} numbers, stored as {} bytes", count, variable.nbytes);
  out->numbers = MatNumbers::Of(std::span(static_cast<const Number*>(variable.data), count));
  return {};
}

Status TakeAnyNumbers(const matvar_t& variable, MatArray* out) {
  const std::size_t count = out->places();
  if (count == 0) return {};
  switch (variable.data_type) {
    case MAT_T_INT8:
      return TakeNumbers<std::int8_t>(variable, count, out);
    case MAT_T_UINT8:
      return TakeNumbers<std::uint8_t>(variable, count, out);
    case MAT_T_INT16:
      return TakeNumbers<std::int16_t>(variable, count, out);
    case MAT_T_UINT16:
      return TakeNumbers<std::uint16_t>(variable, count, out);
    case MAT_T_INT32:
      return TakeNumbers<std::int32_t>(variable, count, out);
    case MAT_T_UINT32:
      return TakeNumbers<std::uint32_t>(variable, count, out);
    case MAT_T_INT64:
      return TakeNumbers<std::int64_t>(variable, count, out);
    case MAT_T_UINT64:
      return TakeNumbers<std::uint64_t>(variable, count, out);
    case MAT_T_SINGLE:
      return TakeNumbers<float>(variable, count, out);
    case MAT_T_DOUBLE:
      return TakeNumbers<double>(variable, count, out);
    default:
      return DataLoss("numbers of type {}", static_cast<int>(variable.data_type));
  }
}

Status TakeText(const matvar_t& variable, MatArray* out) {
  out->kind = MatKind::kText;
  const auto* const bytes = static_cast<const char*>(variable.data);
  if (bytes == nullptr) return {};
  if (variable.data_type == MAT_T_UTF8) {
    out->text.assign(bytes, variable.nbytes);
    return {};
  }
  const std::size_t each = Mat_SizeOf(variable.data_type);
  if (each == 0 || each > 4) return DataLoss("text of type {}", int{variable.data_type});
  for (std::size_t i = 0; i + each <= variable.nbytes; i += each) {
    std::uint32_t c = 0;
    std::memcpy(&c, bytes + i, each);
    AppendUtf8(c, &out->text);
  }
  return {};
}

Status TakeArray(matvar_t* variable, int depth, MatArray* out);

Status TakeElements(const matvar_t& variable, int depth, MatArray* out) {
  const std::size_t each = out->kind == MatKind::kStruct ? out->fields.size() : 1;
  const auto elements = ElementsOf(variable);
  if (elements.size() != each * out->places())
    return DataLoss("{} elements, where {} belong", elements.size(), each * out->places());
  for (matvar_t* element : elements)
    TILEGRAD_TRY(TakeArray(element, depth + 1, &out->elements.emplace_back()));
  return {};
}

Status TakeStruct(matvar_t& variable, int depth, MatArray* out) {
  out->kind = MatKind::kStruct;
  const unsigned count = Mat_VarGetNumberOfFields(&variable);
  char* const* const names = Mat_VarGetStructFieldnames(&variable);
  for (unsigned i = 0; i < count; ++i) out->fields.emplace_back(names[i] ? names[i] : "");
  return TakeElements(variable, depth, out);
}

Status TakeArray(matvar_t* variable, int depth, MatArray* out) {
  if (variable == nullptr) return DataLoss("an element is missing or damaged");
  if (depth == kMaxMatDepth) return DataLoss("arrays within arrays, more than {} deep", depth);
  if (variable->isComplex != 0) return DataLoss("complex numbers, which nothing here needs");
  if (variable->class_type == MAT_C_EMPTY || variable->rank == 0) return {};
  out->logical = variable->isLogical != 0 ? 1 : 0;
  out->dims.assign(variable->dims, variable->dims + variable->rank);
  switch (variable->class_type) {
    case MAT_C_CELL:
      out->kind = MatKind::kCell;
      return TakeElements(*variable, depth, out);
    case MAT_C_STRUCT:
      return TakeStruct(*variable, depth, out);
    case MAT_C_CHAR:
      return TakeText(*variable, out);
    default:
      if (variable->class_type >= MAT_C_DOUBLE && variable->class_type <= MAT_C_UINT64)
        return TakeAnyNumbers(*variable, out);
      return DataLoss("an array of class {}: neither numbers, text, structs nor cells",
                      static_cast<int>(variable->class_type));
  }
}

// The next variable with its data; null at the end.
Result<std::unique_ptr<matvar_t, MatVariableEnd>> NextVariable(mat_t* file) {
  std::unique_ptr<matvar_t, MatVariableEnd> variable(Mat_VarReadNextInfo(file));
  if (!variable || !g_complaint.empty()) return variable;
  TILEGRAD_TRY(
      ReadBudget::Take(BytesOfVariable(*variable), variable->name ? variable->name : "a variable"));
  if (Mat_VarReadDataAll(file, variable.get()) != 0 && g_complaint.empty())
    g_complaint = "the data cannot be read";
  return variable;
}

Result<MatVariables> ReadVariables(const Path& path) {
  Mat_LogInitFunc("tilegrad", kNoteComplaint);
  const std::unique_ptr<mat_t, MatFileEnd> file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) return DataLoss("{}", g_complaint.empty() ? "the file cannot be read" : g_complaint);
  MatVariables out;
  while (true) {
    TILEGRAD_ASSIGN(const auto variable, NextVariable(file.get()));
    const std::string name = variable && variable->name ? variable->name : "";
    Status status = g_complaint.empty() ? Status() : DataLoss("{}", g_complaint);
    if (status.ok() && !variable) return out;
    auto& [own_name, array] = out.emplace_back(name, MatArray());
    if (status.ok()) status = TakeArray(variable.get(), 0, &array);
    if (!status.ok()) return name.empty() ? status : status.Within(name);
  }
}

// The parent ----------------------------------------------------------------------------------

std::uint32_t WordAt(std::span<const std::uint8_t> bytes, std::size_t at, bool swapped) {
  std::uint32_t word;
  std::memcpy(&word, bytes.data() + at, sizeof word);
  return swapped ? __builtin_bswap32(word) : word;
}

// The number of variables in a file of version 5. libmatio takes a truncated variable for the end
// of the file.
Result<std::size_t> CountVariables(std::span<const std::uint8_t> bytes, bool swapped) {
  constexpr std::uint32_t kCompressed = 15;
  std::size_t count = 0, at = 128;
  for (; at < bytes.size(); ++count) {
    if (bytes.size() - at < 8) return DataLoss("cut off after {} bytes", at);
    const std::uint32_t type = WordAt(bytes, at, swapped);
    const std::size_t size = WordAt(bytes, at + 4, swapped);
    if (size > bytes.size() - at - 8)
      return DataLoss("cut off: {} bytes of a variable, where {} are announced",
                      bytes.size() - at - 8, size);
    // Plain variables are padded to eight bytes, compressed ones are not.
    at += 8 + (type == kCompressed ? size : (size + 7) / 8 * 8);
  }
  return count;
}

struct MatHeader {
  std::size_t bytes = 0;                 // of the file
  std::optional<std::size_t> variables;  // of version 5
};

Result<MatHeader> CheckHeader(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 128) return DataLoss("not a MATLAB file: {} bytes", bytes.size());
  const std::string_view order(reinterpret_cast<const char*>(&bytes[126]), 2);
  const int version = order == "MI" ? bytes[124] : bytes[125];
  MatHeader out{bytes.size(), std::nullopt};
  if ((order != "IM" && order != "MI") || version < 1 || version > 2)
    return InvalidArgument("not a MATLAB file of version 5 or 7.3");
  if (version == 2) return out;
  TILEGRAD_ASSIGN(out.variables, CountVariables(bytes, order == "MI"));
  return out;
}

// Checks counts and kinds against the contract of MatArray.
Status CheckArray(const MatArray& array) {
  const Status broken = DataLoss("the reader returned an array that is not whole");
  std::size_t places = 1;
  for (const std::uint64_t extent : array.dims) {
    if (extent > 0 && places > kMostPlaces / extent) return broken;
    places *= extent;
  }
  const MatNumbers& n = array.numbers;
  const bool numbers = array.kind == MatKind::kNumbers, structs = array.kind == MatKind::kStruct,
             cells = array.kind == MatKind::kCell;
  const std::size_t each = structs ? array.fields.size() : cells ? 1 : 0;
  const bool stored = n.bits.empty() ? n.values.size() == n.count
                                     : n.bits.size() == (n.count + 7) / 8 && n.values.empty();
  if (array.kind > MatKind::kCell || array.logical > 1 || array.dims.size() < 2 || !stored ||
      n.count > kMostPlaces || n.count != (numbers ? places : 0) ||
      array.elements.size() != each * places)
    return broken;
  for (const MatArray& element : array.elements) TILEGRAD_TRY(CheckArray(element));
  return {};
}

Result<MatVariables> ReadGuarded(const Path& path, const MatHeader& header) {
  const int megabytes = static_cast<int>(header.bytes >> 20);
  const GuardLimits limits{.cpu_seconds = 20 + 2 * megabytes,
                           .wall_seconds = 120.0 + 10 * megabytes,
                           .memory_bytes = std::min(std::size_t{4} << 30, (std::size_t{256} << 20) +
                                                                              1000 * header.bytes)};
  const auto read = [&](AskParent) { return MatForReader(ReadVariables(path)); };
  const auto no_answer = [](std::string_view) { return std::optional<Bytes>(); };
  auto bytes = RunGuarded(read, no_answer, limits);
  if (!bytes.ok()) return bytes.status().Within("reading it");
  TILEGRAD_TRY(ReadBudget::Take(bytes->size(), "its variables"));
  TILEGRAD_ASSIGN(MatVariables variables, MatFromReader(*bytes));
  if (header.variables && variables.size() != *header.variables)
    return DataLoss("{} could be read of {}", Count(variables.size(), "variable"),
                    *header.variables);
  return variables;
}

}  // namespace

Bytes MatForReader(const Result<MatVariables>& variables) { return EncodeRecord(variables); }

Result<MatVariables> MatFromReader(std::span<const std::uint8_t> bytes) {
  TILEGRAD_ASSIGN(MatVariables variables, DecodeRecord<MatVariables>(bytes));
  for (const auto& [name, array] : variables) TILEGRAD_TRY(CheckArray(array).Within(name));
  return variables;
}

Result<MatFile> LoadMat(const Path& path) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(Bytes bytes, ReadFile(path));
  const auto header = CheckHeader(bytes);
  bytes = {};
  auto variables = header.ok() ? ReadGuarded(path, *header) : header.status();
  if (!variables.ok()) return variables.status().Within(path.string());
  return MatFile{path.string(), std::move(*variables)};
}

}  // namespace tilegrad::io
