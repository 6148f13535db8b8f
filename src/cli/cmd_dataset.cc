// SPDX-License-Identifier: Apache-2.0
// tilegrad dataset: renders models into a dataset that training reads.
#include <algorithm>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/clocks.h"
#include "base/error.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/mesh_options.h"
#include "cli/ranks.h"
#include "cli/run_folder.h"
#include "io/mesh_file.h"
#include "tilegrad/status.h"
#include "train/data/build/build.h"
#include "train/data/dataset.h"
#include "train/data/photographs/collect.h"
#include "train/data/sources/installed.h"
#include "train/data/sources/model_source.h"
#include "train/data/sources/split_list.h"

namespace tilegrad::cli {
namespace {

struct DatasetOptions {
  std::vector<std::string> sources = {"sweethome3d"};
  std::string input, out, masks;
  std::vector<std::string> split_lists, classes;
  std::string meshes_only;  // an option that was given and says how meshes are rendered; or empty
  int workers = 0;
  bool size = false, views = false;  // --size, --views were given
  bool shares = false;               // of the split were given
  bool liveries = false;             // --liveries was given
  bool force = false;
  train::BuildOptions build;

  std::string Name() const { return fmt::format("{}", fmt::join(sources, "+")); }
  Path OutputFolder() const { return out.empty() ? Path("datasets") / Name() : Path(out); }
};

// `tilegrad dataset` for photographs: CUB-200 and PASCAL3D+.

void PrintSummary(const train::CollectionSummary& summary, const Path& folder) {
  const auto [training, validation, test] = summary.photographs;
  Print("{}", summary.broken.Summary());
  for (const auto& [what, count] : summary.notes) Print("{:>7}  {}\n", count, what);
  Print("{} training, {} validation and {} test photographs in {}\n", training, validation, test,
        folder.string());
  PrintResult({{"folder", folder.string()},
               {"training", training},
               {"validation", validation},
               {"test", test}});
}

// A folder without annotations is one of an interrupted call, if it has pictures.
Status CheckOut(const Path& folder, const std::string& source, bool force) {
  const Path pictures = folder / (source == "cub" ? "images" : "Images");
  if (IsFolder(pictures) && !PathExists(folder / "data")) return {};
  return OutputGuard(force).CheckFolder(folder);
}

Status MakeSet(const train::CollectionJob& job, const Path& folder, const Workers& workers,
               bool force) {
  TILEGRAD_TRY(CheckOut(folder, job.source, force));
  ProgressLine line;
  const auto made = train::CollectPhotographs(job, folder, workers, line.Watching());
  line.Finish();
  if (!made.ok()) return made.status();
  PrintSummary(*made, folder);
  return {};
}

// Whether a source holds photographs.
bool IsPhotographSource(const std::string& source) {
  return source == "cub" || source == "pascal3d";
}

// Photographs and models make no one dataset, and photographs are taken as they are.
Status CheckPhotographOptions(const DatasetOptions& options) {
  const std::string source = options.Name();
  if (options.sources.size() > 1)
    return InvalidArgument("--source {}: photographs and models make no one dataset", source);
  if (!options.meshes_only.empty())
    return InvalidArgument("{}: --source {} has photographs, which are taken as they are",
                           options.meshes_only, source);
  if (options.input.empty()) return InvalidArgument("--source {} needs --input FOLDER", source);
  if (source != "pascal3d" && !(options.classes.empty() && options.masks.empty()))
    return InvalidArgument("--classes, --masks: --source {} has one class, and masks", source);
  return {};
}

// Fills one folder, or a folder in it for each of several classes; names and omits classes without
// a usable photograph.
Status MakePhotographs(const DatasetOptions& options) {
  TILEGRAD_TRY(CheckPhotographOptions(options));
  std::vector<std::string> classes = options.classes;
  if (classes.empty()) classes = {"car"};
  const Path out = options.OutputFolder();
  const Workers workers(options.workers);
  std::size_t made = 0;
  for (const std::string& name : classes) {
    const train::CollectionJob job{options.Name(), options.input, name, options.masks,
                                   options.build.allow_broken};
    Status status = MakeSet(job, classes.size() > 1 ? out / name : out, workers, options.force);
    const bool empty = status.code() == StatusCode::kNotFound && classes.size() > 1;
    if (!status.ok() && !empty) return status;
    if (empty) Print("left out: {}\n", status.message());
    made += empty ? 0 : 1;
  }
  return made > 0 ? Status() : NotFound("{}: none of the classes has photographs", options.input);
}

using Opened = Result<std::unique_ptr<train::ModelSource>>;

constexpr int kProceduralModels = 100;  // of each class, where --per-class does not say

std::vector<std::string> DatasetSourceNames() {
  std::vector<std::string> names = {"shapenet", "choy",       "nmr", "dvr",      "dibr",
                                    "folder",   "procedural", "cub", "pascal3d", train::kThirteen};
  for (const auto& source : train::InstalledSources()) names.emplace_back(source.name);
  return names;
}

// One sentence on each.
std::string DatasetSourceHelp() {
  return "where models come from: sweethome3d (Debian package sweethome3d-furniture), planes "
         "(flightgear-data-ai), ships (flightgear-data-models), cars (torcs-data, "
         "trigger-rally-data, ufoai-data), several of these with commas between, thirteen (all of "
         "these), shapenet (ShapeNetCore, version 1 or 2), folder (CLASS/MODEL with "
         "one of " +
         io::MeshFileEndings() +
         "), procedural (built in), cub and pascal3d (photographs); renders of ShapeNet: nmr (.npz "
         "of N3MR and SoftRas), dvr (the NMR_Dataset of DVR), choy (ShapeNetRendering and "
         "ShapeNetVox32 of 3D-R2N2), dibr (the paper's)";
}

// One source, or several of installed packages as one. Errors: --input is missing, or given where
// there is no one folder to read; a name twice; several of which one is no package; and those of
// opening them.
Opened OpenDatasetSource(const DatasetOptions& options) {
  const std::string& name = options.sources.front();
  if (options.sources.size() > 1 || name == train::kThirteen) {
    if (options.input.empty()) return train::OpenInstalledSources(options.Name());
    return InvalidArgument("--input: --source {} reads several folders; leave it out",
                           options.Name());
  }
  if (name == "procedural") {
    const int models = options.build.per_class;
    return train::ProceduralSource(models > 0 ? models : kProceduralModels,
                                   options.build.split.seed);
  }
  if (const auto* installed = train::FindInstalledSource(name))
    return installed->open(options.input.empty() ? installed->folder : options.input);
  if (options.input.empty()) return InvalidArgument("--source {} needs --input FOLDER", name);
  if (name == "folder") return train::FolderSource(options.input);
  if (name == "nmr") return train::NmrSource(options.input);
  const std::vector<Path> files(options.split_lists.begin(), options.split_lists.end());
  TILEGRAD_ASSIGN(const train::SplitList list, train::SplitList::Read(files));
  if (name == "shapenet") return train::ShapeNetSource(options.input, list);
  const auto open = name == "choy"  ? train::ChoySource
                    : name == "dvr" ? train::DvrSource
                                    : train::DibrSource;
  return open(options.input, list, options.build.image_size);
}

bool Has(const DatasetOptions& options, std::string_view source) {
  return std::find(options.sources.begin(), options.sources.end(), source) != options.sources.end();
}

// Sets of pictures: their views, and mostly their split, are what they are.
bool HoldsPictures(const std::string& name) {
  return name == "nmr" || name == "choy" || name == "dvr" || name == "dibr";
}

// An option without effect is an error: the user expects a split that there will not be.
Status CheckEffects(const DatasetOptions& options) {
  const std::string name = options.Name();
  if (!options.masks.empty()) return InvalidArgument("--masks: not for --source {}", name);
  const bool pictures = HoldsPictures(name), listed = !options.split_lists.empty();
  if (listed && (name == "nmr" || (!pictures && name != "shapenet")))
    return InvalidArgument("--split-list needs --source shapenet, choy, dvr or dibr, not {}", name);
  if (options.build.allow_broken && !pictures && name != "shapenet")
    return InvalidArgument("--allow-broken: any model of --source {} may be broken", name);
  if (!options.input.empty() && name == "procedural")
    return InvalidArgument("--input: --source procedural reads no files; use --source folder");
  if (options.build.up != UpAxis::kY && (name == "procedural" || pictures))
    return InvalidArgument("--up: --source {} reads no mesh files", name);
  if (options.build.up != UpAxis::kY && name != "folder" && name != "sweethome3d")
    return InvalidArgument("--up: --source {} has a fixed up axis", name);
  if (options.shares && ((pictures && name != "dibr") || listed)) {
    return InvalidArgument("--test-share, --validation-share: {} has a fixed split",
                           listed ? "--split-list" : "--source " + name);
  }
  if (options.liveries && !Has(options, "thirteen") && !Has(options, "planes") &&
      !Has(options, "cars"))
    return InvalidArgument("--liveries: each model of --source {} has one set of textures", name);
  if (pictures && (options.views || (options.size && name == "nmr"))) {
    return InvalidArgument("--source {} holds 24 views{}: leave out --{}", name,
                           name == "nmr" ? " of 64 pixels" : "", options.views ? "views" : "size");
  }
  return {};
}

void PrintTable(const train::BuildSummary& summary) {
  const bool shapes = train::CountShapes(summary.models) < summary.models.size();
  Print("{:<14}{:>8}{:>8}{:>8}{:>10}{}\n", "class", "train", "valid.", "test", "rejected",
        shapes ? "  shapes" : "");
  for (std::size_t c = 0; c < summary.info.classes.size(); ++c) {
    int counts[3] = {}, rejected = 0;
    std::vector<train::ModelInfo> of_class;
    for (const auto& model : summary.models) {
      if (model.class_index != static_cast<int>(c)) continue;
      ++counts[static_cast<int>(model.split)];
      of_class.push_back(model);
    }
    for (const auto& model : summary.rejected) {
      rejected += model.class_name == summary.info.classes[c];
    }
    Print("{:<14}{:>8}{:>8}{:>8}{:>10}{}\n", summary.info.classes[c], counts[0], counts[1],
          counts[2], rejected, shapes ? fmt::format("{:>8}", train::CountShapes(of_class)) : "");
  }
}

void PrintRejected(const train::BuildSummary& summary, const Path& folder) {
  if (summary.rejected.empty()) return;
  Print("{} could not be used ({} lists them):\n{}", Count(summary.rejected.size(), "model"),
        (folder / "rejected.jsonl").string(), summary.broken.Summary());
}

// A few of what `items` say of files, below a heading.
template <class Item>
void PrintSome(const std::vector<Item>& items, const std::string& heading,
               std::string Item::*what) {
  constexpr std::size_t kShown = 10;
  if (items.empty()) return;
  Print("{}:\n", heading);
  for (std::size_t i = 0; i < std::min(kShown, items.size()); ++i)
    Print("  {}: {}\n", items[i].file, items[i].*what);
  if (items.size() > kShown) Print("  ...\n");
}

void PrintJson(const train::BuildSummary& summary, const Path& folder) {
  int counts[3] = {};
  for (const auto& model : summary.models) ++counts[static_cast<int>(model.split)];
  PrintResult({{"folder", folder.string()},
               {"models", summary.models.size()},
               {"training", counts[0]},
               {"validation", counts[1]},
               {"test", counts[2]},
               {"rejected", summary.rejected.size()},
               {"classes", summary.info.classes},
               {"views", summary.info.views},
               {"image_size", summary.info.image_size},
               {"bytes", summary.bytes}});
}

Opened Open(const DatasetOptions& options, const Path& folder, const Ranks& ranks) {
  // Resumes an existing dataset, unless --force starts over.
  if (!ranks.follows() && !PathExists(train::DatasetInfoPath(folder)))
    TILEGRAD_TRY(OutputGuard(options.force).CheckFolder(folder));
  TILEGRAD_TRY(CheckEffects(options));
  return OpenDatasetSource(options);
}

Status Make(const DatasetOptions& options) {
  if (std::ranges::any_of(options.sources, IsPhotographSource)) return MakePhotographs(options);
  const auto start = std::chrono::steady_clock::now();
  const Path folder = options.OutputFolder();
  Ranks ranks;
  TILEGRAD_TRY(ranks.Join());
  auto source = Open(options, folder, ranks);
  const Status ready = ranks.Agree(source.status());
  if (!ready.ok()) return ranks.Reportable(ready);
  train::BuildOptions build = options.build;
  build.group = ranks.group();
  build.anew = options.force;
  for (const std::string& name : options.classes)
    build.classes.push_back(train::SafeFileName(train::SynsetName(name)));
  const Workers workers(ranks.Workers(options.workers));
  ProgressLine line;
  auto made =
      train::BuildDataset(**source, build, folder, workers,
                          ranks.follows() ? Watch{nullptr, &StopOnSignals()} : line.Watching());
  line.Finish();
  if (!made.ok() || ranks.follows()) return ranks.Reportable(made.status());
  const train::BuildSummary summary = std::move(*made);
  const double seconds = SecondsSince(start);
  PrintTable(summary);
  PrintRejected(summary, folder);
  PrintSome(summary.warnings, Count(summary.warnings.size(), "warning") + " while reading models",
            &train::ModelWarning::text);
  const std::size_t ignored = summary.ignored.size();
  PrintSome(summary.ignored,
            ignored == 1 ? "1 file or folder ignored"
                         : fmt::format("{} files or folders ignored", ignored),
            &train::IgnoredFile::reason);
  Print("{}, {} of {} x {} pixels, {:.1f} MB in {} ({} reused), {:.1f} s\n",
        Count(summary.models.size(), "model"),
        Count(static_cast<std::size_t>(summary.info.views), "view"), summary.info.image_size,
        summary.info.image_size, static_cast<double>(summary.bytes) / 1e6, folder.string(),
        Count(static_cast<std::size_t>(summary.reused), "model file"), seconds);
  if (summary.renewed > 0)
    Print("{} made again: the files read for them changed, or were not recorded\n",
          Count(static_cast<std::size_t>(summary.renewed), "model file"));
  if (const auto advice = train::AdviceOnFewModels(summary.models, /*streamed=*/false))
    PrintNote("tilegrad: warning: {}\n", *advice);
  for (const auto& credit : summary.info.credits) Print("{}\n", credit);
  Print("preview: {}\n", (folder / "contact_sheet.png").string());
  PrintJson(summary, folder);
  return {};
}

void AddSourceOptions(Command* command, DatasetOptions* options) {
  command->Add("--source", &options->sources, DatasetSourceHelp(),
               {SplitAtCommas{}, OneOf{DatasetSourceNames()}});
  command->Add("--input", &options->input,
               "folder of the models; package sources have a default, procedural needs none");
  command->Add("--out", &options->out, "output folder [datasets/SOURCE]");
  command->Add(
      "--split-list", &options->split_lists,
      "published lists of the models to use, with commas between: SYNSET/MODEL "
      "train|val|test, or one file a split, whose name has train, val or test in it; those "
      "of Pixel2Mesh, DVR, DIB-R, PyTorch3D, 3D-R2N2 and ShapeNet's all.csv as they are",
      {SplitAtCommas{}});
  command->Add("--classes", &options->classes,
               "only these classes, by name or ShapeNet's number; pascal3d: a set for each [car]",
               {SplitAtCommas{}});
  command->Add(
      "--masks", &options->masks,
      "pascal3d: folder of masks, CLASS_imagenet/PICTURE.png, or PICTURE_NUMBER.png of one "
      "object among several");
  command->Add("--allow-broken", &options->build.allow_broken,
               "go on if more than 1 % of a published set cannot be used");
}

void AddBuildOptions(Command* command, train::BuildOptions* build) {
  command->Add("--size", &build->image_size, "width and height of the images, pixels");
  command->Add("--views", &build->views, "views per model");
  command->Add("--per-class", &build->per_class,
               "limit on shapes per class; 0: none, or 100 if procedural");
  command->Add("--liveries", &build->liveries,
               "limit on textures per shape; 0: none [1 for thirteen, else 0]", {NoDefault{}});
  command->Add("--limit", &build->limit, "limit on models in total; 0: none");
  command->Add("--seed", &build->split.seed,
               "seed for model selection, split and procedural shapes", {NotNegative()});
  command->Add("--test-share", &build->split.test_share,
               "fraction of each class's shapes in the test split");
  command->Add("--validation-share", &build->split.validation_share,
               "fraction of each class's shapes in the validation split");
}

}  // namespace

void AddDataset(CommandList* list) {
  auto options = std::make_shared<DatasetOptions>();
  Command& command =
      list->emplace_back(Command{"dataset",
                                 "Render 3D models into a dataset: RGBA views, occupancy, surface "
                                 "points.\nAfter Ctrl-C, the same command resumes."});
  AddSourceOptions(&command, options.get());
  AddBuildOptions(&command, &options->build);
  AddUpOption(&command, &options->build.up);
  AddForceOption(&command, &options->force);
  AddWorkersOption(&command, &options->workers);
  command.action = [&command, options] {
    options->size = command.Given("--size");
    options->views = command.Given("--views");
    options->liveries = command.Given("--liveries");
    for (const char* option :
         {"--size", "--views", "--per-class", "--liveries", "--limit", "--seed", "--test-share",
          "--validation-share", "--up", "--split-list"}) {
      if (command.Given(option)) options->meshes_only = option;
    }
    options->shares = command.Given("--test-share") || command.Given("--validation-share");
    if (!options->liveries && options->Name() == "thirteen") options->build.liveries = 1;
    return Make(*options);
  };
}

}  // namespace tilegrad::cli
