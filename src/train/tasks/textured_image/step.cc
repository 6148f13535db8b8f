// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/step.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "nn/nn.h"
#include "train/losses/l1.h"
#include "train/models/camera_ops.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {
namespace {

// A row for each image: that of the input whose view it shows.
nn::Tensor InputsOfImages(nn::Context& context, std::size_t images) {
  std::vector<std::int32_t> inputs(images);
  for (std::size_t n = 0; n < images; ++n) inputs[n] = static_cast<std::int32_t>(InputOfImage(n));
  return context.Indices(inputs);
}

// [images, 1, 1, 1]: `own` where an image is the view that its mesh was predicted from, else 1.
nn::Var ViewWeights(nn::Context& context, std::int64_t images, double own) {
  std::vector<double> weights(static_cast<std::size_t>(images), 1.0);
  for (std::size_t n = 0; n < weights.size(); n += kViewsOfObject) weights[n] = own;
  return nn::Constant(context, context.From({images, 1, 1, 1}, std::span<const double>(weights)));
}

template <std::size_t N>
void ReadRow(const nn::Var& rows, std::size_t row, std::array<float, N>* out) {
  if (!rows.valid()) return;
  nn::WithFloatType(rows.dtype(), [&]<class T>(T) {
    const std::span<const T> numbers = rows.value().template span<T>().subspan(row * N, N);
    std::ranges::transform(numbers, out->begin(), [](T x) { return static_cast<float>(x); });
  });
}

template <class T>
void Copy(std::span<const float> from, T* to) {
  std::transform(from.begin(), from.end(), to, [](float x) { return static_cast<T>(x); });
}

// View `m` of the batch, [4][size][size], to where it is seen.
template <class T>
void Place(std::span<const float> rgba, std::size_t m, TexturedBatch* batch) {
  const std::size_t plane = rgba.size() / 4;
  Copy(rgba, batch->input.data<T>() + m * rgba.size());
  for (const std::size_t n : {2 * m, 2 * (m ^ 1) + 1}) {
    Copy(rgba.first(3 * plane), batch->truth_colors.data<T>() + n * 3 * plane);
    Copy(rgba.subspan(3 * plane), batch->truth_alpha.data<T>() + n * plane);
    batch->cameras[n] = batch->views[m].camera;
  }
}

// A batch under construction.
struct Rendering {
  TexturedStream& stream;
  std::vector<Sample> models;
  std::uint64_t first;
  TexturedBatch batch;
  std::vector<Status> failures = std::vector<Status>(models.size());

  void Run(std::size_t b, std::size_t lane) {
    const auto rgba =
        stream.Render(models[b].model, first + b, lane, std::span(batch.views).subspan(2 * b, 2));
    failures[b] = rgba.status();
    if (!rgba.ok()) return;
    const std::size_t image = rgba->size() / 2;
    nn::WithFloatType(batch.input.dtype(), [&]<class T>(T) {
      Place<T>(rgba->first(image), 2 * b, &batch);
      Place<T>(rgba->subspan(image), 2 * b + 1, &batch);
    });
  }
  Result<TexturedBatch> Finish() {
    for (const Status& failure : failures) TILEGRAD_TRY(failure);
    batch.stream_seconds = stream.TakeSeconds();
    return std::move(batch);
  }
};

// The image of input m's view with the prediction from the object's other input: see TexturedBatch.
constexpr std::size_t ImageFromOther(std::size_t m) { return 2 * (m ^ 1) + 1; }
static_assert(InputOfImage(ImageFromOther(6)) == 6 && InputOfImage(ImageFromOther(7)) == 7);

template <class T>
struct TargetRow {
  const T* said;
  T* out;
  std::size_t numbers;  // 3: a direction, 9: harmonics
};

template <class T>
void Write(const FoundLight& found, const TargetRow<T>& row) {
  const auto& d = found.direction;
  if (d == std::array<double, 3>{}) {
    std::copy_n(row.said, row.numbers, row.out);
  } else if (row.numbers == 3) {
    std::ranges::transform(d, row.out, [](double x) { return static_cast<T>(x); });
  } else {
    const auto sh = SkyAndLight(
        found.sky, {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])});
    std::ranges::transform(sh, row.out, [](float x) { return static_cast<T>(x); });
  }
}

}  // namespace

