// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"
#include "io/image_file.h"
#include "nn/nn.h"
#include "train/data/fingerprint.h"
#include "train/data/trained_models.h"
#include "train/predictor.h"
#include "train/tasks/gan/learner.h"
#include "train/tasks/gan/model.h"
#include "train/tasks/held_out.h"
#include "train/tasks/network_task.h"
#include "train/tasks/registry.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kSampleStream = 0x7368656574;
constexpr std::int64_t kSheetSamples = 24;
constexpr int kStreamRows = 8, kStreamViews = 6;

class GanTask : public Task {
 public:
  ConfigFields Fields() override { return FieldsOf(&config_); }
  const char* ScoreCommand() const override { return "sample --score"; }

  Status Start(const TaskStart& start) override {
    context_ = &start.context;
    config_.schedule = start.schedule;
    TILEGRAD_TRY(CheckConfig(config_));
    TILEGRAD_TRY(CheckPortions(config_.batch, start.schedule.portions));
    TILEGRAD_ASSIGN(dataset_, OpenTrainingData(start));
    TILEGRAD_ASSIGN(
        meshes_, OpenTexturedMeshes(*dataset_, dataset_->Select(Split::kTrain),
                                    config_.stream.meshes, start.context.workers(), start.watch));
    const auto seed = static_cast<std::uint64_t>(start.schedule.seed);
    const CameraRule& camera = dataset_->info().camera;
    pictures_.emplace(*context_,
                      RealPictures::Job{config_.stream, camera, config_.views, image_size(), seed},
                      *meshes_);
    TILEGRAD_TRY(ExtractTextures(start));
    TILEGRAD_ASSIGN(learner_, GanLearner::Make(*context_, {config_, camera, start.warn},
                                               {&*pictures_, bank_ ? &*bank_ : nullptr}));
    return {};
  }

  int image_size() const override { return dataset_->info().image_size; }
  void Settle() override { pictures_->Settle(); }

  RunHeader Header() override {
    return {.dataset_source = dataset_->info().source,
            .training_models = static_cast<int>(meshes_->size()),
            .parameters = learner_->parameters()};
  }

  Result<std::string> Fingerprint(const Path& data, const Workers& workers) const override {
    TILEGRAD_ASSIGN(const std::string own, DataFingerprint(data, workers));
    return bank_ ? bank_->Fingerprint(own) : own;
  }

  Status Begin(const Path& run, std::int64_t first_step) override {
    TILEGRAD_TRY(RememberTrainedModels(run, *dataset_, first_step));
    if (first_step > 0) return {};
    if (!config_.start.empty()) {
      TILEGRAD_ASSIGN(const FoundCheckpoint found, FindCheckpoint(*context_, config_.start));
      const Status started = learner_->StartAs(found.checkpoint.tensors);
      if (!started.ok()) return started.Within("start.run = \"" + config_.start + "\"");
    }
    TILEGRAD_ASSIGN(const ImageU8 sheet, pictures_->Sheet(kStreamRows, kStreamViews));
    return io::SavePng(run / "stream.png", sheet);
  }

  int Updates(std::int64_t step) const override { return learner_->Updates(step); }

  Result<nn::StepVector<nn::Gradient>> Backward(const UpdateIndex& at, StepValues* out) override {
    TILEGRAD_ASSIGN(auto gradients, learner_->Backward(at, out));
    out->stream_seconds = pictures_->TakeSeconds() + (at.update > 0 ? out->stream_seconds : 0);
    return gradients;
  }

  Result<std::vector<nn::NamedTensor>> Statistics() override { return learner_->Statistics(); }
  Status Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) override {
    return learner_->Update(at, gradients);
  }
  std::vector<nn::NamedTensor> State() override { return learner_->State(); }
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) override {
    return learner_->LoadState(state, steps);
  }

  Result<ImageU8> SamplePicture(std::int64_t steps) override {
    TILEGRAD_ASSIGN(ShapeTextureGenerator * generator, learner_->Shown(steps));
    const nn::Tensor codes = learner_->step().Noise(kSampleStream, 0, kSheetSamples);
    TILEGRAD_ASSIGN(const auto meshes,
                    GenerateMeshes(*context_, *generator, codes, steps > config_.shape_steps));
    return DrawSheet(meshes, {}, context_->workers());
  }

  Result<std::unique_ptr<Model>> LoadModel(nn::Context& context,
                                           const Checkpoint& checkpoint) override {
    TILEGRAD_ASSIGN(auto model, GeneratorModel::Load(context, config_, checkpoint));
    return std::unique_ptr<Model>(std::move(model));
  }

  Result<Evaluation> Evaluate(const TaskEvaluation& /*job*/, const Workers& /*workers*/,
                              const Watch& /*watch*/) override {
    return InvalidArgument(
        "a generator is scored by tilegrad sample --score, which compares sets of objects");
  }

  Result<Showcase> Show(const ShowcaseRequest& request, const Workers& workers,
                        const Watch& watch) override {
    TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(request.data));
    Showcase out = AboutDataset(dataset, request.header);
    out.purpose = "to generate textured objects from noise";
    out.generated = true;
    out.thing = "object";
    out.data += " Critics saw only pictures of the training models, no 3D data.";
    out.note = "Objects of the first latent codes, not picked by hand.";
    auto& model = *request.predictor.model().generator();
    const auto count = static_cast<std::size_t>(request.examples);
    for (std::size_t i = 0; i < count; ++i) {
      TILEGRAD_TRY(watch.At({"generating", i, count, ""}, kNothingWritten));
      TILEGRAD_ASSIGN(auto meshes, model.Generate(model.Code(0, i)));
      Example& example = out.examples.emplace_back();
      example.name = fmt::format("sample {}", i + 1);
      example.id = fmt::format("{}", i + 1);
      for (const double azimuth : {0.0, 180.0}) {
        constexpr int kSize = 192;
        TILEGRAD_ASSIGN(auto pictures,
                        DrawObjects(meshes, SheetCamera(kSize, azimuth), kSize, workers));
        const char* const where = azimuth == 0 ? "from the front" : "from behind";
        example.pictures.push_back({std::move(pictures[0]), where, example.name + " " + where});
      }
      example.prediction = std::move(meshes[0]);
    }
    return out;
  }

 private:
  Status ExtractTextures(const TaskStart& start) {
    if (config_.schedule.steps <= config_.shape_steps) return {};
    const TextureBank::Job job{config_.textures.run, static_cast<int>(config_.textures.count),
                               static_cast<std::uint64_t>(config_.schedule.seed), config_.stream,
                               config_.network};
    TILEGRAD_ASSIGN(bank_, TextureBank::Extract(job, {*dataset_, *meshes_}, start.context.workers(),
                                                start.watch));
    return {};
  }

  GanConfig config_;
  nn::Context* context_ = nullptr;
  std::optional<Dataset> dataset_;
  std::optional<MeshCache> meshes_;  // of training
  std::optional<RealPictures> pictures_;
  std::optional<TextureBank> bank_;
  std::unique_ptr<GanLearner> learner_;
};

}  // namespace

std::unique_ptr<Task> MakeGanTask() { return std::make_unique<GanTask>(); }

}  // namespace tilegrad::train
