// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/photographs/model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/file.h"
#include "nn/nn.h"
#include "render/picture/composite.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/dataset_files.h"
#include "train/data/stream/textured_meshes.h"
#include "train/data/trained_models.h"
#include "train/eval/scores.h"
#include "train/eval/statistics.h"
#include "train/metrics/metrics.h"
#include "train/models/camera_ops.h"
#include "train/predictor.h"
#include "train/ranks/process_group.h"
#include "train/run/checkpoint.h"
#include "train/tasks/photographs/step.h"

namespace tilegrad::train {
namespace {

// A planar RGBA picture over black, cropped to its object as training crops photographs.
class CutoutCrop {
 public:
  CutoutCrop(std::span<const std::uint8_t> image, int size, const CropRule& rule)
      : image_(image), size_(size) {
    PhotoBox box{1e9, 1e9, -1e9, -1e9};
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        if (At(3, x, y) < 128) continue;
        box = {std::min(box.left, x + 0.0), std::min(box.top, y + 0.0),
               std::max(box.right, x + 1.0), std::max(box.bottom, y + 1.0)};
      }
    }
    window_ = box.right > box.left ? WindowOf(box, rule, nullptr)
                                   : PhotoWindow{0, 0, static_cast<double>(size)};
  }

  // Bilinear; black beyond the edges.
  void Write(float* out) const {
    const double step = window_.side / size_;
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < size_; ++y) {
        for (int x = 0; x < size_; ++x)
          *out++ = Between(c, window_.left + (x + 0.5) * step - 0.5,
                           window_.top + (y + 0.5) * step - 0.5);
      }
    }
  }

 private:
  int At(int c, int x, int y) const {
    if (x < 0 || y < 0 || x >= size_ || y >= size_) return 0;
    return image_[static_cast<std::size_t>((c * size_ + y) * size_ + x)];
  }
  float Between(int c, double x, double y) const {
    const int u = static_cast<int>(std::floor(x)), v = static_cast<int>(std::floor(y));
    const double fx = x - u, fy = y - v;
    const double upper = (1 - fx) * At(c, u, v) + fx * At(c, u + 1, v);
    const double lower = (1 - fx) * At(c, u, v + 1) + fx * At(c, u + 1, v + 1);
    return static_cast<float>(((1 - fy) * upper + fy * lower) / 255);
  }

  std::span<const std::uint8_t> image_;
  int size_;
  PhotoWindow window_;
};

// As many keypoints as the checkpoint has.
std::size_t KeypointsIn(const Checkpoint& checkpoint) {
  const nn::Tensor* keypoints = nn::Find(checkpoint.tensors, "keypoints");
  return keypoints == nullptr ? 0 : static_cast<std::size_t>(keypoints->shape()[0]);
}

constexpr double kPckThreshold = 0.1;
enum CameraMethod { kCeiling, kMean, kOwnCamera, kOurs, kMethods };
constexpr const char* kRowNames[kMethods] = {"true keypoints", "mean shape", "predicted camera",
                                             "tilegrad"};

// Compares a picture [4][size][size] and the object in a photograph, both over black.
struct ImageScore {
  double color = 0, iou_loss = 0;
  ImageScore(std::span<const float> drawn, std::span<const float> colors,
             std::span<const float> mask) {
    const std::size_t plane = mask.size();
    for (std::size_t i = 0; i < 3 * plane; ++i)
      color += std::abs(static_cast<double>(drawn[i]) - static_cast<double>(colors[i]));
    color /= static_cast<double>(3 * plane);
    double both = 0, either = 0;
    for (std::size_t i = 0; i < plane; ++i) {
      const double a = drawn[3 * plane + i], b = mask[i];
      both += a * b;
      either += a + b - a * b;
    }
    iou_loss = 1 - both / std::max(either, 1e-10);
  }
};

// One method's, of each photograph.
struct Tally {
  std::vector<Score> scores;
  std::vector<double> errors;  // [photograph][keypoint]; NaN where it is not visible

