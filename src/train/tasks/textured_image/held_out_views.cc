// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/held_out_views.h"

#include <array>
#include <cmath>
#include <iterator>

#include "base/error.h"
#include "base/try_all.h"
#include "train/data/dataset_files.h"
#include "train/eval/scores.h"
#include "train/eval/statistics.h"
#include "train/predictor.h"
#include "train/ranks/process_group.h"
#include "train/tasks/held_out.h"
#include "train/tasks/textured_image/light_search.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/object_pictures.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kHeldOutSeed = 0x68656c64;

std::vector<float> Copied(std::span<const float> pictures) {
  return {pictures.begin(), pictures.end()};
}

// The light search's rows: what it is given besides the picture. Truths come first.
struct SearchMethod {
  const char* name;
  bool true_shape, true_texture;
};
constexpr SearchMethod kSearches[] = {{"search, true shape and texture", true, true},
                                      {"search, true shape", true, false},
                                      {"search, true texture", false, true},
                                      {"search", false, false}};

enum LightMethod {
  kWithoutLight,
  kMeanLight,
  kFirstSearch,
  kTexturedOurs = kFirstSearch + static_cast<int>(std::size(kSearches)),
  kLightMethods
};
using MethodScores = std::array<Score, kLightMethods>;

std::vector<Score> ScoresOf(int method, std::span<const MethodScores> all) {
  std::vector<Score> out;
  for (const MethodScores& scores : all) out.push_back(scores[static_cast<std::size_t>(method)]);
  return out;
}

const char* NameOf(int method) {
  if (method == kWithoutLight) return "without light";
  if (method == kMeanLight) return kMeanLightRow;
  return method == kTexturedOurs ? "tilegrad" : kSearches[method - kFirstSearch].name;
}

// Over the colours of two pictures [4][size][size].
double MeanDifference(std::span<const float> a, std::span<const float> b) {
  const std::size_t numbers = a.size() / 4 * 3;
  double sum = 0;
  for (std::size_t i = 0; i < numbers; ++i)
    sum += std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
  return sum / static_cast<double>(numbers);
}

class Judge {
 public:
  Judge(const TexturedImageConfig& config, int size)
      : lighting_(LightingOf(config.light)),
        mean_(MeanLight(config.light)),
        search_(config.light),
        pictures_(config.light, size, static_cast<int>(config.stream.draw.samples)) {}

  struct View {
    const PredictedObject& object;
    const HeldOutViews::Views& truth;
    std::size_t index;
  };
  Result<MethodScores> Compare(const View& at) {
    const auto& [object, truth, v] = at;
    const std::span<const float> input = truth.Of(truth.lit, v);
    TexturedView view = truth.views[v];
    TILEGRAD_ASSIGN(const auto texture, pictures_.Draw(object.mesh, view, Appearance::kTexture));
    MethodScores scores;
    for (Score& score : scores)
      score.texture_l1 = MeanDifference(texture, truth.Of(truth.texture, v));
    scores[kWithoutLight].lit_l1 = MeanDifference(texture, input);
    if (lighting_ != Lighting::kNone) TILEGRAD_TRY(Search(at, texture, &scores));
    const std::pair<LightMethod, const DrawnLight*> lights[] = {{kMeanLight, &mean_},
                                                                {kTexturedOurs, &object.light}};
    for (const auto& [method, light] : lights) {
      view.light = *light;
      TILEGRAD_ASSIGN(const auto lit, pictures_.Draw(object.mesh, view, Appearance::kLit));
      scores[method].lit_l1 = MeanDifference(lit, input);
      if (lighting_ == Lighting::kNone) continue;
      scores[method].light_angle = ErrorOf(DirectionOf(*light, lighting_), at);
    }
    return scores;
  }

 private:
  double ErrorOf(const std::array<float, 3>& direction, const View& at) const {
    return AngleBetween(direction, DirectionOf(at.truth.views[at.index].light, lighting_));
  }

  // An upper bound for the network's light: a search in the same picture, given parts of the true
  // object. `texture`: the predicted one, as it is seen.
  Status Search(const View& at, std::span<const float> texture, MethodScores* scores) {
    const auto& [object, truth, v] = at;
    TILEGRAD_ASSIGN(const auto normals,
                    pictures_.Draw(object.mesh, truth.views[v], Appearance::kNormals));
    const std::span<const float> lit = truth.Of(truth.lit, v);
    const std::size_t rgb = lit.size() / 4 * 3;
    for (std::size_t m = 0; m < std::size(kSearches); ++m) {
      const SearchMethod& method = kSearches[m];
      const auto shape = method.true_shape ? truth.Of(truth.normals, v) : std::span(normals);
      const auto paint = method.true_texture ? truth.Of(truth.texture, v) : texture;
      const FoundLight found = search_.Find<float>(
          {paint.first(rgb), shape.first(rgb), lit.first(rgb), lit.subspan(rgb)},
          truth.views[v].camera.rotation);
      Score& score = (*scores)[kFirstSearch + m];
      if (method.true_texture) score.texture_l1 = 0;
      score.light_angle = ErrorOf(Towards(found), at);
    }
    return {};
  }

