// SPDX-License-Identifier: Apache-2.0
#include "train/eval/evaluate.h"

#include <algorithm>
#include <map>
#include <set>

#include "base/error.h"
#include "train/data/dataset_files.h"
#include "train/eval/single_shape.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

// What is compared with the truth: both normalised to fill the same cube.
struct Shape {
  std::vector<std::uint8_t> occupancy;
  std::vector<glm::vec3> points;
};

Result<Shape> ShapeOf(Mesh mesh, std::uint64_t seed) {
  TILEGRAD_TRY(NormalizeToBox(mesh, static_cast<float>(CameraRule{}.half_extent)));
  Shape shape;
  TILEGRAD_ASSIGN(shape.occupancy, Voxelize(mesh, kOccupancyResolution));
  TILEGRAD_ASSIGN(shape.points, SampleSurface(mesh, kTruthPoints, seed));
  return shape;
}

Score Compare(const Shape& shape, const ModelData& truth) {
  Score score{.iou = VoxelIou(shape.occupancy, truth.occupancy), .f_score = {}};
  if (!truth.points.empty()) {
    score.f_score = CompareSurfaces(shape.points, truth.points, kFScoreThreshold).f_score;
  }
  return score;
}

Score Worst(const ModelData& truth) {
  return {.iou = 0, .f_score = truth.points.empty() ? std::nullopt : std::optional(0.0)};
}

// The mean of scores; an F-score only if all have one.
Score Mean(std::span<const Score> scores) {
  Score mean{.iou = 0, .f_score = 0.0};
  const double n = static_cast<double>(scores.size());
  for (const Score& score : scores) {
    mean.iou += score.iou / n;
    mean.f_score = mean.f_score && score.f_score ? std::optional(*mean.f_score + *score.f_score / n)
                                                 : std::nullopt;
  }
  return mean;
}

// `count` of `views`, evenly spread: 0, step, 2 step, ...
std::vector<int> SpreadViews(int views, int count) {
  std::vector<int> out;
  for (int i = 0; i < count; ++i) out.push_back(i * views / count);
  return out;
}

class Evaluator {
 public:
  Evaluator(const EvaluationJob& job, const Workers& workers, const ProgressSink& progress,
            const StopFlag& stop)
      : job_(job), data_(*job.dataset), workers_(workers), progress_(progress), stop_(stop) {}

  Result<Evaluation> Run() {
    const auto held_out = data_.Select(job_.split);
    if (held_out.empty()) {
      return InvalidArgument("{}: no models in its {} split; `tilegrad dataset` makes the splits",
                             data_.folder().string(), SplitName(job_.split));
    }
    views_ =
        SpreadViews(data_.info().views, std::clamp(job_.views_per_model, 1, data_.info().views));
    TILEGRAD_ASSIGN(const Shape undeformed, ShapeOf(job_.template_mesh, /*seed=*/1));
    TILEGRAD_ASSIGN(const Shape single, MakeSingleShape());
    for (std::size_t i = 0; i < held_out.size(); ++i) {
      TILEGRAD_TRY(Tick("evaluating", i, held_out.size()));
      TILEGRAD_ASSIGN(const ModelData truth, data_.Load(held_out[i]));
      template_scores_.push_back(Compare(undeformed, truth));
      single_scores_.push_back(Compare(single, truth));
      TILEGRAD_ASSIGN(const Score score, ScorePredictions(held_out[i], truth));
      predicted_scores_.push_back(score);
      const ModelInfo& info = data_.models()[static_cast<std::size_t>(held_out[i])];
      out_.models.push_back({ClassOf(info), info.id, score});
    }
    Fill(held_out);
    return std::move(out_);
  }

 private:
  Status Tick(const char* stage, std::size_t done, std::size_t total) const {
    if (stop_.load()) return Cancelled("stopped while {}; nothing was written", stage);
    if (progress_) progress_({.stage = stage, .done = done, .total = total, .note = ""});
    return {};
  }

