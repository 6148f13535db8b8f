// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "io/image_file.h"
#include "nn/nn.h"
#include "render/picture/composite.h"
#include "train/data/dataset.h"
#include "train/data/trained_models.h"
#include "train/eval/baselines.h"
#include "train/eval/training_pictures.h"
#include "train/models/render_op.h"
#include "train/tasks/held_out.h"
#include "train/tasks/network_task.h"
#include "train/tasks/registry.h"
#include "train/tasks/single_image/oracle.h"
#include "train/tasks/single_image/step.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kSingleImageRows = 8;

class SingleImageModel : public Model {
 public:
  SingleImageModel(nn::Context& context, const NetworkConfig& config, int image_size)
      : context_(context),
        image_size_(image_size),
        network_(context, config, image_size, /*seed=*/0) {}

  Status Load(const std::vector<nn::NamedTensor>& state, double half_extent) {
    TILEGRAD_TRY(context_.TakeStatus());
    TILEGRAD_TRY(LoadWeights(network_.module(), state));
    return SetTemplate(network_.sphere().mesh(), half_extent);
  }

  Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) override {
    const nn::NoGrad off(context_);
    const nn::Tensor input = InputOf(context_, images, image_size_);
    const Prediction predicted = network_.Forward(nn::Constant(context_, input), nn::Mode::kEval);
    TILEGRAD_TRY(context_.TakeStatus());
    for (std::size_t i = 0; i < static_cast<std::size_t>(input.shape()[0]); ++i) {
      TILEGRAD_ASSIGN(Mesh mesh, MeshOf(network_.sphere(), predicted, i));
      meshes->push_back(std::move(mesh));
    }
    return {};
  }

 private:
  nn::Context& context_;
  int image_size_;
  MeshNetwork network_;
};

// Predictions have the template's faces, positions of CheckpointInfo::half_extent, centred, and
// vertex colours in [0, 1]; batch statistics are those of training (eval mode). Errors say what
// does not fit in the checkpoint.
Result<std::unique_ptr<Model>> LoadSingleImageModel(nn::Context& context,
                                                    const NetworkConfig& config,
                                                    const Checkpoint& checkpoint) {
  const std::int64_t size = checkpoint.info.image_size;
  if (size % 8 != 0) return DataLoss("image size {} is not possible", size);
  NetworkConfig sized = config;
  sized.sphere.half_extent = checkpoint.info.half_extent;
  auto model = std::make_unique<SingleImageModel>(context, sized, static_cast<int>(size));
  TILEGRAD_TRY(model->Load(checkpoint.tensors, checkpoint.info.half_extent));
  return std::unique_ptr<Model>(std::move(model));
}

constexpr int kSampleZoom = 2, kSampleGap = 2;

ImageU8 ShownPixels(const float* rgb, const float* alpha, int size) {
  const std::size_t plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  return Enlarged(OverGrey(PlanarRgba<float>{{rgb, 3 * plane}, {alpha, plane}, size, size}, kPaper),
                  kSampleZoom);
}

// Pictures of what a network does now: rows of input | prediction | truth ... for a few objects.

// One row an object: input view, its prediction, then each other view as prediction and truth; RGB
// composited over light grey, `zoom` screen pixels a pixel. Runs in eval mode, without gradient,
// with the weights of the last step even where their moving average predicts.
Result<ImageU8> SampleSheet(nn::Context& context, TrainStep& step, const ImageStore& store,
                            std::span<const Sample> samples, std::int64_t at_step) {
  const nn::NoGrad off(context);
  const BatchTensors batch = GatherBatch(context, store, {samples.begin(), samples.end()});
  const Prediction meshes =
      step.network().Forward(nn::Constant(context, batch.input), nn::Mode::kEval);
  const int views = static_cast<int>(samples[0].views.size());
  const RenderedImages images = step.losses().DrawOurs(meshes, batch, at_step);
  TILEGRAD_TRY(context.TakeStatus());
  const std::size_t plane =
      static_cast<std::size_t>(store.size) * static_cast<std::size_t>(store.size);
  // Soft alpha is a signal for training, and rounds to 1 beside a face; people see what is covered.
  const std::span<const std::int32_t> ids = step.losses().renderer().frame.images().face_ids;
  std::vector<float> covered(ids.size());
  std::ranges::transform(ids, covered.begin(),
                         [](std::int32_t id) { return id < 0 ? 0.0f : 1.0f; });
  std::vector<ImageU8> cells;
  for (std::size_t n = 0; n < samples.size() * static_cast<std::size_t>(views); ++n) {
    cells.push_back(ShownPixels(batch.truth_colors.data<float>() + 3 * plane * n,
                                batch.truth_alpha.data<float>() + plane * n, store.size));
    cells.push_back(ShownPixels(images.colors.value().data<float>() + 3 * plane * n,
                                covered.data() + plane * n, store.size));
  }
  return TileImages(cells, 2 * views, kSampleGap);
}

