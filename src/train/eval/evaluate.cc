// SPDX-License-Identifier: Apache-2.0
#include "train/eval/evaluate.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <set>

#include "base/error.h"
#include "train/data/dataset_files.h"
#include "train/eval/baselines.h"
#include "train/eval/statistics.h"

namespace tilegrad::train {
namespace {

constexpr int kColorViews = 4;  // that colours are compared in
// The training models, for the baselines that know nothing else.
struct TrainingShapes {
  std::vector<std::vector<std::uint8_t>> grids;  // of each shape, once
  // Of the models whose pictures are searched, in the order of `index`.
  std::vector<Shape> shapes;
  std::vector<std::vector<std::uint8_t>> color_images;  // [kColorViews][4][size][size] each
  ImageIndex index;
};

class Evaluator {
 public:
  Evaluator(const EvaluationJob& job, const Workers& workers, const Watch& watch)
      : job_(job), data_(*job.dataset), workers_(workers), watch_(watch), share_(job.group) {}

  Result<Evaluation> Run() {
    const auto held_out = data_.Select(job_.split);
    if (held_out.empty())
      return InvalidArgument("{}: its {} split has no models; `tilegrad dataset` makes the splits",
                             data_.folder().string(), SplitName(job_.split));
    const int views = data_.info().views;
    views_ = SpreadViews(views, std::clamp(job_.views_per_model, 1, views));
    color_views_ = SpreadViews(views, std::min(kColorViews, views));
    for (int w = 0; w < workers_.count(); ++w)
      pictures_.push_back(std::make_unique<PredictionPictures>(data_.info(), color_views_));
    TILEGRAD_ASSIGN(const Shape undeformed, ShapeOf(job_.template_mesh, /*seed=*/1, job_.voxels));
    TILEGRAD_TRY(LoadTrainingShapes());
    TILEGRAD_ASSIGN(const Shape single, MakeSingleShape());
    for (auto* scores : AllScores()) scores->resize(held_out.size());
    unusable_.resize(held_out.size());
    for (std::size_t i = 0; i < held_out.size(); ++i) {
      TILEGRAD_TRY(watch_.At({"evaluating", i, held_out.size(), ""}, kNothingWritten));
      if (share_.Has(i)) TILEGRAD_TRY(ScoreModel(i, held_out[i], {undeformed, single}));
    }
    for (auto* scores : AllScores()) TILEGRAD_TRY(share_.Gather(scores));
    TILEGRAD_TRY(share_.Gather(&unusable_));
    Fill(held_out);
    return std::move(out_);
  }

 private:
  std::vector<std::vector<Score>*> AllScores() {
    return {&template_scores_, &single_scores_, &retrieval_scores_, &oracle_scores_,
            &predicted_scores_};
  }

  struct Constant {  // the same for every picture
    const Shape &undeformed, &single;
  };
  Status ScoreModel(std::size_t i, int model, const Constant& shapes) {
    TILEGRAD_ASSIGN(const ModelData data, data_.Load(model));
    TILEGRAD_ASSIGN(const Shape truth, TruthOf(data));
    template_scores_[i] = Compare(shapes.undeformed, truth);
    single_scores_[i] = Compare(shapes.single, truth);
    if (job_.oracle) {
      TILEGRAD_ASSIGN(oracle_scores_[i], ScoreOracle(model, data, truth));
    }
    if (Retrieves()) retrieval_scores_[i] = ScoreRetrieval(data, truth);
    TILEGRAD_ASSIGN(predicted_scores_[i], ScorePredictions(model, data, truth, &unusable_[i]));
    return {};
  }

  Result<Shape> TruthOf(const ModelData& data) const {
    VoxelJob voxels = job_.voxels;
    voxels.half_extent = data_.info().camera.half_extent;
    return TruthShape(data, OwnVoxelRule(data_.info().source), voxels);
  }

  Status LoadTrainingShapes() {
    const auto train = data_.Select(Split::kTrain);
    if (train.empty()) return InvalidArgument("the dataset has no training models");
    const std::size_t searched =
        Retrieves()
            ? std::min<std::size_t>(train.size(), static_cast<std::size_t>(job_.retrieval_models))
            : 0;
    std::set<std::pair<int, std::string>> seen;
    for (std::size_t i = 0; i < train.size(); ++i) {
      TILEGRAD_TRY(watch_.At({"training shapes", i, train.size(), ""}, kNothingWritten));
      TILEGRAD_ASSIGN(const ModelData data, data_.Load(train[i]));
      // The i-th is searched where the rounded share of those up to it goes up.
      if ((i + 1) * searched / train.size() > i * searched / train.size())
        TILEGRAD_TRY(AddSearched(data));
      const ModelInfo& info = data_.model(train[i]);
      if (seen.emplace(info.class_index, ShapeOf(info)).second) TILEGRAD_TRY(AddGrid(data));
    }
    out_.retrieval_models = static_cast<int>(searched);
    return {};
  }

  Status AddGrid(const ModelData& data) {
    TILEGRAD_ASSIGN(Shape shape, TruthOf(data));
    train_.grids.push_back(std::move(shape.occupancy));
    return {};
  }

  // A training model's own picture would be found.
  bool Retrieves() const { return job_.split != Split::kTrain && job_.retrieval_models > 0; }

  Status AddSearched(const ModelData& data) {
    TILEGRAD_ASSIGN(Shape shape, TruthOf(data));
    train_.shapes.push_back(std::move(shape));
    train_.color_images.push_back(ViewsOf(data_.info(), data.images, color_views_));
    train_.index.Add(data.images, data_.info().views, data_.info().image_size);
    return {};
  }

