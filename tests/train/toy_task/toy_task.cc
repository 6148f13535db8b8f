// SPDX-License-Identifier: Apache-2.0
#include "toy_task.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/rng.h"
#include "nn/nn.h"
#include "scene/shapes.h"
#include "train/losses/loss_sum.h"
#include "train/predictor.h"

namespace tilegrad::train {
namespace {

constexpr int kImageSize = 8;
const std::string kOfBias = "bias.";               // before names of the second optimiser
constexpr std::uint64_t kTestStream = 1ull << 40;  // apart from those of the steps

struct ToyConfig {
  std::int64_t batch = 16;
  double learning_rate = 0.05;
  double decay = 1e-4;
};

using Numbers = std::array<float, 3>;  // a colour in [0, 1], and the size of the box that has it

Numbers RandomBox(Rng& rng) {
  Numbers out;
  for (float& x : out) x = static_cast<float>(rng.Uniform(0.2, 0.9));
  return out;
}

// One colour all over, opaque, planar.
std::vector<std::uint8_t> ImageOf(const Numbers& color) {
  std::vector<std::uint8_t> out;
  for (int c = 0; c < 4; ++c) {
    const float value = c < 3 ? 255 * color[static_cast<std::size_t>(c)] : 255;
    out.insert(out.end(), kImageSize * kImageSize, static_cast<std::uint8_t>(value));
  }
  return out;
}

ImageU8 PictureOf(const Numbers& color) {
  ImageU8 out(kImageSize, kImageSize, 3);
  for (std::size_t i = 0; i < out.pixels.size(); ++i)
    out.pixels[i] = static_cast<std::uint8_t>(255 * std::clamp(color[i % 3], 0.0f, 1.0f));
  return out;
}

Mesh BoxOf(const Numbers& size) { return Box({0, 0, 0}, {size[0], size[1], size[2]}); }

// 3D IoU of two boxes with one centre.
double BoxIou(const Numbers& a, const Numbers& b) {
  double both = 1, volume_a = 1, volume_b = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    both *= std::min(a[i], b[i]);
    volume_a *= a[i];
    volume_b *= b[i];
  }
  return both / (volume_a + volume_b - both);
}

class ToyModel : public Model {
 public:
  ToyModel(nn::Context& context, Rng& rng)
      : layer(context, {.in = 3, .out = 3}, rng), context_(context) {
    parameters_ = 12;
    template_ = BoxOf({0.5f, 0.5f, 0.5f});
  }

  nn::LinearLayer layer;

  Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) override {
    constexpr std::size_t kPlane = kImageSize * kImageSize;
    const nn::NoGrad off(context_);
    for (std::size_t at = 0; at < images.size(); at += 4 * kPlane) {
      Numbers color;
      for (std::size_t c = 0; c < 3; ++c) color[c] = images[at + c * kPlane] / 255.0f;
      const nn::Var size = layer.Forward(
          nn::Constant(context_, context_.From({1, 3}, std::span<const float>(color))),
          nn::Mode::kEval);
      TILEGRAD_TRY(context_.TakeStatus());
      const float* s = std::as_const(size).value().data<float>();
      meshes->push_back(
          BoxOf({std::max(s[0], 0.01f), std::max(s[1], 0.01f), std::max(s[2], 0.01f)}));
    }
    return {};
  }

 private:
  nn::Context& context_;
};

Numbers SizeOf(const Mesh& mesh) {
  const Bounds bounds = MeshBounds(mesh);
  const glm::vec3 size = bounds.high - bounds.low;
  return {size.x, size.y, size.z};
}

class ToyTask : public Task {
 public:
  ConfigFields Fields() override {
    return {{"box.batch", &config_.batch, 1, 4096, "images a step"},
            {"box.learning_rate", &config_.learning_rate, 0, 1, "of both optimisers"},
            {"box.decay", &config_.decay, 0, kNoLimit, "weight of the weights' squares"}};
  }

  Status Start(const TaskStart& start) override {
    context_ = &start.context;
    seed_ = static_cast<std::uint64_t>(start.schedule.seed);
    Rng rng(seed_);
    model_ = std::make_unique<ToyModel>(*context_, rng);
    weight_.emplace(*context_, std::vector<nn::NamedVar>{{"weight", model_->layer.weight}},
                    nn::AdamOptions{.learning_rate = config_.learning_rate});
    bias_.emplace(*context_, std::vector<nn::NamedVar>{{"bias", model_->layer.bias}},
                  nn::AdamOptions{.learning_rate = config_.learning_rate});
    return {};
  }
  int image_size() const override { return kImageSize; }
  RunHeader Header() override {
    RunHeader header;
    header.dataset_source = "random numbers";
    header.parameters = model_->parameters();
    return header;
  }
  Status Begin(const Path& /*run*/, std::int64_t /*first_step*/) override { return {}; }