  Score Mean(std::size_t keypoints) const {
    KeypointScore pck(keypoints, kPckThreshold);
    for (std::size_t i = 0; i < errors.size(); ++i)
      if (!std::isnan(errors[i])) pck.Add(i % keypoints, errors[i]);
    Score mean = MeanScore(scores);
    mean.pck = pck.Mean();
    return mean;
  }
};

class PhotographJudge {
 public:
  PhotographJudge(const TaskEvaluation& job, const PhotographSet& set)
      : job_(job),
        set_(set),
        model_(*job.predictor.model().photographs()),
        pictures_(static_cast<int>(model_.config().size)),
        share_(job.group, Model::kImagesAtOnce),
        tallies_(kMethods) {
    const nn::NoGrad off(model_.context());
    const nn::Var mean = model_.network().MeanShape();
    const std::span<const float> p = mean.value().span<float>();
    mean_shape_.assign(p.begin(), p.end());
    const nn::Var keypoints = model_.network().Keypoints(mean);
    if (!keypoints.valid()) return;
    const std::span<const float> k = keypoints.value().span<float>();
    for (std::size_t i = 0; i < k.size(); i += 3)
      mean_keypoints_.push_back({k[i], k[i + 1], k[i + 2]});
  }

  Result<Evaluation> Run(const Workers& workers, const Watch& watch) {
    const std::vector<int> chosen = set_.Select(job_.split);
    if (chosen.empty())
      return InvalidArgument("{}: no photographs in its {} split", set_.folder.string(),
                             SplitName(job_.split));
    const PhotographsConfig& config = model_.config();
    TILEGRAD_ASSIGN(
        const PhotoStore store,
        PhotoStore::Load(set_, chosen, config.crop, static_cast<int>(config.size), workers, watch));
    const std::size_t keypoints = set_.keypoint_names.size();
    for (Tally& tally : tallies_) {
      tally.scores.resize(chosen.size());
      tally.errors.resize(chosen.size() * keypoints, std::numeric_limits<double>::quiet_NaN());
    }
    for (int at = 0; at < store.count(); at += static_cast<int>(Model::kImagesAtOnce)) {
      TILEGRAD_TRY(watch.At({"evaluating", static_cast<std::uint64_t>(at),
                             static_cast<std::uint64_t>(store.count()), ""},
                            kNothingWritten));
      if (share_.Has(static_cast<std::size_t>(at))) TILEGRAD_TRY(ScoreSome(store, at));
    }
    for (Tally& tally : tallies_) {
      TILEGRAD_TRY(share_.Gather(&tally.scores));
      TILEGRAD_TRY(share_.Gather(&tally.errors, keypoints));
    }
    return Fill(chosen);
  }

 private:
  Status ScoreSome(const PhotoStore& store, int first) {
    std::vector<int> some;
    const int end = std::min(store.count(), first + static_cast<int>(Model::kImagesAtOnce));
    for (int i = first; i < end; ++i) some.push_back(i);
    const PhotographBatch batch =
        GatherPhotographs(model_.context(), model_.config(), store, some, -1);
    TILEGRAD_ASSIGN(const auto predicted,
                    PredictPhotographs(model_.context(), model_.network(), batch.input));
    first_ = static_cast<std::size_t>(first);
    for (std::size_t i = 0; i < predicted.size(); ++i) {
      ScoreTruth(store.photograph(some[i]), batch, i);
      TILEGRAD_TRY(ScoreOne(batch, i, predicted[i]));
    }
    return {};
  }

  Status ScoreOne(const PhotographBatch& batch, std::size_t i, const PredictedPhotograph& photo) {
    PredictedPhotograph mean = photo;
    for (std::size_t v = 0; v < mean.mesh.positions.size(); ++v)
      mean.mesh.positions[v] = {mean_shape_[3 * v], mean_shape_[3 * v + 1], mean_shape_[3 * v + 2]};
    mean.keypoints = mean_keypoints_;
    TILEGRAD_TRY(Compare(batch, i, {mean, batch.cameras[i]}, &tallies_[kMean]));
    TILEGRAD_TRY(Compare(batch, i, {photo, photo.camera}, &tallies_[kOwnCamera]));
    return Compare(batch, i, {photo, batch.cameras[i]}, &tallies_[kOurs]);
  }

