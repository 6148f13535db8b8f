// SPDX-License-Identifier: Apache-2.0
#include "train/run/run_files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <string>

#include "base/error.h"
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
                                  "training_models.txt",
                                  "training_photographs.txt",
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
    Series{kCheckpoints, "step_"},   Series{"samples", "step_"}, Series{"timelapse", "0"},
    Series{"live", "mesh_"},         Series{"masks", ""},        Series{"live", "state.js"},
    Series{"tensorboard", "events."}};

void AddSeries(const Path& run, const Series& series, std::vector<Path>* out) {
  std::error_code error;
  for (std::filesystem::directory_iterator at(run / series.folder, error), end; !error && at != end;
       at.increment(error)) {
    const bool ours = at->path().filename().string().starts_with(series.begin);
    if (ours && at->is_regular_file(error)) out->push_back(at->path());
  }
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

}  // namespace tilegrad::train
