// SPDX-License-Identifier: Apache-2.0
// tilegrad train: a run from a configuration and a dataset.
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/parallel.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/live_option.h"
#include "cli/ranks.h"
#include "cli/run_folder.h"
#include "train/config.h"
#include "train/run/run_files.h"
#include "train/trainer.h"

namespace tilegrad::cli {
namespace {

// What --resume is given where no folder follows it.
constexpr const char* kRunInOut = "the run in --out";

struct TrainOptions {
  std::string config, data, out, resume;
  std::vector<std::string> overrides;
  std::int64_t steps = 0;
  bool force = false;
  double max_minutes = 0;
  int workers = 0;
  bool live = false;
};

void PrintOutcome(const train::RunOutcome& outcome, const TrainOptions& options,
                  const char* score_command) {
  const std::string run = ShellWord(options.out);
  if (outcome.first_step == outcome.last_step) {
    Print("{}: the run is complete at step {}; nothing to do\n", options.out, outcome.last_step);
    return;
  }
  Print("{}: {} at step {}, {} of training\n", options.out,
        outcome.finished ? "finished" : "stopped", outcome.last_step,
        FormatDuration(outcome.seconds));
  if (!outcome.finished) Print("resume with: tilegrad train --resume {}\n", run);
  if (outcome.finished) Print("scores: tilegrad {} --run {}\n", score_command, run);
  Print("curves: tensorboard --logdir {}\n", run);
}

void PrintJson(const train::RunOutcome& outcome, const TrainOptions& options) {
  PrintResult({{"run", options.out},
               {"first_step", outcome.first_step},
               {"last_step", outcome.last_step},
               {"finished", outcome.finished},
               {"seconds", outcome.seconds}});
}

// --resume RUN: options not given default to those that the run was started with.
Status TakeFromRun(TrainOptions* options) {
  const Path run = options->resume;
  std::error_code error;
  if (!options->out.empty() && !std::filesystem::equivalent(run, options->out, error))
    return InvalidArgument("--resume {} continues in that folder; leave out --out {}", run.string(),
                           options->out);
  if (!PathExists(run / "config.toml"))
    return NotFound("{}: not a run of tilegrad train: there is no config.toml in it", run.string());
  if (options->data.empty() && !PathExists(run / "run.json"))
    return NotFound(
        "{}: there is no run.json in it, which names its dataset; name that: tilegrad train "
        "--resume {} --data DATASET",
        run.string(), ShellWord(run.string()));
  options->out = run.string();
  if (options->config.empty()) options->config = (run / "config.toml").string();
  TILEGRAD_ASSIGN(const Path data, ChooseDataset(options->data, run));
  options->data = data.string();
  return {};
}

Status Complete(TrainOptions* options) {
  if (!options->resume.empty() && options->resume != kRunInOut) return TakeFromRun(options);
  for (const auto& [name, value] :
       {std::pair("--config", options->config), std::pair("--data", options->data),
        std::pair("--out", options->out)}) {
    if (value.empty())
      return InvalidArgument("train: {} is required; see tilegrad train --help", name);
  }
  return {};
}

// What a run names, such as textures.run, is looked for beside it, as its dataset is.
void FindPlaces(const Path& run, train::TrainConfig* config) {
  for (const train::ConfigField& field : config->Fields()) {
    if (field.affects != train::Affects::kPlace) continue;
    std::string& place = *std::get<std::string*>(field.target);
    if (place.empty()) continue;
    if (const auto found = FindFromRun(place, run)) place = found->string();
  }
}

Status MakeJob(TrainOptions* options, train::TrainJob* job) {
  TILEGRAD_TRY(Complete(options));
  TILEGRAD_ASSIGN(job->config, train::FindConfig(options->config));
  if (!options->resume.empty()) FindPlaces(options->out, &job->config);
  if (options->steps > 0) {
    options->overrides.push_back(fmt::format("schedule.steps={}", options->steps));
    job->extends = !options->resume.empty();
  }
  TILEGRAD_TRY(train::ApplyOverrides(options->overrides, &job->config));
  job->data = options->data;
  job->run = options->out;
  job->existing = ExistingOf(!options->resume.empty(), options->force);
  job->max_minutes = options->max_minutes;
  return {};
}

// Adds how to resume a stopped run, once there is one.
Status WithResume(const Status& status, const std::string& run) {
  const auto begun = train::HoldsRun(run);
  if (!begun.ok() || !*begun) return status;
  return WithCommand(status, "tilegrad train --resume " + ShellWord(run));
}

// Says where sample sheets are, as soon as there is one.
train::PictureSink AnnounceSheets(ProgressLine* line, std::int64_t every) {
  return [line, every, told = false](const Path& file) mutable {
    if (std::exchange(told, true)) return;
    line->Finish();
    PrintRemark("sample sheet: {} (a new one at least every {} steps)\n", file.string(), every);
  };
}

Status RunTraining(const TrainOptions& given) {
  TrainOptions options = given;
  Ranks ranks;
  TILEGRAD_TRY(ranks.Join());
  train::TrainJob job;
  Status ready = MakeJob(&options, &job);
  if (ready.ok() && !ranks.follows())
    ready = CheckRunFolder(options.out, job.existing, OutputGuard(options.force));
  ready = ranks.Agree(ready);
  if (!ready.ok()) return ranks.Reportable(ready);
  job.group = ranks.group();
  const Workers workers(ranks.Workers(options.workers));
  if (ranks.follows())
    return ranks.Reportable(train::Train(job, workers, {nullptr, &StopOnSignals()}).status());
  Live live;
  if (options.live)
    job.begun = [&] { return live.Start({options.out, options.data, job.config.schedule.steps}); };
  ProgressLine line;
  job.warn = line.Warnings();
  job.drawn = AnnounceSheets(&line, job.config.schedule.sample_every);
  auto outcome = train::Train(job, workers, {live.Sink(line.Sink()), &StopOnSignals()});
  line.Finish();
  live.Finish(outcome.status());
  ranks.EndIfBroken(outcome.status());
  if (!outcome.ok()) return WithResume(outcome.status(), options.out);
  PrintOutcome(*outcome, options, job.config.task->ScoreCommand());
  PrintJson(*outcome, options);
  return {};
}

}  // namespace

void AddTrain(CommandList* list) {
  const auto [command, options] =
      AddCommand(list, "train", "Train the network of a configuration on a dataset", RunTraining);
  command->Add(
      "--config", &options->config,
      "name of a configuration (tilegrad configs lists them: quick, paper, ...) or a TOML file");
  command->Add("--data", &options->data, "dataset folder (see: tilegrad dataset)");
  command->Add("--out", &options->out, "run folder: checkpoints, curves, samples");
  command->Add("--set", &options->overrides,
               "override a key: --set schedule.steps=100 (repeatable)");
  AddForceOption(command, &options->force);
  command->Add("--resume", &options->resume,
               "resume the run in this folder with its configuration and dataset; without a "
               "folder, the run in --out, started if there is none",
               {ValueMayLack{kRunInOut, "[RUN]"}, Excludes{{"--force"}}});
  command->Add("--steps", &options->steps,
               "same as --set schedule.steps=N; with --resume, a larger number extends the run",
               {NoDefault{}, Range{1, 0x1p40}});
  command->Add("--max-minutes", &options->max_minutes,
               "save and stop after this many minutes; 0: no limit", {NotNegative()});
  AddLiveOption(command, &options->live);
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
