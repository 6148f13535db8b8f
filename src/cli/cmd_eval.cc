// SPDX-License-Identifier: Apache-2.0
// tilegrad eval: how good a run is on models that it never saw, beside three baselines.
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "fit/input.h"
#include "fit/refine.h"
#include "train/predictor.h"
#include "train/tasks/task.h"

namespace tilegrad::cli {
namespace {

const std::map<std::string, train::Split> kSplits = {{"test", train::Split::kTest},
                                                     {"validation", train::Split::kValidation},
                                                     {"train", train::Split::kTrain}};

struct EvalOptions {
  RunOptions on;
  int views_per_model = 24;
  std::string split = "test";
  bool force = false;
  int refine = 0, oracle = 0;
};

// Refines on the calling thread: pictures are worked on side by side.
train::PredictionChange RefineWith(int steps, int image_size) {
  if (steps == 0) return nullptr;
  return
      [steps, image_size](const Mesh& mesh, std::span<const std::uint8_t> image) -> Result<Mesh> {
        TILEGRAD_ASSIGN(train::RefinedMesh refined,
                        train::RefineMesh(mesh, train::TargetsOfPlanar(image, image_size),
                                          {.steps = steps}, Workers(1)));
        return std::move(refined.mesh);
      };
}

Status RunEvaluation(const EvalOptions& options) {
  TILEGRAD_ASSIGN(const Path run, ChooseRun(options.on.run));
  TILEGRAD_ASSIGN(const Path data, ChooseDataset(options.on.data, run));
  const OutputGuard guard(options.force);
  const Path files[] = {run / "eval.md", run / "eval.json"};
  const train::Split split = kSplits.at(options.split);
  const bool writes = split == train::Split::kTest && options.refine == 0;
  if (writes) TILEGRAD_TRY(guard.CheckAll(files));
  const Workers workers(options.on.workers);
  TILEGRAD_ASSIGN(const train::Predictor predictor, LoadPredictor(run, workers));
  const train::TaskEvaluation job{run,
                                  data,
                                  predictor,
                                  split,
                                  options.views_per_model,
                                  RefineWith(options.refine, predictor.image_size()),
                                  options.oracle};
  ProgressLine line;
  auto evaluation = predictor.task().Evaluate(job, workers, line.Sink(), StopOnSignals());
  line.Finish();
  if (!evaluation.ok()) return evaluation.status();
  // Files first: printing may fail. They keep the figures of the network alone on held-out models.
  if (writes) TILEGRAD_TRY(train::WriteEvaluation(run, *evaluation));
  Print("{}\n{}", evaluation->predictor, train::FormatTable(*evaluation));
  PrintResult(train::EvaluationJson(*evaluation));
  if (!writes) return {};
  guard.NoteAll(files);
  Print("written to {} and {}\n", files[0].string(), files[1].string());
  return {};
}

}  // namespace

void AddEval(CLI::App& app, Action* action) {
  auto options = std::make_shared<EvalOptions>();
  auto* command = app.add_subcommand(
      "eval", "3D IoU and F-score of a run on held-out models, beside three baselines");
  AddRunOptions(command, &options->on);
  command
      ->add_option("--views-per-model", options->views_per_model,
                   "images of each model that are predicted from")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  command
      ->add_option("--split", options->split,
                   "which models are scored; the scores of others than test are printed only")
      ->capture_default_str()
      ->check(CLI::IsMember(kSplits));
  command
      ->add_option("--refine", options->refine,
                   "steps of refinement of each prediction on its image, as of predict; the scores "
                   "are printed only")
      ->capture_default_str()
      ->check(CLI::Range(0, 100000));
  command
      ->add_option("--oracle", options->oracle,
                   "steps of fitting the template to all views of each model, for a row that says "
                   "how good predictions can be at best; 300 take a second a model or two")
      ->capture_default_str()
      ->check(CLI::Range(0, 100000));
  AddForceOption(command, &options->force);
  command->callback([options, action] { *action = [options] { return RunEvaluation(*options); }; });
}

}  // namespace tilegrad::cli
