// SPDX-License-Identifier: Apache-2.0
#include "train/run/run_files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "base/json_text.h"
#include "base/parallel.h"
#include "base/simd_target.h"
#include "tilegrad/version.h"
#include "train/json_fields.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train {
namespace {

constexpr const char* kCheckpoints = "checkpoints";  // the folder of them

constexpr std::array kRunNames = {kTrainSettings,
                                  kFitSettings,
                                  "run.json",
                                  "metrics.jsonl",
                                  "stream.png",
                                  "thumbnails.npz",
                                  "eval.json",
                                  "eval.md",
                                  kTrainedModels,
                                  kTrainedPhotographs,
                                  "report.html",
                                  "live.html",
                                  "summary.png",
                                  "cameras_start.json",
                                  "transforms_fitted.json",
                                  "mesh.glb",
                                  "timelapse.png",
                                  "timelapse.webp"};

// Folders of a run, and how its files in them begin.
struct Series {
  const char *folder, *begin;
};
constexpr std::array kSeries = {
    Series{kCheckpoints, "step_"},    Series{"samples", "step_"}, Series{"timelapse", "0"},
    Series{"live", "mesh_"},          Series{"masks", ""},        Series{"live", "state.js"},
    Series{"tensorboard", "events."}, Series{"", "eval_on_"}};

void AddSeries(const Path& run, const Series& series, std::vector<Path>* out) {
  std::error_code error;
  for (std::filesystem::directory_iterator at(run / series.folder, error), end; !error && at != end;
       at.increment(error)) {
    const bool ours = at->path().filename().string().starts_with(series.begin);
    if (ours && at->is_regular_file(error)) out->push_back(at->path());
  }
}

std::vector<std::pair<std::string, std::string>> TextsIn(const nlohmann::json& json,
                                                         const char* key) {
  std::vector<std::pair<std::string, std::string>> out;
  if (!json.contains(key)) return out;
  for (const auto& [name, value] : json[key].items())
    out.emplace_back(name, value.is_string() ? value.get<std::string>() : DumpJson(value));
  return out;
}

std::string CpuName() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const auto begin = line.find_first_not_of(": \t", line.find(':'));
    if (line.starts_with("model name") && begin != std::string::npos) return line.substr(begin);
  }
  return "unknown";
}

}  // namespace

Result<std::map<std::int64_t, Path>> FilesOfSteps(const Path& folder, std::string_view beginning,
                                                  std::string_view ending) {
  std::map<std::int64_t, Path> files;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(beginning) || !name.ends_with(ending)) continue;
    std::int64_t step = -1;
    const char* const last = name.data() + name.size() - ending.size();
    const auto [rest, bad] = std::from_chars(name.data() + beginning.size(), last, step);
    if (bad == std::errc() && rest == last && step >= 0) files[step] = at->path();
  }
  if (!error || error == std::errc::no_such_file_or_directory) return files;
  return IoError("{}: cannot list its files: {}; nothing was changed", folder.string(),
                 error.message());
}

Result<bool> HoldsRun(const Path& folder) {
  for (const char* name : {kTrainSettings, kFitSettings}) {
    std::error_code error;
    if (std::filesystem::exists(folder / name, error)) return true;
    if (error)
      return IoError("{}: cannot check whether it exists: {}", (folder / name).string(),
                     error.message());
  }
  return !ListCheckpoints(folder).empty();
}

Path RunFolderOf(const Path& path) {
  const Path folder = path.parent_path();
  if (folder.filename() != kCheckpoints || !IsFile(path)) return path;
  return folder.has_parent_path() ? folder.parent_path() : Path(".");
}

bool IsOfFit(const std::string& settings) {
  return settings.find("\ninput = ") != std::string::npos &&
         settings.find("\nmesh = ") != std::string::npos;
}

std::vector<Path> RunFiles(const Path& folder) {
  std::vector<Path> out;
  for (const char* name : kRunNames) {
    if (PathExists(folder / name)) out.push_back(folder / name);
  }
  for (const Series& series : kSeries) AddSeries(folder, series, &out);
  return out;
}

// Settings last: a run that is half removed still counts as one.
Status RemoveRun(const Path& folder) {
  std::vector<Path> files = RunFiles(folder);
  std::ranges::reverse(files);
  return RemoveFiles(files);
}

Status WriteHeader(const Path& run, const RunHeader& header) {
  nlohmann::ordered_json json = {{"name", header.name},
                                 {"dataset", header.dataset},
                                 {"dataset_source", header.dataset_source},
                                 {"training_models", header.training_models},
                                 {"parameters", header.parameters}};
  for (const auto& [key, value] : header.machine) json["machine"][key] = value;
  for (const auto& [name, label] : header.labels) json["labels"][name] = label;
  return WriteTextAtomic(run / "run.json", JsonText(std::move(json), 2) + "\n");
}

Result<RunHeader> ReadHeader(const Path& run) {
  const std::string place = (run / "run.json").string();
  TILEGRAD_ASSIGN(const std::string text, ReadText(place));
  TILEGRAD_ASSIGN(const nlohmann::json json, ParseJson(text, place));
  JsonFields fields(json, place);
  RunHeader header;
  const int most = std::numeric_limits<int>::max();
  int parameters = 0;
  fields.Read("dataset", &header.dataset);
  fields.Read("dataset_source", &header.dataset_source);
  fields.Read("training_models", 0, most, &header.training_models);
  fields.Read("parameters", 0, most, &parameters);
  if (!fields.status().ok()) return fields.status();
  header.parameters = parameters;
  for (const auto& [key, value] : TextsIn(json, "machine")) header.machine.emplace_back(key, value);
  for (const auto& [name, label] : TextsIn(json, "labels")) header.labels.emplace(name, label);
  return header;
}

std::vector<std::pair<std::string, std::string>> DescribeMachine() {
#if defined(__clang__)
  const std::string compiler = "clang " __clang_version__;
#else
  const std::string compiler = "g++ " __VERSION__;
#endif
  return {{"version", TILEGRAD_VERSION},
          {"compiler", compiler},
          {"cpu", CpuName()},
          {"cores", std::to_string(AvailableCores())},
          {"simd", ActiveTarget()}};
}

}  // namespace tilegrad::train
