// SPDX-License-Identifier: Apache-2.0
// tilegrad predict: a coloured mesh and pictures of it all around from each image.
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/match_file.h"
#include "cli/predict_light.h"
#include "cli/predict_pictures.h"
#include "cli/run_folder.h"
#include "cli/unique_names.h"
#include "fit/input.h"
#include "fit/refine.h"
#include "io/glb_writer.h"
#include "io/image_file.h"
#include "train/data/cutout.h"
#include "train/data/dataset.h"
#include "train/eval/training_pictures.h"
#include "train/predictor.h"

namespace tilegrad::cli {
namespace {

struct PredictOptions {
  std::string run, out = ".", mask;
  std::vector<std::string> images;
  bool keep_framing = false, force = false, relight = false;
  int refine = train::kRefineSteps;
  int workers = 0;
};

struct TrainedNetwork {
  train::Predictor predictor;
  std::optional<train::TrainingPictures> pictures;  // none: of an earlier version
};

// A run predicts without its pictures, too.
Result<TrainedNetwork> LoadNetwork(const Path& run, const Workers& workers) {
  TILEGRAD_ASSIGN(train::Predictor predictor, LoadPredictor(run, workers));
  auto pictures = train::TrainingPictures::Read(run);
  if (!pictures.ok())
    PrintNote("tilegrad: warning: passed over: {}\n", pictures.status().message());
  return TrainedNetwork{std::move(predictor), pictures.ok() ? std::move(*pictures) : std::nullopt};
}

train::Framing FramingOf(const PredictOptions& options) {
  return options.keep_framing ? train::Framing::kKeep : train::Framing::kFit;
}

Result<ImageU8> LoadCutout(const PredictOptions& options, const std::string& file) {
  TILEGRAD_ASSIGN(ImageU8 image, io::LoadImage(file));
  if (options.mask.empty()) return image;
  TILEGRAD_ASSIGN(const ImageU8 mask, io::LoadImage(options.mask));
  auto masked = train::WithMask(image, mask);
  return masked.ok() ? std::move(masked) : masked.status().Within(file);
}

// Image files and what their results are called: by the file, each name once.
std::vector<std::pair<std::string, std::string>> NameResults(
    const std::vector<std::string>& images) {
  std::vector<std::pair<std::string, std::string>> named;
  UniqueNames names;
  for (const std::string& file : images)
    named.emplace_back(file, names.Take(Path(file).stem().string()));
  return named;
}

Path RecordOf(Path match) { return match.replace_extension(".json"); }

Status Refine(const PredictOptions& options, const ImageU8& cutout, const Path& file, Mesh* mesh,
              const Workers& workers) {
  TILEGRAD_ASSIGN(const auto planar,
                  train::PrepareCutout(cutout, train::kRefineSize, FramingOf(options)));
  TILEGRAD_ASSIGN(train::RefinedMesh refined,
                  train::RefineMesh(*mesh, train::TargetsOfPlanar(planar, train::kRefineSize),
                                    {.steps = options.refine}, workers));
  TILEGRAD_TRY(DrawMatch(planar, *mesh, refined, file, workers));
  TILEGRAD_TRY(WriteMatch(refined, RecordOf(file)));
  Print("{}: silhouette {:.0f} -> {:.0f} %, colour off by {:.3f} -> {:.3f}\n", file.string(),
        100 * refined.before.silhouette_iou, 100 * refined.after.silhouette_iou,
        refined.before.color_l1, refined.after.color_l1);
  *mesh = std::move(refined.mesh);
  return {};
}

// Says so if the picture is like none that the network has learned from.
Status WarnOfUnlike(const train::TrainingPictures& trained, const ImageU8& cutout,
                    const std::string& file) {
  TILEGRAD_ASSIGN(const auto match, trained.Nearest(cutout));
  if (!match || !trained.IsUnlike(*match)) return {};
  PrintNote(
      "tilegrad: warning: {} is unlike the {} training pictures: nearest is {} ({}) at {:.2f}, "
      "where {:.0f} % of them have another shape within {:.2f}; expect little\n",
      file, fmt::group_digits(trained.count()), match->name, match->class_name, match->distance,
      100 * train::kUsualShare, *trained.usual());
  return {};
}

// With the light, where the network says one.
Status SaveResult(const train::Predictor& predictor, std::span<const std::uint8_t> picture,
                  const Path& glb, Mesh* mesh) {
  TILEGRAD_ASSIGN(const auto lit, PredictLit(predictor, picture));
  if (!lit) return io::SaveGlb(glb, *mesh);
  for (Material& material : mesh->materials) material.unlit = false;
  const auto& model = dynamic_cast<train::TexturedModel&>(predictor.model());
  return io::SaveLitGlb(glb, *mesh, SunOf(*lit, model.config().light));
}

Status Relight(const train::Predictor& predictor, std::span<const std::uint8_t> picture,
               const Mesh& mesh, const Path& file) {
  TILEGRAD_ASSIGN(const auto lit, PredictLit(predictor, picture));
  if (!lit) {
    return InvalidArgument(
        "--relight: this run predicts no light and camera; train configs/texture_quick.toml");
  }
  const auto& model = dynamic_cast<train::TexturedModel&>(predictor.model());
  return AnimateRelighting(mesh, {*lit, model.config().light, predictor.image_size()}, file);
}

Status PredictOne(const TrainedNetwork& network, const PredictOptions& options,
                  const std::pair<std::string, std::string>& image, const OutputGuard& guard,
                  const Workers& workers, nlohmann::ordered_json* json) {
  const auto& [file, stem] = image;
  const Path out(options.out);
  const Path glb = out / (stem + "_predicted.glb"), turntable = out / (stem + "_turntable.png"),
             animation = out / (stem + "_turntable.webp"), match = out / (stem + "_match.png"),
             relit = out / (stem + "_relit.webp");
  std::vector<Path> written = {glb, turntable, animation};
  if (options.relight) written.push_back(relit);
  if (options.refine > 0) written.insert(written.end(), {match, RecordOf(match)});
  TILEGRAD_TRY(guard.CheckAll(written));
  TILEGRAD_ASSIGN(const ImageU8 cutout, LoadCutout(options, file));
  const train::Predictor& predictor = network.predictor;
  const auto input = train::PrepareCutout(cutout, predictor.image_size(), FramingOf(options));
  if (!input.ok()) return input.status().Within(file);
  if (network.pictures) TILEGRAD_TRY(WarnOfUnlike(*network.pictures, cutout, file));
  TILEGRAD_ASSIGN(auto meshes, predictor.Predict(*input));
  if (options.refine > 0) {
    TILEGRAD_TRY(predictor.model().CheckRefinable());
    const Status refined = Refine(options, cutout, match, &meshes[0], workers);
    if (!refined.ok()) return refined.Within(file);
  }
  TILEGRAD_TRY(SaveResult(predictor, *input, glb, &meshes[0]));
  if (options.relight) {
    const Status status = Relight(predictor, *input, meshes[0], relit);
    if (!status.ok()) return status.Within(file);
  }
  TILEGRAD_TRY(DrawTurntable(meshes[0], turntable, workers));
  TILEGRAD_TRY(AnimateTurntable(meshes[0], animation, workers));
  Print("{} -> {}, {}, {}{}\n", file, glb.string(), turntable.string(), animation.string(),
        options.relight ? ", " + relit.string() : "");
  json->push_back({{"image", file},
                   {"mesh", glb.string()},
                   {"turntable", turntable.string()},
                   {"animation", animation.string()}});
  if (options.relight) json->back()["relit"] = relit.string();
  return {};
}

Status RunPrediction(const PredictOptions& options) {
  if (!options.mask.empty() && options.images.size() > 1)
    return InvalidArgument("--mask belongs to one image, got {}", options.images.size());
  TILEGRAD_ASSIGN(const Path run, ChooseRun(options.run));
  const Workers workers(options.workers);
  TILEGRAD_ASSIGN(const TrainedNetwork network, LoadNetwork(run, workers));
  // One bad image does not keep the others from being predicted; the first error is the result.
  Status first;
  OutputGuard guard(options.force);
  for (const std::string& image : options.images) guard.AddInput(image);
  guard.AddInput(options.mask);
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const auto& image : NameResults(options.images)) {
    const Status status = PredictOne(network, options, image, guard, workers, &json);
    if (status.ok()) continue;
    if (!first.ok()) PrintNote("tilegrad: {}\n", status.message());
    if (first.ok()) first = status;
  }
  PrintResult(json);
  return first;
}

}  // namespace

void AddPredict(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "predict", "Predict a coloured 3D mesh from one image of an object that is cut out",
      RunPrediction);
  command->Add("images", &options->images, "RGBA cut-outs (PNG), or an RGB image with --mask",
               {Required{}});
  command->Add("--run", &options->run, "run folder or one checkpoint [the newest below runs/]");
  command->Add("--out", &options->out,
               "folder for NAME_predicted.glb, NAME_turntable.png and NAME_turntable.webp (an "
               "animation), named after the image; NAME_2 for a second image of that name");
  AddForceOption(command, &options->force);
  command->Add("--mask", &options->mask,
               "image of the same size: the object is white or, in one with transparency, opaque");
  command->Add("--keep-framing", &options->keep_framing,
               "only resize: the image is framed like a training image already");
  command->Add("--refine", &options->refine,
               "steps of gradient descent that move the prediction onto the image, and write "
               "NAME_match.png (image, prediction, refined) and NAME_match.json (how well they "
               "agree); 0: the network alone",
               {Range{0, 100000}});
  command->Add("--relight", &options->relight,
               "also NAME_relit.webp: the object under a light that moves around; of a run that "
               "predicts light");
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
