// SPDX-License-Identifier: Apache-2.0
// tilegrad sample: new textured objects from a trained generator.
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_text.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "cli/sample_pictures.h"
#include "io/glb_writer.h"
#include "io/image_file.h"
#include "train/tasks/gan/scores.h"
#include "train/tasks/gan/sheet.h"

namespace tilegrad::cli {
namespace {

struct SampleOptions {
  std::string run, out = "samples";
  int count = 24, interpolate = 0, workers = 0;
  std::uint64_t seed = 0;
  bool force = false, score = false;
  std::string data, judge;
  int score_count = 256;
};

// Where everything goes.
struct SampleFiles {
  explicit SampleFiles(const SampleOptions& options)
      : out(options.out),
        sheet(out / "sheet.png"),
        turntable(out / "turntable.webp"),
        strip(out / "interpolation.png"),
        animation(out / "interpolation.webp"),
        scores(out / "scores.md"),
        numbers(out / "scores.json"),
        nearest(out / "nearest.png") {
    for (int i = 1; i <= options.count; ++i)
      meshes.push_back(out / fmt::format("sample_{:03}.glb", i));
    all = meshes;
    all.insert(all.end(), {sheet, turntable});
    if (options.interpolate > 0) all.insert(all.end(), {strip, animation});
    if (options.score) all.insert(all.end(), {scores, numbers, nearest});
  }
  Path out, sheet, turntable, strip, animation, scores, numbers, nearest;
  std::vector<Path> meshes, all;
};

Result<train::GeneratorModel*> GeneratorOf(const train::Predictor& predictor, const Path& run) {
  auto* const model = predictor.model().generator();
  if (model != nullptr) return model;
  return InvalidArgument("{}: not a generator; train one with --config gan_quick", run.string());
}

Result<std::vector<Mesh>> GenerateAll(train::GeneratorModel& model,
                                      std::span<const std::vector<float>> codes) {
  std::vector<Mesh> meshes;
  for (std::size_t at = 0; at < codes.size(); at += train::Model::kImagesAtOnce) {
    std::vector<float> some;
    const std::size_t end = std::min(codes.size(), at + train::Model::kImagesAtOnce);
    for (std::size_t i = at; i < end; ++i)
      some.insert(some.end(), codes[i].begin(), codes[i].end());
    TILEGRAD_ASSIGN(auto made, model.Generate(some));
    for (Mesh& mesh : made) meshes.push_back(std::move(mesh));
  }
  return meshes;
}

Status Interpolate(const SampleOptions& options, const SampleFiles& files,
                   std::span<const std::vector<float>> codes, train::GeneratorModel& model,
                   const Workers& workers, nlohmann::ordered_json* json) {
  TILEGRAD_ASSIGN(const InterpolationSteps steps,
                  DrawInterpolation({codes, options.interpolate, files.strip, files.animation},
                                    model, workers));
  Print(
      "interpolation: {}, {}; largest step of a row relative to its mean step: {:.1f} on average, "
      "{:.1f} at most\n",
      files.strip.string(), files.animation.string(), steps.mean, steps.largest);
  (*json)["interpolation"] = {{"strip", files.strip.string()},
                              {"animation", files.animation.string()},
                              {"largest_by_mean_step", steps.mean},
                              {"at_most", steps.largest}};
  return {};
}

Status Score(const SampleOptions& options, const SampleFiles& files, const Path& run,
             train::GeneratorModel& model, nlohmann::ordered_json* json) {
  TILEGRAD_ASSIGN(const Path data, ChooseDataset(options.data, run));
  ProgressLine line;
  const auto scores =
      train::ScoreGenerator(model, {run, data, options.score_count, options.seed, options.judge},
                            line.Sink(), StopOnSignals());
  line.Finish();
  if (!scores.ok()) return scores.status();
  const std::string text = train::FormatScores(*scores);
  TILEGRAD_TRY(WriteTextAtomic(files.scores, text));
  (*json)["scores"] = train::ScoresJson(*scores);
  TILEGRAD_TRY(WriteTextAtomic(files.numbers, JsonText((*json)["scores"], 2) + "\n"));
  TILEGRAD_TRY(io::SavePng(files.nearest, scores->nearest));
  Print("{}written to {} and {}; samples beside the nearest training objects: {}\n", text,
        files.scores.string(), files.numbers.string(), files.nearest.string());
  return {};
}

Status RunSampling(const SampleOptions& options) {
  if (options.interpolate > 0 && options.count < 2)
    return InvalidArgument("--interpolate needs two samples or more: --count 2");
  if (!options.score && !(options.data.empty() && options.judge.empty()))
    return InvalidArgument("--data and --judge need --score");
  TILEGRAD_ASSIGN(const Path run, ChooseRun(options.run));
  const SampleFiles files(options);
  const OutputGuard guard(options.force);
  TILEGRAD_TRY(guard.CheckAll(files.all));
  const Workers workers(options.workers);
  TILEGRAD_ASSIGN(const train::Predictor predictor, LoadPredictor(run, workers));
  TILEGRAD_ASSIGN(train::GeneratorModel * model, GeneratorOf(predictor, run));
  std::vector<std::vector<float>> codes;
  for (int i = 0; i < options.count; ++i)
    codes.push_back(model->Code(options.seed, static_cast<std::uint64_t>(i)));
  TILEGRAD_ASSIGN(const auto meshes, GenerateAll(*model, codes));
  nlohmann::ordered_json json = {{"seed", options.seed},
                                 {"textured", model->textured()},
                                 {"sheet", files.sheet.string()},
                                 {"turntable", files.turntable.string()}};
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    TILEGRAD_TRY(io::SaveGlb(files.meshes[i], meshes[i]));
    json["meshes"].push_back(files.meshes[i].string());
  }
  TILEGRAD_ASSIGN(const ImageU8 sheet, train::DrawSheet(meshes, {}, workers));
  TILEGRAD_TRY(io::SavePng(files.sheet, sheet));
  TILEGRAD_TRY(AnimateSamples(meshes, files.turntable, workers));
  Print("{}: {} to {}\n{}, {}\n", predictor.description(), files.meshes.front().string(),
        files.meshes.back().string(), files.sheet.string(), files.turntable.string());
  if (options.interpolate > 0)
    TILEGRAD_TRY(Interpolate(options, files, codes, *model, workers, &json));
  if (options.score) TILEGRAD_TRY(Score(options, files, run, *model, &json));
  PrintResult(json);
  return {};
}

}  // namespace

void AddSample(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "sample", "Make new textured 3D objects with a trained generator", RunSampling);
  command->Add("--run", &options->run, "run folder or one checkpoint [the newest below runs/]");
  command->Add("--count", &options->count, "objects", {Range{1, 999}});
  command->Add("--out", &options->out,
               "folder for sample_001.glb and so on, sheet.png (each from the front and from "
               "behind) and turntable.webp");
  command->Add("--seed", &options->seed,
               "of the latent codes: the same seed makes the same objects, to the bit");
  command->Add(
      "--interpolate", &options->interpolate,
      "steps from each object to the next, for interpolation.png (a row for each pair) and "
      "interpolation.webp; 0: none",
      {Range{0, 64}});
  command->Add("--score", &options->score,
               "compare as many objects more with true ones, as sets: scores.md, scores.json, and "
               "nearest.png with the nearest training objects");
  command->Add("--data", &options->data, "with --score: dataset [the run's own]");
  command->Add("--judge", &options->judge,
               "with --score: run of configs/classify.toml whose features pictures are compared by "
               "[cells of the pictures]");
  command->Add("--score-count", &options->score_count, "with --score: objects of each set",
               {Range{16, 100000}});
  AddForceOption(command, &options->force);
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