  // The ceiling: true keypoints through the annotated camera.
  void ScoreTruth(const Photograph& photo, const PhotographBatch& batch, std::size_t i) {
    if (photo.points.empty()) return;
    Score score;
    score.pck = Pck(batch.crops[i], {photo.points, batch.cameras[i]}, i, &tallies_[kCeiling]);
    tallies_[kCeiling].scores[first_ + i] = score;
  }

  struct SeenKeypoints {
    const std::vector<std::array<double, 3>>& places;
    const WeakPerspective& camera;
  };
  std::optional<double> Pck(const CroppedPhoto& crop, const SeenKeypoints& seen, std::size_t i,
                            Tally* tally) const {
    KeypointScore own(1, kPckThreshold);
    for (std::size_t k = 0; k < crop.keypoints.size(); ++k) {
      if (!crop.keypoints[k].visible) continue;
      const auto at = ProjectWeakly(seen.camera, seen.places[k]);
      const double error =
          crop.to_box * std::hypot(at[0] - crop.keypoints[k].x, at[1] - crop.keypoints[k].y);
      tally->errors[(first_ + i) * crop.keypoints.size() + k] = error;
      own.Add(0, error);
    }
    return own.Mean();
  }

  struct SeenThrough {
    const PredictedPhotograph& photo;
    const WeakPerspective& camera;
  };
  Status Compare(const PhotographBatch& batch, std::size_t i, const SeenThrough& seen,
                 Tally* tally) {
    TILEGRAD_ASSIGN(const auto drawn, pictures_.Draw(seen.photo.mesh, seen.camera));
    const std::size_t plane = drawn.size() / 4;
    const ImageScore image(drawn, batch.colors.span<float>().subspan(3 * plane * i, 3 * plane),
                           batch.mask.span<float>().subspan(plane * i, plane));
    Score score;
    score.texture_l1 = image.color;
    score.mask_loss = image.iou_loss;
    score.pck = Pck(batch.crops[i], {seen.photo.keypoints, seen.camera}, i, tally);
    tally->scores[first_ + i] = score;
    return {};
  }

  Evaluation Fill(const std::vector<int>& chosen) {
    Evaluation out;
    out.split = SplitName(job_.split);
    out.predictor = job_.predictor.description();
    out.dataset_source = set_.source;
    out.views_per_model = 1;
    out.classes = {set_.source};
    out.class_models = {static_cast<int>(chosen.size())};
    const bool truths = std::ranges::all_of(chosen, [&](int i) {
      return !set_.photographs[static_cast<std::size_t>(i)].points.empty();
    });
    for (int m = truths ? kCeiling : kMean; m < kMethods; ++m) {
      const Tally& tally = tallies_[static_cast<std::size_t>(m)];
      const Score mean = tally.Mean(set_.keypoint_names.size());
      out.rows.push_back({kRowNames[m], {mean}, mean, StandardErrors({&tally.scores, 1})});
    }
    for (std::size_t i = 0; i < chosen.size(); ++i)
      out.models.push_back({set_.source, set_.photographs[static_cast<std::size_t>(chosen[i])].id,
                            tallies_[kOurs].scores[i]});
    return out;
  }

  const TaskEvaluation& job_;
  const PhotographSet& set_;
  PhotographModel& model_;
  PhotographPictures pictures_;
  const Share share_;  // of photographs
  std::vector<Tally> tallies_;
  std::size_t first_ = 0;  // photograph of the batch
  std::vector<float> mean_shape_;
  std::vector<std::array<double, 3>> mean_keypoints_;
};

constexpr int kPixelSamples = 3, kPictureZoom = 4;
constexpr std::uint8_t kSeen[3] = {255, 60, 30}, kPredicted[3] = {40, 200, 255};

// Looks at the object from the side (azimuth 90), or obliquely from in front.
WeakPerspective LookAround(double azimuth, double scale) {
  const double half = azimuth * std::numbers::pi / 360, tilt = 0.96 * std::numbers::pi / 2;
  const double c = std::cos(half), s = std::sin(half);
  const double w = std::cos(tilt), x = std::sin(tilt);
  return {scale, {0, 0}, {w * c, x * c, w * s, x * s}};
}