double AngleBetween(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  double dot = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    dot += double{a[i]} * b[i];
    aa += double{a[i]} * a[i];
    bb += double{b[i]} * b[i];
  }
  return std::acos(std::clamp(dot / std::sqrt(aa * bb), -1.0, 1.0)) * 180 / std::numbers::pi;
}

DrawnLight LightOf(const Prediction& objects, std::size_t row) {
  DrawnLight light;
  ReadRow(objects.directions, row, &light.direction);
  ReadRow(objects.sh, row, &light.sh);
  std::array<float, 1> shininess = {light.shininess};
  ReadRow(objects.shininess, row, &shininess);
  light.shininess = shininess[0];
  return light;
}

std::array<float, 3> DirectionOf(const DrawnLight& light, Lighting lighting) {
  return lighting == Lighting::kSphericalHarmonics ? DirectionOf(light.sh) : light.direction;
}

TexturedStep::TexturedStep(nn::Context& context, const TexturedImageConfig& config, int image_size)
    : context_(context),
      config_(config),
      image_size_(image_size),
      network_(context, NetworkOf(config), LightHeadOf(config.light), image_size,
               static_cast<std::uint64_t>(config.schedule.seed)),
      weights_(context, network_.module(), config.optimizer, config.schedule.steps),
      renderer_(context),
      light_targets_(context, config.light),
      rival_renderer_(context) {}

RenderJob TexturedStep::JobAt(const TexturedBatch& batch, std::int64_t step) const {
  const double sharpness = SharpnessAt(config_.render, config_.schedule.steps, step);
  RenderJob job = network_.sphere().Job(OptionsOf(config_.render, sharpness, image_size_));
  job.cameras = batch.cameras;
  job.views = kViewsOfObject;
  job.shading = {.lighting = LightingOf(config_.light), .two_sided = true, .clamp = true};
  job.surface = SurfaceUnder(config_.light);
  return job;
}

// Colours of faces differ from image to image with their light, so each image has a mesh of its
// own.
RenderedImages TexturedStep::DrawN3mr(const Prediction& objects, const nn::Var& directions,
                                      const TexturedBatch& batch) {
  std::vector<std::int32_t> of_image;
  for (std::size_t n = 0; n < batch.cameras.size(); ++n)
    of_image.push_back(static_cast<std::int32_t>(n / kViewsOfObject));
  const nn::Tensor meshes = context_.Indices(of_image);
  const nn::Var positions = nn::Gather(objects.positions, 0, meshes);
  nn::Var cubes = nn::Gather(network_.cubes().Cubes(objects.textures), 0, meshes);
  if (directions.valid())
    cubes = cubes *
            FaceLight(positions, network_.sphere().mesh().faces, directions, config_.light.ambient);
  RivalJob job{.faces = network_.sphere().faces(),
               .cameras = batch.cameras,
               .size = image_size_,
               .options = {.rule = rivals::Rule::kN3mr}};
  return RenderTextured(rival_renderer_.Here(), positions, cubes, std::move(job));
}

TexturedRenders TexturedStep::Draw(const TexturedBatch& batch, std::int64_t step) {
  TexturedRenders out;
  out.objects = network_.Forward(nn::Constant(context_, batch.input), nn::Mode::kTrain);
  SceneVars scenes{.positions = out.objects.positions, .textures = out.objects.textures};
  const nn::Tensor inputs = InputsOfImages(context_, batch.cameras.size());
  const auto seen = [&](const nn::Var& light) { return nn::Gather(light, 0, inputs); };
  if (out.objects.directions.valid())
    scenes.light_directions = DirectionsToWorld(seen(out.objects.directions), batch.cameras);
  if (out.objects.shininess.valid()) scenes.shininess = seen(out.objects.shininess);
  if (out.objects.sh.valid()) scenes.sh = HarmonicsToWorld(seen(out.objects.sh), batch.cameras);
  if (IsN3mr(config_)) {
    out.images = DrawN3mr(out.objects, scenes.light_directions, batch);
    return out;
  }
  out.images = RenderScenes(renderer_.Here(), scenes, JobAt(batch, step));
  return out;
}

