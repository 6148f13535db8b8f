// SPDX-License-Identifier: Apache-2.0
#include <set>

#include "base/error.h"
#include "nn/nn.h"
#include "render/picture/composite.h"
#include "train/data/trained_models.h"
#include "train/losses/loss_sum.h"
#include "train/models/classifier.h"
#include "train/predictor.h"
#include "train/tasks/classify/model.h"
#include "train/tasks/common_config.h"
#include "train/tasks/held_out.h"
#include "train/tasks/network_task.h"
#include "train/tasks/registry.h"

namespace tilegrad::train {
namespace {

constexpr int kSampleModels = 24, kSampleColumns = 8, kFrame = 3, kFrameGap = 2;
constexpr std::uint8_t kRight[3] = {40, 110, 200}, kWrong[3] = {230, 120, 20};

// The keys of `task.kind = "classify"`.
struct ClassifyConfig {
  ClassifierConfig network;
  OptimizerConfig optimizer = {
      .learning_rate = 2e-3, .final_factor = 0.01, .warmup = 20, .weight_decay = 1e-2};
  std::int64_t batch = 64;
  double mirrored = 0.5;   // share of pictures mirrored
  std::int64_t shift = 4;  // most pixels of a random shift, each way; black fills in
  Schedule schedule;       // of the run; no keys of the task
};

ConfigFields FieldsOf(ClassifyConfig* c) {
  return Joined(
      {{{"network.channels", &c->network.channels, 1, 4096,
         "channels of the first level; they double"},
        {"network.most", &c->network.most, 1, 4096, "up to this many"},
        {"network.levels", &c->network.levels, 1, 8, "convolutions, each at half the size"}},
       Without(FieldsOf(&c->optimizer),
               {"optimizer.beta1", "optimizer.beta2", "optimizer.average"}),
       {{"optimizer.weight_decay", &c->optimizer.weight_decay, 0, 1,
         "weight decay per step, relative to the learning rate"},
        {"schedule.batch", &c->batch, 2, 65536, "pictures per step, one per model"},
        {"schedule.mirrored", &c->mirrored, 0, 1, "fraction of the pictures mirrored"},
        {"schedule.shift", &c->shift, 0, 64,
         "largest random shift of a picture along each axis, pixels"}}});
}

// The share of `scores` [n, classes] that is largest at its label.
double ShareRight(const nn::Tensor& scores, const nn::Tensor& labels) {
  const std::vector<int> said = MostLikely(scores);
  int right = 0;
  for (std::size_t i = 0; i < said.size(); ++i) right += said[i] == labels.data<std::int32_t>()[i];
  return static_cast<double>(right) / static_cast<double>(said.size());
}

ImageU8 Framed(const ImageU8& image, const std::uint8_t (&color)[3]) {
  ImageU8 out(image.width + 2 * kFrame, image.height + 2 * kFrame, 3);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const int u = x - kFrame, v = y - kFrame;
      const bool inside = u >= 0 && v >= 0 && u < image.width && v < image.height;
      std::copy_n(inside ? image.at(u, v) : color, 3, out.at(x, y));
    }
  }
  return out;
}

class ClassifyTask : public NetworkTask {
 public:
  ConfigFields Fields() override { return FieldsOf(&config_); }

  Status Start(const TaskStart& start) override {
    config_.schedule = start.schedule;
    TILEGRAD_TRY(BeginStart(start, config_.batch));
    TILEGRAD_ASSIGN(dataset_, Dataset::Open(start.data));
    TILEGRAD_TRY(CheckDataset());
    TILEGRAD_TRY(LoadPictures(start));
    lesson_.source = dataset_->info().source;
    lesson_.objects = train_.images.models;
    batches_.emplace(*context_);
    order_.emplace(train_.images.models, train_.images.views, seed(), config_.mirrored);
    network_.emplace(*context_, config_.network,
                     static_cast<std::int64_t>(dataset_->info().classes.size()), seed());
    weights_.emplace(*context_, *network_, config_.optimizer, start.schedule.steps);
    return {};
  }

  int image_size() const override { return train_.images.size; }
  void Settle() override { batches_->Settle(); }
  Status Begin(const Path& run, std::int64_t first_step) override {
    return RememberTrainedModels(run, *dataset_, first_step);
  }

