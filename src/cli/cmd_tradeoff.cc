// SPDX-License-Identifier: Apache-2.0
// tilegrad tradeoff: what accuracy costs, measured.
#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "proof/tradeoff.h"

namespace tilegrad::cli {
namespace {

struct TradeoffOptions {
  std::string mesh, out = "tradeoff", data, config = "quick";
  int size = 256, repetitions = 7, steps = 1000, workers = 0;
  bool force = false;
  std::vector<double> errors = {0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1};
  std::vector<double> deltas = {1.0 / 7000, 1e-2};
  std::vector<double> training_errors = {1e-6, 1e-3, 3e-2};
};

// The last one only with trainings.
std::vector<Path> StudyFiles(const Path& folder, bool trained) {
  std::vector<Path> files = {folder / "tradeoff.md", folder / "tradeoff.csv",
                             folder / "tradeoff.svg"};
  if (trained) files.push_back(folder / "training.csv");
  return files;
}

Status WriteStudy(const Path& folder, const std::vector<StudyResult>& results,
                  const std::vector<StudyTraining>& training) {
  TILEGRAD_TRY(MakeFolder(folder));
  const std::string tables = StudyMarkdown(results, training);
  TILEGRAD_TRY(WriteTextAtomic(folder / "tradeoff.md", tables));
  TILEGRAD_TRY(WriteTextAtomic(folder / "tradeoff.csv", StudyCsv(results)));
  TILEGRAD_TRY(WriteTextAtomic(folder / "tradeoff.svg", StudyPicture(results)));
  if (!training.empty()) {
    TILEGRAD_TRY(WriteTextAtomic(folder / "training.csv", TrainingCsv(training)));
  }
  Print("{}written to {}: tradeoff.md, tradeoff.csv, tradeoff.svg{}\n", tables, folder.string(),
        training.empty() ? "" : ", training.csv");
  PrintResult({{"folder", folder.string()},
               {"files", {"tradeoff.md", "tradeoff.csv", "tradeoff.svg"}},
               {"trained", !training.empty()}});
  if (training.empty() && PathExists(folder / "training.csv")) {
    Print("training.csv is from an earlier call\n");
  }
  return {};
}

Result<std::vector<StudyScene>> ChooseScenes(const TradeoffOptions& options) {
  if (options.mesh.empty()) return BuiltInScenes();
  std::vector<StudyScene> scenes;
  TILEGRAD_ASSIGN(scenes.emplace_back(), SceneFromFile(options.mesh, options.size));
  return scenes;
}

Status RunTradeoff(const TradeoffOptions& options) {
  OutputGuard guard(options.force);
  guard.AddInput(options.mesh);
  TILEGRAD_TRY(guard.CheckAll(StudyFiles(options.out, !options.data.empty())));
  TILEGRAD_ASSIGN(const std::vector<StudyScene> scenes, ChooseScenes(options));
  ProgressLine line;
  const TrainingStudyJob study{options.data,  options.config, options.out, options.training_errors,
                               options.steps, line.Warnings()};
  if (!options.data.empty()) TILEGRAD_TRY(CheckTrainingStudy(study));
  std::vector<StudyResult> results;
  for (const StudyScene& scene : scenes) {
    for (const double delta : options.deltas) {
      TradeoffJob job;
      job.scene.positions = scene.positions;
      job.scene.faces = scene.faces;
      job.scene.camera = scene.camera;
      job.options.width = job.options.height = scene.size;
      job.options.delta = delta;
      job.errors = options.errors;
      job.repetitions = options.repetitions;
      auto tradeoff = MeasureTradeoff(job, line.Watching());
      if (!tradeoff.ok()) {
        return tradeoff.status().Within(fmt::format("{}, delta = {:g}", scene.name, delta));
      }
      results.push_back({scene.name, scene.size, delta, std::move(*tradeoff)});
    }
  }
  std::vector<StudyTraining> training;
  if (!options.data.empty()) {
    const Workers workers(options.workers);
    TILEGRAD_ASSIGN(training, RunTrainingStudy(study, workers, line.Watching()));
  }
  line.Finish();
  return WriteStudy(options.out, results, training);
}

}  // namespace

void AddTradeoff(CommandList* list) {
  const auto [command, options] =
      AddCommand(list, "tradeoff",
                 "Measure the trade-off of max_alpha_error: time, error of alpha and gradients "
                 "against float64, and the effect on training",
                 RunTradeoff);
  command->Add("mesh", &options->mesh, "mesh file [two built-in scenes]");
  command->Add(
      "--out", &options->out,
      "folder for tradeoff.md, .csv and .svg, and with --training for training.csv and the runs");
  AddForceOption(command, &options->force);
  command->Add("--size", &options->size, "width and height of a mesh file's image, pixels",
               {Needs{"mesh"}, Range{1, 4096}});
  command->Add("--errors", &options->errors, "values of max_alpha_error, in [0, 1]",
               {SplitAtCommas{}, Range{0, 1}});
  command->Add("--deltas", &options->deltas,
               "kernels: A = exp(-d^2 / delta), d in NDC (the paper's code: 1/7000)",
               {SplitAtCommas{}, AboveZero()});
  command->Add("--repetitions", &options->repetitions, "timings of each setting", {Range{1, 1000}});
  command->Add("--training", &options->data,
               "dataset folder: also train and evaluate a network for each of --training-errors");
  command->Add("--training-errors", &options->training_errors, "for --training",
               {Needs{"--training"}, SplitAtCommas{}, Range{0, 1}});
  command->Add("--config", &options->config, "for --training", {Needs{"--training"}});
  command->Add("--steps", &options->steps, "steps of each training run",
               {Needs{"--training"}, Range{1, 10000000}});
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