  Result<Shape> MakeSingleShape() {
    const auto train = data_.Select(Split::kTrain);
    if (train.empty()) return InvalidArgument("the dataset has no training models");
    std::vector<std::vector<std::uint8_t>> grids;
    std::set<std::pair<int, std::string>> seen;
    for (std::size_t i = 0; i < train.size(); ++i) {
      TILEGRAD_TRY(Tick("mean training shape", i, train.size()));
      const ModelInfo& info = data_.models()[static_cast<std::size_t>(train[i])];
      if (!seen.emplace(info.class_index, ShapeOf(info)).second) continue;
      TILEGRAD_ASSIGN(auto model, data_.Load(train[i]));
      grids.push_back(std::move(model.occupancy));
    }
    SingleShape best = BestSingleShape(grids);
    out_.shape_threshold = best.threshold;
    // The grid itself is scored, not a voxelization of its surface, which might differ by rounding.
    TILEGRAD_ASSIGN(Shape shape, ShapeOf(VoxelSurface(best.occupancy, kOccupancyResolution), 1));
    shape.occupancy = std::move(best.occupancy);
    return shape;
  }

  Result<Score> ScorePredictions(int model, const ModelData& truth) {
    const std::size_t bytes = truth.images.size() / static_cast<std::size_t>(data_.info().views);
    std::vector<std::uint8_t> images;
    for (const int view : views_) {
      const auto at = truth.images.begin() + static_cast<std::ptrdiff_t>(bytes) * view;
      images.insert(images.end(), at, at + static_cast<std::ptrdiff_t>(bytes));
    }
    TILEGRAD_ASSIGN(auto meshes, job_.predict(images));
    if (meshes.size() != views_.size()) {
      return InternalError("{} predictions for {} images", meshes.size(), views_.size());
    }
    std::vector<Score> scores(meshes.size());
    std::vector<std::uint8_t> unusable(meshes.size(), 0);
    workers_.For(meshes.size(), [&](std::size_t i, std::size_t) {
      const auto seed = static_cast<std::uint64_t>(model) * 4096 + i;
      const auto shape = ShapeOf(std::move(meshes[i]), seed);
      unusable[i] = !shape.ok();
      scores[i] = shape.ok() ? Compare(*shape, truth) : Worst(truth);
    });
    for (const auto flag : unusable) out_.unusable_predictions += flag;
    return Mean(scores);
  }

  // class -> shape -> positions in held_out
  using Members = std::map<int, std::map<std::string, std::vector<std::size_t>>>;

  EvaluationRow Row(const std::string& method, std::span<const Score> scores,
                    const Members& members) const {
    EvaluationRow row{.method = method, .classes = {}, .mean = {}};
    for (const auto& [class_index, shapes] : members) {
      std::vector<Score> of_class;
      for (const auto& [shape, indices] : shapes) {
        std::vector<Score> of_shape;
        for (const std::size_t i : indices) of_shape.push_back(scores[i]);
        of_class.push_back(Mean(of_shape));
      }
      row.classes.push_back(Mean(of_class));
    }
    row.mean = Mean(row.classes);
    return row;
  }

  const std::string& ClassOf(const ModelInfo& info) const {
    return data_.info().classes[static_cast<std::size_t>(info.class_index)];
  }

  void Fill(std::span<const int> held_out) {
    Members members;
    std::map<int, int> models;
    for (std::size_t i = 0; i < held_out.size(); ++i) {
      const ModelInfo& info = data_.models()[static_cast<std::size_t>(held_out[i])];
      members[info.class_index][ShapeOf(info)].push_back(i);
      ++models[info.class_index];
    }
    for (const auto& [class_index, count] : models) {
      out_.classes.push_back(data_.info().classes[static_cast<std::size_t>(class_index)]);
      out_.class_models.push_back(count);
    }
    out_.rows = {Row("undeformed template", template_scores_, members),
                 Row("best single shape", single_scores_, members),
                 Row("tilegrad", predicted_scores_, members)};
    out_.predictor = job_.predictor;
    out_.split = SplitName(job_.split);
    out_.dataset_source = data_.info().source;
    out_.views_per_model = static_cast<int>(views_.size());
  }

  const EvaluationJob& job_;
  const Dataset& data_;
  const Workers& workers_;
  const ProgressSink& progress_;
  const StopFlag& stop_;
  std::vector<int> views_;
  std::vector<Score> template_scores_, single_scores_, predicted_scores_;
  Evaluation out_;
};

}  // namespace

Result<Evaluation> Evaluate(const EvaluationJob& job, const Workers& workers,
                            const ProgressSink& progress, const StopFlag& stop) {
  return Evaluator(job, workers, progress, stop).Run();
}

}  // namespace tilegrad::train