  // The mean one where the picture shows nothing.
  std::array<float, 3> Towards(const FoundLight& found) const {
    const auto& d = found.direction;
    if (d == std::array<double, 3>{}) return mean_.direction;
    return {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])};
  }

  Lighting lighting_;
  DrawnLight mean_;
  LightSearch search_;
  ObjectPictures pictures_;
};

class TexturedEvaluator {
 public:
  TexturedEvaluator(const TexturedImageConfig& config, const TaskEvaluation& job,
                    const Dataset& dataset, const Workers& workers)
      : config_(config),
        job_(job),
        dataset_(dataset),
        workers_(workers),
        model_(*job.predictor.model().textured()),
        share_(job.group) {
    for (int w = 0; w < workers.count(); ++w)
      judges_.push_back(std::make_unique<Judge>(config, dataset.info().image_size));
  }

  Result<Evaluation> Run(const Watch& watch) {
    const std::vector<int> models = dataset_.Select(job_.split);
    out_.split = SplitName(job_.split);
    if (models.empty())
      return InvalidArgument("{}: its {} split has no models", dataset_.folder().string(),
                             out_.split);
    TILEGRAD_ASSIGN(HeldOutViews views,
                    HeldOutViews::Load({config_, dataset_, models}, workers_, watch));
    scores_.resize(models.size());
    unusable_.resize(models.size());
    for (std::size_t i = 0; i < models.size(); ++i) {
      TILEGRAD_TRY(watch.At({"evaluating", i, models.size(), ""}, kNothingWritten));
      if (share_.Has(i)) TILEGRAD_TRY(Score(views, i));
    }
    TILEGRAD_TRY(share_.Gather(&scores_));
    TILEGRAD_TRY(share_.Gather(&unusable_));
    Fill(models);
    return std::move(out_);
  }

 private:
  Result<std::vector<PredictedObject>> Predict(const std::vector<float>& pictures) {
    const std::vector<std::uint8_t> images = ToBytes(pictures);
    const std::size_t bytes = images.size() / static_cast<std::size_t>(job_.views_per_model);
    std::vector<PredictedObject> objects;
    for (std::size_t at = 0; at < images.size(); at += Model::kImagesAtOnce * bytes) {
      const std::size_t size = std::min(Model::kImagesAtOnce * bytes, images.size() - at);
      TILEGRAD_ASSIGN(auto some, model_.PredictObjects(std::span(images).subspan(at, size)));
      for (PredictedObject& object : some) objects.push_back(std::move(object));
    }
    return objects;
  }

  Status Score(HeldOutViews& held_out, std::size_t i) {
    TILEGRAD_ASSIGN(const HeldOutViews::Views truth, held_out.Draw(i, job_.views_per_model));
    TILEGRAD_ASSIGN(const ModelData data, dataset_.Load(held_out.models()[i]));
    TILEGRAD_ASSIGN(const Shape shape, TruthShape(data));
    TILEGRAD_ASSIGN(const auto objects, Predict(truth.lit));
    std::vector<MethodScores> scores(objects.size());
    std::vector<std::uint8_t> unusable(objects.size());
    const train::Score perfect = train::Compare(shape, shape);
    const auto score = [&](std::size_t v, std::size_t worker) -> Status {
      TILEGRAD_ASSIGN(scores[v], judges_[worker]->Compare({objects[v], truth, v}));
      const auto seed = static_cast<std::uint64_t>(held_out.models()[i]) * 4096 + v;
      const auto predicted = ShapeOf(objects[v].mesh, seed);
      unusable[v] = !predicted.ok();
      AddShape(predicted.ok() ? train::Compare(*predicted, shape) : WorstScore(shape), perfect,
               &scores[v]);
      return {};
    };
    TILEGRAD_TRY(TryAll(workers_, objects.size(), score));
    for (const auto flag : unusable) unusable_[i] += flag;
    for (int m = 0; m < kLightMethods; ++m) scores_[i][m] = MeanScore(ScoresOf(m, scores));
    return {};
  }

