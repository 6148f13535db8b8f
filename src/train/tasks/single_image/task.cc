// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"
#include "base/text.h"
#include "io/image_file.h"
#include "nn/nn.h"
#include "train/data/few_models.h"
#include "train/data/trained_models.h"
#include "train/eval/baselines.h"
#include "train/eval/training_pictures.h"
#include "train/tasks/held_out.h"
#include "train/tasks/network_task.h"
#include "train/tasks/registry.h"
#include "train/tasks/single_image/model.h"
#include "train/tasks/single_image/oracle.h"
#include "train/tasks/single_image/step.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kSingleImageRows = 8;

class SingleImageTask : public NetworkTask {
 public:
  ConfigFields Fields() override { return FieldsOf(&config_); }

  Status Start(const TaskStart& start) override;
  int image_size() const override { return train_.size; }
  void Settle() override { batches_->Settle(); }
  Status Begin(const Path& run, std::int64_t first_step) override;

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
                        const Watch& watch) override;

 private:
  LearnedWeights& weights() override { return step_->weights(); }
  Result<nn::Var> Loss(const UpdateIndex& at, const Slots& slots, StepValues* out) override;
  BatchWork<BatchTensors> Batch(const BatchIndex& of);
  Status CheckDataset() const;
  Status KeepPictures(const Path& run, std::int64_t first_step) const;
  void WarnOfFewModels() const;
  Status LoadImages(const TaskStart& start);
  Status LoadMeshes(const TaskStart& start);

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

Status SingleImageTask::Start(const TaskStart& start) {
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

Status SingleImageTask::Begin(const Path& run, std::int64_t first_step) {
  TILEGRAD_TRY(RememberTrainedModels(run, *dataset_, first_step));
  TILEGRAD_TRY(KeepPictures(run, first_step));
  if (first_step == 0) WarnOfFewModels();
  if (!stream_ || first_step > 0) return {};
  TILEGRAD_ASSIGN(const ImageU8 sheet, stream_->Sheet(kSingleImageRows, 6));
  return io::SavePng(run / "stream.png", sheet);
}

Status SingleImageTask::CheckDataset() const {
  const std::string folder = dataset_->folder().string();
  const DatasetInfo& info = dataset_->info();
  if (config_.views > info.views) {
    return InvalidArgument("schedule.views is {}, but the dataset has {} of each model",
                           config_.views, Count(info.views, "view"));
  }
  if (info.image_size % 8 != 0) {
    return InvalidArgument("{}: images are {} pixels a side; the network needs a multiple of 8",
                           folder, info.image_size);
  }
  return {};
}

// A run of an earlier version gets them when it is resumed.
Status SingleImageTask::KeepPictures(const Path& run, std::int64_t first_step) const {
  if (first_step > 0) {
    const auto kept = TrainingPictures::Read(run);
    if (!kept.ok() || *kept) return {};
  }
  return TrainingPictures::Of(*dataset_, train_, context_->workers()).Write(run);
}

void SingleImageTask::WarnOfFewModels() const {
  const auto advice = AdviceOnFewModels(dataset_->models(), config_.stream.share > 0);
  if (advice && warn_) warn_(*advice);
}

Status SingleImageTask::LoadImages(const TaskStart& start) {
  std::vector<int> test = dataset_->Select(Split::kTest);
  // The pictures show models spread over the held-out ones, which stand in the order of their
  // classes.
  if (test.size() > kSingleImageRows) {
    for (std::size_t i = 0; i < kSingleImageRows; ++i)
      test[i] = test[i * test.size() / kSingleImageRows];
    test.resize(kSingleImageRows);
  }
  const Workers& workers = start.context.workers();
  TILEGRAD_ASSIGN(train_,
                  LoadImageStore(*dataset_, dataset_->Select(Split::kTrain), workers, start.watch));
  TILEGRAD_ASSIGN(held_out_, LoadImageStore(*dataset_, test, workers, start.watch));
  for (int m = 0; m < held_out_.models; ++m) samples_.push_back({m, ShownViews(held_out_.views)});
  return {};
}

Status SingleImageTask::LoadMeshes(const TaskStart& start) {
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

BatchWork<BatchTensors> SingleImageTask::Batch(const BatchIndex& of) {
  const Slots slots = SlotsOf(of.step, config_.batch, of.portion);
  if (stream_) {
    const auto next = order_->Batch(SlotsOf(of.step + 1, config_.batch, of.portion), 1);
    stream_->Expect(std::span(next).first(stream_->Count(next.size())));
  }
  return GatherWork(*context_, train_, order_->Batch(slots, static_cast<int>(config_.views)),
                    {stream_ ? &*stream_ : nullptr, slots.first});
}

Result<nn::Var> SingleImageTask::Loss(const UpdateIndex& at, const Slots& slots, StepValues* out) {
  TILEGRAD_ASSIGN(const BatchTensors tensors,
                  batches_->Take(at, [this](const BatchIndex& of) { return Batch(of); }));
  out->images = slots.count;
  out->stream_seconds = tensors.stream_seconds;
  return step_->Loss(tensors, at.step, out);
}

Result<Showcase> SingleImageTask::Show(const ShowcaseRequest& request, const Workers& workers,
                                       const Watch& watch) {
  TILEGRAD_ASSIGN(Showcase out, ShowHeldOut(request, workers, watch));
  out.purpose = "to predict shape and colour of an object from one image";
  out.data += " It saw only rendered views, no 3D data.";
  return out;
}

}  // namespace

std::unique_ptr<Task> MakeSingleImageTask() { return std::make_unique<SingleImageTask>(); }

}  // namespace tilegrad::train
