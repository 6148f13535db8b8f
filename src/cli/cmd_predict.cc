// SPDX-License-Identifier: Apache-2.0
// tilegrad predict: a coloured mesh and pictures of it all around from each image.
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <span>

#include "base/error.h"
#include "base/file.h"
#include "base/json_text.h"
#include "base/output_guard.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "fit/background.h"
#include "fit/input.h"
#include "fit/refine.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/webp_animation.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "scene/camera_conventions.h"
#include "scene/light_frame.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"
#include "train/data/cutout.h"
#include "train/data/dataset.h"
#include "train/eval/baselines.h"
#include "train/eval/training_pictures.h"
#include "train/named_weights.h"
#include "train/predictor.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/object_pictures.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::cli {
namespace {

// How predict uses the light of a network of textures and light.

// `mesh` from where its picture was taken, once around under a light as far from the camera's axis
// as the predicted one, from where that is: an animated WebP that loops.
struct Relighting {
  const train::PredictedObject& object;
  const train::LightConfig& light;
  int size;  // pixels a side of the network's pictures
  const Watch& watch;
};

constexpr int kLightFrames = 36, kLightFrameMilliseconds = 100, kLightQuality = 85, kLightZoom = 4,
              kLightSamples = 2;
constexpr double kLeastTilt = 20 * std::numbers::pi / 180;  // less would not be seen to move

// The light turned about the camera's axis.
std::array<float, 3> Turned(const std::array<float, 3>& d, double angle) {
  const double start = std::atan2(d[1], d[0]);
  const double tilt = std::max(kLeastTilt, std::acos(std::clamp(double{d[2]}, -1.0, 1.0)));
  return {static_cast<float>(std::sin(tilt) * std::cos(start + angle)),
          static_cast<float>(std::sin(tilt) * std::sin(start + angle)),
          static_cast<float>(std::cos(tilt))};
}

// Whether its network predicts a light.
bool PredictsLight(const train::Predictor& predictor) {
  const auto* const model = predictor.model().textured();
  return model != nullptr && train::LightingOf(model->config().light) != Lighting::kNone;
}

// Of one picture, [4][size][size] planar bytes; nothing if the network predicts no light, or no
// camera that it is in the axes of.
Result<std::optional<train::PredictedObject>> PredictLit(const train::Predictor& predictor,
                                                         std::span<const std::uint8_t> picture) {
  if (!PredictsLight(predictor)) return std::optional<train::PredictedObject>();
  TILEGRAD_ASSIGN(auto objects, predictor.model().textured()->PredictObjects(picture));
  if (!objects[0].camera) return std::optional<train::PredictedObject>();
  return std::optional(std::move(objects[0]));
}

// Unit, in the mesh's axes, towards the light.
glm::dvec3 SunOf(const train::PredictedObject& object, const train::LightConfig& light) {
  const auto d =
      DirectionToWorld(train::DirectionOf(object.light, train::LightingOf(light)), *object.camera);
  return {d[0], d[1], d[2]};
}

Status AnimateRelighting(const Mesh& mesh, const Relighting& job, const Path& file) {
  // Harmonics are shown as a direction: turning nine coefficients would turn the sky, too.
  train::LightConfig light = job.light;
  if (train::LightingOf(light) == Lighting::kSphericalHarmonics) light.model = "lambert";
  const int size = kLightZoom * job.size;
  train::ObjectPictures pictures(light, size, kLightSamples);
  train::TexturedView view{ScaledCamera(*job.object.camera, kLightZoom), job.object.light};
  const auto predicted = train::DirectionOf(job.object.light, train::LightingOf(job.light));
  std::vector<ImageU8> frames;
  for (int k = 0; k < kLightFrames; ++k) {
    TILEGRAD_TRY(job.watch.At(
        {"rendering the moving light", static_cast<std::uint64_t>(k), kLightFrames, ""}));
    view.light.direction = Turned(predicted, 2 * std::numbers::pi * k / kLightFrames);
    TILEGRAD_ASSIGN(const auto rgba, pictures.Draw(mesh, view, train::Appearance::kLit));
    frames.push_back(OnPaper(rgba, size));
  }
  return io::SaveWebpAnimation(
      file, frames,
      {.frame_ms = kLightFrameMilliseconds, .quality = kLightQuality, .watch = job.watch});
}

constexpr int kTurntableViews = 8, kTurntableColumns = 4, kTurntableFrames = 36,
              kTurntableSize = 256;
constexpr int kTurntableFrameMilliseconds = 100, kTurntableQuality = 85;

Result<std::vector<ImageU8>> DrawAround(const Mesh& mesh, int views, const Workers& workers) {
  const train::CameraRule rule;
  std::vector<Camera> cameras;
  for (int i = 0; i < views; ++i)
    cameras.push_back(OrbitCamera(rule.lens, -360.0 * i / views, rule.elevation, rule.distance));
  return DrawMesh(mesh, {cameras, rule.lens.width, kTurntableSize}, workers);
}

// Eight views around the mesh in one PNG, from where cameras of datasets stand.
Status DrawTurntable(const Mesh& mesh, const Path& file, const Workers& workers) {
  TILEGRAD_ASSIGN(const auto views, DrawAround(mesh, kTurntableViews, workers));
  return io::SavePng(file, TileImages(views, kTurntableColumns));
}

// The mesh turning once around in 36 frames, as an animated WebP that loops.
Status AnimateTurntable(const Mesh& mesh, const Path& file, const Workers& workers,
                        const Watch& watch) {
  TILEGRAD_ASSIGN(const auto frames, DrawAround(mesh, kTurntableFrames, workers));
  return io::SaveWebpAnimation(
      file, frames,
      {.frame_ms = kTurntableFrameMilliseconds, .quality = kTurntableQuality, .watch = watch});
}

// Draws the picture, planar RGBA of kRefineSize, beside the network's mesh and the refined one,
// seen from its camera.
Status DrawMatch(std::span<const std::uint8_t> picture, const Mesh& prediction,
                 const train::RefinedMesh& refined, const Path& file, const Workers& workers) {
  constexpr int size = train::kRefineSize;
  std::vector<ImageU8> cells = {Enlarged(OnPaper(picture, size), kTurntableSize / size)};
  for (const auto& [mesh, camera] : {std::pair(&prediction, &refined.camera_before),
                                     std::pair(&refined.mesh, &refined.camera)}) {
    TILEGRAD_ASSIGN(auto views, DrawMesh(*mesh, {{camera, 1}, size, kTurntableSize}, workers));
    cells.push_back(std::move(views[0]));
  }
  return io::SavePng(file, TileImages(cells, static_cast<int>(cells.size())));
}

nlohmann::ordered_json CameraRecord(const Camera& camera) {
  return {{"size", train::kRefineSize},
          {"rotation", camera.rotation},
          {"translation", camera.translation},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy}};
}