  Result<Shape> MakeSingleShape() {
    SingleShape best = BestSingleShape(train_.grids);
    out_.shape_threshold = best.threshold;
    // The grid itself is scored, not a voxelization of its surface, which might differ by rounding.
    TILEGRAD_ASSIGN(Shape shape, ShapeOf(VoxelSurface(best.occupancy, kOccupancyResolution), 1));
    shape.occupancy = std::move(best.occupancy);
    return shape;
  }

  // `sides` as PredictionPictures has them, or empty.
  void AddColors(std::span<const std::uint8_t> images, std::span<const Side> sides,
                 const ModelData& truth, Score* score) const {
    ColorDifference difference;
    const std::size_t bytes = images.size() / color_views_.size(),
                      pixels = sides.size() / color_views_.size();
    for (std::size_t v = 0; v < color_views_.size(); ++v)
      difference.Add(images.subspan(v * bytes, bytes),
                     ViewOf(data_.info(), truth.images, color_views_[v]),
                     sides.subspan(v * pixels, pixels));
    difference.To(score);
  }

  // Of the training model whose picture is nearest to each view.
  Score ScoreRetrieval(const ModelData& data, const Shape& truth) const {
    std::vector<Score> scores(views_.size());
    workers_.For(views_.size(), [&](std::size_t i, std::size_t) {
      const DatasetInfo& info = data_.info();
      const auto match =
          train_.index.Nearest(ViewOf(info, data.images, views_[i]), info.image_size);
      const auto model = static_cast<std::size_t>(match.model);
      scores[i] = Compare(train_.shapes[model], truth);
      AddColors(train_.color_images[model], {}, data, &scores[i]);
    });
    return MeanScore(scores);
  }

  struct Origin {
    std::uint64_t seed;       // of points on its surface
    std::optional<int> view;  // that it was predicted from; none: from all
    std::size_t worker = 0;
  };
  Score ScorePrediction(Mesh mesh, const Origin& from, const ModelData& data, const Shape& truth,
                        std::uint8_t* unusable) const {
    const auto pictures = pictures_[from.worker]->Draw(mesh, from.view, data.cameras);
    const auto shape = ShapeOf(std::move(mesh), from.seed, job_.voxels);
    *unusable = !shape.ok() || !pictures.ok();
    if (*unusable) return WorstScore(truth);
    Score score = Compare(*shape, truth);
    AddColors(pictures->rgba, pictures->sides, data, &score);
    return score;
  }

  Result<Score> ScoreOracle(int model, const ModelData& data, const Shape& truth) {
    TILEGRAD_ASSIGN(Mesh mesh, job_.oracle(data));
    std::uint8_t unusable = 0;
    const Origin from{static_cast<std::uint64_t>(model), std::nullopt};
    Score score = ScorePrediction(std::move(mesh), from, data, truth, &unusable);
    score.seen_color_l1 = score.hidden_color_l1 = std::nullopt;  // also where it is unusable
    return score;
  }

  Result<Score> ScorePredictions(int model, const ModelData& data, const Shape& truth,
                                 int* unusable_predictions) {
    TILEGRAD_ASSIGN(auto meshes, job_.predict(ViewsOf(data_.info(), data.images, views_)));
    if (meshes.size() != views_.size())
      return InternalError("{} predictions for {} images", meshes.size(), views_.size());
    std::vector<Score> scores(meshes.size());
    std::vector<std::uint8_t> unusable(meshes.size(), 0);
    workers_.For(meshes.size(), [&](std::size_t i, std::size_t worker) {
      const Origin from{static_cast<std::uint64_t>(model) * 4096 + i, views_[i], worker};
      scores[i] = ScorePrediction(std::move(meshes[i]), from, data, truth, &unusable[i]);
    });
    for (const auto flag : unusable) *unusable_predictions += flag;
    return MeanScore(scores);
  }

  void Fill(std::span<const int> held_out) {
    for (const int count : unusable_) out_.unusable_predictions += count;
    const ClassMeans means(data_, held_out);
    means.Describe(predicted_scores_, &out_);
    out_.rows = {means.Row("undeformed template", template_scores_),
                 means.Row("best single shape", single_scores_)};
    if (Retrieves()) out_.rows.push_back(means.Row("nearest training picture", retrieval_scores_));
    if (job_.oracle) out_.rows.push_back(means.Row("oracle", oracle_scores_));
    out_.rows.push_back(means.Row("tilegrad", predicted_scores_));
    out_.predictor = job_.predictor;
    out_.split = SplitName(job_.split);
    out_.voxels = kVoxelRuleNames[static_cast<int>(job_.voxels.rule)];
    out_.views_per_model = static_cast<int>(views_.size());
  }

  const EvaluationJob& job_;
  const Dataset& data_;
  const Workers& workers_;
  const Watch& watch_;
  const Share share_;  // of held-out models
  std::vector<int> views_, color_views_;
  std::vector<std::unique_ptr<PredictionPictures>> pictures_;  // by worker
  TrainingShapes train_;
  std::vector<Score> template_scores_, single_scores_, retrieval_scores_, oracle_scores_,
      predicted_scores_;
  std::vector<int> unusable_;  // predictions of each model
  Evaluation out_;
};

}  // namespace

Result<Evaluation> Evaluate(const EvaluationJob& job, const Workers& workers, const Watch& watch) {
  return Evaluator(job, workers, watch).Run();
}

}  // namespace tilegrad::train