void Dot(double x, double y, const std::uint8_t (&color)[3], bool ring, ImageU8* image) {
  const double u = (x + 1) / 2 * image->width, v = (y + 1) / 2 * image->height;
  const double radius = image->width / 40.0;
  for (int j = 0; j < image->height; ++j) {
    for (int i = 0; i < image->width; ++i) {
      const double d = std::hypot(i + 0.5 - u, j + 0.5 - v);
      if (ring ? std::abs(d - radius) < radius / 3 : d < radius / 2)
        std::copy_n(color, 3, image->at(i, j));
    }
  }
}

ImageU8 PhotoImage(std::span<const float> rgb, int size) {
  ImageU8 out(size, size, 3);
  const std::size_t plane = rgb.size() / 3;
  for (std::size_t i = 0; i < rgb.size(); ++i) out.pixels[i] = ToByte(rgb[i % 3 * plane + i / 3]);
  return out;
}

}  // namespace

PhotographModel::PhotographModel(nn::Context& context, const PhotographsConfig& config,
                                 const Checkpoint& checkpoint)
    : context_(context),
      config_(config),
      network_(context, config.network, {.count = KeypointsIn(checkpoint)},
               static_cast<int>(config.size), /*seed=*/0) {}

Status PhotographModel::Load(const std::vector<nn::NamedTensor>& state) {
  TILEGRAD_TRY(context_.TakeStatus());
  TILEGRAD_TRY(LoadWeights(network_.module(), state));
  const nn::NoGrad off(context_);
  const nn::Var mean = network_.MeanShape();
  TILEGRAD_TRY(context_.TakeStatus());
  TILEGRAD_ASSIGN(const Mesh shape, MeshOf(network_.sphere(), {.positions = mean}, 0));
  return SetTemplate(shape, kPredictionHalfExtent);
}

Status PhotographModel::Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) {
  const auto size = static_cast<std::size_t>(config_.size);
  const std::size_t bytes = 4 * size * size, count = images.size() / bytes;
  nn::Tensor pictures =
      context_.Empty({static_cast<std::int64_t>(count), 3, config_.size, config_.size});
  for (std::size_t i = 0; i < count; ++i)
    CutoutCrop(images.subspan(i * bytes, bytes), static_cast<int>(size), config_.crop)
        .Write(pictures.data<float>() + 3 * size * size * i);
  TILEGRAD_ASSIGN(auto predicted, PredictPhotographs(context_, network_, pictures));
  for (PredictedPhotograph& photo : predicted) {
    TILEGRAD_TRY(NormalizeToBox(photo.mesh, kPredictionHalfExtent));
    meshes->push_back(std::move(photo.mesh));
  }
  return {};
}

Result<std::vector<PredictedPhotograph>> PredictPhotographs(nn::Context& context,
                                                            PhotographNetwork& network,
                                                            const nn::Tensor& pictures) {
  const nn::NoGrad off(context);
  const Prediction all = network.Forward(nn::Constant(context, pictures), nn::Mode::kEval);
  TILEGRAD_TRY(context.TakeStatus());
  const auto count = static_cast<std::size_t>(pictures.shape()[0]);
  std::vector<PredictedPhotograph> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    TILEGRAD_ASSIGN(out[i].mesh, MeshOf(network.sphere(), all, i));
    const auto c = ItemOf(all.cameras, i);
    out[i].camera = {c[0], {c[1], c[2]}, {c[3], c[4], c[5], c[6]}};
    if (!all.keypoints.valid()) continue;
    const auto k = ItemOf(all.keypoints, i);
    for (std::size_t at = 0; at < k.size(); at += 3)
      out[i].keypoints.push_back({k[at], k[at + 1], k[at + 2]});
  }
  return out;
}