// {"silhouette_iou": [before, after], "color_l1": [before, after], "camera_doubtful": false}:
// PictureMatch of the prediction and of the refined mesh, and whether RefinedMesh::rival is near.
nlohmann::ordered_json ScoresOf(const train::RefinedMesh& refined) {
  const train::PictureMatch &before = refined.before, &after = refined.after;
  return {{"silhouette_iou", {before.silhouette_iou, after.silhouette_iou}},
          {"color_l1", {before.color_l1, after.color_l1}},
          {"camera_doubtful", refined.rival < train::kDoubtfulRival}};
}

// The same and "camera", which sees the refined mesh, in pixels of a picture of "size" pixels a
// side.
Status WriteMatch(const train::RefinedMesh& refined, const Path& file) {
  nlohmann::ordered_json record = ScoresOf(refined);
  record["camera"] = CameraRecord(refined.camera);
  return WriteTextAtomic(file, DumpJson(record, 1) + "\n");
}

constexpr int kAsNetworkAllows = -1;  // of PredictOptions::refine: kRefineSteps, or 0

struct PredictOptions {
  std::string run, out = ".", mask;
  std::vector<std::string> images;
  bool keep_framing = false, force = false, relight = false;
  int refine = kAsNetworkAllows;
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
  if (!pictures.ok()) PrintNote("tilegrad: warning: skipped: {}\n", pictures.status().message());
  return TrainedNetwork{std::move(predictor), pictures.ok() ? std::move(*pictures) : std::nullopt};
}

