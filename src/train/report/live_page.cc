// SPDX-License-Identifier: Apache-2.0
#include "train/report/live_page.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/mesh_file.h"
#include "train/config.h"
#include "train/predictor.h"
#include "train/report/html.h"
#include "train/report/report.h"
#include "train/run/checkpoint.h"
#include "train/run/log.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;
using Files = std::map<std::int64_t, Path>;

constexpr const char* kLiveFile = "live.html";
constexpr const char* kLiveFolder = "live";
constexpr const char* kLiveState = "state.js";
constexpr std::chrono::seconds kLivePause{1}, kLongestPause{5};
constexpr int kRest = 20;  // times what writing took
constexpr std::chrono::seconds kStale{10};
constexpr std::size_t kMostMeshes = 60, kMostPictures = 300;

// As FilesOfSteps; empty if the folder cannot be read.
Files FilesIn(const Path& folder, std::string_view beginning, std::string_view ending) {
  auto files = FilesOfSteps(folder, beginning, ending);
  return files.ok() ? std::move(*files) : Files();
}

// At most so many, the first and the last among them.
Files Thinned(const Files& files, std::size_t most) {
  if (files.size() <= most) return files;
  Files out;
  std::size_t i = 0;
  for (const auto& file : files) {
    if (out.size() * (files.size() - 1) <= i * (most - 1)) out.insert(file);
    ++i;
  }
  return out;
}

// When a file was last written; the beginning of time if there is none.
std::filesystem::file_time_type WrittenAt(const Path& file) {
  std::error_code error;
  const auto time = std::filesystem::last_write_time(file, error);
  return error ? std::filesystem::file_time_type::min() : time;
}

double Seconds(std::chrono::system_clock::duration since) {
  return std::chrono::duration<double>(since).count();
}

Json PictureList(const Path& run) {
  Files files = FilesIn(run / "samples", "step_", ".png");
  files.merge(FilesIn(run / "timelapse", "", ".png"));
  Json out = Json::array();
  for (const auto& [step, file] : Thinned(files, kMostPictures))
    out.push_back({{"step", step}, {"file", file.lexically_relative(run).generic_string()}});
  return out;
}

Result<Json> MeshOf(Mesh mesh) {
  const std::size_t faces = mesh.faces.size();
  TILEGRAD_ASSIGN(Json json, CentredMeshJson(std::move(mesh)));
  if (!json.is_null()) json["face_count"] = faces;
  return json;
}

Json RunningJson(const Progress& progress) {
  return {{"running", true},
          {"error", ""},
          {"stage", progress.stage},
          {"done", progress.done},
          {"total", progress.total}};
}

}  // namespace

LivePage::LivePage(LiveSource source)
    : source_(std::move(source)),
      file_(std::filesystem::absolute(source_.run / kLiveFile).lexically_normal()),
      folder_(source_.run / kLiveFolder) {}

Status LivePage::Start() {
  TILEGRAD_ASSIGN(
      const std::string page,
      FillTemplate(kLiveHtml, {{"style", std::string(kReportCss)},
                               {"script", std::string(kPartsJs) + std::string(kLiveJs)}}));
  TILEGRAD_TRY(WriteTextAtomic(file_, page));
  RemoveTemporaries(folder_);
  return Write(RunningJson({}));
}

void LivePage::Tell(const Progress& progress) {
  const auto begin = Clock::now();
  if (begin < next_ && progress.stage == stage_) return;
  stage_ = progress.stage;
  Note(Write(RunningJson(progress)));
  const auto end = Clock::now();
  next_ = end + std::clamp<Clock::duration>(kRest * (end - begin), kLivePause, kLongestPause);
}

Status LivePage::Finish(const Status& outcome) {
  const bool failed = !outcome.ok() && outcome.code() != StatusCode::kCancelled;
  Note(Write({{"running", false}, {"error", failed ? outcome.message() : ""}}));
  return problem_;
}

void LivePage::Note(const Status& status) {
  if (problem_.ok() && status.code() != StatusCode::kCancelled) problem_ = status;
}

Status LivePage::Write(const Json& now) {
  TILEGRAD_ASSIGN(Json state, State());
  state["meshes"] = WriteMeshes(Meshes(state["step"].get<std::int64_t>()));
  state.update(now);
  return WriteTextAtomic(folder_ / kLiveState, "tilegradState(" + ScriptJson(state) + ");\n");
}

