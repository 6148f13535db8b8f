// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"
#include "base/text.h"
#include "nn/nn.h"
#include "train/data/batches.h"
#include "train/data/trained_models.h"
#include "train/predictor.h"
#include "train/tasks/network_task.h"
#include "train/tasks/photographs/model.h"
#include "train/tasks/photographs/step.h"
#include "train/tasks/registry.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {
namespace {

constexpr int kPhotographRows = 8;

// A photograph of a store as a report shows it.
struct ShownPhotograph {
  std::vector<ShownPicture> pictures;
  Mesh prediction;
};

Result<std::vector<ShownPhotograph>> ShowAll(nn::Context& context, const PhotographsConfig& config,
                                             PhotographNetwork& network, const PhotoStore& store) {
  std::vector<ShownPhotograph> all;
  PhotographPictures pictures(store.size());
  for (int i = 0; i < store.count(); ++i) {
    const PhotographBatch batch = GatherPhotographs(context, config, store, {i}, -1);
    TILEGRAD_ASSIGN(auto predicted, PredictPhotographs(context, network, batch.input));
    CroppedPhoto crop = batch.crops[0];
    if (!store.photograph(i).camera) crop.camera = predicted[0].camera;
    TILEGRAD_ASSIGN(auto row, pictures.Row(store.photograph(i).id, predicted[0], crop,
                                           batch.input.span<float>()));
    all.push_back({std::move(row), std::move(predicted[0].mesh)});
  }
  return all;
}

class PhotographsTask : public NetworkTask {
 public:
  ConfigFields Fields() override { return FieldsOf(&config_); }

  Status Start(const TaskStart& start) override {
    config_.schedule = start.schedule;
    TILEGRAD_TRY(CheckConfig(config_));
    TILEGRAD_TRY(BeginStart(start, config_.batch));
    TILEGRAD_ASSIGN(set_, OpenPhotographs(start.data));
    TILEGRAD_TRY(CheckCameras());
    const Workers& workers = start.context.workers();
    const std::vector<int> train = set_.Select(Split::kTrain);
    TILEGRAD_ASSIGN(
        train_, PhotoStore::Load(set_, train, config_.crop, image_size(), workers, start.watch));
    TILEGRAD_ASSIGN(held_out_,
                    PhotoStore::Load(set_, ChoosePhotographs(set_, Split::kTest, kPhotographRows),
                                     config_.crop, image_size(), workers, start.watch));
    lesson_.source = set_.source;
    lesson_.objects = train_->count();
    batches_.emplace(*context_);
    order_.emplace(static_cast<int>(train.size()), 1,
                   static_cast<std::uint64_t>(start.schedule.seed));
    step_.emplace(*context_, config_,
                  PhotographStart{set_.mean_keypoints, set_.keypoint_names.size()});
    TILEGRAD_TRY(context_->TakeStatus());
    TILEGRAD_ASSIGN(adversary_, Adversary::Make(*context_, config_.adversary, start.schedule));
    step_->SetAdversary(adversary_.get());
    return {};
  }

  int image_size() const override { return static_cast<int>(config_.size); }
  void Settle() override { batches_->Settle(); }

  Status Begin(const Path& run, std::int64_t first_step) override {
    TILEGRAD_TRY(RememberPhotographs(run, set_, first_step, context_->workers()));
    if (first_step > 0 || config_.start.empty()) return {};
    return StartAs(config_.start);
  }

  Result<ImageU8> SamplePicture(std::int64_t /*steps*/) override {
    TILEGRAD_ASSIGN(auto shown, ShowAll(*context_, config_, step_->network(), *held_out_));
    std::vector<std::vector<ShownPicture>> rows;
    for (ShownPhotograph& photo : shown) rows.push_back(std::move(photo.pictures));
    return rows.empty() ? ImageU8() : SheetOf(rows, image_size());
  }

  Result<std::unique_ptr<Model>> LoadModel(nn::Context& context,
                                           const Checkpoint& checkpoint) override {
    return LoadPhotographModel(context, config_, checkpoint);
  }
  Result<Evaluation> Evaluate(const TaskEvaluation& job, const Workers& workers,
                              const Watch& watch) override {
    return EvaluatePhotographs(job, workers, watch);
  }

  Result<Showcase> Show(const ShowcaseRequest& request, const Workers& workers,
                        const Watch& watch) override {
    TILEGRAD_ASSIGN(const PhotographSet set, OpenPhotographs(request.data));
    TILEGRAD_TRY(CheckHeldOutPhotographs(request.run, set, Split::kTest));
    auto& model = *request.predictor.model().photographs();
    Showcase out;
    out.thing = "photograph";
    out.purpose = "to predict shape, texture and camera of an object from one photograph";
    out.data =
        fmt::format("It learned from {}, one of each object, with masks{}. It saw no 3D data.",
                    Count(request.header.training_models, "photograph"),
                    set.keypoint_names.empty() ? "" : " and keypoints");
    out.note =
        "Dots are annotated keypoints, rings predicted ones. Photographs are spread evenly over "
        "the held-out ones, not picked by hand.";
    TILEGRAD_ASSIGN(const PhotoStore store,
                    PhotoStore::Load(set, ChoosePhotographs(set, Split::kTest, request.examples),
                                     model.config().crop, static_cast<int>(model.config().size),
                                     workers, watch));
    TILEGRAD_ASSIGN(auto shown, ShowAll(model.context(), model.config(), model.network(), store));
    for (int i = 0; i < store.count(); ++i) {
      auto& [pictures, prediction] = shown[static_cast<std::size_t>(i)];
      Example& example = out.examples.emplace_back();
      example.name = example.id = store.photograph(i).id;
      example.class_name = set.source;
      example.pictures = std::move(pictures);
      example.prediction = std::move(prediction);
    }
    return out;
  }

 private:
  LearnedWeights& weights() override { return step_->weights(); }

  Result<nn::Var> Loss(const UpdateIndex& at, const Slots& slots, StepValues* out) override {
    TILEGRAD_ASSIGN(PhotographBatch batch,
                    batches_->Take(at, [this](const BatchIndex& of) { return Batch(of); }));
    batch.portion = at.portion;
    out->images = slots.count;
    return step_->Loss(batch, at.step, out);
  }

  BatchWork<PhotographBatch> Batch(const BatchIndex& of) {
    const Slots slots = SlotsOf(of.step, config_.batch, of.portion);
    PhotographPlaces places{{}, slots.first};
    for (const Sample& sample : order_->Batch(slots, 1)) places.photographs.push_back(sample.model);
    return PhotographWork(*context_, config_, *train_, std::move(places));
  }

  Status CheckCameras() const {
    if (config_.camera == "predicted") return {};
    for (const Photograph& photo : set_.photographs) {
      if (photo.camera) continue;
      return InvalidArgument(
          "{}: no camera for {}: give cameras or keypoints (docs/photographs.md), or let the "
          "network find them with photographs.camera = \"predicted\"",
          set_.folder.string(), photo.id);
    }
    return {};
  }

  PhotographsConfig config_;
  PhotographSet set_;
  std::optional<PhotoStore> train_, held_out_;
  std::optional<BatchOrder> order_;
  std::optional<PhotographStep> step_;
  std::optional<NextBatch<PhotographBatch>> batches_;
};

}  // namespace

std::unique_ptr<Task> MakePhotographsTask() { return std::make_unique<PhotographsTask>(); }

}  // namespace tilegrad::train
