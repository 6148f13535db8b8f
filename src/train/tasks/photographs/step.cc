// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/photographs/step.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "nn/nn.h"
#include "train/data/photographs/distance_barrier.h"
#include "train/losses/l1.h"
#include "train/models/camera_ops.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

PhotographStep::PhotographStep(nn::Context& context, const PhotographsConfig& config,
                               const PhotographStart& start)
    : context_(context),
      config_(config),
      network_(context, config.network, start, static_cast<int>(config.size),
               static_cast<std::uint64_t>(config.schedule.seed)),
      weights_(context, network_.module(), config.optimizer, config.schedule.steps),
      renderer_(context),
      color_renderer_(context) {
  const nn::NoGrad off(context);
  const nn::Var mean = network_.MeanShape();
  std::vector<double> positions;
  nn::WithFloatType(mean.dtype(), [&]<class T>(T) {
    for (const T x : mean.value().span<T>()) positions.push_back(static_cast<double>(x));
  });
  edges_ = CotangentWeights(network_.sphere().mesh().faces, positions);
}

RenderJob PhotographStep::JobAt(const PhotographBatch& batch, std::int64_t step) const {
  const auto size = static_cast<int>(config_.size);
  const double sharpness = SharpnessAt(config_.render, config_.schedule.steps, step);
  RenderJob job = network_.sphere().Job(OptionsOf(config_.render, sharpness, size));
  for (const WeakPerspective& camera : batch.cameras)
    job.cameras.push_back(PinholeIn(camera, size));
  return job;
}

nn::Var PhotographStep::CamerasOf(const Prediction& predicted, const PhotographBatch& batch) const {
  return config_.camera == "predicted"
             ? predicted.cameras
             : nn::Constant(context_, CameraRows(context_, batch.cameras));
}

// Where colours are not to move shapes, they are drawn a second time, of a shape that is fixed.
RenderedImages PhotographStep::Draw(const Prediction& predicted, const PhotographBatch& batch,
                                    std::int64_t step) {
  SceneVars scenes{.positions = predicted.positions, .textures = predicted.textures};
  if (config_.camera == "predicted")
    scenes.cameras = PinholeCameras(predicted.cameras, static_cast<int>(config_.size));
  RenderedImages images = RenderScenes(renderer_.Here(), scenes, JobAt(batch, step));
  if (config_.loss.color_moves) return images;
  scenes.positions = nn::Detach(scenes.positions);
  if (scenes.cameras.valid()) scenes.cameras = nn::Detach(scenes.cameras);
  images.colors = RenderScenes(color_renderer_.Here(), scenes, JobAt(batch, step)).colors;
  return images;
}

// CMR's: over all keypoints, those that are not visible with an error of 0.
nn::Var PhotographStep::KeypointLoss(const Prediction& predicted,
                                     const PhotographBatch& batch) const {
  const nn::Var seen = ProjectPoints(predicted.keypoints, CamerasOf(predicted, batch));
  const nn::Var visible = nn::Constant(context_, batch.visible);
  return nn::Mean(nn::Square(visible * (seen - nn::Constant(context_, batch.keypoints))));
}

nn::Var PhotographStep::Masked(const nn::Var& colors, const PhotographBatch& batch) const {
  const nn::Shape& shape = batch.mask.shape();
  const nn::Var mask =
      nn::Reshape(nn::Constant(context_, batch.mask), {shape[0], 1, shape[1], shape[2]});
  return mask * colors;
}

nn::Var PhotographStep::FlowLoss(const nn::Var& flow, const PhotographBatch& batch) const {
  return nn::Mean(nn::SamplePictures(batch.barrier, flow));
}