Result<Json> LivePage::State() const {
  std::int64_t steps = source_.steps;
  const auto config = ReadConfig(source_.run / kTrainSettings);
  if (config.ok() && steps == 0) steps = config->schedule.steps;
  const auto header = ReadHeader(source_.run);
  std::vector<LogEntry> log;
  const Path metrics = source_.run / "metrics.jsonl";
  if (PathExists(metrics)) {
    TILEGRAD_ASSIGN(log, ReadLog(source_.run));
  }
  const std::int64_t step = log.empty() ? 0 : log.back().step;
  // A fit writes its result at the end.
  const bool fitted = WrittenAt(source_.run / "mesh.glb") > WrittenAt(metrics);
  Json json = {{"name", file_.parent_path().filename().string()},
               {"time", Seconds(std::chrono::system_clock::now().time_since_epoch())},
               {"finished", step > 0 && (fitted || step == steps)},
               {"step", step},
               {"steps", steps},
               {"pictures", PictureList(source_.run)}};
  json.update(CurveData(log, header.ok() ? header->labels : source_.labels));
  return json;
}

// `step`: the last one that was logged.
Files LivePage::Meshes(std::int64_t step) const {
  Files files = FilesIn(source_.run / "timelapse", "", ".glb");
  const Path result = source_.run / "mesh.glb";
  const bool newest = files.empty() || WrittenAt(result) >= WrittenAt(files.rbegin()->second);
  if (IsFile(result) && newest) files[step] = result;
  if (!files.empty() || source_.data.empty()) return Thinned(files, kMostMeshes);
  files = FilesIn(source_.run / "checkpoints", "step_", ".safetensors");
  if (!files.empty()) files.erase(files.begin(), std::prev(files.end()));
  return files;
}

// Writes scripts of new meshes and removes those of others.
Json LivePage::WriteMeshes(const Files& files) {
  Json out = Json::array();
  Files old = FilesIn(folder_, "mesh_", ".js");
  for (const auto& [step, source] : files) {
    const Path script = folder_ / fmt::format("mesh_{:08}.js", step);
    if (broken_.contains(source)) continue;
    if (WrittenAt(script) < WrittenAt(source)) {
      if (const Status status = WriteMesh(source, script, step); !status.ok()) {
        broken_.insert(source);
        Note(status);
        continue;
      }
    }
    old.erase(step);
    const auto made = WrittenAt(script).time_since_epoch();
    out.push_back({{"step", step},
                   {"made", std::chrono::duration_cast<std::chrono::milliseconds>(made).count()}});
  }
  std::error_code error;
  for (const auto& [step, script] : old) std::filesystem::remove(script, error);
  return out;
}

Status LivePage::WriteMesh(const Path& source, const Path& script, std::int64_t step) const {
  Json shown = {{"mesh", nullptr}, {"truth", nullptr}};
  if (source.extension() == ".glb") {
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(source));
    TILEGRAD_ASSIGN(shown["mesh"], MeshOf(std::move(loaded.mesh)));
  } else {
    TILEGRAD_ASSIGN(shown, Predicted());
  }
  return WriteTextAtomic(script, fmt::format("tilegradMesh({}, {});\n", step, ScriptJson(shown)));
}

Result<Json> LivePage::Predicted() const {
  const Workers workers(1);
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(source_.run, workers));
  TILEGRAD_ASSIGN(const RunHeader header, ReadHeader(source_.run));
  const ShowcaseRequest request{source_.run, source_.data, header, predictor, /*examples=*/1};
  TILEGRAD_ASSIGN(Showcase show, predictor.task().Show(request, workers, {}));
  Json json = {{"mesh", nullptr}, {"truth", nullptr}};
  if (show.examples.empty()) return json;
  TILEGRAD_ASSIGN(json["mesh"], MeshOf(std::move(show.examples[0].prediction)));
  TILEGRAD_ASSIGN(json["truth"], MeshOf(std::move(show.examples[0].truth)));
  return json;
}

bool LivePage::IsKept(const Path& run) {
  const auto now = std::filesystem::file_time_type::clock::now();
  return WrittenAt(run / kLiveFolder / kLiveState) > now - kStale && FolderLock::IsHeld(run);
}

std::string FileAddress(const Path& file) {
  std::string out = "file://";
  for (const char c : file.string()) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("/-._~").find(c) != std::string_view::npos;
    out += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return out;
}

}  // namespace tilegrad::train
