// SPDX-License-Identifier: Apache-2.0
#include "train/report/report.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>
#include <span>

#include "base/error.h"
#include "io/image_file.h"
#include "scene/shrink_image.h"
#include "train/data/trained_models.h"
#include "train/predictor.h"
#include "train/report/html.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kCurvePoints = 1000;
constexpr int kMostTexels = 2048;  // a side; some browsers take no more than twice that

void AppendLittleEndian(std::uint32_t value, std::size_t bytes, Bytes* out) {
  for (std::size_t i = 0; i < bytes; ++i) out->push_back(static_cast<std::uint8_t>(value >> 8 * i));
}

std::uint32_t Quantise(float unit, float levels) {
  return static_cast<std::uint32_t>(std::lround(std::clamp(unit, 0.0f, 1.0f) * levels));
}

// 16 bits for each number of `points`, over [low, high] of its axis.
template <class Point>
std::string Steps(const std::vector<Point>& points, const Point& low, const Point& high) {
  Bytes bytes;
  for (const Point& p : points) {
    for (int k = 0; k < Point::length(); ++k) {
      const float extent = high[k] - low[k];
      AppendLittleEndian(Quantise(extent > 0 ? (p[k] - low[k]) / extent : 0, 65535), 2, &bytes);
    }
  }
  return Base64(bytes);
}

// Of vertices, times the factor of their material.
std::string Colors(const Mesh& mesh, const glm::vec4& factor) {
  Bytes bytes;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const glm::vec4 color = mesh.colors.empty() ? factor : mesh.colors[v] * factor;
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

template <class Point>
Json ListOf(const Point& point) {
  Json out = Json::array();
  for (int k = 0; k < Point::length(); ++k) out.push_back(point[k]);
  return out;
}

// The material of the one texture that all faces have; null where there is none or several.
const Material* TexturedMaterial(const Mesh& mesh) {
  if (mesh.corner_uvs.empty() || mesh.materials.empty()) return nullptr;
  const Material& first = mesh.materials[0];
  const auto alike = [&](const Material& m) {
    return m.base_color_texture == first.base_color_texture;
  };
  const bool one = first.base_color_texture >= 0 && std::ranges::all_of(mesh.materials, alike);
  return one ? &first : nullptr;
}

const char* WrapName(TextureWrap wrap) {
  return wrap == TextureWrap::kRepeat   ? "REPEAT"
         : wrap == TextureWrap::kMirror ? "MIRRORED_REPEAT"
                                        : "CLAMP_TO_EDGE";
}

Json TextureJson(const Mesh& mesh, const Material& material) {
  const MeshTexture& texture = mesh.textures[static_cast<std::size_t>(material.base_color_texture)];
  const auto address = PngAddress(ShrunkImage(texture.image, kMostTexels));
  if (!address.ok()) return nullptr;  // of no pixels
  glm::vec2 low = mesh.corner_uvs[0];
  glm::vec2 high = low;
  for (const glm::vec2& uv : mesh.corner_uvs) {
    low = glm::min(low, uv);
    high = glm::max(high, uv);
  }
  return {{"image", *address},
          {"wrap", {WrapName(material.wrap[0]), WrapName(material.wrap[1])}},
          {"low", ListOf(low)},
          {"high", ListOf(high)},
          {"uvs", Steps(mesh.corner_uvs, low, high)}};
}

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

std::string TitleOf(const std::string& name, const TermLabels& labels) {
  if (name == "loss") return "Total loss";
  if (const auto known = labels.find(name); known != labels.end()) return known->second;
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

// The means of a stretch of entries that have the same values.
LogEntry MeanEntry(std::span<const LogEntry> stretch) {
  LogEntry mean = stretch.back();
  for (std::size_t v = 0; v < mean.values.size(); ++v) {
    double sum = 0;
    int count = 0;
    for (const LogEntry& entry : stretch) {
      if (v >= entry.values.size() || entry.values[v].first != mean.values[v].first) continue;
      sum += entry.values[v].second;
      ++count;
    }
    mean.values[v].second = sum / count;
  }
  return mean;
}

// run.json, config.toml, metrics.jsonl; errors name the file and the key or line.
Result<RunFacts> ReadRun(const Path& run) {
  RunFacts facts;
  facts.folder = run;
  TILEGRAD_ASSIGN(facts.header, ReadHeader(run));
  const Path config = run / kTrainSettings;
  TILEGRAD_ASSIGN(facts.config_text, ReadText(config));
  TILEGRAD_ASSIGN(facts.config, ParseConfig(facts.config_text, config.string()));
  TILEGRAD_ASSIGN(facts.log, ReadLog(run));
  return facts;
}

// CurveData with {"camera": {...}, "generated", "models": [...]}.
Json PageData(const ReportFacts& facts) {
  const Showcase& show = facts.showcase;
  Json out = CurveData(facts.run.log, facts.run.header.labels);
  out["camera"] = {{"fov_y", show.fov_y},
                   {"azimuth", show.azimuth},
                   {"elevation", show.elevation},
                   {"distance", show.distance}};
  out["generated"] = show.generated;
  out["models"] = Json::array();
  for (const Example& example : show.examples) out["models"].push_back(ExampleJson(example));
  return out;
}

Result<std::string> Page(const ReportFacts& facts) {
  TILEGRAD_ASSIGN(const std::string models, ModelsHtml(facts));
  const bool made = facts.showcase.generated;
  return FillTemplate(
      kReportHtml,
      {{"name", EscapeHtml(facts.run.config.name)},
       {"summary", SummaryHtml(facts)},
       {"comparison", ComparisonHtml(facts)},
       {"meshes_title", made ? "Generated meshes, interactive" : "Predicted meshes, interactive"},
       {"models_title", (made ? "Generated " : "Held-out ") + facts.showcase.thing + "s"},
       {"models", models},
       {"scores", ScoresHtml(facts)},
       {"commands", CommandsHtml(facts)},
       {"config", EscapeHtml(facts.run.config_text)},
       {"machine", MachineHtml(facts)},
       {"credits", CreditsHtml(facts)},
       {"data", ScriptJson(PageData(facts))},
       {"style", std::string(kReportCss)},
       {"script", std::string(kPartsJs) + std::string(kReportJs)}});
}

}  // namespace

Json MeshJson(const Mesh& mesh) {
  if (mesh.faces.empty()) return nullptr;
  const Bounds bounds = MeshBounds(mesh);
  const std::size_t index_bytes = mesh.positions.size() > 65536 ? 4 : 2;
  const Material* textured = TexturedMaterial(mesh);
  return {{"low", ListOf(bounds.low)},
          {"high", ListOf(bounds.high)},
          {"positions", Steps(mesh.positions, bounds.low, bounds.high)},
          {"colors", Colors(mesh, textured == nullptr ? glm::vec4(1) : textured->base_color)},
          {"faces", Faces(mesh, index_bytes)},
          {"index_bytes", index_bytes},
          {"texture", textured == nullptr ? Json() : TextureJson(mesh, *textured)}};
}

Result<Json> CentredMeshJson(Mesh mesh) {
  if (mesh.faces.empty()) return Json();
  TILEGRAD_TRY(NormalizeToBox(mesh, static_cast<float>(CameraRule().half_extent)));
  return MeshJson(mesh);
}

std::vector<LogEntry> Thin(const std::vector<LogEntry>& log, std::size_t count) {
  if (log.size() <= count) return log;
  std::vector<LogEntry> out;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t begin = i * log.size() / count, end = (i + 1) * log.size() / count;
    out.push_back(MeanEntry(std::span(log).subspan(begin, end - begin)));
  }
  return out;
}