// 1 - |q q'|, and the mean square of the three other numbers.
nn::Var PhotographStep::CameraLoss(const nn::Var& cameras, const PhotographBatch& batch) const {
  std::vector<WeakPerspective> unit = batch.cameras;
  for (WeakPerspective& camera : unit) {
    double squares = 0;
    for (const double c : camera.quaternion) squares += c * c;
    for (double& c : camera.quaternion) c /= std::sqrt(squares);
  }
  const nn::Var truth = nn::Constant(context_, CameraRows(context_, unit));
  const nn::Var agree =
      nn::Abs(nn::Sum(nn::Slice(cameras, 1, 3, 7) * nn::Slice(truth, 1, 3, 7), {1}));
  const nn::Var rest =
      nn::Mean(nn::Square(nn::Slice(cameras, 1, 0, 3) - nn::Slice(truth, 1, 0, 3)));
  return rest + (1.0 - nn::Mean(agree));
}

// Of several camera hypotheses, the one that starts nearest to the true camera is trained towards
// it, and to be the likeliest.
void PhotographStep::AddCamera(const Prediction& predicted, const PhotographBatch& batch,
                               LossSum* sum) const {
  nn::Var cameras = predicted.cameras;
  if (predicted.choice_logits.valid()) {
    const auto count = static_cast<std::int32_t>(config_.network.azimuths);
    std::vector<std::int32_t> nearest, rows;
    for (const WeakPerspective& camera : batch.cameras) {
      nearest.push_back(NearestStart(camera.quaternion, count));
      rows.push_back(static_cast<std::int32_t>(rows.size()) * count + nearest.back());
    }
    cameras = nn::Gather(predicted.camera_choices, 0, context_.Indices(rows));
    sum->Add("azimuth", "Camera hypothesis (cross-entropy)", config_.loss.azimuth,
             nn::CrossEntropy(predicted.choice_logits, context_.Indices(nearest)));
  }
  sum->Add("camera", "Camera (rotation, scale and shift)", config_.loss.camera,
           CameraLoss(cameras, batch));
}

nn::Var PhotographStep::Entropy() const {
  const nn::Var weights = network_.KeypointWeights();
  return -nn::Mean(nn::Sum(weights * nn::Log(weights + 1e-12), {1}));
}

nn::Var PhotographStep::Loss(const PhotographBatch& batch, std::int64_t step, StepValues* values) {
  const Prediction predicted =
      network_.Forward(nn::Constant(context_, batch.input), nn::Mode::kTrain);
  if (!predicted.positions.valid()) return predicted.positions;
  const RenderedImages images = Draw(predicted, batch, step);
  const PhotographLosses& w = config_.loss;
  LossSum sum(values);
  if (predicted.keypoints.valid()) {
    sum.Add("keypoint", "Keypoints (mean square in the crop)", w.keypoint,
            KeypointLoss(predicted, batch));
    sum.Add("entropy", "Entropy of the keypoints' weights", w.entropy, Entropy());
  }
  sum.Add("mask", "Silhouette (mean square)", w.mask,
          nn::Mean(nn::Square(images.alpha - nn::Constant(context_, batch.mask))));
  AddIou(w.iou, images.alpha, batch.mask, &sum);
  AddColor(w.color, ColorL1Loss(Masked(images.colors, batch), batch.colors), &sum);
  if (predicted.flow.valid())
    sum.Add("flow_distance", "Distance of the texture flow from the object", w.flow_distance,
            FlowLoss(predicted.flow, batch));
  if (config_.camera == "given") AddCamera(predicted, batch, &sum);
  sum.Add("deformation", "Mean displacement", w.deformation,
          nn::Mean(nn::Sqrt(nn::Sum(nn::Square(predicted.movement), {2}) + 1e-12)));
  sum.Add("laplacian", "Cotangent Laplacian", w.laplacian,
          CotangentLaplacianLoss(predicted.positions, edges_));
  // Where the object is: outlines are equation 12's.
  if (adversary_ != nullptr)
    adversary_->AddLosses({Masked(images.colors, batch), batch.colors, batch.portion}, &sum);
  return sum.total();
}

