// SPDX-License-Identifier: Apache-2.0
// tilegrad dataset-view: one image of a dataset as a PNG, to look at or to predict from.
#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "io/binvox.h"
#include "io/image_file.h"
#include "render/picture/composite.h"
#include "train/data/dataset.h"

namespace tilegrad::cli {
namespace {

struct ViewOptions {
  std::string data, model, class_name, split = "test", out = "view.png", voxels;
  int view = 0;
  bool force = false;
};

// The models of the split, and of the class if one is named.
Result<std::vector<int>> Candidates(const train::Dataset& dataset, const ViewOptions& options) {
  const auto split = options.split == "train"        ? train::Split::kTrain
                     : options.split == "validation" ? train::Split::kValidation
                                                     : train::Split::kTest;
  std::vector<int> models = dataset.Select(split);
  if (!options.class_name.empty()) {
    const auto& classes = dataset.info().classes;
    const auto found = std::find(classes.begin(), classes.end(), options.class_name);
    if (found == classes.end()) {
      return NotFound("{}: no class \"{}\"; there are {}", options.data, options.class_name,
                      fmt::join(classes, ", "));
    }
    const auto wanted = static_cast<int>(found - classes.begin());
    std::erase_if(models, [&](int m) { return dataset.model(m).class_index != wanted; });
  }
  if (models.empty()) {
    return NotFound("{}: no models in the {} split{}", options.data, options.split,
                    options.class_name.empty() ? "" : " of class " + options.class_name);
  }
  return models;
}

// The model that "class/id" names, or the one in the middle of the candidates.
Result<int> ChooseModel(const train::Dataset& dataset, const ViewOptions& options) {
  if (options.model.empty()) {
    TILEGRAD_ASSIGN(const std::vector<int> models, Candidates(dataset, options));
    return models[models.size() / 2];
  }
  for (std::size_t m = 0; m < dataset.models().size(); ++m) {
    const auto& info = dataset.models()[m];
    if (dataset.ClassOf(info) + "/" + info.id == options.model) return static_cast<int>(m);
  }
  return NotFound("{}: no model \"{}\" (they are named CLASS/ID, as the files below models/)",
                  options.data, options.model);
}

// The model's solid as the dataset has it, in a cube around the origin in which it is as large as
// in the dataset.
Status WriteVoxels(const ViewOptions& options, const train::Dataset& dataset, int model) {
  if (options.voxels.empty()) return {};
  TILEGRAD_ASSIGN(train::ModelData data, dataset.Load(model));
  const double half = dataset.info().camera.half_extent;
  const Bytes bytes = io::EncodeBinvox(
      {train::kOccupancyResolution, {-half, -half, -half}, 2 * half, std::move(data.occupancy)});
  return WriteGuarded(OutputGuard(options.force), options.voxels,
                      [&] { return WriteFileAtomic(options.voxels, bytes); });
}

Status WriteView(const ViewOptions& options) {
  TILEGRAD_ASSIGN(const train::Dataset dataset, train::Dataset::Open(options.data));
  if (options.view >= dataset.info().views)
    return InvalidArgument("--view {}: the dataset has views 0 to {}", options.view,
                           dataset.info().views - 1);
  TILEGRAD_ASSIGN(const int model, ChooseModel(dataset, options));
  TILEGRAD_ASSIGN(const auto images, dataset.LoadImages(model));
  const int size = dataset.info().image_size;
  const auto image = ViewOf(dataset.info(), images, options.view);
  TILEGRAD_TRY(WriteGuarded(OutputGuard(options.force), options.out,
                            [&] { return io::SavePng(options.out, StraightRgba(image, size)); }));
  TILEGRAD_TRY(WriteVoxels(options, dataset, model));
  const auto& info = dataset.model(model);
  const std::string& of_class = dataset.ClassOf(info);
  Print("{}: {} ({}), view {}\n", options.out, info.name, of_class, options.view);
  PrintResult({{"image", options.out},
               {"name", info.name},
               {"class", of_class},
               {"id", info.id},
               {"view", options.view}});
  return {};
}

}  // namespace

void AddDatasetView(CommandList* list) {
  const auto [command, options] =
      AddCommand(list, "dataset-view", "Save one image of a dataset as an RGBA PNG", WriteView);
  command->Add("--data", &options->data, "dataset folder", {Required{}});
  command->Add("--model", &options->model,
               "CLASS/ID, named as the files below models/ [one of --split]");
  command->Add("--class", &options->class_name, "choose among the models of this class",
               {Excludes{{"--model"}}});
  command->Add("--split", &options->split, "train, validation or test",
               {Excludes{{"--model"}}, OneOf{{"train", "validation", "test"}}});
  command->Add("--view", &options->view, "index of the view", {NotNegative()});
  command->Add("--out", &options->out, "PNG file", {EndsIn(".png")});
  command->Add("--voxels", &options->voxels, "also write the model's 32^3 voxels there",
               {EndsIn(".binvox")});
  AddForceOption(command, &options->force);
}

}  // namespace tilegrad::cli