double TexturedStep::ShareOfRun(std::int64_t step) const {
  return static_cast<double>(step) / static_cast<double>(config_.schedule.steps);
}

// The truth is over black, so cover times colour is what a prediction with the true outline would
// look like.
nn::Var TexturedStep::Covered(const nn::Var& colors, const TexturedBatch& batch) const {
  if (!config_.color.masked) return colors;
  const nn::Shape& shape = batch.truth_alpha.shape();
  return colors *
         nn::Reshape(nn::Constant(context_, batch.truth_alpha), {shape[0], 1, shape[1], shape[2]});
}

// Uses the views that textures were not predicted from: these need it most, and half as many
// pictures cost half as much.
void TexturedStep::AddAdversary(const RenderedImages& images, const TexturedBatch& batch,
                                LossSum* sum) const {
  std::vector<std::int32_t> others;
  for (std::size_t n = 1; n < batch.cameras.size(); n += kViewsOfObject)
    others.push_back(static_cast<std::int32_t>(n));
  const nn::Tensor which = context_.Indices(others);
  const nn::Var truth = nn::Gather(nn::Constant(context_, batch.truth_colors), 0, which);
  adversary_->AddLosses(
      {nn::Gather(Covered(images.colors, batch), 0, which), truth.value(), batch.portion}, sum);
}

nn::Var TexturedStep::ColorLoss(const RenderedImages& images, const TexturedBatch& batch,
                                std::int64_t step) const {
  nn::Var predicted = Covered(images.colors, batch);
  nn::Tensor truth = batch.truth_colors;
  if (config_.color.own != 1) {
    const nn::Var weights = ViewWeights(context_, truth.shape()[0], config_.color.own);
    predicted = weights * predicted;
    truth = (weights * nn::Constant(context_, truth)).value();
  }
  const ColorRule& rule = config_.color;
  if (rule.soft > 0 && ShareOfRun(step) < rule.soft_until)
    return ColorHuberLoss(predicted, truth, rule.soft);
  return ColorL1Loss(predicted, truth);
}

nn::Var TexturedStep::PoseLoss(const nn::Var& pose, const TexturedBatch& batch) const {
  nn::Tensor truth = context_.Empty(pose.shape(), pose.dtype());
  nn::WithFloatType(truth.dtype(), [&]<class T>(T) {
    for (std::size_t m = 0; m < batch.views.size(); ++m) {
      const Pose want = PoseOf(batch.views[m].camera, image_size_);
      std::ranges::transform(want, truth.data<T>() + m * want.size(),
                             [](double x) { return static_cast<T>(x); });
    }
  });
  return nn::Mean(nn::Square(pose - nn::Constant(context_, std::move(truth))));
}

nn::Var TexturedStep::LightLoss(const Prediction& objects, const TexturedBatch& batch) {
  nn::Tensor targets = light_targets_.Find(objects, batch, JobAt(batch, config_.schedule.steps));
  if (targets.empty()) return nn::Invalid({&objects.positions});
  return nn::Mean(
      nn::Square(PredictedLights(objects) - nn::Constant(context_, std::move(targets))));
}

// Degrees, mean over the inputs.
double TexturedStep::LightAngle(const Prediction& objects, const TexturedBatch& batch) const {
  const Lighting lighting = LightingOf(config_.light);
  double mean = 0;
  for (std::size_t m = 0; m < batch.views.size(); ++m)
    mean += AngleBetween(DirectionOf(LightOf(objects, m), lighting),
                         DirectionOf(batch.views[m].light, lighting)) /
            static_cast<double>(batch.views.size());
  return mean;
}

