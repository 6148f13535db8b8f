// SPDX-License-Identifier: Apache-2.0
#include "cli/run_folder.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/json_text.h"
#include "base/read_budget.h"
#include "cli/console.h"
#include "train/named_weights.h"
#include "train/run/checkpoint.h"
#include "train/run/run_files.h"

namespace tilegrad::cli {

namespace {

constexpr const char* kThreadsVariable = "TILEGRAD_THREADS";
constexpr int kMostThreads = 1024;

}  // namespace

Result<int> ThreadsFromEnvironment() {
  const char* const text = std::getenv(kThreadsVariable);
  if (text == nullptr || *text == '\0') return 0;
  int threads = 0;
  const char* const end = text + std::strlen(text);
  const auto [at, error] = std::from_chars(text, end, threads);
  if (error == std::errc() && at == end && threads >= 0 && threads <= kMostThreads) return threads;
  return InvalidArgument("{}: \"{}\" must be a number from 0 to {}", kThreadsVariable, text,
                         kMostThreads);
}

void AddWorkersOption(Command* command, int* workers) {
  const auto threads = ThreadsFromEnvironment();  // main reports its error
  if (threads.ok()) *workers = *threads;
  command->Add("--threads", workers,
               fmt::format("number of threads; 0: one per core; results do not depend on it. "
                           "Default: {} in the environment",
                           kThreadsVariable),
               {Range{0, kMostThreads}});
  command->Add("--workers", workers, "the name in earlier versions",
               {Hidden{}, Range{0, kMostThreads}});
}

void AddReadLimitOption(Command* command) {
  const auto take = [](const std::string& text) {
    const Status status = ParseByteCount(text).status();
    // Processes inherit it.
    if (status.ok()) ::setenv(kReadLimitVariable, text.c_str(), /*overwrite=*/1);
    return status.message();
  };
  command->Add("--read-limit", WordCheck{take, ""},
               fmt::format("memory limit per file, referenced files included: bytes, or 500M, 16G "
                           "[{} in the environment, else 4G]",
                           kReadLimitVariable),
               {TypeName{"BYTES"}});
}

void AddForceOption(Command* command, bool* force) {
  command->Add("--force", force,
               "start over and replace existing output files; inputs are never overwritten");
}

void AddRunOptions(Command* command, RunOptions* options, const char* what) {
  command->Add("--run", &options->run, fmt::format("{} [the newest run below runs/]", what));
  command->Add("--data", &options->data, "dataset folder [the training dataset]");
  AddWorkersOption(command, &options->workers);
}

train::ExistingRun ExistingOf(bool resume, bool force) {
  if (resume) return train::ExistingRun::kContinue;
  return force ? train::ExistingRun::kReplace : train::ExistingRun::kRefuse;
}

Status CheckRunFolder(const Path& folder, train::ExistingRun existing, const OutputGuard& guard) {
  TILEGRAD_TRY(train::CheckExistingRun(folder, existing));
  TILEGRAD_ASSIGN(const bool holds, train::HoldsRun(folder));
  return holds ? Status() : guard.CheckFolder(folder);
}

Status CheckIsRun(const Path& folder) {
  if (!PathExists(folder)) return NotFound("{} does not exist", folder.string());
  TILEGRAD_ASSIGN(const bool holds, train::HoldsRun(folder));
  // One of tilegrad.fit has nothing else before its first checkpoint.
  if (holds || IsFile(folder / "metrics.jsonl")) return {};
  return NotFound("{}: not the folder of a training or a fit", folder.string());
}

namespace {

// The run below runs/ whose last checkpoint is the newest.
std::optional<Path> NewestRun() {
  // Compares times of checkpoints, then names: time of the folder does not serve, since eval and
  // report of an old run change it, too.
  std::optional<std::pair<std::filesystem::file_time_type, Path>> newest;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("runs", error)) {
    const std::vector<Path> files = train::ListCheckpoints(entry.path());
    if (files.empty() || !PathExists(entry.path() / "run.json")) continue;
    const auto when = std::filesystem::last_write_time(files.back(), error);
    newest = std::max(newest, std::optional(std::pair(when, entry.path())));
  }
  return newest ? std::optional(newest->second) : std::nullopt;
}

}  // namespace

Result<Path> ChooseRun(const std::string& given, const char* otherwise) {
  if (!given.empty()) return train::FindRun(given);
  if (const auto newest = NewestRun()) {
    PrintRemark("{}: using the newest run below runs/; --run chooses another\n", newest->string());
    return *newest;
  }
  const Status none = NotFound(
      "no run with a checkpoint below runs/; name one with --run, or train one (tilegrad train "
      "--help)");
  if (otherwise == nullptr) return none;
  auto weights = train::WeightsNamed(otherwise);
  if (!weights.ok()) return NotFound("{}; {}", none.message(), weights.status().message());
  PrintRemark("{}: using the installed weights \"{}\"; --run chooses others\n", weights->string(),
              otherwise);
  return weights;
}

Status WithCommand(const Status& status, const std::string& command) {
  if (status.code() != StatusCode::kCancelled) return status;
  return Cancelled("{}; resume with: {}", status.message(), command);
}

Result<train::Predictor> LoadPredictor(const Path& run, const Workers& workers) {
  auto predictor = train::Predictor::Load(run, workers);
  if (!predictor.ok()) return predictor;
  for (const std::string& warning : predictor->warnings())
    PrintNote("tilegrad: warning: skipped: {}\n", warning);
  return predictor;
}

std::optional<Path> FindFromRun(const Path& name, const Path& run) {
  std::error_code error;
  // A run is not its own input, even if both have the same name.
  const auto is_input = [&](const Path& path) {
    return PathExists(path) && !std::filesystem::equivalent(path, run, error);
  };
  if (is_input(name)) return name;
  if (name.is_absolute()) return std::nullopt;
  Path above = std::filesystem::canonical(run, error);
  while (!error && above.has_relative_path()) {
    above = above.parent_path();
    if (is_input(above / name)) return above / name;
  }
  return std::nullopt;
}

Result<Path> ChooseDataset(const std::string& given, const Path& run) {
  if (!given.empty()) return Path(given);
  const Path folder = train::RunFolderOf(run), file = folder / "run.json";
  if (!PathExists(folder)) return NotFound("{}: no such folder", folder.string());
  if (IsFile(folder))
    return NotFound("{}: not a run folder; a file of weights names no dataset: name it with --data",
                    run.string());
  if (!PathExists(file)) {
    return NotFound("{}: not a run folder of tilegrad train: there is no run.json in it",
                    folder.string());
  }
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  TILEGRAD_ASSIGN(const nlohmann::json json, ParseJson(text, file.string()));
  if (!json.is_object() || !json.contains("dataset") || !json["dataset"].is_string()) {
    return DataLoss("{}: no \"dataset\" in it; name the dataset with --data", file.string());
  }
  const Path dataset = json["dataset"].get<std::string>();
  if (const auto found = FindFromRun(dataset, folder)) return *found;
  return NotFound("{}: cannot find its dataset {}; name it with --data", file.string(),
                  dataset.string());
}

}  // namespace tilegrad::cli
