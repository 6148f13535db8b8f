// SPDX-License-Identifier: Apache-2.0
// tilegrad train: a run from a configuration and a dataset.
#include <nlohmann/json.hpp>

#include "base/parallel.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/live_server.h"
#include "cli/option_checks.h"
#include "cli/run_folder.h"
#include "train/named_configs.h"
#include "train/trainer.h"

namespace tilegrad::cli {
namespace {

struct TrainOptions {
  std::string config, data, out;
  std::vector<std::string> overrides;
  bool resume = false, force = false;
  double max_minutes = 0;
  int workers = 0;
  LiveOption live;
};

void PrintOutcome(const train::RunOutcome& outcome, const TrainOptions& options) {
  if (outcome.first_step == outcome.last_step) {
    Print("{}: the run is complete at step {}; nothing to do\n", options.out, outcome.last_step);
    return;
  }
  Print("{}: {} at step {}, {} of training\n", options.out,
        outcome.finished ? "finished" : "stopped", outcome.last_step,
        FormatDuration(outcome.seconds));
  if (!outcome.finished) Print("continue with the same command and --resume\n");
}

void PrintJson(const train::RunOutcome& outcome, const TrainOptions& options) {
  PrintResult({{"run", options.out},
               {"first_step", outcome.first_step},
               {"last_step", outcome.last_step},
               {"finished", outcome.finished},
               {"seconds", outcome.seconds}});
}

Status RunTraining(const TrainOptions& options) {
  train::TrainJob job;
  TILEGRAD_ASSIGN(job.config, train::FindConfig(options.config));
  TILEGRAD_TRY(train::ApplyOverrides(options.overrides, &job.config));
  TILEGRAD_TRY(CheckRunFolder(options.out, OutputGuard(options.force)));
  job.data = options.data;
  job.run = options.out;
  job.existing = options.resume ? train::ExistingRun::kContinue : train::ExistingRun::kRefuse;
  job.max_minutes = options.max_minutes;
  TILEGRAD_ASSIGN(const auto live,
                  StartLive(options.live, {options.out, options.data, job.config.schedule.steps}));
  const Workers workers(options.workers);
  ProgressLine line;
  job.warn = line.Warnings();
  auto outcome = train::Train(job, workers, line.Sink(), StopOnSignals());
  line.Finish();
  if (!outcome.ok()) return outcome.status();
  PrintOutcome(*outcome, options);
  PrintJson(*outcome, options);
  return {};
}

}  // namespace

void AddTrain(CLI::App& app, Action* action) {
  auto options = std::make_shared<TrainOptions>();
  auto* command = app.add_subcommand("train", "Train what a configuration names on a dataset");
  command
      ->add_option("--config", options->config,
                   "a name (tilegrad configs lists them: quick, paper, ...) or a TOML file")
      ->required();
  command->add_option("--data", options->data, "dataset folder (see: tilegrad dataset)")
      ->required();
  command->add_option("--out", options->out, "run folder: checkpoints, curves, samples")
      ->required();
  command->add_option("--set", options->overrides,
                      "override a key: --set schedule.steps=100 (repeatable)");
  command->add_flag("--resume", options->resume,
                    "continue the run in --out (start it if there is none)");
  AddForceOption(command, &options->force);
  command
      ->add_option("--max-minutes", options->max_minutes,
                   "save and stop after this many minutes; 0: no limit")
      ->capture_default_str()
      ->check(NotNegative());
  AddLiveOption(command, &options->live);
  AddWorkersOption(command, &options->workers);
  command->callback([options, action] { *action = [options] { return RunTraining(*options); }; });
}

}  // namespace tilegrad::cli
