// SPDX-License-Identifier: Apache-2.0
// tilegrad export: the weights of a run that predict, in one file to give away.
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "train/data/dataset.h"
#include "train/tasks/task.h"

namespace tilegrad::cli {
namespace {

struct ExportOptions {
  RunOptions on;
  std::string out, credits;
  bool half = false, force = false;
};

// What the file says of its training data, a line each.
Result<std::string> CreditsOf(const ExportOptions& options, const Path& run) {
  if (!options.credits.empty()) return options.credits;
  const auto data = ChooseDataset(options.on.data, run);
  if (!data.ok())
    return Status(data.status().code(),
                  data.status().message() + ", or say whose data it is with --credits");
  TILEGRAD_ASSIGN(const train::Dataset dataset, train::Dataset::Open(*data));
  return fmt::format("{}", fmt::join(dataset.info().credits, "\n"));
}

Status RunExport(const ExportOptions& options) {
  TILEGRAD_ASSIGN(const Path run, ChooseRun(options.on.run));
  const Path out = options.out;
  OutputGuard guard(options.force);
  guard.AddInput(run);
  TILEGRAD_TRY(guard.Check(out));
  const Workers workers(options.on.workers);
  TILEGRAD_ASSIGN(const train::Predictor predictor, LoadPredictor(run, workers));
  TILEGRAD_ASSIGN(const std::string credits, CreditsOf(options, run));
  const auto floats = options.half ? nn::StoredFloats::kHalf : nn::StoredFloats::kFull;
  TILEGRAD_TRY(predictor.ExportWeights(out, credits, floats));
  std::error_code error;
  const auto bytes = std::filesystem::file_size(out, error);  // devices have none
  Print("{}: {}{}\n{}\n", out.string(), predictor.description(),
        error ? "" : fmt::format(", {:.1f} MB", static_cast<double>(bytes) / 1e6), credits);
  PrintResult({{"weights", out.string()},
               {"parameters", predictor.model().parameters()},
               {"step", predictor.step()},
               {"half", options.half},
               {"bytes", error ? nlohmann::json() : nlohmann::json(bytes)},
               {"credits", credits}});
  return {};
}

}  // namespace

void AddExport(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "export",
      "Write the weights of a run that predict into one file, which predict, sample and eval take "
      "as --run",
      RunExport);
  AddRunOptions(command, &options->on, kRunOrWeights);
  command->Add("--out", &options->out, "file of weights, with the configuration and the credits",
               {Required{}, EndsIn(".safetensors")});
  command->Add("--half", &options->half, "as float16, rounded to the nearest: half the size");
  command->Add("--credits", &options->credits,
               "what the file says of its training data [the credits of the dataset]");
  AddForceOption(command, &options->force);
}

}  // namespace tilegrad::cli