Result<std::unique_ptr<Model>> LoadPhotographModel(nn::Context& context,
                                                   const PhotographsConfig& config,
                                                   const Checkpoint& checkpoint) {
  TILEGRAD_TRY(CheckConfig(config));
  if (checkpoint.info.image_size != config.size)
    return DataLoss("photographs of {} pixels a side, but its configuration says {}",
                    checkpoint.info.image_size, config.size);
  auto model = std::make_unique<PhotographModel>(context, config, checkpoint);
  TILEGRAD_TRY(model->Load(checkpoint.tensors));
  return std::unique_ptr<Model>(std::move(model));
}

std::vector<int> ChoosePhotographs(const PhotographSet& set, Split split, int count) {
  const std::vector<int> all = set.Select(split);
  std::vector<int> out;
  const auto shown = std::min<std::size_t>(static_cast<std::size_t>(count), all.size());
  for (std::size_t i = 0; i < shown; ++i) out.push_back(all[i * all.size() / shown]);
  return out;
}

Result<Evaluation> EvaluatePhotographs(const TaskEvaluation& job, const Workers& workers,
                                       const Watch& watch) {
  if (job.change)
    return InvalidArgument(
        "--refine needs cameras; predictions from photographs cannot be refined");
  if (job.voxels) return InvalidArgument("--voxels: photographs have none");
  if (job.oracle_steps > 0) return InvalidArgument("photographs have no oracle");
  TILEGRAD_ASSIGN(const PhotographSet set, OpenPhotographs(job.data));
  if (!set.photographs[0].camera)
    return InvalidArgument("{}: no cameras to score with", job.data.string());
  if (job.split != Split::kTrain) TILEGRAD_TRY(CheckHeldOutPhotographs(job.run, set, job.split));
  auto& model = *job.predictor.model().photographs();
  const nn::Var weights = model.network().KeypointWeights();
  const std::size_t learned = weights.valid() ? static_cast<std::size_t>(weights.shape()[0]) : 0;
  if (learned != set.keypoint_names.size())
    return InvalidArgument("{}: {} keypoints, but the network has learned {}", job.data.string(),
                           set.keypoint_names.size(), learned);
  return PhotographJudge(job, set).Run(workers, watch);
}

PhotographPictures::PhotographPictures(int size)
    : size_(size), pictures_(NoLight(), size, kPixelSamples) {}

Result<std::vector<float>> PhotographPictures::Draw(const Mesh& mesh,
                                                    const WeakPerspective& camera) {
  return pictures_.Draw(mesh, {PinholeIn(camera, size_), {}}, Appearance::kTexture);
}

Result<std::vector<ShownPicture>> PhotographPictures::Row(const std::string& name,
                                                          const PredictedPhotograph& predicted,
                                                          const CroppedPhoto& crop,
                                                          std::span<const float> rgb) {
  std::vector<ShownPicture> out;
  const auto add = [&](const std::string& caption, ImageU8 image) {
    out.push_back({std::move(image), caption, name + ": " + caption});
  };
  const ImageU8 photo = PhotoImage(rgb, size_);
  add("photograph", photo);
  if (!predicted.keypoints.empty()) {
    ImageU8 marked = Enlarged(photo, kPictureZoom);
    for (std::size_t k = 0; k < crop.keypoints.size(); ++k) {
      if (!crop.keypoints[k].visible) continue;
      const auto seen = ProjectWeakly(crop.camera, predicted.keypoints[k]);
      Dot(crop.keypoints[k].x, crop.keypoints[k].y, kSeen, false, &marked);
      Dot(seen[0], seen[1], kPredicted, true, &marked);
    }
    add("keypoints", std::move(marked));
  }
  TILEGRAD_ASSIGN(const auto drawn, Draw(predicted.mesh, crop.camera));
  add("prediction", OnPaper(drawn, size_));
  for (const auto& [caption, azimuth] :
       {std::pair("side", 90.0), {"front", 30.0}, {"other side", 240.0}}) {
    TILEGRAD_ASSIGN(const auto around, Draw(predicted.mesh, LookAround(azimuth, 0.8)));
    add(caption, OnPaper(around, size_));
  }
  add("texture", predicted.mesh.textures[0].image);
  return out;
}

}  // namespace tilegrad::train
