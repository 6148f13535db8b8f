// SPDX-License-Identifier: Apache-2.0
#include "io/ply_header.h"

#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

constexpr std::size_t kMaxProperties = 256;

struct TypeName {
  std::string_view name, sized_name;
  StoredType type;
};
constexpr std::array<TypeName, 8> kPlyTypes = {{{"char", "int8", StoredType::kI8},
                                                {"uchar", "uint8", StoredType::kU8},
                                                {"short", "int16", StoredType::kI16},
                                                {"ushort", "uint16", StoredType::kU16},
                                                {"int", "int32", StoredType::kI32},
                                                {"uint", "uint32", StoredType::kU32},
                                                {"float", "float32", StoredType::kF32},
                                                {"double", "float64", StoredType::kF64}}};

bool ParseType(std::string_view token, StoredType& type) {
  for (const TypeName& row : kPlyTypes) {
    if (token != row.name && token != row.sized_name) continue;
    type = row.type;
    return true;
  }
  return false;
}

bool ParseFormat(std::string_view rest, PlyHeader& header) {
  const auto token = NextToken(rest);
  using Encoding = PlyHeader::Encoding;
  header.encoding = token == "binary_little_endian" ? Encoding::kLittleEndian
                    : token == "binary_big_endian"  ? Encoding::kBigEndian
                                                    : Encoding::kText;
  return header.encoding != Encoding::kText || token == "ascii";
}

bool ParseElement(std::string_view rest, PlyHeader& header) {
  PlyElement element;
  element.name = NextToken(rest);
  if (!ParseNumber(NextToken(rest), element.count)) return false;
  header.elements.push_back(std::move(element));
  return true;
}

bool ParseProperty(std::string_view rest, PlyHeader& header) {
  if (header.elements.empty()) return false;
  auto& properties = header.elements.back().properties;
  PlyProperty property;
  auto token = NextToken(rest);
  if (token == "list") {
    StoredType count_type;
    if (!ParseType(NextToken(rest), count_type)) return false;
    if (count_type == StoredType::kF32 || count_type == StoredType::kF64) return false;
    property.count_type = count_type;
    token = NextToken(rest);
  }
  if (!ParseType(token, property.type) || properties.size() == kMaxProperties) return false;
  property.name = NextToken(rest);
  properties.push_back(std::move(property));
  return true;
}

void ParseComment(std::string_view rest, PlyHeader& header) {
  if (LowerCase(NextToken(rest)) != "texturefile") return;
  const auto begin = rest.find_first_not_of(" \t");
  if (begin != std::string_view::npos) header.textures.emplace_back(rest.substr(begin));
}

bool ParseLine(std::string_view line, PlyHeader& header) {
  const auto keyword = NextToken(line);
  if (keyword == "format") return ParseFormat(line, header);
  if (keyword == "element") return ParseElement(line, header);
  if (keyword == "property") return ParseProperty(line, header);
  if (keyword == "comment") ParseComment(line, header);
  return keyword == "comment" || keyword == "obj_info";
}

// The minimum bytes of a row: a list may be empty, a number in text is a digit and a space.
std::size_t LeastRowSize(const PlyElement& element, PlyHeader::Encoding encoding) {
  std::size_t size = 0;
  for (const PlyProperty& p : element.properties)
    size += encoding == PlyHeader::Encoding::kText ? 2 : RowOf(p.count_type.value_or(p.type)).size;
  return size;
}

Status CheckCounts(const PlyHeader& header, const std::string& place) {
  for (const PlyElement& element : header.elements) {
    const std::size_t row = LeastRowSize(element, header.encoding);
    if (row == 0 && element.count > 0)
      return DataLoss("{}: element \"{}\" has no property", place, element.name);
    // The last number of a text may lack its space.
    if (element.count > 0 && element.count > (header.data.size() + 1) / row) {
      return DataLoss("{}: the header declares {} \"{}\", but only {} bytes follow", place,
                      element.count, element.name, header.data.size());
    }
  }
  return {};
}

}  // namespace

std::size_t PlyHeader::CountOf(std::string_view element) const {
  for (const PlyElement& e : elements) {
    if (e.name == element) return e.count;
  }
  return 0;
}

Result<PlyHeader> ParsePlyHeader(std::string_view file, const std::string& place) {
  PlyHeader header;
  Lines lines(file, place);
  std::string_view line;
  if (!lines.Next(line) || line != "ply") return DataLoss("{}: does not begin with \"ply\"", place);
  while (lines.Next(line)) {
    if (line.starts_with("end_header")) {
      header.data = lines.Rest();
      TILEGRAD_TRY(CheckCounts(header, place));
      return header;
    }
    if (!ParseLine(line, header))
      return lines.Error("\"{}\" is not a line of a PLY header", line.substr(0, 80));
  }
  return DataLoss("{}: ends before end_header", place);
}

}  // namespace tilegrad::io