train::Framing FramingOf(const PredictOptions& options) {
  return options.keep_framing ? train::Framing::kKeep : train::Framing::kFit;
}

// A picture without transparency may stand before a plain background, as those of fits.
Result<ImageU8> LoadCutout(const PredictOptions& options, const std::string& file,
                           const Watch& watch) {
  TILEGRAD_ASSIGN(ImageU8 image, io::LoadImage(file));
  if (options.mask.empty() && !train::IsOpaque(image)) return image;
  if (options.mask.empty()) {
    TILEGRAD_TRY(watch.At({"segmenting the plain background", 0, 0, ""}));
    auto cutout = train::WithoutPlainBackground(image);
    return cutout.ok() ? std::move(cutout) : cutout.status().Within(file);
  }
  TILEGRAD_ASSIGN(const ImageU8 mask, io::LoadImage(options.mask));
  auto masked = train::WithMask(image, mask);
  return masked.ok() ? std::move(masked) : masked.status().Within(file);
}

// Ends of the results' names, after the image's.
constexpr std::string_view kPredicted = "_predicted.glb";
constexpr std::string_view kTurntable = "_turntable", kMatch = "_match", kRelit = "_relit";

Path ResultPath(const Path& folder, const std::string& image, std::string_view end,
                std::string_view ending = "") {
  return folder / fmt::format("{}{}{}", image, end, ending);
}

// Whether `predict` itself wrote the picture: results may lie beside the images.
bool IsResult(const Path& picture) {
  const std::string stem = picture.stem().string();
  for (const std::string_view end : {kTurntable, kMatch, kRelit}) {
    if (!stem.ends_with(end)) continue;
    const std::string image = stem.substr(0, stem.size() - end.size());
    if (PathExists(ResultPath(picture.parent_path(), image, kPredicted))) return true;
  }
  return false;
}

// The files, and of folders their pictures.
Result<std::vector<std::string>> PicturesOf(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) {
      files.push_back(path);
      continue;
    }
    const io::PictureNames names = io::PicturesIn(path);
    const std::string others = names.DescribeOthers();
    if (names.read.empty())
      return InvalidArgument("{}: holds no picture{}", path, others.empty() ? "" : "; " + others);
    if (!others.empty()) PrintNote("tilegrad: warning: {}: skipped {}\n", path, others);
    for (const Path& name : names.read) {
      if (!IsResult(Path(path) / name)) files.push_back((Path(path) / name).string());
    }
  }
  return files;
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

// What is the same for all images.
struct Prediction {
  const PredictOptions& options;
  const TrainedNetwork& network;
  const OutputGuard& guard;
  const Workers& workers;
  Watch watch;
};

Status Refine(const Prediction& p, const std::string& image, const ImageU8& cutout,
              const Path& file, Mesh* mesh, nlohmann::ordered_json* json) {
  TILEGRAD_ASSIGN(const auto planar,
                  train::PrepareCutout(cutout, train::kRefineSize, FramingOf(p.options)));
  TILEGRAD_ASSIGN(train::RefinedMesh refined,
                  train::RefineMesh(*mesh, train::TargetsOfPlanar(planar, train::kRefineSize),
                                    {.steps = p.options.refine, .watch = p.watch}, p.workers));
  TILEGRAD_TRY(DrawMatch(planar, *mesh, refined, file, p.workers));
  TILEGRAD_TRY(WriteMatch(refined, RecordOf(file)));
  const train::PictureMatch &before = refined.before, &after = refined.after;
  Print("{}: silhouette {:.0f} -> {:.0f} %, colour error {:.3f} -> {:.3f}\n", file.string(),
        100 * before.silhouette_iou, 100 * after.silhouette_iou, before.color_l1, after.color_l1);
  if (refined.rival < train::kDoubtfulRival) {
    PrintNote(
        "tilegrad: warning: {}: the camera is ambiguous, another side fits almost as well; check "
        "{}\n",
        image, file.string());
  }
  json->update(ScoresOf(refined));
  *mesh = std::move(refined.mesh);
  return {};
}

