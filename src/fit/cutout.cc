// SPDX-License-Identifier: Apache-2.0
#include "fit/cutout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "base/error.h"
#include "fit/hull/mask_distance.h"
#include "fit/texture_fill.h"
#include "nn/context.h"
#include "nn/optim.h"
#include "render/picture/layers.h"
#include "render/picture/mesh_scene.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kCutoutPixels = 2'000'000;  // of all views together that alpha is fitted by

bool MayHaveCutout(const FitConfig& config) {
  return config.material == MaterialKind::kUnlit && config.lighting == Lighting::kNone &&
         !config.vertex_colors && config.loss.silhouette_weight > 0;
}

// Whether the fit has a texture, as far as its start tells; those without a mesh get one.
bool HasTexture(const FitJob& job) {
  const ParameterSet& set = job.config.parameters;
  return !job.start.has_value() || !job.start->textures.empty() || set[Parameter::kTexture] ||
         set[Parameter::kUv];
}

std::span<const float> MaskOf(const TargetImages& images, int view) {
  return std::span(images.alpha)
      .subspan(static_cast<std::size_t>(view) * images.pixels(), images.pixels());
}

// Texels that no view shows are as those around them.
void FillUnseen(const std::vector<bool>& seen, FitScene* scene) {
  FitScene grey = *scene;
  for (std::size_t i = 0; i < grey.texture.pixels.size(); ++i)
    grey.texture.pixels[i] = scene->cutout[i / 3];
  FillUnseenTexels(seen, &grey);
  for (std::size_t t = 0; t < scene->cutout.size(); ++t)
    scene->cutout[t] = grey.texture.pixels[3 * t];
}

}  // namespace

Status CheckCutout(const FitJob& job) {
  if (job.config.cutout != Cutout::kOn) return {};
  if (!MayHaveCutout(job.config)) {
    return InvalidArgument(
        "a cut-out texture takes masks, a texture and unlit colours: leave out --cutout on");
  }
  if (HasTexture(job)) return {};
  return InvalidArgument(
      "a cut-out texture takes a texture, which the mesh to start from lacks: add \"texture\" to "
      "--optimize, or leave out --cutout on");
}

std::optional<FitJob> CutoutJob(const FitJob& job, const Workers& workers) {
  const bool automatic = job.config.cutout == Cutout::kAuto;
  if (job.config.cutout == Cutout::kOff || !MayHaveCutout(job.config)) return std::nullopt;
  if (automatic && !MayStartFromHull(job)) return std::nullopt;
  ClosedMasks closed = CloseMasks(job.input.images, workers);
  if (automatic && closed.gaps < kCutoutGaps) return std::nullopt;
  FitJob out = job;
  out.input.images.silhouette = std::move(closed.alpha);
  return out;
}

Status FitCutout(const FitJob& job, const Workers& workers, const Watch& watch, FitScene* scene) {
  if (scene->texture.empty()) return {};
  const TargetImages& images = job.input.images;
  const std::vector<int>& views = job.input.training;
  const std::size_t stride = images.pixels() * views.size() / kCutoutPixels + 1;
  TILEGRAD_ASSIGN(const std::vector<SeenThrough> seen,
                  SeeThrough(*scene, views, {images.width, images.height},
                             static_cast<std::uint32_t>(stride), workers));
  std::vector<std::span<const float>> masks;
  for (const int view : views) masks.push_back(MaskOf(images, view));
  TILEGRAD_ASSIGN(TexelAlpha fitted,
                  FitTexelAlpha(seen, masks, scene->texture.pixels.size() / 3, workers, watch));
  scene->cutout = std::move(fitted.alpha);
  FillUnseen(fitted.seen, scene);
  return {};
}

