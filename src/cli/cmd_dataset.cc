// SPDX-License-Identifier: Apache-2.0
// tilegrad dataset: renders models into a dataset that training reads.
#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <string>

#include "base/error.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/mesh_options.h"
#include "cli/run_folder.h"
#include "io/mesh_file.h"
#include "train/data/build/build.h"

namespace tilegrad::cli {
namespace {

using train::ModelSource;

struct DatasetOptions {
  std::string source = "sweethome3d", input, out, split_list;
  int workers = 0;
  bool fixed_size = false;  // --size or --views was given
  bool shares = false;      // of the split were given
  bool force = false;
  train::BuildOptions build;
};

constexpr int kProceduralModels = 100;  // of each class, where --per-class does not say

// An option that would do nothing is a mistake: somebody expects a split that there will not be.
Status CheckEffects(const DatasetOptions& options) {
  if (!options.split_list.empty() && options.source != "shapenet") {
    return InvalidArgument("--split-list is for --source shapenet, not {}", options.source);
  }
  if (!options.input.empty() && options.source == "procedural") {
    return InvalidArgument("--input: --source procedural reads no models; folder does");
  }
  if (options.build.up != UpAxis::kY &&
      (options.source == "procedural" || options.source == "nmr")) {
    return InvalidArgument("--up: --source {} reads no mesh files", options.source);
  }
  if (options.shares && (options.source == "nmr" || !options.split_list.empty())) {
    return InvalidArgument("--test-share, --validation-share: {} has a split of its own",
                           options.source == "nmr" ? "--source nmr" : "--split-list");
  }
  return {};
}

Result<std::unique_ptr<ModelSource>> OpenSource(const DatasetOptions& options) {
  TILEGRAD_TRY(CheckEffects(options));
  const train::BuildOptions& build = options.build;
  if (options.source == "procedural") {
    return train::ProceduralSource(build.per_class > 0 ? build.per_class : kProceduralModels,
                                   build.split.seed);
  }
  if (options.source == "sweethome3d") {
    return train::SweetHome3dSource(options.input.empty() ? train::kSweetHome3dFolder
                                                          : options.input);
  }
  if (options.input.empty()) {
    return InvalidArgument("--source {} needs --input FOLDER", options.source);
  }
  if (options.source == "folder") return train::FolderSource(options.input);
  if (options.source == "shapenet") {
    return train::ShapeNetSource(options.input, options.split_list);
  }
  if (options.fixed_size) {
    return InvalidArgument(
        "--source nmr holds images of 64 pixels in 24 views: leave out --size "
        "and --views");
  }
  return train::NmrSource(options.input);
}

void PrintTable(const train::BuildSummary& summary) {
  Print("{:<14}{:>8}{:>8}{:>8}{:>10}\n", "class", "train", "valid.", "test", "rejected");
  for (std::size_t c = 0; c < summary.info.classes.size(); ++c) {
    int counts[3] = {}, rejected = 0;
    for (const auto& model : summary.models) {
      if (model.class_index == static_cast<int>(c)) ++counts[static_cast<int>(model.split)];
    }
    for (const auto& model : summary.rejected) {
      rejected += model.class_name == summary.info.classes[c];
    }
    Print("{:<14}{:>8}{:>8}{:>8}{:>10}\n", summary.info.classes[c], counts[0], counts[1], counts[2],
          rejected);
  }
}

// Reasons mostly begin with the file: what is the same in several is what follows it.
void PrintRejected(const train::BuildSummary& summary, const Path& folder) {
  if (summary.rejected.empty()) return;
  std::map<std::string, int> reasons;
  for (const auto& model : summary.rejected) {
    const auto colon = model.reason.rfind(": ");
    ++reasons[colon == std::string::npos ? model.reason : model.reason.substr(colon + 2)];
  }
  Print("{} could not be used ({} lists them):\n", Count(summary.rejected.size(), "model"),
        (folder / "rejected.jsonl").string());
  for (const auto& [reason, count] : reasons) Print("  {:>5}  {}\n", count, reason);
}

void PrintWarnings(const train::BuildSummary& summary) {
  constexpr std::size_t kShown = 10;
  if (summary.warnings.empty()) return;
  Print("{} of reading models:\n", Count(summary.warnings.size(), "warning"));
  for (std::size_t i = 0; i < std::min(kShown, summary.warnings.size()); ++i)
    Print("  {}: {}\n", summary.warnings[i].file, summary.warnings[i].text);
  if (summary.warnings.size() > kShown) Print("  ...\n");
}

Status Make(const DatasetOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const Path folder = options.out.empty() ? Path("datasets") / options.source : Path(options.out);
  TILEGRAD_TRY(OutputGuard(options.force).CheckFolder(folder));
  TILEGRAD_ASSIGN(const auto source, OpenSource(options));
  const Workers workers(options.workers);
  ProgressLine line;
  TILEGRAD_ASSIGN(
      const train::BuildSummary summary,
      train::BuildDataset(*source, options.build, folder, workers, line.Sink(), StopOnSignals()));
  line.Finish();
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  PrintTable(summary);
  PrintRejected(summary, folder);
  PrintWarnings(summary);
  Print("{}, {} of {} x {} pixels, {:.1f} MB in {} ({} kept from earlier), {:.1f} s\n",
        Count(summary.models.size(), "model"),
        Count(static_cast<std::size_t>(summary.info.views), "view"), summary.info.image_size,
        summary.info.image_size, static_cast<double>(summary.bytes) / 1e6, folder.string(),
        Count(static_cast<std::size_t>(summary.reused), "model file"), seconds.count());
  for (const auto& credit : summary.info.credits) Print("{}\n", credit);
  Print("look at {}\n", (folder / "contact_sheet.png").string());
  return {};
}

void AddSourceOptions(CLI::App* command, DatasetOptions* options) {
  command
      ->add_option("--source", options->source,
                   "where models come from: sweethome3d (Debian package sweethome3d-furniture), "
                   "shapenet (SYNSET/MODEL/models/model_normalized.obj), folder (CLASS/MODEL with "
                   "one of " +
                       io::MeshFileEndings() +
                       "), procedural (built in), nmr (.npz renders of N3MR and SoftRas)")
      ->check(CLI::IsMember({"sweethome3d", "shapenet", "folder", "procedural", "nmr"}))
      ->capture_default_str();
  command->add_option("--input", options->input,
                      "folder of the models; sweethome3d has a default, procedural needs none");
  command->add_option("--out", options->out, "folder to fill [datasets/SOURCE]");
  command->add_option("--split-list", options->split_list,
                      "shapenet: lines \"SYNSET/MODEL train|val|test\"; only these are used");
}

void AddBuildOptions(CLI::App* command, train::BuildOptions* build) {
  command->add_option("--size", build->image_size, "pixels a side")->capture_default_str();
  command->add_option("--views", build->views, "views of a model")->capture_default_str();
  command
      ->add_option("--per-class", build->per_class,
                   "at most this many models of a class; 0: all, or 100 if procedural")
      ->capture_default_str();
  command->add_option("--limit", build->limit, "at most this many models in all; 0: all")
      ->capture_default_str();
  command
      ->add_option("--seed", build->split.seed,
                   "seed of the choice of models, the split and procedural shapes")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--test-share", build->split.test_share,
                   "share of each class's models to test with")
      ->capture_default_str();
  command
      ->add_option("--validation-share", build->split.validation_share,
                   "share of each class's models to validate with")
      ->capture_default_str();
}

}  // namespace

void AddDataset(CLI::App& app, Action* action) {
  auto options = std::make_shared<DatasetOptions>();
  auto* command =
      app.add_subcommand("dataset",
                         "Render 3D models into a dataset: RGBA views, occupancy, surface points.\n"
                         "After Ctrl-C the same command goes on where it stopped.");
  AddSourceOptions(command, options.get());
  AddBuildOptions(command, &options->build);
  AddUpOption(command, &options->build.up);
  AddForceOption(command, &options->force);
  AddWorkersOption(command, &options->workers);
  command->callback([options, action, command] {
    options->fixed_size = command->count("--size") + command->count("--views") > 0;
    options->shares = command->count("--test-share") + command->count("--validation-share") > 0;
    *action = [options] { return Make(*options); };
  });
}

}  // namespace tilegrad::cli