nn::Var TexturedStep::Loss(const TexturedRenders& renders, const TexturedBatch& batch,
                           std::int64_t step, StepValues* values) {
  const Prediction& objects = renders.objects;
  if (!objects.positions.valid()) return objects.positions;
  const bool colored = ShareOfRun(step) >= config_.color.from;
  LossSum sum(values);
  AddIou(config_.loss.iou, renders.images.alpha, batch.truth_alpha, &sum);
  AddColor(colored ? config_.loss.color : 0, ColorLoss(renders.images, batch, step), &sum);
  const SphereModel& sphere = network_.sphere();
  AddRegularizers(config_.loss,
                  {sphere.mesh().faces, sphere.topology(), objects.positions, objects.movement},
                  &sum);
  if (objects.pose.valid())
    sum.Add("pose", "Camera (mean square error of its numbers)", config_.color.pose,
            PoseLoss(objects.pose, batch));
  const bool lit = LightingOf(config_.light) != Lighting::kNone;
  if (lit && colored && config_.color.light > 0)
    sum.Add("light", "Light (mean square distance to the best-fitting one)", config_.color.light,
            LightLoss(objects, batch));
  if (adversary_ != nullptr) AddAdversary(renders.images, batch, &sum);
  if (lit)
    sum.Watch("light_angle", "Angle of the light (degrees, not part of the loss)",
              LightAngle(objects, batch));
  return sum.total();
}

BatchWork<TexturedBatch> RenderWork(nn::Context& context, TexturedStream& stream, int size,
                                    std::vector<Sample> models, std::int64_t first) {
  const std::size_t objects = models.size(), inputs = kViewsOfObject * objects, images = 2 * inputs;
  const auto m = static_cast<std::int64_t>(inputs), n = static_cast<std::int64_t>(images);
  TexturedBatch batch{context.Empty({m, 4, size, size}), context.Empty({n, 3, size, size}),
                      context.Empty({n, size, size}), std::vector<Camera>(images),
                      std::vector<TexturedView>(inputs)};
  const auto work = std::make_shared<Rendering>(
      Rendering{stream, std::move(models), static_cast<std::uint64_t>(first), std::move(batch)});
  return {objects, [work](std::size_t b, std::size_t lane) { work->Run(b, lane); },
          [work] { return work->Finish(); }};
}

Result<TexturedBatch> RenderBatch(nn::Context& context, TexturedStream& stream, int size,
                                  const std::vector<Sample>& models, std::int64_t first) {
  return MakeNow(RenderWork(context, stream, size, models, first), context);
}

LightTargets::LightTargets(nn::Context& context, const LightConfig& config)
    : context_(context), search_(config), renderer_(context) {}

nn::Tensor LightTargets::Find(const Prediction& objects, const TexturedBatch& batch,
                              RenderJob job) {
  job.shading.lighting = Lighting::kNone;
  job.normals = true;
  const std::size_t size = static_cast<std::size_t>(job.options.width), pixels = size * size;
  const SceneVars scenes{.positions = nn::Constant(context_, objects.positions.value()),
                         .textures = nn::Constant(context_, objects.textures.value())};
  SceneRenderer& renderer = renderer_.Here();
  if (!RenderScenes(renderer, scenes, std::move(job)).colors.valid()) return {};
  const nn::Tensor said = PredictedLights(objects).value();
  nn::Tensor out = context_.Empty(said.shape(), said.dtype());
  nn::WithFloatType(out.dtype(), [&]<class T>(T) {
    const ImagesT<T>& drawn = FrameOf(renderer, T{}).images();
    const std::span<const T> picture = batch.truth_colors.template span<T>();
    const std::span<const T> cover = batch.truth_alpha.template span<T>();
    context_.workers().For(batch.views.size(), [&](std::size_t m, std::size_t) {
      const std::size_t n = ImageFromOther(m);
      const auto planes = [&](std::span<const T> images) {
        return images.subspan(3 * n * pixels, 3 * pixels);
      };
      const FoundLight found = search_.Find<T>({planes(drawn.color), planes(drawn.normals),
                                                planes(picture), cover.subspan(n * pixels, pixels)},
                                               batch.cameras[n].rotation);
      const auto numbers = static_cast<std::size_t>(said.shape()[1]);
      Write<T>(found, {said.data<T>() + numbers * m, out.data<T>() + numbers * m, numbers});
    });
  });
  return out;
}

}  // namespace tilegrad::train
