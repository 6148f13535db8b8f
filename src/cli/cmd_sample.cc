// SPDX-License-Identifier: Apache-2.0
// tilegrad sample: new textured objects from a trained generator.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>

#include "base/error.h"
#include "base/file.h"
#include "base/json_text.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/webp_animation.h"
#include "render/picture/composite.h"
#include "train/data/trained_models.h"
#include "train/named_weights.h"
#include "train/tasks/gan/model.h"
#include "train/tasks/gan/scores.h"

namespace tilegrad::cli {
namespace {

struct InterpolationJob {
  std::span<const std::vector<float>> codes;  // at least 2
  int steps = 8;                              // from each code to the next, the last to the first
  Path strip, animation;
};

// How evenly an interpolation goes: the largest difference of neighbouring pictures of a row as a
// multiple of the row's mean one. Of all rows.
struct InterpolationSteps {
  double mean = 0, largest = 0;
};

constexpr int kMostSamples = 999;  // their files have numbers of three digits
constexpr int kTurning = 8;        // samples of the turntable
constexpr int kTurningColumns = 4;
constexpr int kTurningSize = 112;  // pixels
constexpr int kTurningFrames = 30;
constexpr int kStripSize = 96;  // pixels, of one step between two codes
constexpr int kAnimated = 6;    // rows of the animation
constexpr int kAnimationSize = 192;
constexpr int kSampleFrameMilliseconds = 100;
constexpr int kSampleQuality = 70;  // of WebP, 0 to 100

double Difference(const ImageU8& a, const ImageU8& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
  return sum / 255 / static_cast<double>(a.pixels.size());
}

double LargestStep(std::span<const ImageU8> row) {
  double sum = 0, largest = 0;
  for (std::size_t k = 1; k < row.size(); ++k) {
    const double step = Difference(row[k - 1], row[k]);
    sum += step;
    largest = std::max(largest, step);
  }
  return sum > 0 ? largest * static_cast<double>(row.size() - 1) / sum : 1;
}

// `steps` codes from `from`, which is the first of them, towards `to`, and that if `whole`.
std::vector<float> CodesBetween(std::span<const float> from, std::span<const float> to, int steps,
                                bool whole) {
  std::vector<float> codes;
  for (int i = 0; i < steps + (whole ? 1 : 0); ++i) {
    const auto code = train::BetweenCodes(from, to, static_cast<double>(i) / steps);
    codes.insert(codes.end(), code.begin(), code.end());
  }
  return codes;
}

// The first objects, side by side, turning once.
Status AnimateSamples(std::span<const Mesh> meshes, const Path& file, const Workers& workers) {
  const auto some = meshes.first(std::min<std::size_t>(meshes.size(), kTurning));
  const int columns = std::min<int>(kTurningColumns, static_cast<int>(some.size()));
  std::vector<ImageU8> frames;
  for (int frame = 0; frame < kTurningFrames; ++frame) {
    const Camera camera = train::SheetCamera(kTurningSize, 360.0 * frame / kTurningFrames);
    TILEGRAD_ASSIGN(const auto pictures, train::DrawObjects(some, camera, kTurningSize, workers));
    frames.push_back(TileImages(pictures, columns, 0));
  }
  return io::SaveWebpAnimation(file, frames,
                               {.frame_ms = kSampleFrameMilliseconds, .quality = kSampleQuality});
}

// A row of pictures for each pair of codes, and an animation of them all.
Result<InterpolationSteps> DrawInterpolation(const InterpolationJob& job,
                                             train::GeneratorModel& model, const Workers& workers) {
  std::vector<ImageU8> cells, frames;
  InterpolationSteps out;
  for (std::size_t i = 0; i < job.codes.size(); ++i) {
    const std::vector<float>& to = job.codes[(i + 1) % job.codes.size()];
    TILEGRAD_ASSIGN(const auto meshes,
                    model.Generate(CodesBetween(job.codes[i], to, job.steps, true)));
    TILEGRAD_ASSIGN(auto row, train::DrawObjects(meshes, train::SheetCamera(kStripSize, 0),
                                                 kStripSize, workers));
    const double ratio = LargestStep(row);
    out.mean += ratio / static_cast<double>(job.codes.size());
    out.largest = std::max(out.largest, ratio);
    for (ImageU8& cell : row) cells.push_back(std::move(cell));
    if (i >= kAnimated) continue;
    TILEGRAD_ASSIGN(const auto between,
                    model.Generate(CodesBetween(job.codes[i], to, 2 * job.steps, false)));
    TILEGRAD_ASSIGN(auto large, train::DrawObjects(between, train::SheetCamera(kAnimationSize, 0),
                                                   kAnimationSize, workers));
    for (ImageU8& frame : large) frames.push_back(std::move(frame));
  }
  TILEGRAD_TRY(io::SavePng(job.strip, TileImages(cells, job.steps + 1, 2)));
  TILEGRAD_TRY(io::SaveWebpAnimation(
      job.animation, frames, {.frame_ms = kSampleFrameMilliseconds, .quality = kSampleQuality}));
  return out;
}

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

// All that earlier calls may have left, which would pass for a part of these samples.
Status RemoveEarlier(SampleOptions options) {
  options.count = kMostSamples;
  options.interpolate = 1;
  options.score = true;
  return RemoveFiles(SampleFiles(options).all);
}

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

Result<train::GanScores> Score(const SampleOptions& options, const Path& run,
                               train::GeneratorModel& model) {
  TILEGRAD_ASSIGN(const Path data, ChooseDataset(options.data, run));
  ProgressLine line;
  TILEGRAD_TRY(train::WarnWithoutList(run, line.Warnings()));
  auto scores = train::ScoreGenerator(
      model, {run, data, options.score_count, options.seed, options.judge}, line.Watching());
  line.Finish();
  return scores;
}

Status WriteScores(const train::GanScores& scores, const SampleFiles& files,
                   nlohmann::ordered_json* json) {
  const std::string text = train::FormatScores(scores);
  TILEGRAD_TRY(WriteTextAtomic(files.scores, text));
  (*json)["scores"] = train::ScoresJson(scores);
  TILEGRAD_TRY(WriteTextAtomic(files.numbers, JsonText((*json)["scores"], 2) + "\n"));
  TILEGRAD_TRY(io::SavePng(files.nearest, scores.nearest));
  Print("{}written to {} and {}; samples beside the nearest training objects: {}\n", text,
        files.scores.string(), files.numbers.string(), files.nearest.string());
  return {};
}

Status RunSampling(const SampleOptions& options) {
  if (options.interpolate > 0 && options.count < 2)
    return InvalidArgument("--interpolate needs two samples or more: --count 2");
  if (!options.score && !(options.data.empty() && options.judge.empty()))
    return InvalidArgument("--data and --judge need --score");
  TILEGRAD_ASSIGN(const Path run, ChooseRun(options.run, train::kGeneratorWeights));
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
  // First: it may be refused.
  train::GanScores scores;
  if (options.score) {
    TILEGRAD_ASSIGN(scores, Score(options, run, *model));
  }
  if (options.force) TILEGRAD_TRY(RemoveEarlier(options));
  nlohmann::ordered_json json = {{"seed", options.seed},
                                 {"textured", model->has_textures()},
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
  if (options.score) TILEGRAD_TRY(WriteScores(scores, files, &json));
  PrintResult(json);
  return {};
}

}  // namespace

void AddSample(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "sample", "Generate textured 3D objects with a trained generator", RunSampling);
  command->Add("--run", &options->run,
               fmt::format("{} [the newest run below runs/, else {} if installed]", kRunOrWeights,
                           train::kGeneratorWeights));
  command->Add("--count", &options->count, "objects", {Range{1, kMostSamples}});
  command->Add("--out", &options->out,
               "folder for sample_001.glb and so on, sheet.png (each from the front and from "
               "behind) and turntable.webp");
  command->Add("--seed", &options->seed,
               "seed of the latent codes; the same seed gives the same objects, bit for bit",
               {NotNegative()});
  command->Add("--interpolate", &options->interpolate,
               "interpolation steps from each object to the next, for interpolation.png (a row for "
               "each pair) and interpolation.webp; 0: none",
               {Range{0, 64}});
  command->Add("--score", &options->score,
               "compare a further set of generated objects with real ones: scores.md, scores.json, "
               "and nearest.png with the nearest training objects");
  command->Add("--data", &options->data, "with --score: dataset [the run's own]");
  command->Add("--judge", &options->judge,
               "with --score: run of configs/classify.toml whose features compare the images "
               "[cells of the images]");
  command->Add("--score-count", &options->score_count, "with --score: objects per set",
               {Range{16, 100000}});
  AddForceOption(command, &options->force);
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
