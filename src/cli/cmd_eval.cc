// SPDX-License-Identifier: Apache-2.0
// tilegrad eval: how good a run is on held-out models, with three baselines.
#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/ranks.h"
#include "cli/run_folder.h"
#include "fit/input.h"
#include "fit/refine.h"
#include "train/data/fingerprint.h"
#include "train/data/trained_models.h"
#include "train/eval/statistics.h"
#include "train/models/sphere_model.h"
#include "train/predictor.h"
#include "train/tasks/task.h"

namespace tilegrad::cli {
namespace {

const std::map<std::string, train::Split> kSplits = {{"test", train::Split::kTest},
                                                     {"validation", train::Split::kValidation},
                                                     {"train", train::Split::kTrain}};

const std::vector<std::string> kVoxelRules(std::begin(train::kVoxelRuleNames),
                                           std::end(train::kVoxelRuleNames));

std::optional<train::VoxelRule> RuleOf(const std::string& name) {
  if (name.empty()) return std::nullopt;
  const auto at = std::find(kVoxelRules.begin(), kVoxelRules.end(), name);
  return static_cast<train::VoxelRule>(at - kVoxelRules.begin());
}

struct EvalOptions {
  RunOptions on;
  int views_per_model = 24;
  std::string split = "test";
  int refine = 0, oracle = 0;
  std::string voxels;   // by whose rule; empty: the dataset's
  std::string compare;  // a run whose scores are there; empty: none
};

// Refines on the calling thread: pictures are worked on side by side. What is refined has the size
// of CameraRule's defaults, and gets back that of predictions.
train::PredictionChange RefineWith(int steps, const train::Predictor& predictor) {
  if (steps == 0) return nullptr;
  const int size = predictor.image_size();
  const float scale = static_cast<float>(predictor.half_extent()) / train::kPredictionHalfExtent;
  return [=](const Mesh& mesh, std::span<const std::uint8_t> image) -> Result<Mesh> {
    TILEGRAD_ASSIGN(
        train::RefinedMesh refined,
        train::RefineMesh(mesh, train::TargetsOfPlanar(image, size), {.steps = steps}, Workers(1)));
    for (glm::vec3& p : refined.mesh.positions) p *= scale;
    return std::move(refined.mesh);
  };
}

// What is evaluated, and where that is written.
struct Subject {
  Path run, data;
  std::string scores;   // how the files that keep the figures begin
  bool is_kept = true;  // the figures, of the network alone on held-out models
  std::optional<train::Predictor> predictor;
  std::optional<train::Evaluation> other;  // of EvalOptions::compare
};

// On another dataset than the run's own, that is part of the name.
Result<std::string> ScoresName(const Path& run, const Path& data) {
  TILEGRAD_ASSIGN(const bool own, train::IsTrainedOn(run, data));
  if (own) return std::string(train::kOwnScores);
  std::error_code error;
  const Path folder = std::filesystem::canonical(data, error);
  return fmt::format("{}_on_{}", train::kOwnScores, folder.filename().string());
}

Status Prepare(const EvalOptions& options, const Workers& workers, Subject* out) {
  TILEGRAD_ASSIGN(out->run, ChooseRun(options.on.run));
  TILEGRAD_ASSIGN(out->data, ChooseDataset(options.on.data, out->run));
  out->is_kept = IsFolder(out->run) && kSplits.at(options.split) == train::Split::kTest &&
                 options.refine == 0 && options.voxels.empty();
  TILEGRAD_ASSIGN(out->predictor, LoadPredictor(out->run, workers));
  TILEGRAD_ASSIGN(out->scores, ScoresName(out->run, out->data));
  if (options.compare.empty()) return {};
  TILEGRAD_ASSIGN(out->other, train::ReadEvaluation(options.compare, out->scores));
  if (out->other) return {};
  return NotFound("{}: there is no {}.json in it; run tilegrad eval --run {} --data {} first",
                  options.compare, out->scores, ShellWord(options.compare),
                  ShellWord(out->data.string()));
}

// What ranks must have in common.
Result<std::vector<train::Trait>> TraitsOf(const EvalOptions& options, const Subject& subject,
                                           const Workers& workers) {
  std::vector<train::Trait> out =
      train::CommonTraits(fmt::format("{} {} {} {} {}", options.views_per_model, options.split,
                                      options.refine, options.oracle, options.voxels));
  TILEGRAD_ASSIGN(std::string run, train::WithFile("", subject.predictor->checkpoint()));
  TILEGRAD_ASSIGN(std::string data, train::DataFingerprint(subject.data, workers));
  out.push_back({"checkpoint", std::move(run), "all must see the same run"});
  out.push_back({"dataset", std::move(data), "all must see the same files"});
  return out;
}

Status Meet(const EvalOptions& options, const Workers& workers, Ranks& ranks, Subject* out) {
  Status ready = Prepare(options, workers, out);
  if (ready.ok() && !ranks.follows() && kSplits.at(options.split) != train::Split::kTrain)
    ready = train::WarnWithoutList(out->run, ProgressLine().Warnings());
  if (!ranks.group()) return ready;
  std::vector<train::Trait> traits;
  if (ready.ok()) {
    auto all = TraitsOf(options, *out, workers);
    ready = all.status();
    if (all.ok()) traits = std::move(*all);
  }
  return ranks.group()->Agree(ready, traits);
}

Status Tell(const train::Evaluation& evaluation, const Subject& subject) {
  // Files first: printing may fail. Where they cannot be written, the work must not be lost.
  const Status saved =
      subject.is_kept ? train::WriteEvaluation(subject.run, evaluation, subject.scores) : Status();
  Print("{}\n{}", evaluation.predictor, train::FormatTable(evaluation));
  nlohmann::ordered_json json = train::EvaluationJson(evaluation);
  if (subject.other) {
    TILEGRAD_ASSIGN(const auto comparison, train::ComparePaired(evaluation, *subject.other));
    Print("\n{}", train::FormatComparison(comparison));
    json["compared"] = train::ComparisonJson(comparison);
  }
  PrintResult(json);
  if (!saved.ok() || !subject.is_kept) return saved;
  Print("written to {0}.md and {0}.json\n", (subject.run / subject.scores).string());
  return {};
}

Status RunEvaluation(const EvalOptions& options) {
  Ranks ranks;
  TILEGRAD_TRY(ranks.Join());
  const Workers workers(ranks.Workers(options.on.workers));
  Subject subject;
  const Status ready = Meet(options, workers, ranks, &subject);
  if (!ready.ok()) return ranks.Reportable(ready);
  const train::TaskEvaluation job{subject.run,
                                  subject.data,
                                  *subject.predictor,
                                  kSplits.at(options.split),
                                  options.views_per_model,
                                  RefineWith(options.refine, *subject.predictor),
                                  options.oracle,
                                  ranks.group(),
                                  RuleOf(options.voxels)};
  ProgressLine line;
  auto evaluation = subject.predictor->task().Evaluate(
      job, workers, ranks.follows() ? Watch{nullptr, &StopOnSignals()} : line.Watching());
  line.Finish();
  ranks.EndIfFailed(evaluation.status());
  if (!evaluation.ok()) return evaluation.status();
  return ranks.follows() ? Status() : Tell(*evaluation, subject);
}

}  // namespace

void AddEval(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "eval", "3D IoU and F-score of a run on held-out models, beside three baselines",
      RunEvaluation);
  AddRunOptions(command, &options->on, kRunOrWeights);
  command->Add("--views-per-model", &options->views_per_model, "input images per model",
               {Range{1, 1000}});
  command->Add("--split", &options->split,
               "split to score; scores of train and validation are printed, not saved",
               {OneOf{{"test", "train", "validation"}}});
  command->Add("--refine", &options->refine,
               "refinement steps per prediction, as in predict; scores are printed, not saved",
               {Range{0, 100000}});
  command->Add("--oracle", &options->oracle,
               "add an upper-bound row: the template fitted to all views of each model in this "
               "many steps; 300 take one to two seconds per model",
               {Range{0, 100000}});
  command->Add("--voxels", &options->voxels,
               "by whose rule the voxels of the 3D IoU are made: ours, binvox's (-cb -dc -aw, the "
               "paper's) or N3MR's; with it scores are printed only [that of the dataset's own]",
               {NoDefault{}, OneOf{kVoxelRules}});
  command->Add(
      "--compare", &options->compare,
      "folder of another run that was scored on the same models: each measure's difference "
      "with its standard error, by pairs of models");
}

}  // namespace tilegrad::cli