// Says so if the picture is like none that the network has learned from.
Status WarnOfUnlike(const train::TrainingPictures& trained, const ImageU8& cutout,
                    const std::string& file) {
  TILEGRAD_ASSIGN(const auto match, trained.Nearest(cutout));
  if (!match || !trained.IsUnlike(*match)) return {};
  PrintNote(
      "tilegrad: warning: {}: unlike the {} training images; expect a poor mesh (nearest: {} "
      "({}), at {:.2f}; usual: {:.2f})\n",
      file, fmt::group_digits(trained.count()), match->name, match->class_name, match->distance,
      *trained.usual());
  return {};
}

// With the light, if the network predicts one.
Status SaveResult(const train::Predictor& predictor, std::span<const std::uint8_t> picture,
                  const Path& glb, Mesh* mesh) {
  TILEGRAD_ASSIGN(const auto lit, PredictLit(predictor, picture));
  if (!lit) return io::SaveGlb(glb, *mesh);
  for (Material& material : mesh->materials) material.unlit = false;
  const auto& model = *predictor.model().textured();
  return io::SaveGlb(glb, *mesh, {.sun = SunOf(*lit, model.config().light)});
}

// Before anything is predicted.
Status CheckRelight(bool asked, const train::Predictor& predictor) {
  if (!asked || PredictsLight(predictor)) return {};
  return InvalidArgument(
      "--relight: this network predicts no light; train one with --config texture_quick");
}

Status Relight(const Prediction& p, std::span<const std::uint8_t> picture, const Mesh& mesh,
               const Path& file) {
  const train::Predictor& predictor = p.network.predictor;
  TILEGRAD_ASSIGN(const auto lit, PredictLit(predictor, picture));
  if (!lit) return InvalidArgument("--relight: this network predicts no camera");
  const auto& model = *predictor.model().textured();
  return AnimateRelighting(mesh, {*lit, model.config().light, predictor.image_size(), p.watch},
                           file);
}

// Where the results of an image go.
struct ResultFiles {
  ResultFiles(const PredictOptions& options, const std::string& stem)
      : glb(ResultPath(options.out, stem, kPredicted)),
        turntable(ResultPath(options.out, stem, kTurntable, ".png")),
        animation(ResultPath(options.out, stem, kTurntable, ".webp")),
        match(ResultPath(options.out, stem, kMatch, ".png")),
        relit(ResultPath(options.out, stem, kRelit, ".webp")),
        all({glb, turntable, animation}) {
    if (options.relight) all.push_back(relit);
    if (options.refine > 0) all.insert(all.end(), {match, RecordOf(match)});
  }
  Path glb, turntable, animation, match, relit;
  std::vector<Path> all;
};

Status Draw(const Prediction& p, const std::string& image, const ResultFiles& files,
            const Mesh& mesh) {
  TILEGRAD_TRY(p.watch.At({"drawing " + image, 0, 0, ""}));
  TILEGRAD_TRY(DrawTurntable(mesh, files.turntable, p.workers));
  return AnimateTurntable(mesh, files.animation, p.workers, p.watch);
}

