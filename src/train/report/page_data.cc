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
constexpr const char* kCurves[] = {"loss", "iou", "color", "images_per_second"};

void Append(std::uint32_t value, std::size_t bytes, Bytes* out) {
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
      Append(Quantise(extent > 0 ? (p[k] - bounds.low[k]) / extent : 0, 65535), 2, &bytes);
    }
  }
  return Base64(bytes);
}

std::string Colors(const Mesh& mesh) {
  if (mesh.colors.empty()) return Base64(Bytes(3 * mesh.positions.size(), 255));
  Bytes bytes;
  for (const glm::vec4& color : mesh.colors) {
    for (int k = 0; k < 3; ++k) Append(Quantise(color[k], 255), 1, &bytes);
  }
  return Base64(bytes);
}

std::string Faces(const Mesh& mesh, std::size_t index_bytes) {
  Bytes bytes;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) Append(static_cast<std::uint32_t>(v), index_bytes, &bytes);
  }
  return Base64(bytes);
}

Json Triple(const glm::vec3& v) { return {v.x, v.y, v.z}; }

// More than a pen can draw. std::stod would throw for numbers next to 0.
double SixDigits(double value) {
  return std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr);
}

Json CurvesJson(const std::vector<LogEntry>& log) {
  Json curves = {{"step", Json::array()}};
  for (const char* name : kCurves) curves[name] = Json::array();
  for (const LogEntry& entry : Thin(log, kCurvePoints)) {
    curves["step"].push_back(entry.step);
    for (const char* name : kCurves) {
      const auto at = std::find_if(entry.values.begin(), entry.values.end(),
                                   [&](const auto& value) { return value.first == name; });
      curves[name].push_back(at == entry.values.end() ? Json() : Json(SixDigits(at->second)));
    }
  }
  return curves;
}

Json CameraJson(const DatasetInfo& info) {
  return {{"fov_y", info.camera.lens.fov_y},
          {"azimuth", info.camera.azimuth_step * ShownViews(info)[0]},
          {"elevation", info.camera.elevation},
          {"distance", info.camera.distance}};
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

Json PageData(const RunFacts& run, const Dataset& dataset, std::span<const ShownModel> models) {
  Json out = {{"curves", CurvesJson(run.log)},
              {"camera", CameraJson(dataset.info())},
              {"models", Json::array()}};
  for (const ShownModel& shown : models) {
    const ModelInfo& info = dataset.models()[static_cast<std::size_t>(shown.model)];
    out["models"].push_back(
        {{"name", info.name.empty() ? info.id : info.name},
         {"class", dataset.info().classes[static_cast<std::size_t>(info.class_index)]},
         {"prediction", MeshJson(shown.prediction)},
         {"truth", MeshJson(shown.truth)}});
  }
  return out;
}

}  // namespace tilegrad::train
