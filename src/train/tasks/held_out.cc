// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/held_out.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "base/try_all.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "train/data/trained_models.h"
#include "train/predictor.h"

namespace tilegrad::train {
namespace {

std::string SourceName(const std::string& source) {
  static const std::map<std::string, std::string> names = {
      {"sweethome3d", "of the Sweet Home 3D furniture library"},
      {"shapenet", "of ShapeNet"},
      {"nmr", "of ShapeNet, as rendered for N3MR"},
      {"choy", "of ShapeNet, as rendered for 3D-R2N2"},
      {"dvr", "of ShapeNet, as rendered for N3MR"},
      {"dibr", "of ShapeNet, as rendered for DIB-R"},
      {"planes", "of FlightGear's aircraft"},
      {"ships", "of FlightGear's ships"},
      {"cars", "of the games TORCS, Trigger Rally and UFO: Alien Invasion"},
      {"thirteen", "of Sweet Home 3D, FlightGear and three games"},
      {"folder", "of a local folder"},
      {"procedural", "made by the built-in generator"}};
  const auto at = names.find(source);
  return at == names.end() ? "of " + source : at->second;
}

// How far the camera of a shown view has gone around from the first: "+90°".
std::string TurnTo(const DatasetInfo& info, int view) {
  if (info.own_cameras) return "another side";
  const int steps = (view - ShownViews(info.views)[0] + info.views) % info.views;
  return fmt::format("+{}°", std::lround(std::abs(info.camera.azimuth_step) * steps) % 360);
}

// The captions of a truth and of the prediction beside it.
std::pair<ShownPicture, ShownPicture> Captions(const std::string& name, const std::string& turn,
                                               bool input) {
  const std::string view = input ? "" : fmt::format(", camera at {}", turn);
  return {{{},
           input ? "input" : fmt::format("truth, {}", turn),
           name + (input ? ": the image that the network sees" : ": truth") + view},
          {{}, "predicted", name + ": predicted" + view}};
}

class ShowcaseBuilder {
 public:
  ShowcaseBuilder(const Dataset& dataset, const Predictor& predictor, const Workers& workers)
      : dataset_(dataset), info_(dataset.info()), predictor_(predictor), workers_(workers) {}

  Result<Example> Show(int model) const {
    Example out = NamedExample(dataset_, model);
    TILEGRAD_ASSIGN(ModelData data, dataset_.Load(model));
    out.truth = std::move(data.mesh);
    const std::vector<int> views = ShownViews(info_.views);
    TILEGRAD_ASSIGN(auto meshes, predictor_.Predict(ViewOf(info_, data.images, views[0])));
    out.prediction = std::move(meshes[0]);
    const std::vector<Camera> all = CamerasOf(info_, data.cameras);
    std::vector<Camera> cameras;
    for (const int view : views) cameras.push_back(all[static_cast<std::size_t>(view)]);
    out.cameras = cameras;
    TILEGRAD_ASSIGN(
        auto predicted,
        DrawMesh(out.prediction, {cameras, info_.image_size, info_.image_size}, workers_));
    for (std::size_t v = 0; v < views.size(); ++v) {
      auto [left, right] = Captions(out.name, TurnTo(info_, views[v]), v == 0);
      left.image = OnPaper(ViewOf(info_, data.images, views[v]), info_.image_size);
      right.image = std::move(predicted[v]);
      out.pictures.push_back(std::move(left));
      out.pictures.push_back(std::move(right));
    }
    return out;
  }

