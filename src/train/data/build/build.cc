// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/build.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <span>

#include "base/error.h"
#include "base/file.h"
#include "base/hash.h"
#include "base/rng.h"
#include "base/text.h"
#include "io/image_file.h"
#include "render/picture/composite.h"
#include "train/data/broken_members.h"
#include "train/data/build/make_model.h"
#include "train/data/dataset.h"
#include "train/data/dataset_files.h"
#include "train/ranks/exchange.h"

namespace tilegrad::train {
namespace {

bool IsWanted(const std::vector<std::string>& classes, const std::string& name) {
  return classes.empty() || std::find(classes.begin(), classes.end(), name) != classes.end();
}

// Selects entries by classes, per_class, liveries and limit; ascending. Takes the first by a hash,
// first of shapes, then of the models of each, so that a part of a set is as varied as the whole.
std::vector<std::size_t> ChooseEntries(const std::vector<SourceEntry>& entries,
                                       const BuildOptions& options) {
  struct Candidate {
    std::uint64_t shape_hash, hash;
    std::size_t entry;
    auto operator<=>(const Candidate&) const = default;
  };
  const auto shape_of = [&](std::size_t i) {
    return entries[i].class_name + "/" +
           (entries[i].shape.empty() ? entries[i].id : entries[i].shape);
  };
  std::vector<Candidate> order;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!IsWanted(options.classes, entries[i].class_name)) continue;
    const std::uint64_t seed = Mix64(options.split.seed);
    order.push_back({HashText(shape_of(i), seed),
                     HashText(entries[i].class_name + "/" + entries[i].id, seed), i});
  }
  std::sort(order.begin(), order.end());
  std::map<std::string, int> shapes, models;  // taken of a class, of a shape
  std::vector<std::size_t> chosen;
  for (const Candidate& c : order) {
    int &of_class = shapes[entries[c.entry].class_name], &of_shape = models[shape_of(c.entry)];
    if (of_shape == 0 && options.per_class > 0 && of_class >= options.per_class) continue;
    if (options.liveries > 0 && of_shape >= options.liveries) continue;
    if (options.limit > 0 && chosen.size() >= static_cast<std::size_t>(options.limit)) break;
    of_class += of_shape++ == 0;
    chosen.push_back(c.entry);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

Status CheckClasses(const std::vector<SourceEntry>& entries,
                    const std::vector<std::string>& classes) {
  std::set<std::string> there;
  for (const SourceEntry& entry : entries) there.insert(entry.class_name);
  for (const std::string& name : classes) {
    if (there.count(name) > 0) continue;
    return InvalidArgument("--classes: \"{}\" is none of the source's classes: {}", name,
                           fmt::join(there, ", "));
  }
  return {};
}

Status CheckRange(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return InvalidArgument("{} must be in [{}, {}], got {}", name, low, high, value);
}

Status CheckOptions(const BuildOptions& options) {
  TILEGRAD_TRY(CheckRange("the image size", options.image_size, 8, 1024));
  TILEGRAD_TRY(CheckRange("the number of views", options.views, 1, 1024));
  TILEGRAD_TRY(CheckRange("the number per class", options.per_class, 0, INT32_MAX));
  TILEGRAD_TRY(CheckRange("the number of liveries", options.liveries, 0, INT32_MAX));
  TILEGRAD_TRY(CheckRange("the limit", options.limit, 0, INT32_MAX));
  TILEGRAD_TRY(CheckRange("the test share", options.split.test_share, 0, 0.9));
  TILEGRAD_TRY(CheckRange("the validation share", options.split.validation_share, 0, 0.9));
  return CheckRange("the sum of the test and validation shares",
                    options.split.test_share + options.split.validation_share, 0, 0.95);
}

constexpr int kModels = 6, kSheetViews = 3;
constexpr int kSheetGap = 4;  // pixels between models and rows

// Up to kModels models of a class, evenly spread.
std::vector<int> Pick(const Dataset& dataset, int class_index) {
  std::vector<int> all, out;
  for (std::size_t i = 0; i < dataset.models().size(); ++i) {
    if (dataset.models()[i].class_index == class_index) all.push_back(static_cast<int>(i));
  }
  const std::size_t n = std::min<std::size_t>(kModels, all.size());
  for (std::size_t i = 0; i < n; ++i) out.push_back(all[i * all.size() / n]);
  return out;
}

// Writes <folder>/contact_sheet.png: a row for each class, up to six of its models (the first in
// the order of models.jsonl, spread over it), each from three views, over light grey.
Status WriteContactSheet(const Dataset& dataset) {
  const DatasetInfo& info = dataset.info();
  const int size = info.image_size, views = std::min(kSheetViews, info.views);
  const int step_x = views * size + kSheetGap, step_y = size + kSheetGap;
  const int rows = static_cast<int>(info.classes.size());
  ImageU8 sheet(kModels * step_x + kSheetGap, rows * step_y + kSheetGap, 3, ToByte(kPaper));
  const std::size_t plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  for (int row = 0; row < rows; ++row) {
    const auto models = Pick(dataset, row);
    for (std::size_t column = 0; column < models.size(); ++column) {
      TILEGRAD_ASSIGN(const auto images, dataset.LoadImages(models[column]));
      for (int v = 0; v < views; ++v) {
        const auto view = static_cast<std::size_t>(v * info.views / views);
        const auto planes = std::span(images).subspan(4 * view * plane, 4 * plane);
        Paste(OnPaper(planes, size), kSheetGap + static_cast<int>(column) * step_x + v * size,
              kSheetGap + row * step_y, &sheet);
      }
    }
  }
  return io::SavePng(ContactSheetPath(dataset.folder()), sheet);
}

struct Outcome {
  std::optional<ModelStamp> stamp;  // of a finished file
  Status failure;                   // of a model that cannot be used
  std::vector<std::string> warnings;
};

DatasetInfo MakeInfo(const ModelSource& source, const BuildOptions& options) {
  DatasetInfo info;
  info.image_size = options.image_size;
  info.views = options.views;
  info.camera = options.camera;
  if (const auto fixed = source.FixedInfo()) info = *fixed;
  const SourceFacts& facts = source.facts();
  info.source = facts.name;
  info.credits = facts.credits;
  info.input = facts.input;
  info.up = options.up;
  info.camera.lens.width = info.camera.lens.height = info.image_size;
  info.recipe = RecipeOf(info, facts.version);
  return info;
}

std::vector<std::string> ClassesOf(const ModelSource& source,
                                   const std::vector<std::size_t>& chosen) {
  std::set<std::string> classes;
  for (std::size_t i : chosen) classes.insert(source.entries()[i].class_name);
  return {classes.begin(), classes.end()};
}

class Builder {
 public:
  Builder(const ModelSource& source, const BuildOptions& options, const Path& folder,
          const Workers& workers, const Watch& watch)
      : source_(source),
        options_(options),
        folder_(folder),
        workers_(workers),
        watch_(watch),
        info_(MakeInfo(source, options)),
        chosen_(ChooseEntries(source.entries(), options)),
        outcomes_(chosen_.size()) {}

  Result<BuildSummary> Run() {
    if (chosen_.empty()) return NotFound("the source \"{}\" holds no models", source_.facts().name);
    ProcessGroup* const group = options_.group;
    TILEGRAD_TRY(group ? MakeTogether(*group) : Prepare());
    if (group && !group->leads()) return std::move(summary_);
    // Models of other ranks count like those of an earlier build.
    TILEGRAD_TRY(MakeShare({0, 1}));
    return Finish();
  }

 private:
  const SourceEntry& entry(std::size_t i) const { return source_.entries()[chosen_[i]]; }
  Path FileOf(std::size_t i) const {
    return ModelFilePath(folder_, entry(i).class_name, entry(i).id);
  }

  // The models that this process makes: every `of`th, beginning with `first`.
  struct Share {
    std::size_t first, of;
    bool Has(std::size_t i) const { return i % of == first; }
  };

  Status MakeShare(const Share& share) {
    std::atomic<int> reused = 0;
    std::atomic<bool> missing = false;
    TILEGRAD_TRY(ForEachModel("checking", [&](std::size_t i, std::size_t) {
      if (!share.Has(i) || outcomes_[i].stamp) return;
      Reuse(i);
      if (outcomes_[i].stamp)
        ++reused;
      else
        missing = true;
    }));
    if (missing) TILEGRAD_TRY(MakeMissing(share));
    if (!options_.group || share.of > 1) {
      summary_.reused = reused;
      summary_.renewed = renewed_;
    }
    return {};
  }

  Status MakeTogether(ProcessGroup& group) {
    const auto rank = static_cast<std::size_t>(group.ranks().rank()),
               ranks = static_cast<std::size_t>(group.ranks().size());
    Hash models;
    for (const std::size_t i : chosen_) models.Add(source_.entries()[i].id);
    const Status ready = group.leads() ? Prepare() : Status();
    TILEGRAD_TRY(group.Agree(ready, {{"recipe", info_.recipe, "give all the same options"},
                                     {"list of models", models.Text(),
                                      "the source must hold the same files everywhere"}}));
    const Status made = MakeShare({rank, ranks});
    TILEGRAD_TRY(group.Agree(made, {}));
    for (int* count : {&summary_.reused, &summary_.renewed}) {
      int all = 0;
      for (const std::string& one : GatherTexts(group.ranks(), std::to_string(*count)))
        all += std::stoi(one);
      *count = all;
    }
    return {};
  }

  Status Prepare() {
    TILEGRAD_ASSIGN(lock_, FolderLock::Take(folder_));
    if (options_.anew) TILEGRAD_TRY(RemoveDataset(folder_));
    info_.classes = ClassesOf(source_, chosen_);
    RemoveTemporaries(folder_);
    for (const std::string& name : info_.classes)
      RemoveTemporaries(ModelFilePath(folder_, name, "").parent_path());
    const auto there = ReadDatasetInfo(folder_);
    if (there.status().code() == StatusCode::kNotFound) return WriteDatasetInfo(folder_, info_);
    if (!there.ok()) return there.status();
    if (there->recipe != info_.recipe)
      return InvalidArgument(
          "{}: holds a dataset with other settings (source {}, {} pixels, {}); choose another "
          "folder, or replace it with --force",
          folder_.string(), there->source, there->image_size, Count(there->views, "view"));
    // The index that may be there belongs to the classes of then, and stays until the new one.
    return {};
  }

  void Reuse(std::size_t i) {
    auto stamp = VerifyModelFile(FileOf(i), info_);
    if (stamp.status().code() == StatusCode::kIo) Fail(stamp.status());
    if (!stamp.ok()) return;
    if (source_.IsUnchanged(chosen_[i], stamp->inputs))
      outcomes_[i].stamp = std::move(*stamp);
    else
      ++renewed_;
  }

  // A refused resource may be refused for all models, and is no fault of this one.
  void Fail(const Status& status) {
    const std::lock_guard lock(mutex_);
    if (failure_.ok()) failure_ = status;
    failed_ = true;
  }

  Status MakeMissing(const Share& share) {
    // The list marks a complete set, which this no longer is.
    std::error_code error;
    std::filesystem::remove(ModelsPath(folder_), error);
    std::vector<LitRenderer> renderers(static_cast<std::size_t>(workers_.count()));
    TILEGRAD_TRY(ForEachModel("rendering", [&](std::size_t i, std::size_t worker) {
      const bool done = outcomes_[i].stamp || !outcomes_[i].failure.ok();
      if (share.Has(i) && !done) Make(i, renderers[worker]);
    }));
    return {};
  }

  void Make(std::size_t i, LitRenderer& renderer) {
    auto made = Load(i, renderer);
    if (!made.ok()) {
      const StatusCode code = made.status().code();
      outcomes_[i].failure = made.status();
      if (code == StatusCode::kIo || code == StatusCode::kCancelled) Fail(made.status());
      return;
    }
    const Status written = SaveModelFile(FileOf(i), info_, made->data, made->stamp);
    if (written.ok()) {
      outcomes_[i].stamp = made->stamp;
      return;
    }
    Fail(written);
  }

  Result<MadeModel> Load(std::size_t i, LitRenderer& renderer) {
    TILEGRAD_ASSIGN(SourceModel model, source_.Load(chosen_[i]));
    outcomes_[i].warnings = std::move(model.warnings);
    return MakeModel(entry(i), std::move(model), info_, renderer);
  }

  // Workers draw the next model from a counter: ascending, as sources want it, and balanced, since
  // the largest mesh takes a thousand times as long as the smallest.
  template <class Task>
  Status ForEachModel(const char* stage, Task task) {
    std::atomic<std::size_t> next = 0, done = 0;
    workers_.For(static_cast<std::size_t>(workers_.count()), [&](std::size_t, std::size_t worker) {
      for (std::size_t i = next++; i < chosen_.size() && !watch_.stopped() && !failed_;
           i = next++) {
        task(i, worker);
        const std::lock_guard lock(mutex_);
        watch_.Report({stage, ++done, chosen_.size(), entry(i).class_name});
      }
    });
    const bool cancelled = failure_.code() == StatusCode::kCancelled;
    if (!failure_.ok() && !cancelled) return failure_;
    if (!cancelled && (!watch_.stopped() || done == chosen_.size())) return {};
    return Cancelled("stopped; finished models are in {}; the same command resumes",
                     folder_.string());
  }

  void Collect() {
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
      const SourceEntry& e = entry(i);
      if (!outcomes_[i].stamp) {
        const std::string& reason = outcomes_[i].failure.message();
        summary_.rejected.push_back({e.id, e.class_name, e.file, reason});
        summary_.broken.Add(e.class_name + "/" + e.id, reason);
        continue;
      }
      usable_.push_back(chosen_[i]);
      for (std::string& text : outcomes_[i].warnings)
        summary_.warnings.push_back({e.file, std::move(text)});
    }
    info_.classes = ClassesOf(source_, usable_);
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
      if (outcomes_[i].stamp) summary_.models.push_back(Describe(entry(i), *outcomes_[i].stamp));
    }
  }