  int Updates(std::int64_t /*step*/) const override { return 2; }
  Result<nn::StepVector<nn::Gradient>> Backward(const UpdateIndex& at, StepValues* out) override;
  Status Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) override {
    return Moved(at).Step(gradients);
  }

  std::vector<nn::NamedTensor> State() override {
    std::vector<nn::NamedTensor> out = nn::State(model_->layer);
    for (const nn::NamedTensor& t : weight_->State()) out.push_back(t);
    for (const nn::NamedTensor& t : bias_->State()) out.push_back({kOfBias + t.name, t.value});
    return out;
  }
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t /*steps*/) override {
    TILEGRAD_TRY(nn::LoadState(model_->layer, state));
    TILEGRAD_TRY(weight_->LoadState(state));
    std::vector<nn::NamedTensor> of_bias;
    for (const nn::NamedTensor& t : state) {
      if (t.name.starts_with(kOfBias)) of_bias.push_back({t.name.substr(kOfBias.size()), t.value});
    }
    return bias_->LoadState(of_bias);
  }
  Result<ImageU8> SamplePicture(std::int64_t /*steps*/) override {
    Rng rng(seed_, kTestStream);
    const Numbers color = RandomBox(rng);
    std::vector<Mesh> mesh;
    TILEGRAD_TRY(model_->Predict(ImageOf(color), &mesh));
    return PictureOf(SizeOf(mesh[0]));
  }

  Result<std::unique_ptr<Model>> LoadModel(nn::Context& context,
                                           const Checkpoint& checkpoint) override {
    Rng rng(0);
    auto model = std::make_unique<ToyModel>(context, rng);
    TILEGRAD_TRY(nn::LoadState(model->layer, checkpoint.tensors));
    return std::unique_ptr<Model>(std::move(model));
  }
  Result<Evaluation> Evaluate(const TaskEvaluation& job, const Workers& workers,
                              const Watch& watch) override;
  Result<Showcase> Show(const ShowcaseRequest& request, const Workers& workers,
                        const Watch& watch) override;

 private:
  nn::Adam& Moved(const UpdateIndex& at) { return at.update == 0 ? *weight_ : *bias_; }

  ToyConfig config_;
  nn::Context* context_ = nullptr;
  std::uint64_t seed_ = 0;
  std::unique_ptr<ToyModel> model_;
  std::optional<nn::Adam> weight_, bias_;
};

Result<nn::StepVector<nn::Gradient>> ToyTask::Backward(const UpdateIndex& at, StepValues* out) {
  Rng rng(seed_, static_cast<std::uint64_t>(at.step));
  std::vector<float> colors;
  for (std::int64_t i = 0; i < config_.batch; ++i) {
    for (const float x : RandomBox(rng)) colors.push_back(x);
  }
  const nn::Tensor boxes = context_->From({config_.batch, 3}, std::span<const float>(colors));
  const nn::Var predicted = model_->layer.Forward(nn::Constant(*context_, boxes), nn::Mode::kTrain);
  StepValues values;
  LossSum sum(&values);
  sum.Add("size", "Squared error of sizes", 1,
          nn::Mean(nn::Square(predicted - nn::Constant(*context_, boxes))));
  sum.Add("decay", "", config_.decay, nn::Mean(nn::Square(model_->layer.weight)));
  auto gradients = nn::Gradients(sum.total(), Moved(at).parameters());
  TILEGRAD_TRY(context_->TakeStatus());
  if (!std::isfinite(values.loss) || !nn::IsFinite(*context_, gradients))
    return InternalError("the loss is {}", values.loss);
  if (at.update > 0) return gradients;
  *out = values;
  out->images = config_.batch;
  return gradients;
}

Result<Evaluation> ToyTask::Evaluate(const TaskEvaluation& job, const Workers& /*workers*/,
                                     const Watch& watch) {
  Evaluation out;
  out.predictor = job.predictor.description();
  out.split = "test";
  out.dataset_source = "random numbers";
  out.views_per_model = 1;
  out.classes = {"box"};
  out.class_models = {10};
  Rng rng(0, kTestStream);
  double untrained = 0, predicted = 0;
  for (int i = 0; i < out.class_models[0]; ++i) {
    if (watch.stopped()) return Cancelled("stopped while evaluating; nothing was written");
    const Numbers box = RandomBox(rng);
    TILEGRAD_ASSIGN(const auto meshes, job.predictor.Predict(ImageOf(box)));
    untrained += BoxIou(SizeOf(job.predictor.template_mesh()), box) / out.class_models[0];
    const double iou = BoxIou(SizeOf(meshes[0]), box);
    predicted += iou / out.class_models[0];
    out.models.push_back({"box", fmt::format("{}", i), {iou, {}}});
  }
  out.rows = {{"untrained box", {{untrained, {}}}, {untrained, {}}},
              {"toy", {{predicted, {}}}, {predicted, {}}}};
  return out;
}

Result<Showcase> ToyTask::Show(const ShowcaseRequest& request, const Workers& /*workers*/,
                               const Watch& watch) {
  Showcase out;
  out.purpose = "to tell the size of a box by its colour";
  out.data = "It saw random colours.";
  out.note = "Red, green and blue are width, height and depth.";
  out.credits = {"nobody"};
  Rng rng(0, kTestStream);
  for (int i = 0; i < request.examples; ++i) {
    if (watch.stopped()) return Cancelled("stopped while predicting; nothing was written");
    const Numbers box = RandomBox(rng);
    TILEGRAD_ASSIGN(auto meshes, request.predictor.Predict(ImageOf(box)));
    Example& example = out.examples.emplace_back();
    example.name = fmt::format("box {}", i);
    example.class_name = "box";
    example.id = fmt::format("{}", i);
    example.pictures = {{PictureOf(box), "seen", "a colour"},
                        {PictureOf(SizeOf(meshes[0])), "predicted", "its size as a colour"}};
    example.prediction = std::move(meshes[0]);
    example.truth = BoxOf(box);
  }
  return out;
}

}  // namespace

std::unique_ptr<Task> MakeToyTask() { return std::make_unique<ToyTask>(); }

}  // namespace tilegrad::train