class SingleImageTask : public NetworkTask {
 public:
  ConfigFields Fields() override { return FieldsOf(&config_); }

  Status Start(const TaskStart& start) override {
    config_.schedule = start.schedule;
    TILEGRAD_TRY(CheckConfig(config_));
    TILEGRAD_TRY(BeginStart(start, config_.batch));
    TILEGRAD_ASSIGN(dataset_, OpenTrainingData(start));
    TILEGRAD_TRY(CheckDataset());
    TILEGRAD_TRY(LoadImages(start));
    batches_.emplace(*context_);
    TILEGRAD_TRY(LoadMeshes(start));
    lesson_.source = dataset_->info().source;
    lesson_.half_extent = dataset_->info().camera.half_extent;
    config_.network.sphere.half_extent = lesson_.half_extent;
    lesson_.objects = train_.models;
    warn_ = start.warn;
    step_.emplace(*context_, config_, train_.size);
    order_.emplace(train_.models, train_.views, static_cast<std::uint64_t>(start.schedule.seed),
                   config_.mirrored);
    return {};
  }

  int image_size() const override { return train_.size; }
  void Settle() override { batches_->Settle(); }

  Status Begin(const Path& run, std::int64_t first_step) override {
    TILEGRAD_TRY(RememberTrainedModels(run, *dataset_, first_step));
    TILEGRAD_TRY(KeepPictures(run, first_step));
    if (first_step == 0) WarnOfFewModels();
    if (!stream_ || first_step > 0) return {};
    TILEGRAD_ASSIGN(const ImageU8 sheet, stream_->Sheet(kSingleImageRows, 6));
    return io::SavePng(run / "stream.png", sheet);
  }

  Result<ImageU8> SamplePicture(std::int64_t steps) override {
    if (samples_.empty()) return ImageU8();
    return SampleSheet(*context_, *step_, held_out_, samples_, steps);
  }

  Result<std::unique_ptr<Model>> LoadModel(nn::Context& context,
                                           const Checkpoint& checkpoint) override {
    return LoadSingleImageModel(context, config_.network, checkpoint);
  }
  Result<Evaluation> Evaluate(const TaskEvaluation& job, const Workers& workers,
                              const Watch& watch) override {
    return EvaluateOnDataset(job, workers, watch,
                             [this](const DatasetInfo& info, int steps, const Workers& on) {
                               return FitTemplates(config_, info, steps, on);
                             });
  }

  Result<Showcase> Show(const ShowcaseRequest& request, const Workers& workers,
                        const Watch& watch) override {
    TILEGRAD_ASSIGN(Showcase out, ShowHeldOut(request, workers, watch));
    out.purpose = "to predict shape and colour of an object from one image";
    out.data += " It saw only rendered views, no 3D data.";
    return out;
  }

 private:
  LearnedWeights& weights() override { return step_->weights(); }

  Result<nn::Var> Loss(const UpdateIndex& at, const Slots& slots, StepValues* out) override {
    TILEGRAD_ASSIGN(const BatchTensors tensors,
                    batches_->Take(at, [this](const BatchIndex& of) { return Batch(of); }));
    out->images = slots.count;
    out->stream_seconds = tensors.stream_seconds;
    return step_->Loss(tensors, at.step, out);
  }