 private:
  const Dataset& dataset_;
  const DatasetInfo& info_;
  const Predictor& predictor_;
  const Workers& workers_;
};

// N images to N meshes, each changed as the job requests.
Result<std::vector<Mesh>> PredictAndChange(const TaskEvaluation& job,
                                           std::span<const std::uint8_t> images,
                                           const Workers& workers) {
  TILEGRAD_ASSIGN(std::vector<Mesh> meshes, job.predictor.Predict(images));
  if (!job.change) return meshes;
  const std::size_t bytes = images.size() / meshes.size();
  const auto change = [&](std::size_t i, std::size_t) -> Status {
    TILEGRAD_ASSIGN(meshes[i], job.change(meshes[i], images.subspan(i * bytes, bytes)));
    return {};
  };
  TILEGRAD_TRY(TryAll(workers, meshes.size(), change));
  return meshes;
}

constexpr int kCellSize = 192;  // pixels a side, or the largest multiple of a picture's below

// Index of the second view's truth in Example::pictures, which has truth and prediction of each
// view.
constexpr std::size_t kTurnedTruth = 2;

Status AddRow(const Example& example, const UnlitPictures& request, const Workers& workers,
              std::vector<ImageU8>* cells) {
  const int zoom = request.size / request.camera_size;
  TILEGRAD_ASSIGN(auto predicted, DrawMesh(example.prediction, request, workers));
  cells->push_back(Enlarged(example.pictures[0].image, zoom));
  for (ImageU8& picture : predicted) cells->push_back(std::move(picture));
  if (predicted.size() > 1) cells->push_back(Enlarged(example.pictures[kTurnedTruth].image, zoom));
  return {};
}

// Fills sheet and sheet_columns from examples that show, as ShowHeldOut makes them, ShownViews of
// the dataset, each as truth and prediction. One row per example: what the network sees, its
// prediction from there, its prediction from the second view, and the truth from there. Predictions
// are drawn in detail, the dataset's pictures pixel by pixel. Does nothing without examples.
Status AddSheet(int image_size, const Workers& workers, Showcase* showcase) {
  if (showcase->examples.empty()) return {};
  const std::size_t views = std::min<std::size_t>(2, showcase->examples[0].cameras.size());
  const int size = image_size * std::max(1, kCellSize / image_size);
  std::vector<ImageU8> cells;
  for (const Example& example : showcase->examples) {
    const auto cameras = std::span(example.cameras).first(views);
    TILEGRAD_TRY(AddRow(example, {cameras, image_size, size}, workers, &cells));
  }
  const bool turned = views > 1;
  showcase->sheet = TileImages(cells, turned ? 4 : 2);
  showcase->sheet_columns =
      turned ? "input, prediction, prediction from another side, truth from there"
             : "input, prediction";
  return {};
}

}  // namespace

Result<Dataset> OpenHeldOut(const TaskEvaluation& job) {
  TILEGRAD_ASSIGN(Dataset dataset, Dataset::Open(job.data));
  if (job.split != Split::kTrain) TILEGRAD_TRY(CheckHeldOut(job.run, dataset, job.split));
  TILEGRAD_TRY(job.predictor.CheckImageSize(dataset));
  return dataset;
}

Result<Dataset> OpenHeldOut(const ShowcaseRequest& request) {
  return OpenHeldOut(TaskEvaluation{request.run, request.data, request.predictor});
}

Showcase AboutDataset(const Dataset& dataset, const RunHeader& header) {
  const DatasetInfo& info = dataset.info();
  Showcase out;
  const std::size_t classes = info.classes.size();
  std::vector<ModelInfo> models;
  for (const int m : dataset.Select(Split::kTrain)) models.push_back(dataset.model(m));
  const std::size_t shapes = CountShapes(models);
  out.data = fmt::format("It learned from {}{} in {} {}.", Count(header.training_models, "model"),
                         shapes < models.size() ? " of " + Count(shapes, "shape") : "",
                         Count(classes, "class"), SourceName(header.dataset_source));
  out.credits = info.credits;
  out.fov_y = info.camera.lens.fov_y;
  out.azimuth = info.camera.azimuth_step * ShownViews(info.views)[0];
  out.elevation = info.camera.elevation;
  out.distance = info.camera.distance;
  return out;
}

Example NamedExample(const Dataset& dataset, int index) {
  const ModelInfo& model = dataset.model(index);
  Example out;
  out.name = model.name.empty() ? model.id : model.name;
  out.class_name = dataset.ClassOf(model);
  out.id = model.id;
  out.creator = model.creator;
  out.license = model.license;
  return out;
}

std::vector<int> ChooseModels(const Dataset& dataset, int count) {
  std::vector<std::vector<int>> rounds;  // rounds[r]: the r-th test model of each class that has it
  std::vector<std::size_t> seen(dataset.info().classes.size(), 0);
  for (const int model : dataset.Select(Split::kTest)) {
    const ModelInfo& info = dataset.model(model);
    const std::size_t round = seen[static_cast<std::size_t>(info.class_index)]++;
    if (round == rounds.size()) rounds.emplace_back();
    rounds[round].push_back(model);
  }
  std::vector<int> out;
  for (const auto& round : rounds) {
    const std::size_t left = static_cast<std::size_t>(count) - out.size();
    const std::size_t taken = std::min(left, round.size());
    for (std::size_t i = 0; i < taken; ++i) out.push_back(round[i * round.size() / taken]);
  }
  std::stable_sort(out.begin(), out.end(), [&](int a, int b) {
    return dataset.model(a).class_index < dataset.model(b).class_index;
  });
  return out;
}

std::vector<int> ShownViews(int views) {
  std::vector<int> out;
  const int count = std::min(kShownViews, views);
  for (int k = 0; k < count; ++k) out.push_back((5 * views / 6 + k * views / count) % views);
  return out;
}

Result<Showcase> ShowHeldOut(const ShowcaseRequest& request, const Workers& workers,
                             const Watch& watch) {
  TILEGRAD_ASSIGN(const Dataset dataset, OpenHeldOut(request));
  Showcase out = AboutDataset(dataset, request.header);
  out.note =
      "From the first picture alone the network predicted one mesh, here from three sides beside "
      "the truth. The models are spread over the classes in the dataset's order, not picked by "
      "hand.";
  const ShowcaseBuilder builder(dataset, request.predictor, workers);
  const std::vector<int> chosen = ChooseModels(dataset, request.examples);
  for (const int model : chosen) {
    TILEGRAD_TRY(watch.At({"predicting", out.examples.size(), chosen.size(), ""}, kNothingWritten));
    TILEGRAD_ASSIGN(Example example, builder.Show(model));
    out.examples.push_back(std::move(example));
  }
  TILEGRAD_TRY(AddSheet(dataset.info().image_size, workers, &out));
  return out;
}

Result<Evaluation> EvaluateOnDataset(const TaskEvaluation& job, const Workers& workers,
                                     const Watch& watch, const MakeFitFunction& fit) {
  if (job.oracle_steps > 0 && !fit)
    return InvalidArgument("--oracle fits meshes; this task predicts none");
  TILEGRAD_ASSIGN(const Dataset dataset, OpenHeldOut(job));
  EvaluationJob evaluation;
  evaluation.dataset = &dataset;
  evaluation.split = job.split;
  evaluation.predict = [&](auto images) { return PredictAndChange(job, images, workers); };
  if (job.oracle_steps > 0) evaluation.oracle = fit(dataset.info(), job.oracle_steps, workers);
  evaluation.template_mesh = job.predictor.template_mesh();
  evaluation.views_per_model = job.views_per_model;
  evaluation.predictor = job.predictor.description();
  evaluation.group = job.group;
  evaluation.voxels = {job.voxels.value_or(OwnVoxelRule(dataset.info().source)),
                       job.predictor.half_extent()};
  return train::Evaluate(evaluation, workers, watch);
}

}  // namespace tilegrad::train
