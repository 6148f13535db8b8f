// SPDX-License-Identifier: Apache-2.0
#include "io/sh3f.h"

#include <charconv>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "io/text_scan.h"
#include "scene/shapes.h"

namespace tilegrad::io {
namespace {

// Logical lines: comments dropped, a trailing odd backslash joins the next line, leading white
// space removed. Bytes are kept.
std::vector<std::string> LogicalLines(const Bytes& text) {
  std::vector<std::string> lines;
  std::string line;
  bool continued = false;
  for (std::size_t at = 0; at < text.size();) {
    std::size_t end = at;
    while (end < text.size() && text[end] != '\n' && text[end] != '\r') ++end;
    std::string part(text.begin() + static_cast<std::ptrdiff_t>(at),
                     text.begin() + static_cast<std::ptrdiff_t>(end));
    at = end + 1;
    part.erase(0, std::min(part.find_first_not_of(" \t\f"), part.size()));
    if (!continued && (part.empty() || part[0] == '#' || part[0] == '!')) continue;
    const auto last = part.find_last_not_of('\\');
    const std::size_t slashes = part.size() - (last == std::string::npos ? 0 : last + 1);
    continued = slashes % 2 == 1;
    if (continued) part.pop_back();
    line += part;
    if (!continued) lines.push_back(std::exchange(line, {}));
  }
  if (!line.empty()) lines.push_back(line);
  return lines;
}

std::string Unescape(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c != '\\' || i + 1 == text.size()) {
      AppendUtf8(c, &out);
      continue;
    }
    const char next = text[++i];
    unsigned code = 0;
    if (next == 'u' && i + 4 < text.size() &&
        std::from_chars(text.data() + i + 1, text.data() + i + 5, code, 16).ptr ==
            text.data() + i + 5) {
      AppendUtf8(code, &out);
      i += 4;
    } else {
      out += next == 'n' ? '\n' : next == 't' ? '\t' : next == 'r' ? '\r' : next;
    }
  }
  return out;
}

// The end of the key: the first unescaped '=', ':' or white space.
std::size_t KeyEnd(const std::string& line) {
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\\')
      ++i;
    else if (std::string_view("=: \t").find(line[i]) != std::string_view::npos)
      return i;
  }
  return line.size();
}

using Properties = std::map<std::string, std::string>;

std::string Get(const Properties& properties, const std::string& key) {
  const auto it = properties.find(key);
  return it == properties.end() ? "" : it->second;
}

// Numbers separated by white space; anything else ends the list.
std::vector<float> Numbers(std::string_view text) {
  std::vector<float> out;
  for (float value = 0; ParseNumber(NextToken(text), value);) out.push_back(value);
  return out;
}

FurnitureEntry MakeEntry(const Properties& p, const std::string& suffix) {
  FurnitureEntry e;
  e.id = Get(p, "id" + suffix);
  e.name = Get(p, "name" + suffix);
  e.creator = Get(p, "creator" + suffix);
  e.model = Get(p, "model" + suffix);
  if (e.model.starts_with('/')) e.model.erase(0, 1);
  const auto rotation = Numbers(Get(p, "modelRotation" + suffix));
  if (rotation.size() == 9) {
    e.rotation.emplace();
    std::copy(rotation.begin(), rotation.end(), e.rotation->begin());
  }
  return e;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> ParseProperties(const Bytes& text) {
  std::vector<std::pair<std::string, std::string>> out;
  for (const std::string& line : LogicalLines(text)) {
    const std::size_t end = KeyEnd(line);
    std::size_t value = std::min(line.find_first_not_of(" \t", end), line.size());
    if (value < line.size() && (line[value] == '=' || line[value] == ':'))
      value = std::min(line.find_first_not_of(" \t", value + 1), line.size());
    out.emplace_back(Unescape(std::string_view(line).substr(0, end)),
                     Unescape(std::string_view(line).substr(value)));
  }
  return out;
}

Result<FurnitureCatalog> ReadFurnitureCatalog(const FileSource& library) {
  const std::string name = "PluginFurnitureCatalog.properties";
  TILEGRAD_ASSIGN(const Bytes text, library.Read(name));
  Properties properties;
  for (auto& [key, value] : ParseProperties(text)) properties.insert_or_assign(key, value);
  FurnitureCatalog catalog{Get(properties, "license"), {}};
  for (int i = 1; properties.count(fmt::format("id#{}", i)) > 0; ++i) {
    FurnitureEntry entry = MakeEntry(properties, fmt::format("#{}", i));
    if (!entry.model.empty()) catalog.entries.push_back(std::move(entry));
  }
  if (catalog.entries.empty()) return DataLoss("{}: no entry with a model", library.Describe(name));
  return catalog;
}

void ApplyRotation(Mesh& mesh, const std::array<float, 9>& r) {
  Transform(mesh,
            {glm::vec3(r[0], r[3], r[6]), glm::vec3(r[1], r[4], r[7]), glm::vec3(r[2], r[5], r[8])},
            glm::vec3(0));
}

}  // namespace tilegrad::io
