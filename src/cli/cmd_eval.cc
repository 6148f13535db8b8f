// SPDX-License-Identifier: Apache-2.0
// tilegrad eval: how good a run is on models that it never saw, beside two baselines.
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "train/predictor.h"
#include "train/tasks/task.h"

namespace tilegrad::cli {
namespace {

struct EvalOptions {
  RunOptions on;
  int views_per_model = 24;
  bool training_models = false, force = false;
};

Status RunEvaluation(const EvalOptions& options) {
  TILEGRAD_ASSIGN(const Path run, ChooseRun(options.on.run));
  TILEGRAD_ASSIGN(const Path data, ChooseDataset(options.on.data, run));
  const OutputGuard guard(options.force);
  const Path files[] = {run / "eval.md", run / "eval.json"};
  if (!options.training_models) TILEGRAD_TRY(guard.CheckAll(files));
  const Workers workers(options.on.workers);
  TILEGRAD_ASSIGN(const train::Predictor predictor, LoadPredictor(run, workers));
  const train::TaskEvaluation job{run, data, predictor, options.training_models,
                                  options.views_per_model};
  ProgressLine line;
  auto evaluation = predictor.task().Evaluate(job, workers, line.Sink(), StopOnSignals());
  line.Finish();
  if (!evaluation.ok()) return evaluation.status();
  // Files first: printing may fail. A look at overfitting leaves them their held-out figures.
  if (!options.training_models) TILEGRAD_TRY(train::WriteEvaluation(run, *evaluation));
  Print("{}\n{}", evaluation->predictor, train::FormatTable(*evaluation));
  if (options.training_models) return {};
  guard.NoteAll(files);
  Print("written to {} and {}\n", files[0].string(), files[1].string());
  return {};
}

}  // namespace

void AddEval(CLI::App& app, Action* action) {
  auto options = std::make_shared<EvalOptions>();
  auto* command = app.add_subcommand(
      "eval", "3D IoU and F-score of a run on held-out models, beside two baselines");
  AddRunOptions(command, &options->on);
  command
      ->add_option("--views-per-model", options->views_per_model,
                   "images of each model that are predicted from")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  command->add_flag("--training-models", options->training_models,
                    "score the training models instead and write nothing");
  AddForceOption(command, &options->force);
  command->callback([options, action] { *action = [options] { return RunEvaluation(*options); }; });
}

}  // namespace tilegrad::cli