  static void AddShape(const train::Score& shape, const train::Score& perfect,
                       MethodScores* scores) {
    for (std::size_t m = 0; m < scores->size(); ++m) {
      const bool search = m >= kFirstSearch && m < kTexturedOurs;
      const bool true_shape = search && kSearches[m - kFirstSearch].true_shape;
      const train::Score& from = true_shape ? perfect : shape;
      train::Score& score = (*scores)[m];
      score.iou = from.iou;
      score.f_score = from.f_score;
      score.carved_iou = from.carved_iou;
    }
  }

  void Fill(const std::vector<int>& models) {
    const ClassMeans means(dataset_, models);
    const bool lit = LightingOf(config_.light) != Lighting::kNone;
    for (int m = lit ? kWithoutLight : kTexturedOurs; m < kLightMethods; ++m)
      out_.rows.push_back(means.Row(NameOf(m), ScoresOf(m, scores_)));
    means.Describe(ScoresOf(kTexturedOurs, scores_), &out_);
    for (const int count : unusable_) out_.unusable_predictions += count;
    out_.predictor = job_.predictor.description();
    out_.views_per_model = job_.views_per_model;
  }

  const TexturedImageConfig& config_;
  const TaskEvaluation& job_;
  const Dataset& dataset_;
  const Workers& workers_;
  TexturedModel& model_;
  std::vector<std::unique_ptr<Judge>> judges_;  // by worker
  const Share share_;                           // of models
  std::vector<MethodScores> scores_;            // by model
  std::vector<int> unusable_;                   // predictions of each
  Evaluation out_;
};

}  // namespace

Result<HeldOutViews> HeldOutViews::Load(const Request& request, const Workers& workers,
                                        const Watch& watch) {
  HeldOutViews out;
  out.models_ = request.models;
  TILEGRAD_ASSIGN(MeshCache meshes,
                  OpenTexturedMeshes(request.dataset, request.models, request.config.stream.meshes,
                                     workers, watch));
  const DatasetInfo& info = request.dataset.info();
  out.stream_.emplace(
      TexturedStream::Job{WithoutChanges(request.config.stream), request.config.light, info.camera,
                          info.image_size, kHeldOutSeed},
      std::move(meshes), workers);
  return out;
}

Result<HeldOutViews::Views> HeldOutViews::Draw(std::size_t i, int count) {
  Views out;
  out.views.resize(static_cast<std::size_t>(count));
  const auto position = static_cast<std::uint64_t>(models_[i]);
  TILEGRAD_TRY(stream_->Render(static_cast<int>(i), position, 0, out.views).status());
  TILEGRAD_TRY(Fill(&out));
  return out;
}

Result<HeldOutViews::Views> HeldOutViews::Show(std::size_t i, std::vector<TexturedView> views) {
  Views out;
  out.views = views;
  const auto position = static_cast<std::uint64_t>(models_[i]);
  TILEGRAD_TRY(stream_->Render(static_cast<int>(i), position, 0, out.views).status());
  out.views = std::move(views);
  TILEGRAD_TRY(stream_->Change(0, out.views));
  TILEGRAD_TRY(Fill(&out));
  return out;
}

// The pictures of the object as it was set up last.
Status HeldOutViews::Fill(Views* out) {
  TILEGRAD_ASSIGN(auto pictures, stream_->Again(0, Appearance::kLit));
  out->lit = Copied(pictures);
  TILEGRAD_ASSIGN(pictures, stream_->Again(0, Appearance::kTexture));
  out->texture = Copied(pictures);
  TILEGRAD_ASSIGN(pictures, stream_->Again(0, Appearance::kLight));
  out->light = Copied(pictures);
  TILEGRAD_ASSIGN(pictures, stream_->Again(0, Appearance::kNormals));
  out->normals = Copied(pictures);
  return {};
}

Result<Evaluation> EvaluateTextured(const TexturedImageConfig& config, const TaskEvaluation& job,
                                    const Workers& workers, const Watch& watch) {
  if (job.change)
    return InvalidArgument(
        "--refine fits shapes only; predictions of textures and lights cannot be refined");
  if (job.voxels) return InvalidArgument("--voxels: this task is scored by ours and by binvox's");
  if (job.oracle_steps > 0) return InvalidArgument("textures and lights have no oracle");
  TILEGRAD_ASSIGN(const Dataset dataset, OpenHeldOut(job));
  return TexturedEvaluator(config, job, dataset, workers).Run(watch);
}

}  // namespace tilegrad::train
