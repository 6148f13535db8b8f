// SPDX-License-Identifier: Apache-2.0
#include "train/report/page_data.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "train/report/html.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kCurvePoints = 1000;

void AppendLittleEndian(std::uint32_t value, std::size_t bytes, Bytes* out) {
  for (std::size_t i = 0; i < bytes; ++i) out->push_back(static_cast<std::uint8_t>(value >> 8 * i));
}

std::uint32_t Quantise(float unit, float levels) {
  return static_cast<std::uint32_t>(std::lround(std::clamp(unit, 0.0f, 1.0f) * levels));
}

std::string Positions(const Mesh& mesh, const Bounds& bounds) {
  Bytes bytes;
  for (const glm::vec3& p : mesh.positions) {
    for (int k = 0; k < 3; ++k) {
      const float extent = bounds.high[k] - bounds.low[k];
      AppendLittleEndian(Quantise(extent > 0 ? (p[k] - bounds.low[k]) / extent : 0, 65535), 2,
                         &bytes);
    }
  }
  return Base64(bytes);
}

std::string Colors(const Mesh& mesh) {
  if (mesh.colors.empty()) return Base64(Bytes(3 * mesh.positions.size(), 255));
  Bytes bytes;
  for (const glm::vec4& color : mesh.colors) {
    for (int k = 0; k < 3; ++k) AppendLittleEndian(Quantise(color[k], 255), 1, &bytes);
  }
  return Base64(bytes);
}

std::string Faces(const Mesh& mesh, std::size_t index_bytes) {
  Bytes bytes;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face)
      AppendLittleEndian(static_cast<std::uint32_t>(v), index_bytes, &bytes);
  }
  return Base64(bytes);
}

Json Triple(const glm::vec3& v) { return {v.x, v.y, v.z}; }

// More than a pen can draw. std::stod would throw for numbers next to 0.
double SixDigits(double value) {
  return std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr);
}

// The log's names in their order; later entries may bring new ones. What only counts on with the
// steps makes no curve.
std::vector<std::string> CurveNames(const std::vector<LogEntry>& log) {
  std::vector<std::string> names;
  for (const LogEntry& entry : log) {
    for (const auto& [name, value] : entry.values) {
      if (name == "epoch" || name == "seconds") continue;
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  return names;
}

Json CurvesJson(const std::vector<LogEntry>& log, const std::vector<std::string>& names) {
  Json curves = {{"step", Json::array()}};
  for (const std::string& name : names) curves[name] = Json::array();
  for (const LogEntry& entry : Thin(log, kCurvePoints)) {
    curves["step"].push_back(entry.step);
    for (const std::string& name : names) {
      const auto at = std::find_if(entry.values.begin(), entry.values.end(),
                                   [&](const auto& value) { return value.first == name; });
      curves[name].push_back(at == entry.values.end() ? Json() : Json(SixDigits(at->second)));
    }
  }
  return curves;
}

std::string TitleOf(const std::string& name, const std::vector<TermLabel>& labels) {
  if (name == "loss") return "Total loss";
  for (const TermLabel& label : labels) {
    if (name == label.name) return label.label;
  }
  std::string words = name;
  std::replace(words.begin(), words.end(), '_', ' ');
  if (!words.empty())
    words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
  return words;
}

Json ExampleJson(const Example& example) {
  return {{"name", example.name},
          {"class", example.class_name},
          {"prediction", MeshJson(example.prediction)},
          {"truth", MeshJson(example.truth)}};
}

}  // namespace

Json MeshJson(const Mesh& mesh) {
  if (mesh.faces.empty()) return nullptr;
  const Bounds bounds = MeshBounds(mesh);
  const std::size_t index_bytes = mesh.positions.size() > 65536 ? 4 : 2;
  return {{"low", Triple(bounds.low)},
          {"high", Triple(bounds.high)},
          {"positions", Positions(mesh, bounds)},
          {"colors", Colors(mesh)},
          {"faces", Faces(mesh, index_bytes)},
          {"index_bytes", index_bytes}};
}

Json CurveData(const std::vector<LogEntry>& log, const std::vector<TermLabel>& labels) {
  const std::vector<std::string> names = CurveNames(log);
  Json out = {{"curves", CurvesJson(log, names)}, {"charts", Json::array()}};
  for (const std::string& name : names)
    out["charts"].push_back({{"key", name}, {"title", TitleOf(name, labels)}});
  return out;
}

Json PageData(const ReportFacts& facts) {
  const Showcase& show = facts.showcase;
  Json out = CurveData(facts.run.log, facts.run.config.task->Labels());
  out["camera"] = {{"fov_y", show.fov_y},
                   {"azimuth", show.azimuth},
                   {"elevation", show.elevation},
                   {"distance", show.distance}};
  out["generated"] = show.generated;
  out["models"] = Json::array();
  for (const Example& example : show.examples) out["models"].push_back(ExampleJson(example));
  return out;
}

}  // namespace tilegrad::train