  std::vector<nn::NamedTensor> State() override {
    std::vector<nn::NamedTensor> out = NetworkTask::State();
    out.push_back(ClassNames(*context_, dataset_->info().classes));
    return out;
  }

  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) override {
    TILEGRAD_ASSIGN(const auto classes, ReadClassNames(state));
    if (classes == dataset_->info().classes) return NetworkTask::LoadState(state, steps);
    return InvalidArgument("{}: the run was started with other classes",
                           dataset_->folder().string());
  }

  // Held-out models in a frame: blue where the class is told right, orange where not.
  Result<ImageU8> SamplePicture(std::int64_t /*steps*/) override {
    const ImageStore& store = held_out_.images;
    if (store.models == 0) return ImageU8();
    std::vector<Sample> samples;
    for (int m = 0; m < store.models; ++m) samples.push_back({m, {ShownViews(store.views)[0]}});
    const nn::NoGrad off(*context_);
    const LabelledBatch batch = GatherLabelled(*context_, held_out_, samples);
    const nn::Var scores =
        network_->Forward(nn::Constant(*context_, batch.images), nn::Mode::kEval);
    TILEGRAD_TRY(context_->TakeStatus());
    const std::vector<int> said = MostLikely(scores.value());
    std::vector<ImageU8> cells;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const ImageU8 shown = OnPaper(store.Image(samples[i].model, samples[i].views[0]), store.size);
      cells.push_back(Framed(shown, said[i] == held_out_.labels[i] ? kRight : kWrong));
    }
    return TileImages(cells, kSampleColumns, kFrameGap);
  }

  Result<std::unique_ptr<Model>> LoadModel(nn::Context& context,
                                           const Checkpoint& checkpoint) override {
    TILEGRAD_ASSIGN(auto model, ClassifierModel::Load(context, config_.network, checkpoint));
    return std::unique_ptr<Model>(std::move(model));
  }
  Result<Evaluation> Evaluate(const TaskEvaluation& job, const Workers& workers,
                              const Watch& watch) override {
    return EvaluateClassifier(job, *job.predictor.model().classifier(), workers, watch);
  }
  Result<Showcase> Show(const ShowcaseRequest& request, const Workers& /*workers*/,
                        const Watch& watch) override {
    return ShowClassified(request, *request.predictor.model().classifier(), watch);
  }

 private:
  std::uint64_t seed() const { return static_cast<std::uint64_t>(config_.schedule.seed); }
  LearnedWeights& weights() override { return *weights_; }

  Result<nn::Var> Loss(const UpdateIndex& at, const Slots& slots, StepValues* out) override {
    TILEGRAD_ASSIGN(const LabelledBatch batch,
                    batches_->Take(at, [this](const BatchIndex& of) { return Batch(of); }));
    const nn::Var scores =
        network_->Forward(nn::Constant(*context_, batch.images), nn::Mode::kTrain);
    LossSum sum(out);
    sum.Add("cross_entropy", "Cross entropy of the classes", 1,
            nn::CrossEntropy(scores, batch.labels));
    if (scores.valid())
      sum.Watch("right", "Accuracy on the step's pictures",
                ShareRight(scores.value(), batch.labels));
    out->images = slots.count;
    return sum.total();
  }

  Status CheckDataset() const {
    const std::string folder = dataset_->folder().string();
    std::set<int> classes;
    for (const int m : dataset_->Select(Split::kTrain))
      classes.insert(dataset_->model(m).class_index);
    if (classes.size() < 2)
      return InvalidArgument(
          "{}: its training models are of {} class{}; a classifier needs two or more, as the "
          "sources \"sweethome3d\" and \"thirteen\" of tilegrad dataset have",
          folder, classes.size(), classes.size() == 1 ? "" : "es");
    const std::int64_t least = std::int64_t{1} << (config_.network.levels - 1);
    if (dataset_->info().image_size >= least) return {};
    return InvalidArgument(
        "{}: images are {} pixels a side, but a network of {} levels needs at least {}; set "
        "network.levels lower",
        folder, dataset_->info().image_size, config_.network.levels, least);
  }

  Status LoadPictures(const TaskStart& start) {
    const Workers& workers = start.context.workers();
    TILEGRAD_ASSIGN(train_,
                    LoadLabelled(*dataset_, dataset_->Select(Split::kTrain), workers, start.watch));
    TILEGRAD_ASSIGN(held_out_, LoadLabelled(*dataset_, ChooseModels(*dataset_, kSampleModels),
                                            workers, start.watch));
    return {};
  }

  BatchWork<LabelledBatch> Batch(const BatchIndex& of) {
    const Slots slots = SlotsOf(of.step, config_.batch, of.portion);
    auto batch = order_->Batch(slots, /*views=*/1);
    std::vector<Shift> shifts;
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const auto position = static_cast<std::uint64_t>(slots.first) + i;
      shifts.push_back(RandomShift(seed(), position, static_cast<int>(config_.shift)));
    }
    return LabelledWork(*context_, train_, std::move(batch), std::move(shifts));
  }

  ClassifyConfig config_;
  std::optional<Dataset> dataset_;
  LabelledImages train_, held_out_;
  std::optional<BatchOrder> order_;
  std::optional<ClassifierNetwork> network_;
  std::optional<LearnedWeights> weights_;
  std::optional<NextBatch<LabelledBatch>> batches_;
};

}  // namespace

std::unique_ptr<Task> MakeClassifyTask() { return std::make_unique<ClassifyTask>(); }

}  // namespace tilegrad::train