Json CurveData(const std::vector<LogEntry>& log, const TermLabels& labels) {
  const std::vector<std::string> names = CurveNames(log);
  Json out = {{"curves", CurvesJson(log, names)}, {"charts", Json::array()}};
  for (const std::string& name : names)
    out["charts"].push_back({{"key", name}, {"title", TitleOf(name, labels)}});
  return out;
}

Result<ReportSummary> WriteReport(const ReportJob& job, const Workers& workers,
                                  const Watch& watch) {
  ReportFacts facts;
  TILEGRAD_ASSIGN(facts.run, ReadRun(job.run));
  facts.data = job.data.string();
  TILEGRAD_ASSIGN(facts.evaluation, ReadEvaluation(job.run));
  TILEGRAD_ASSIGN(facts.listed, HasTrainedList(job.run));
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(job.run, workers));
  facts.predictor = predictor.description();
  facts.step = predictor.step();
  const ShowcaseRequest request{job.run, job.data, facts.run.header, predictor, job.models};
  TILEGRAD_ASSIGN(facts.showcase, predictor.task().Show(request, workers, watch));
  TILEGRAD_ASSIGN(const std::string page, Page(facts));
  ReportSummary summary;
  summary.bytes = page.size();
  summary.thing = facts.showcase.thing;
  summary.models = static_cast<int>(facts.showcase.examples.size());
  summary.evaluated = facts.evaluation.has_value() || facts.showcase.generated;
  summary.warnings = predictor.warnings();
  RemoveTemporariesOf(job.out);  // of killed calls
  TILEGRAD_TRY(WriteTextAtomic(job.out, page));
  if (!job.sheet.empty() && !facts.showcase.sheet.empty()) {
    RemoveTemporariesOf(job.sheet);
    TILEGRAD_TRY(io::SavePng(job.sheet, facts.showcase.sheet));
    summary.sheet_columns = facts.showcase.sheet_columns;
  }
  return summary;
}

}  // namespace tilegrad::train