  ModelInfo Describe(const SourceEntry& e, const ModelStamp& stamp) const {
    const auto at = std::find(info_.classes.begin(), info_.classes.end(), e.class_name);
    ModelInfo model;
    model.id = e.id;
    model.name = e.name;
    model.class_index = static_cast<int>(at - info_.classes.begin());
    model.license = e.license;
    model.creator = e.creator;
    model.source_faces = stamp.source_faces;
    model.geometry = stamp.geometry;
    model.shape = e.shape;
    return model;
  }

  // Keeps what the source fixes; the rest is ours.
  void Split() {
    SplitModels(info_.classes, options_.split, &summary_.models);
    for (std::size_t i = 0; i < usable_.size(); ++i) {
      if (const auto& fixed = source_.entries()[usable_[i]].split)
        summary_.models[i].split = *fixed;
    }
  }

  Result<BuildSummary> Finish() {
    Collect();
    TILEGRAD_TRY(WriteRejected(folder_, summary_.rejected));
    if (summary_.models.empty())
      return DataLoss("none of {} can be used; {} says why", Count(chosen_.size(), "model"),
                      RejectedPath(folder_).string());
    if (source_.facts().published)
      TILEGRAD_TRY(summary_.broken.Check(chosen_.size(), options_.allow_broken));
    Split();
    // No list for a moment rather than one that does not fit the classes.
    std::error_code error;
    std::filesystem::remove(ModelsPath(folder_), error);
    TILEGRAD_TRY(WriteDatasetInfo(folder_, info_));
    TILEGRAD_TRY(WriteModels(folder_, info_, summary_.models));
    TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(folder_));
    TILEGRAD_TRY(WriteContactSheet(dataset));
    summary_.info = info_;
    summary_.ignored = source_.ignored();
    for (std::size_t i = 0; i < summary_.models.size(); ++i)
      summary_.bytes += std::filesystem::file_size(dataset.ModelPath(static_cast<int>(i)), error);
    return std::move(summary_);
  }

  const ModelSource& source_;
  const BuildOptions& options_;
  const Path& folder_;
  const Workers& workers_;
  const Watch& watch_;
  FolderLock lock_;
  DatasetInfo info_;
  std::vector<std::size_t> chosen_;  // entries of the source, ascending
  std::vector<Outcome> outcomes_;    // of chosen_
  std::vector<std::size_t> usable_;  // entries of summary_.models
  std::mutex mutex_;
  Status failure_;
  std::atomic<bool> failed_ = false;
  std::atomic<int> renewed_ = 0;
  BuildSummary summary_;
};

}  // namespace

Result<BuildSummary> BuildDataset(const ModelSource& source, const BuildOptions& options,
                                  const Path& folder, const Workers& workers, const Watch& watch) {
  TILEGRAD_TRY(CheckOptions(options));
  TILEGRAD_TRY(CheckClasses(source.entries(), options.classes));
  return Builder(source, options, folder, workers, watch).Run();
}

}  // namespace tilegrad::train
