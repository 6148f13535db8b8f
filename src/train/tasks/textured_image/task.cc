// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"
#include "io/image_file.h"
#include "nn/nn.h"
#include "train/data/trained_models.h"
#include "train/predictor.h"
#include "train/tasks/held_out.h"
#include "train/tasks/network_task.h"
#include "train/tasks/registry.h"
#include "train/tasks/textured_image/held_out_views.h"
#include "train/tasks/textured_image/object_pictures.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::train {
namespace {

constexpr int kTexturedRows = 8, kRowViews = 3;

// The pictures of all examples, a row each.
void AddTexturedSheet(int size, Showcase* showcase) {
  if (showcase->examples.empty()) return;
  std::vector<std::vector<ShownPicture>> rows;
  for (const Example& example : showcase->examples) rows.push_back(example.pictures);
  showcase->sheet = SheetOf(rows, size);
  for (const ShownPicture& picture : rows[0]) {
    if (!showcase->sheet_columns.empty()) showcase->sheet_columns += ", ";
    showcase->sheet_columns += picture.caption;
  }
}

class TexturedImageTask : public NetworkTask {
 public:
  ConfigFields Fields() override { return FieldsOf(&config_); }

  Status Start(const TaskStart& start) override {
    config_.schedule = start.schedule;
    TILEGRAD_TRY(CheckConfig(config_));
    TILEGRAD_TRY(BeginStart(start, config_.batch));
    TILEGRAD_ASSIGN(dataset_, OpenTrainingData(start));
    TILEGRAD_TRY(CheckImageSize(config_.network.code, image_size()));
    const std::vector<int> train = dataset_->Select(Split::kTrain);
    lesson_.source = dataset_->info().source;
    lesson_.half_extent = dataset_->info().camera.half_extent;
    config_.network.sphere.half_extent = lesson_.half_extent;
    lesson_.objects = static_cast<int>(train.size());
    const Workers& workers = start.context.workers();
    TILEGRAD_ASSIGN(MeshCache meshes, OpenTexturedMeshes(*dataset_, train, config_.stream.meshes,
                                                         workers, start.watch));
    TILEGRAD_ASSIGN(HeldOutViews held_out,
                    HeldOutViews::Load({config_, *dataset_, ChooseModels(*dataset_, kTexturedRows)},
                                       workers, start.watch));
    held_out_.emplace(std::move(held_out));
    const auto seed = static_cast<std::uint64_t>(start.schedule.seed);
    batches_.emplace(*context_);
    stream_.emplace(TexturedStream::Job{config_.stream, config_.light, dataset_->info().camera,
                                        image_size(), seed},
                    std::move(meshes), SideLoop::LanesOf(workers));
    order_.emplace(static_cast<int>(train.size()), 1, seed);
    step_.emplace(*context_, config_, image_size());
    TILEGRAD_ASSIGN(adversary_, Adversary::Make(*context_, config_.adversary, start.schedule));
    step_->SetAdversary(adversary_.get());
    return {};
  }

  int image_size() const override { return dataset_->info().image_size; }
  void Settle() override { batches_->Settle(); }

  Status Begin(const Path& run, std::int64_t first_step) override {
    TILEGRAD_TRY(RememberTrainedModels(run, *dataset_, first_step));
    if (first_step > 0) return {};
    if (!config_.start.empty()) TILEGRAD_TRY(StartAs(config_.start));
    TILEGRAD_ASSIGN(const ImageU8 sheet, stream_->Sheet(kTexturedRows, 6));
    return io::SavePng(run / "stream.png", sheet);
  }

  Result<ImageU8> SamplePicture(std::int64_t /*steps*/) override {
    std::vector<std::vector<ShownPicture>> rows;
    ObjectPictures pictures = Pictures(image_size());
    for (std::size_t i = 0; i < held_out_->models().size(); ++i) {
      TILEGRAD_ASSIGN(const HeldOutViews::Views truth, held_out_->Draw(i, kRowViews));
      TILEGRAD_ASSIGN(const auto objects,
                      PredictObjects(*context_, step_->network(), ToBytes(truth.Of(truth.lit, 0)),
                                     image_size()));
      TILEGRAD_ASSIGN(auto row, PicturesOf({"", objects[0], truth}, pictures, image_size()));
      rows.push_back(std::move(row));
    }
    return rows.empty() ? ImageU8() : SheetOf(rows, image_size());
  }