Status PredictOne(const Prediction& p, const std::pair<std::string, std::string>& image,
                  nlohmann::ordered_json* all) {
  const auto& [file, stem] = image;
  const ResultFiles files(p.options, stem);
  TILEGRAD_TRY(p.guard.CheckAll(files.all));
  TILEGRAD_ASSIGN(const ImageU8 cutout, LoadCutout(p.options, file, p.watch));
  const train::Predictor& predictor = p.network.predictor;
  const auto input = train::PrepareCutout(cutout, predictor.image_size(), FramingOf(p.options));
  if (!input.ok()) return input.status().Within(file);
  if (p.network.pictures) TILEGRAD_TRY(WarnOfUnlike(*p.network.pictures, cutout, file));
  TILEGRAD_TRY(p.watch.At({"predicting from " + file, 0, 0, ""}));
  TILEGRAD_ASSIGN(auto meshes, predictor.Predict(*input));
  nlohmann::ordered_json json = {{"image", file},
                                 {"mesh", files.glb.string()},
                                 {"turntable", files.turntable.string()},
                                 {"animation", files.animation.string()}};
  if (p.options.refine > 0) {
    TILEGRAD_TRY(predictor.model().CheckRefinable());
    TILEGRAD_TRY(Refine(p, file, cutout, files.match, &meshes[0], &json).Within(file));
  }
  TILEGRAD_TRY(SaveResult(predictor, *input, files.glb, &meshes[0]));
  if (p.options.relight) {
    TILEGRAD_TRY(Relight(p, *input, meshes[0], files.relit).Within(file));
    json["relit"] = files.relit.string();
  }
  TILEGRAD_TRY(Draw(p, file, files, meshes[0]));
  Print("{} -> {}, {}, {}{}\n", file, files.glb.string(), files.turntable.string(),
        files.animation.string(), p.options.relight ? ", " + files.relit.string() : "");
  all->push_back(std::move(json));
  return {};
}

Status RunPrediction(const PredictOptions& given) {
  PredictOptions options = given;
  TILEGRAD_ASSIGN(options.images, PicturesOf(given.images));
  if (!options.mask.empty() && options.images.size() > 1)
    return InvalidArgument("--mask works with one image, got {}", options.images.size());
  TILEGRAD_ASSIGN(const Path run, ChooseRun(options.run, train::kCutoutWeights));
  const Workers workers(options.workers);
  ProgressLine line;
  const Watch watch = line.Watching();
  TILEGRAD_TRY(watch.At({"loading the network", 0, 0, ""}));
  TILEGRAD_ASSIGN(const TrainedNetwork network, LoadNetwork(run, workers));
  TILEGRAD_TRY(CheckRelight(options.relight, network.predictor));
  if (options.refine == kAsNetworkAllows)
    options.refine = network.predictor.model().CheckRefinable().ok() ? train::kRefineSteps : 0;
  OutputGuard guard(options.force);
  for (const std::string& image : options.images) guard.AddInput(image);
  guard.AddInput(options.mask);
  const Prediction prediction{options, network, guard, workers, watch};
  // One bad image does not keep the others from being predicted; the first error is the result.
  Status first;
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const auto& image : NameResults(options.images)) {
    Status status = PredictOne(prediction, image, &json);
    if (status.ok()) continue;
    if (status.code() == StatusCode::kCancelled) return status;
    if (!first.ok()) PrintNote("tilegrad: {}\n", status.message());
    if (first.ok()) first = status;
  }
  line.Finish();
  PrintResult(json);
  return first;
}

}  // namespace

void AddPredict(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "predict", "Predict a coloured 3D mesh from one image of an object", RunPrediction);
  command->Add(
      "images", &options->images,
      "images of an object, or folders of them: cut out (RGBA), on a plain background, or with "
      "--mask",
      {Required{}});
  command->Add("--run", &options->run,
               fmt::format("{} [the newest run below runs/, else {} if installed]", kRunOrWeights,
                           train::kCutoutWeights));
  command->Add("--out", &options->out,
               "folder for NAME_predicted.glb, NAME_turntable.png and NAME_turntable.webp (an "
               "animation), named after the image; NAME_2 for a second image of that name");
  AddForceOption(command, &options->force);
  command->Add("--mask", &options->mask,
               "mask of the same size: the object is white or, if the mask has alpha, opaque");
  command->Add("--keep-framing", &options->keep_framing,
               "only resize: the image is already framed like the training images");
  command->Add("--refine", &options->refine,
               "gradient-descent steps that refine the prediction on the image; writes "
               "NAME_match.png (image, prediction, refined) and NAME_match.json (agreement before "
               "and after); 0: network output only [800; textured networks: 0]",
               {NoDefault{}, Range{0, 100000}});
  command->Add("--relight", &options->relight,
               "also write NAME_relit.webp: the object under a moving light; needs a run that "
               "predicts light");
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