  BatchWork<BatchTensors> Batch(const BatchIndex& of) {
    const Slots slots = SlotsOf(of.step, config_.batch, of.portion);
    if (stream_) {
      const auto next = order_->Batch(SlotsOf(of.step + 1, config_.batch, of.portion), 1);
      stream_->Expect(std::span(next).first(stream_->Count(next.size())));
    }
    return GatherWork(*context_, train_, order_->Batch(slots, static_cast<int>(config_.views)),
                      {stream_ ? &*stream_ : nullptr, slots.first});
  }

  Status CheckDataset() const {
    const std::string folder = dataset_->folder().string();
    const DatasetInfo& info = dataset_->info();
    if (config_.views > info.views)
      return InvalidArgument("schedule.views is {}, but the dataset has {} of each model",
                             config_.views, Count(info.views, "view"));
    if (info.image_size % 8 != 0)
      return InvalidArgument("{}: images are {} pixels a side; the network needs a multiple of 8",
                             folder, info.image_size);
    return {};
  }

  // A run of an earlier version gets them when it is resumed.
  Status KeepPictures(const Path& run, std::int64_t first_step) const {
    if (first_step > 0) {
      const auto kept = TrainingPictures::Read(run);
      if (!kept.ok() || *kept) return {};
    }
    return TrainingPictures::Of(*dataset_, train_, context_->workers()).Write(run);
  }

  void WarnOfFewModels() const {
    const auto advice = AdviceOnFewModels(dataset_->models(), config_.stream.share > 0);
    if (advice && warn_) warn_(*advice);
  }

  Status LoadImages(const TaskStart& start) {
    std::vector<int> test = dataset_->Select(Split::kTest);
    // The pictures show models spread over the held-out ones, which stand in the order of their
    // classes.
    if (test.size() > kSingleImageRows) {
      for (std::size_t i = 0; i < kSingleImageRows; ++i)
        test[i] = test[i * test.size() / kSingleImageRows];
      test.resize(kSingleImageRows);
    }
    const Workers& workers = start.context.workers();
    TILEGRAD_ASSIGN(
        train_, LoadImageStore(*dataset_, dataset_->Select(Split::kTrain), workers, start.watch));
    TILEGRAD_ASSIGN(held_out_, LoadImageStore(*dataset_, test, workers, start.watch));
    for (int m = 0; m < held_out_.models; ++m) samples_.push_back({m, ShownViews(held_out_.views)});
    return {};
  }

  Status LoadMeshes(const TaskStart& start) {
    if (config_.stream.share <= 0) return {};
    const TexturedStreamConfig stream{
        .draw = config_.stream,
        .meshes = {
            .max_faces = config_.stream.max_faces, .colored = true, .cache = config_.stream.cache}};
    const Workers& workers = start.context.workers();
    TILEGRAD_ASSIGN(MeshCache meshes, OpenTexturedMeshes(*dataset_, dataset_->Select(Split::kTrain),
                                                         stream.meshes, workers, start.watch));
    const DatasetInfo& info = dataset_->info();
    stream_.emplace(TexturedStream::Job{.config = stream,
                                        .light = {},
                                        .camera = info.camera,
                                        .size = info.image_size,
                                        .seed = static_cast<std::uint64_t>(start.schedule.seed),
                                        .dataset_light = true},
                    std::move(meshes), SideLoop::LanesOf(workers));
    return {};
  }

  SingleImageConfig config_;
  WarningSink warn_;
  std::optional<Dataset> dataset_;
  ImageStore train_, held_out_;
  std::vector<Sample> samples_;  // of held_out_, for pictures
  std::optional<TrainStep> step_;
  std::optional<BatchOrder> order_;
  std::optional<TexturedStream> stream_;
  std::optional<NextBatch<BatchTensors>> batches_;
};

}  // namespace

std::unique_ptr<Task> MakeSingleImageTask() { return std::make_unique<SingleImageTask>(); }

}  // namespace tilegrad::train
