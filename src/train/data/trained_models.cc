// SPDX-License-Identifier: Apache-2.0
#include "train/data/trained_models.h"

#include <sstream>
#include <unordered_set>

#include "base/error.h"
#include "base/file.h"
#include "base/try_all.h"
#include "io/archive.h"
#include "train/data/fingerprint.h"
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

std::string TextOf(const PhotographSet& set) {
  std::string text;
  for (const int i : set.Select(Split::kTrain))
    text += set.photographs[static_cast<std::size_t>(i)].id + "\n";
  return text;
}

// A fingerprint of each photograph with its annotations.
Result<std::string> ContentsOf(const PhotographSet& set, const Workers& workers) {
  const std::vector<int> all = set.Select(Split::kTrain);
  std::vector<std::string> lines(all.size());
  const auto read = [&](std::size_t i, std::size_t) -> Status {
    const Photograph& photo = set.photographs[static_cast<std::size_t>(all[i])];
    TILEGRAD_ASSIGN(const std::string file, PhotographFingerprint(photo));
    lines[i] = fmt::format("file {} {}\n", file, photo.id);
    return {};
  };
  TILEGRAD_TRY(TryAll(workers, all.size(), read));
  return fmt::format("{}", fmt::join(lines, ""));
}

// The part that lines of one mesh share, whatever its colours; the whole line without a mesh.
std::string MeshOf(const std::string& line) {
  return line.starts_with("0000000000000000 ") ? line : line.substr(0, line.find('/'));
}

std::unordered_set<std::string> LinesOf(const RunFile& list) {
  std::unordered_set<std::string> out;
  std::istringstream lines(std::string(list.bytes.begin(), list.bytes.end()));
  for (std::string line; std::getline(lines, line);) out.insert(line);
  return out;
}

// What a run is trained on now.
struct TrainedData {
  std::string names, contents;  // the two parts of its list
  const char* what;             // may differ, for people
  const Path& folder;
};

Status RememberList(const Path& run, const char* list, const TrainedData& data, bool is_new) {
  const std::string now = data.names + data.contents;
  if (is_new) return WriteTextAtomic(run / list, now);
  const auto read = ReadText(run / list);
  if (!read.ok() && read.status().code() != StatusCode::kNotFound) return read.status();
  const std::string& then = read.ok() ? *read : data.names;
  if (then == now) return {};
  if (then == data.names) return WriteTextAtomic(run / list, now);  // of an earlier version
  return InvalidArgument(
      "{}: this run was started with other {} than those of {}: {}; resume with that dataset and "
      "its split, or give another --out",
      run.string(), data.what, data.folder.string(), FirstDifference(then, now));
}

// The first part of such a list of a run that is trained on `data`.
Result<std::string> TrainingNames(const Path& data, std::string_view list) {
  if (list == kTrainedPhotographs) {
    TILEGRAD_ASSIGN(const PhotographSet set, OpenPhotographs(data));
    return TextOf(set);
  }
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(data));
  return TextOf(dataset);
}

}  // namespace

Status RememberTrainedModels(const Path& run, const Dataset& dataset, std::int64_t first_step) {
  TILEGRAD_ASSIGN(std::string contents, ContentsOf(dataset));
  return RememberList(run, kTrainedModels,
                      {TextOf(dataset), std::move(contents),
                       "training models, cameras or model files", dataset.folder()},
                      first_step == 0);
}

Status RememberPhotographs(const Path& run, const PhotographSet& set, std::int64_t first_step,
                           const Workers& workers) {
  TILEGRAD_ASSIGN(std::string contents, ContentsOf(set, workers));
  return RememberList(
      run, kTrainedPhotographs,
      {TextOf(set), std::move(contents), "training photographs or annotations", set.folder},
      first_step == 0);
}

Result<bool> IsTrainedOn(const Path& run, const Path& data) {
  for (const char* name : {kTrainedModels, kTrainedPhotographs}) {
    TILEGRAD_ASSIGN(const auto list, ReadRunFile(run, name));
    if (!list) continue;
    TILEGRAD_ASSIGN(const std::string names, TrainingNames(data, name));
    const std::string_view text(reinterpret_cast<const char*>(list->bytes.data()),
                                list->bytes.size());
    if (!text.starts_with(names)) return false;
    const std::string_view contents = text.substr(names.size());
    return contents.empty() || contents.starts_with("camera ") || contents.starts_with("file ");
  }
  return true;
}

Status CheckHeldOut(const Path& run, const Dataset& dataset, Split split) {
  TILEGRAD_ASSIGN(const auto list, ReadRunFile(run, kTrainedModels));
  if (!list) return {};
  std::unordered_set<std::string> trained;
  for (const std::string& line : LinesOf(*list)) trained.insert(MeshOf(line));
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

Status CheckHeldOutPhotographs(const Path& run, const PhotographSet& set, Split split) {
  TILEGRAD_ASSIGN(const auto list, ReadRunFile(run, kTrainedPhotographs));
  if (!list) return {};
  const auto trained = LinesOf(*list);
  for (const int i : set.Select(split)) {
    const std::string& id = set.photographs[static_cast<std::size_t>(i)].id;
    if (trained.count(id) > 0)
      return InvalidArgument("{}: {} of {} was trained on", run.string(), id, set.folder.string());
  }
  return {};
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