  Result<std::unique_ptr<Model>> LoadModel(nn::Context& context,
                                           const Checkpoint& checkpoint) override {
    return LoadTexturedModel(context, config_, checkpoint);
  }
  Result<Evaluation> Evaluate(const TaskEvaluation& job, const Workers& workers,
                              const Watch& watch) override {
    return EvaluateTextured(config_, job, workers, watch);
  }

  Result<Showcase> Show(const ShowcaseRequest& request, const Workers& workers,
                        const Watch& watch) override {
    TILEGRAD_ASSIGN(const Dataset dataset, OpenHeldOut(request));
    Showcase out = AboutDataset(dataset, request.header);
    out.purpose = "to predict shape, texture and light of an object from one image";
    out.data += " It saw only pictures that were rendered while it trained, no 3D data.";
    out.note =
        "From the first picture alone the network predicted a mesh, its texture map and the light. "
        "The models are spread over the classes in the dataset's order, not picked by hand.";
    auto& model = *request.predictor.model().textured();
    const int size = dataset.info().image_size;
    ObjectPictures pictures = Pictures(size);
    TILEGRAD_ASSIGN(HeldOutViews held_out,
                    HeldOutViews::Load({config_, dataset, ChooseModels(dataset, request.examples)},
                                       workers, watch));
    for (std::size_t i = 0; i < held_out.models().size(); ++i) {
      TILEGRAD_TRY(watch.At({"predicting", i, held_out.models().size(), ""}, kNothingWritten));
      Example example = NamedExample(dataset, held_out.models()[i]);
      TILEGRAD_ASSIGN(const HeldOutViews::Views truth, held_out.Draw(i, kRowViews));
      TILEGRAD_ASSIGN(auto objects, model.PredictObjects(ToBytes(truth.Of(truth.lit, 0))));
      TILEGRAD_ASSIGN(example.pictures,
                      PicturesOf({example.name, objects[0], truth}, pictures, size));
      example.prediction = std::move(objects[0].mesh);
      TILEGRAD_ASSIGN(ModelData data, dataset.Load(held_out.models()[i]));
      example.truth = std::move(data.mesh);
      out.examples.push_back(std::move(example));
    }
    AddTexturedSheet(size, &out);
    return out;
  }

 private:
  LearnedWeights& weights() override { return step_->weights(); }

  Result<nn::Var> Loss(const UpdateIndex& at, const Slots& slots, StepValues* out) override {
    TILEGRAD_ASSIGN(TexturedBatch batch,
                    batches_->Take(at, [this](const BatchIndex& of) { return Batch(of); }));
    batch.portion = at.portion;
    out->images = kViewsOfObject * slots.count;
    out->stream_seconds = batch.stream_seconds;
    return step_->Loss(step_->Draw(batch, at.step), batch, at.step, out);
  }

  BatchWork<TexturedBatch> Batch(const BatchIndex& of) {
    const Slots slots = SlotsOf(of.step, config_.batch, of.portion);
    stream_->Expect(order_->Batch(SlotsOf(of.step + 1, config_.batch, of.portion), 1));
    return RenderWork(*context_, *stream_, image_size(), order_->Batch(slots, 1), slots.first);
  }

  ObjectPictures Pictures(int size) const {
    return {config_.light, size, static_cast<int>(config_.stream.draw.samples)};
  }

  TexturedImageConfig config_;
  std::optional<Dataset> dataset_;
  std::optional<TexturedStream> stream_;
  std::optional<HeldOutViews> held_out_;  // for sample pictures
  std::optional<BatchOrder> order_;
  std::optional<TexturedStep> step_;
  std::optional<NextBatch<TexturedBatch>> batches_;
};

}  // namespace

std::unique_ptr<Task> MakeTexturedImageTask() { return std::make_unique<TexturedImageTask>(); }

}  // namespace tilegrad::train
