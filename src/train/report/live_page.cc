// SPDX-License-Identifier: Apache-2.0
#include "train/report/live_page.h"

#include <charconv>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"
#include "base/folder_lock.h"
#include "io/mesh_file.h"
#include "train/config.h"
#include "train/predictor.h"
#include "train/report/assets.h"
#include "train/report/html.h"
#include "train/report/page_data.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;
using Files = std::map<std::int64_t, Path>;  // by step

// Files "BEGINNING00001500.ENDING" of a folder.
Files FilesOfSteps(const Path& folder, const std::string& beginning, const std::string& ending) {
  Files files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string stem = entry.path().stem().string();
    if (entry.path().extension() != ending || !stem.starts_with(beginning)) continue;
    std::int64_t step = -1;
    const char* const end = stem.data() + stem.size();
    const auto [at, bad] = std::from_chars(stem.data() + beginning.size(), end, step);
    if (bad == std::errc() && at == end && step >= 0) files[step] = entry.path();
  }
  return files;
}

Files Pictures(const Path& run) {
  Files files = FilesOfSteps(run / "samples", "step_", ".png");
  files.merge(FilesOfSteps(run / "timelapse", "", ".png"));
  return files;
}

Files Meshes(const Path& run) { return FilesOfSteps(run / "timelapse", "", ".glb"); }

// Of the newest checkpoint; -1: there is none.
std::int64_t CheckpointStep(const Path& run) {
  const Files files = FilesOfSteps(run / "checkpoints", "step_", ".safetensors");
  return files.empty() ? -1 : files.rbegin()->first;
}

Json StepsOf(const Files& files) {
  Json steps = Json::array();
  for (const auto& [step, file] : files) steps.push_back(step);
  return steps;
}

Result<Json> MeshOf(Mesh mesh) {
  if (mesh.faces.empty()) return Json();
  TILEGRAD_TRY(NormalizeToBox(mesh, static_cast<float>(CameraRule().half_extent)));
  Json json = MeshJson(mesh);
  json["face_count"] = mesh.faces.size();
  return json;
}

std::string DumpForScript(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// What its config.toml says of a run; a fit has none.
struct Known {
  std::string name;
  std::int64_t steps = 0;
  std::vector<TermLabel> labels;
};

Known ReadKnown(const LiveSource& source) {
  Known known{std::filesystem::absolute(source.run).lexically_normal().filename().string(),
              source.steps,
              {}};
  if (auto config = ReadConfig(source.run / "config.toml"); config.ok()) {
    if (known.steps == 0) known.steps = config->schedule.steps;
    known.labels = config->task->Labels();
  }
  return known;
}

}  // namespace

Result<std::string> LiveRun::State() {
  const Known known = ReadKnown(source_);
  std::vector<LogEntry> log;
  if (PathExists(source_.run / "metrics.jsonl")) {
    TILEGRAD_ASSIGN(log, ReadLog(source_.run));
  }
  const bool running = FolderLock::IsHeld(source_.run);
  const std::int64_t step = log.empty() ? 0 : log.back().step;
  // A fit writes its result at the end.
  const bool fitted = !running && PathExists(source_.run / "mesh.glb");
  Json json = {{"name", known.name},
               {"running", running},
               {"step", step},
               {"steps", fitted ? step : known.steps},
               {"pictures", StepsOf(Pictures(source_.run))},
               {"meshes", StepsOf(Meshes(source_.run))}};
  const std::int64_t saved = CheckpointStep(source_.run);
  if (json["meshes"].empty() && !source_.data.empty() && saved >= 0) json["meshes"] = {saved};
  json.update(CurveData(log, known.labels));
  return DumpForScript(json);
}

Result<std::string> LiveRun::Mesh(std::int64_t step) {
  const Files files = Meshes(source_.run);
  const auto found = files.find(step);
  if (found == files.end()) return Predicted(step);
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(found->second));
  TILEGRAD_ASSIGN(Json mesh, MeshOf(std::move(loaded.mesh)));
  return DumpForScript({{"mesh", std::move(mesh)}, {"truth", nullptr}});
}

Result<std::string> LiveRun::Predicted(std::int64_t step) {
  const std::scoped_lock lock(mutex_);
  if (step == predicted_step_) return predicted_;
  if (source_.data.empty() || step != CheckpointStep(source_.run))
    return NotFound("{}: no mesh of step {}", source_.run.string(), step);
  const Workers workers(1);  // the others are at work
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(source_.run, workers));
  TILEGRAD_ASSIGN(const RunHeader header, ReadHeader(source_.run));
  const ShowcaseRequest request{source_.run, source_.data, header, predictor, /*examples=*/1};
  const StopFlag go_on = false;
  TILEGRAD_ASSIGN(Showcase show, predictor.task().Show(request, workers, nullptr, go_on));
  Json json = {{"mesh", nullptr}, {"truth", nullptr}};
  if (!show.examples.empty()) {
    TILEGRAD_ASSIGN(json["mesh"], MeshOf(std::move(show.examples[0].prediction)));
    TILEGRAD_ASSIGN(json["truth"], MeshOf(std::move(show.examples[0].truth)));
  }
  predicted_ = DumpForScript(json);
  predicted_step_ = step;
  return predicted_;
}

Result<Bytes> LiveRun::Picture(std::int64_t step) const {
  const Files files = Pictures(source_.run);
  const auto found = files.find(step);
  if (found == files.end())
    return NotFound("{}: no picture of step {}", source_.run.string(), step);
  return ReadFile(found->second);
}

Result<std::string> LivePage() {
  return FillTemplate(kLiveHtml, {{"style", std::string(kReportCss)},
                                  {"script", std::string(kPartsJs) + std::string(kLiveJs)}});
}

}  // namespace tilegrad::train
