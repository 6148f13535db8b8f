// SPDX-License-Identifier: Apache-2.0
#include "train/data/trained_models.h"

#include <sstream>
#include <unordered_set>

#include "base/error.h"
#include "base/file.h"
#include "io/archive.h"
#include "train/run/carried_files.h"
#include "train/run/checkpoint.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

std::string ModelLine(const Dataset& dataset, int index) {
  const ModelInfo& model = dataset.model(index);
  return fmt::format("{:016x} {}/{}", model.geometry, dataset.ClassOf(model), model.id);
}

std::string TextOf(const Dataset& dataset) {
  std::string text = fmt::format("recipe {}\n", dataset.info().recipe);
  for (const int model : dataset.Select(Split::kTrain)) text += ModelLine(dataset, model) + "\n";
  return text;
}

// The contents of the models: the cameras of all, and a fingerprint of each file.
Result<std::string> ContentsOf(const Dataset& dataset) {
  const DatasetInfo& info = dataset.info();
  const CameraRule& c = info.camera;
  std::string text = fmt::format(
      "camera fov_y {} azimuth_step {} elevation {} distance {} half_extent {}, {} views of {} "
      "pixels\n",
      c.lens.fov_y, c.azimuth_step, c.elevation, c.distance, c.half_extent, info.views,
      info.image_size);
  for (const int model : dataset.Select(Split::kTrain)) {
    TILEGRAD_ASSIGN(const std::string file, io::ZipFingerprint(dataset.ModelPath(model)));
    const ModelInfo& m = dataset.model(model);
    text += fmt::format("file {} {}/{}\n", file, dataset.ClassOf(m), m.id);
  }
  return text;
}

// The part that lines of one mesh share, whatever its colours; the whole line without a mesh.
std::string MeshOf(const std::string& line) {
  return line.starts_with("0000000000000000 ") ? line : line.substr(0, line.find('/'));
}

// Lists of earlier versions have no contents.
bool HasContents(const std::string& list) { return list.find("\ncamera ") != std::string::npos; }

}  // namespace

Status RememberTrainedModels(const Path& run, const Dataset& dataset, std::int64_t first_step) {
  const Path file = run / kTrainedModels;
  const std::string models = TextOf(dataset);
  TILEGRAD_ASSIGN(const std::string contents, ContentsOf(dataset));
  const std::string now = models + contents;
  if (first_step == 0) return WriteTextAtomic(file, now);
  const auto read = ReadText(file);
  if (!read.ok() && read.status().code() != StatusCode::kNotFound) return read.status();
  const std::string& then = read.ok() ? *read : models;
  if (then == now) return {};
  if (then == models && !HasContents(then)) return WriteTextAtomic(file, now);
  return InvalidArgument(
      "{}: this run was started with other training models, cameras or model files than those of "
      "{}: {}; resume with that dataset and its split, or give another --out",
      run.string(), dataset.folder().string(), FirstDifference(then, now));
}

Status CheckHeldOut(const Path& run, const Dataset& dataset, Split split) {
  TILEGRAD_ASSIGN(const auto list, ReadRunFile(run, kTrainedModels));
  if (!list) return {};
  std::unordered_set<std::string> trained;
  std::istringstream lines(std::string(list->bytes.begin(), list->bytes.end()));
  for (std::string line; std::getline(lines, line);) trained.insert(MeshOf(line));
  const std::vector<int> held_out = dataset.Select(split);
  std::vector<std::string> seen;
  for (const int model : held_out) {
    if (trained.count(MeshOf(ModelLine(dataset, model))) > 0)
      seen.push_back(ModelLine(dataset, model));
  }
  if (seen.empty()) return {};
  return InvalidArgument(
      "{}: {} of the {} held-out models of {} were trained on ({}, ...): the dataset has been "
      "split anew since; make it with the seed, shares and limits it had then, or train again",
      run.string(), seen.size(), held_out.size(), dataset.folder().string(),
      seen[0].substr(seen[0].find(' ') + 1));
}

Result<bool> HasTrainedList(const Path& run) {
  for (const char* name : {kTrainedModels, kTrainedPhotographs}) {
    TILEGRAD_ASSIGN(const auto list, ReadRunFile(run, name));
    if (list) return true;
  }
  return false;
}

Status WarnWithoutList(const Path& run, const WarningSink& warn) {
  TILEGRAD_ASSIGN(const bool listed, HasTrainedList(run));
  if (listed) return {};
  warn(fmt::format(
      "{}: has no {} (of photographs: {}), which lists what it was trained on: what is taken for "
      "held out may be among it",
      RunFolderOf(run).string(), kTrainedModels, kTrainedPhotographs));
  return {};
}

}  // namespace tilegrad::train