namespace {

// The mask whose outline is `by` pixels outside of that which `distance` is from.
std::vector<float> Moved(const MaskDistance& distance, float by) {
  std::vector<float> out(distance.values.size());
  std::ranges::transform(distance.values, out.begin(),
                         [by](float d) { return std::clamp(d + by + 0.5f, 0.0f, 1.0f); });
  return out;
}

double Sum(std::span<const float> values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace

ClosedMasks CloseMasks(const TargetImages& images, const Workers& workers) {
  ClosedMasks out{images.alpha, 0};
  const std::size_t plane = images.pixels(), views = images.alpha.size() / plane;
  const double area = Sum(images.alpha);
  const auto radius =
      static_cast<float>(kClosedShare * std::sqrt(area / static_cast<double>(views)));
  workers.For(views, [&](std::size_t v, std::size_t) {
    const auto alpha = std::span(out.alpha).subspan(v * plane, plane);
    const std::vector<float> wide = Moved(DistanceOf(alpha, images.width, images.height), radius);
    const std::vector<float> closed = Moved(DistanceOf(wide, images.width, images.height), -radius);
    for (std::size_t p = 0; p < plane; ++p) alpha[p] = std::max(alpha[p], closed[p]);
  });
  if (area > 0) out.gaps = Sum(out.alpha) / area - 1;
  return out;
}

namespace {

// One axis of a bilinear lookup in a texture that repeats.
struct Axis {
  std::uint32_t low, high;
  float weight;  // of `high`

  Axis(float at, int count) {
    const float cell = std::floor(at);
    weight = at - cell;
    const int i = (static_cast<int>(cell) % count + count) % count;
    low = static_cast<std::uint32_t>(i);
    high = static_cast<std::uint32_t>(i + 1 < count ? i + 1 : 0);
  }
};

TexelFootprint FootprintAt(float u, float v, ImageSize texture) {
  const auto width = static_cast<std::uint32_t>(texture.width);
  const Axis x(u * static_cast<float>(texture.width) - 0.5f, texture.width);
  const Axis y((1 - v) * static_cast<float>(texture.height) - 0.5f, texture.height);
  return {{y.low * width + x.low, y.low * width + x.high, y.high * width + x.low,
           y.high * width + x.high},
          {(1 - x.weight) * (1 - y.weight), x.weight * (1 - y.weight), (1 - x.weight) * y.weight,
           x.weight * y.weight}};
}

// A surface that hides nothing, so that all its layers are drawn.
Mesh ClearMesh(const FitScene& scene) {
  Mesh mesh = MeshOfScene(scene);
  mesh.textures[0].image = ImageU8(1, 1, 4, 0);
  mesh.materials[0].alpha_mode = AlphaMode::kBlend;
  return mesh;
}

struct Layer {
  std::uint32_t pixel;
  TexelFootprint at;
};

// From layer by layer to pixel by pixel.
SeenThrough Sorted(std::vector<Layer> found) {
  std::ranges::stable_sort(found, {}, &Layer::pixel);
  SeenThrough out;
  for (const Layer& layer : found) {
    if (out.pixels.empty() || out.pixels.back() != layer.pixel) {
      out.pixels.push_back(layer.pixel);
      out.first.push_back(static_cast<std::uint32_t>(out.layers.size()));
    }
    out.layers.push_back(layer.at);
  }
  out.first.push_back(static_cast<std::uint32_t>(out.layers.size()));
  return out;
}

}  // namespace

Result<std::vector<SeenThrough>> SeeThrough(const FitScene& scene, std::span<const int> views,
                                            ImageSize size, std::uint32_t stride,
                                            const Workers& workers) {
  const Mesh mesh = ClearMesh(scene);
  const MeshScene clear(mesh, {.color_space = ColorSpace::kSrgb});
  const ImageSize texture{scene.texture.width, scene.texture.height};
  const std::size_t pixels =
      static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
  RenderOptions options;
  options.width = size.width;
  options.height = size.height;
  Outputs outputs;
  outputs.color = outputs.alpha = outputs.attributes = false;
  outputs.uv = true;
  LayerRenderer renderer(workers);
  std::vector<SeenThrough> out;
  for (const int view : views) {
    Scene seen = clear.scene();
    seen.camera = scene.cameras[static_cast<std::size_t>(view)];
    std::vector<Layer> found;
    std::vector<std::uint8_t> count(pixels, 0);
    const auto take = [&](const Images& layer, std::size_t at, float /*cover*/) {
      if ((at + static_cast<std::size_t>(view)) % stride != 0) return true;
      found.push_back({static_cast<std::uint32_t>(at),
                       FootprintAt(layer.uv[at], layer.uv[pixels + at], texture)});
      return ++count[at] >= kMostLayersSeen;
    };
    TILEGRAD_TRY(renderer.Render(seen, *clear.cover(), options, outputs, take));
    out.push_back(Sorted(std::move(found)));
  }
  return out;
}

namespace {

constexpr int kSteps = 200;
constexpr double kRate = 0.1;                              // of Adam
constexpr double kFirstSharpness = 1, kLastSharpness = 8;  // of alpha = sigmoid(sharpness x)
constexpr float kStart = 0.5f;     // x of what no pixel tells about: it stays
constexpr float kFront = 0.2f;     // weight of: the foremost layer covers
constexpr float kLeast = 1e-3f;    // of what gradients divide by
constexpr std::size_t kParts = 8;  // that gradients are summed in, whatever the number of workers
constexpr std::size_t kGrain = 1 << 16;

// dL/d(alpha) of the texels of one view, added to `gradient`.
void AddGradient(const SeenThrough& seen, std::span<const float> mask,
                 const std::vector<float>& alpha, std::vector<float>* gradient) {
  std::array<float, kMostLayersSeen> clear;
  for (std::size_t i = 0; i < seen.pixels.size(); ++i) {
    const std::uint32_t first = seen.first[i], count = seen.first[i + 1] - first;
    float through = 1;
    for (std::uint32_t k = 0; k < count; ++k) {
      clear[k] = std::max(kLeast, 1 - seen.layers[first + k].Of(alpha));
      through *= clear[k];
    }
    const float inside = mask[seen.pixels[i]];
    const float common = 1 - inside - inside * through / std::max(kLeast, 1 - through);
    for (std::uint32_t k = 0; k < count; ++k) {
      const TexelFootprint& at = seen.layers[first + k];
      float d = common / clear[k];
      if (k == 0) d -= kFront * inside / std::max(kLeast, 1 - clear[k]);
      for (std::size_t j = 0; j < 4; ++j) (*gradient)[at.texels[j]] += at.weights[j] * d;
    }
  }
}

class AlphaFit {
 public:
  AlphaFit(std::span<const SeenThrough> seen, std::span<const std::span<const float>> masks,
           std::size_t texels, const Workers& workers)
      : seen_(seen),
        masks_(masks),
        workers_(workers),
        context_(workers),
        numbers_(nn::Parameter(
            context_, context_.From({static_cast<std::int64_t>(texels)},
                                    std::span<const float>(std::vector<float>(texels, kStart))))),
        adam_(context_, {{"alpha", numbers_}}, {.learning_rate = kRate}),
        alpha_(texels),
        parts_(kParts, std::vector<float>(texels)) {}

  Result<TexelAlpha> Run(const Watch& watch) {
    for (int step = 0; step < kSteps; ++step) {
      TILEGRAD_TRY(watch.At({"fitting the cut-out", static_cast<std::uint64_t>(step), kSteps, ""}));
      const double time = static_cast<double>(step) / (kSteps - 1);
      TILEGRAD_TRY(Step(nn::Geometric(kFirstSharpness, kLastSharpness, time)));
    }
    SetAlpha(static_cast<float>(kLastSharpness));
    return TexelAlpha{alpha_, Seen()};
  }

 private:
  void SetAlpha(float sharpness) {
    const auto x = numbers_.value().span<float>();
    workers_.ForRanges(x.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t t = begin; t < end; ++t) alpha_[t] = 1 / (1 + std::exp(-sharpness * x[t]));
    });
  }

  Status Step(double sharpness) {
    const auto sharp = static_cast<float>(sharpness);
    SetAlpha(sharp);
    workers_.For(kParts, [&](std::size_t part, std::size_t) {
      std::ranges::fill(parts_[part], 0.0f);
      for (std::size_t v = part; v < seen_.size(); v += kParts)
        AddGradient(seen_[v], masks_[v], alpha_, &parts_[part]);
    });
    nn::Tensor gradient = context_.Empty(numbers_.value().shape(), nn::DType::kF32);
    float* const d = gradient.data<float>();
    workers_.ForRanges(alpha_.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t t = begin; t < end; ++t) {
        float sum = 0;
        for (const std::vector<float>& part : parts_) sum += part[t];
        d[t] = sum * sharp * alpha_[t] * (1 - alpha_[t]);
      }
    });
    const nn::Var step = nn::Constant(context_, gradient);
    return adam_.Step(std::span<const nn::Var>(&step, 1));
  }

  std::vector<bool> Seen() const {
    std::vector<bool> out(alpha_.size(), false);
    for (const SeenThrough& view : seen_) {
      for (const TexelFootprint& at : view.layers) {
        for (const std::uint32_t texel : at.texels) out[texel] = true;
      }
    }
    return out;
  }

  const std::span<const SeenThrough> seen_;
  const std::span<const std::span<const float>> masks_;
  const Workers& workers_;
  nn::Context context_;
  const nn::Var numbers_;  // x of each texel
  nn::Adam adam_;
  std::vector<float> alpha_;
  std::vector<std::vector<float>> parts_;
};

}  // namespace

Result<TexelAlpha> FitTexelAlpha(std::span<const SeenThrough> seen,
                                 std::span<const std::span<const float>> masks, std::size_t texels,
                                 const Workers& workers, const Watch& watch) {
  return AlphaFit(seen, masks, texels, workers).Run(watch);
}

CutoutView::CutoutView(const FitScene& scene, const Workers& workers)
    : mesh_(MeshOfScene(scene)),
      scene_(mesh_, {.color_space = ColorSpace::kSrgb, .filter = scene.filter}),
      renderer_(workers) {}

Result<Picture> CutoutView::Draw(const Camera& camera, ImageSize size, int samples) {
  Scene scene = scene_.scene();
  scene.camera = camera;
  PictureRequest request;
  request.width = size.width;
  request.height = size.height;
  request.supersampling = samples;
  request.cover = scene_.cover();
  Picture out;
  TILEGRAD_TRY(renderer_.Render(scene, request, &out));
  return out;
}

}  // namespace tilegrad::train