namespace {

constexpr std::uint64_t kCutoutStream = 0x6375746f7574;

template <class T>
void Put(std::span<const float> from, T* to) {
  std::transform(from.begin(), from.end(), to, [](float x) { return static_cast<T>(x); });
}

struct Pixels {
  std::vector<float> rgb, mask, barrier;
};

// One photograph's planes, to place `b` of the batch.
template <class T>
void Place(Pixels pixels, bool cutout, std::size_t b, PhotographBatch* batch) {
  const std::size_t plane = pixels.mask.size();
  T* const input = batch->input.data<T>() + 3 * plane * b;
  if (!cutout) Put(pixels.rgb, input);
  for (std::size_t i = 0; i < pixels.rgb.size(); ++i) pixels.rgb[i] *= pixels.mask[i % plane];
  if (cutout) Put(pixels.rgb, input);
  Put(pixels.rgb, batch->colors.data<T>() + 3 * plane * b);
  Put(pixels.mask, batch->mask.data<T>() + plane * b);
  if (!pixels.barrier.empty()) Put(pixels.barrier, batch->barrier.data<T>() + plane * b);
}

void AddKeypoints(nn::Context& context, PhotographBatch* batch) {
  const std::size_t count = batch->crops[0].keypoints.size();
  if (count == 0) return;
  std::vector<double> places, visible;
  for (const CroppedPhoto& crop : batch->crops) {
    for (const Keypoint& k : crop.keypoints) {
      places.insert(places.end(), {k.x, k.y});
      visible.push_back(k.visible ? 1 : 0);
    }
  }
  const auto b = static_cast<std::int64_t>(batch->crops.size()),
             k = static_cast<std::int64_t>(count);
  batch->keypoints = context.From({b, k, 2}, std::span<const double>(places));
  batch->visible = context.From({b, k, 1}, std::span<const double>(visible));
}

// A batch under construction.
struct Cutting {
  nn::Context& context;
  const PhotographsConfig& config;
  const PhotoStore& store;
  PhotographPlaces places;
  PhotographBatch batch;

  void Run(std::size_t i) {
    const auto plane =
        static_cast<std::size_t>(store.size()) * static_cast<std::size_t>(store.size());
    Pixels pixels{std::vector<float>(3 * plane), std::vector<float>(plane), {}};
    const auto seed = static_cast<std::uint64_t>(config.schedule.seed);
    const bool random = places.first >= 0;
    const std::uint64_t position =
        static_cast<std::uint64_t>(std::max<std::int64_t>(places.first, 0)) + i;
    batch.crops[i] =
        store.Cut(places.photographs[i], {seed, position, random, 0.5}, pixels.rgb, pixels.mask);
    if (!batch.barrier.empty()) {
      pixels.barrier.resize(plane);
      DistanceBarrier(pixels.mask, store.size(), pixels.barrier);
    }
    const bool cutout = random && Rng(seed ^ kCutoutStream, position).Uniform() < config.cutouts;
    nn::WithFloatType(batch.input.dtype(),
                      [&]<class T>(T) { Place<T>(std::move(pixels), cutout, i, &batch); });
  }
  PhotographBatch Finish() {
    for (const CroppedPhoto& crop : batch.crops) batch.cameras.push_back(crop.camera);
    AddKeypoints(context, &batch);
    return std::move(batch);
  }
};

}  // namespace

BatchWork<PhotographBatch> PhotographWork(nn::Context& context, const PhotographsConfig& config,
                                          const PhotoStore& store, PhotographPlaces places) {
  const std::size_t count = places.photographs.size();
  const auto b = static_cast<std::int64_t>(count);
  const std::int64_t s = store.size();
  PhotographBatch batch;
  batch.input = context.Empty({b, 3, s, s});
  batch.colors = context.Empty({b, 3, s, s});
  batch.mask = context.Empty({b, s, s});
  if (config.network.texture == "flow") batch.barrier = context.Empty({b, 1, s, s});
  batch.crops.resize(count);
  const auto work = std::make_shared<Cutting>(
      Cutting{context, config, store, std::move(places), std::move(batch)});
  return {count, [work](std::size_t i, std::size_t) { work->Run(i); },
          [work] { return work->Finish(); }};
}

PhotographBatch GatherPhotographs(nn::Context& context, const PhotographsConfig& config,
                                  const PhotoStore& store, const std::vector<int>& photographs,
                                  std::int64_t first) {
  return *MakeNow(PhotographWork(context, config, store, {photographs, first}), context);
}

}  // namespace tilegrad::train
