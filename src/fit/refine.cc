// SPDX-License-Identifier: Apache-2.0
#include "fit/refine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/vec3.hpp>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.h"
#include "fit/fitter.h"
#include "fit/image_loss.h"
#include "fit/input.h"
#include "fit/scene.h"
#include "fit/score.h"
#include "nn/optim.h"
#include "scene/camera_conventions.h"
#include "scene/shapes.h"
#include "train/data/batches.h"
#include "train/data/dataset.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train {
namespace {

constexpr int kAzimuths = 24;
constexpr std::array kElevations = {-5.0, 12.0, 27.0, 42.0, 60.0};  // degrees
constexpr int kAlignments = 3;  // a move changes perspective, and with it the outline
constexpr float kInsideAlpha = 0.5f;

// The middle and the longer side of what a mask covers, pixels.
struct Extent {
  float x = 0, y = 0, side = 0;
};

template <class Covers>  // bool(std::size_t pixel)
std::optional<Extent> ExtentOf(const TargetImages& size, const Covers& covers) {
  int left = size.width, right = -1, top = size.height, bottom = -1;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (!covers(static_cast<std::size_t>(y * size.width + x))) continue;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  if (right < left) return std::nullopt;
  const int side = std::max(right - left, bottom - top) + 1;
  return Extent{0.5f * static_cast<float>(left + right + 1),
                0.5f * static_cast<float>(top + bottom + 1), static_cast<float>(side)};
}

// Brings what covers `seen` to `wanted`, by the rule of a camera that is far from a flat object.
void Align(const Extent& seen, const Extent& wanted, Camera* camera) {
  float* const t = camera->translation;
  const float depth = -t[2] * seen.side / wanted.side;
  // A point on the optical axis' plane at that depth moves by fx / depth pixels a unit; the middle
  // stays where it is in the world.
  const float x = (seen.x - camera->cx) * -t[2] / camera->fx;
  const float y = (seen.y - camera->cy) * -t[2] / camera->fy;
  t[0] += (wanted.x - camera->cx) * depth / camera->fx - x;
  t[1] -= (wanted.y - camera->cy) * depth / camera->fy - y;
  t[2] = -depth;
}

class CameraFinder {
 public:
  CameraFinder(const FitScene& scene, const TargetImages& picture, const CameraRule& rule,
               const Workers& workers)
      : scene_(scene), picture_(picture), rule_(rule), renderer_(workers) {}

  Result<std::vector<FoundCamera>> Run() {
    const auto wanted =
        ExtentOf(picture_, [&](std::size_t p) { return picture_.alpha[p] >= kInsideAlpha; });
    if (!wanted) {
      return InvalidArgument("the picture shows no object: at {} x {}, no pixel is opaque",
                             picture_.width, picture_.height);
    }
    Start();
    for (int i = 0; i < kAlignments; ++i) {
      TILEGRAD_TRY(Render());
      ForEachImage([&](std::size_t n, std::span<const std::int32_t> ids) {
        const auto seen = ExtentOf(picture_, [&](std::size_t p) { return ids[p] >= 0; });
        if (seen) Align(*seen, *wanted, &scene_.cameras[n]);
      });
    }
    TILEGRAD_TRY(Render());
    ForEachImage([&](std::size_t n, std::span<const std::int32_t> ids) { Score(n, ids); });
    std::ranges::stable_sort(found_, {}, &FoundCamera::cost);
    return std::move(found_);
  }

 private:
  void Start() {
    Lens lens = rule_.lens;
    lens.width = picture_.width;
    lens.height = picture_.height;
    scene_.cameras.clear();
    for (const double elevation : kElevations) {
      for (int i = 0; i < kAzimuths; ++i) {
        const double azimuth = 360.0 * i / kAzimuths;
        found_.push_back({.azimuth = azimuth, .elevation = elevation});
        scene_.cameras.push_back(OrbitCamera(lens, azimuth, elevation, rule_.distance));
      }
    }
    views_.resize(found_.size());
    std::iota(views_.begin(), views_.end(), 0);
  }

  Status Render() {
    FitRenderer::Job job;
    job.views = views_;
    job.alpha = false;
    job.options.width = picture_.width;
    job.options.height = picture_.height;
    return renderer_.Render(scene_, job);
  }

  template <class Visit>
  void ForEachImage(const Visit& visit) {
    const std::size_t pixels = picture_.pixels();
    for (std::size_t n = 0; n < found_.size(); ++n) {
      visit(n, renderer_.images().face_ids.subspan(n * pixels, pixels));
    }
  }

  void Score(std::size_t n, std::span<const std::int32_t> ids) {
    const std::size_t pixels = picture_.pixels();
    const float* const color = renderer_.images().color.data() + 3 * n * pixels;
    double both = 0, either = 0, gap = 0;
    for (std::size_t p = 0; p < pixels; ++p) {
      const auto alpha = static_cast<double>(picture_.alpha[p]);
      either += ids[p] >= 0 ? 1 : alpha;
      if (ids[p] < 0) continue;
      both += alpha;
      for (std::size_t c = 0; c < 3; ++c) {
        gap +=
            alpha *
            std::abs(static_cast<double>(color[c * pixels + p] - picture_.color[c * pixels + p]));
      }
    }
    found_[n].camera = scene_.cameras[n];
    found_[n].silhouette_iou = either > 0 ? both / either : 0;
    found_[n].color_l1 = both > 0 ? gap / (3 * both) : 1;
  }

  FitScene scene_;
  const TargetImages& picture_;
  const CameraRule& rule_;
  FitRenderer renderer_;
  std::vector<FoundCamera> found_;
  std::vector<int> views_;
};

// Where no other reason is given, values were chosen by eye and by silhouette and colour on a few
// furniture pictures and photographs: docs/lab.md, "Refinement on the picture".
constexpr std::size_t kCoarseVertices = 2000;  // vertices below which faces are divided: the
                                               // template of level 3 becomes that of level 4
constexpr int kRefineSearchSide = 64;     // pixels a side of pictures that cameras are searched in
constexpr std::size_t kCandidates = 3;    // cameras that are tried by descent
constexpr double kApart = 30;             // degrees between them: two steps of the search
constexpr double kPilotShare = 0.1;       // of the steps, for each candidate
constexpr double kSymmetricShare = 0.75;  // of the steps that see the mirror image, too
// Softness of outlines (equation 5), squared NDC, then pixels. Soft alpha lies outside of faces, so
// a mesh that fits it is too small by about its width: it ends narrow, and before the last steps.
constexpr double kRefineDeltaStart = 2e-3, kRefineFinalPixels = 0.15, kRefineDeltaShare = 0.9;
constexpr double kRefineMaxAlphaError = 1e-4;  // as of fits
constexpr double kRefineFinalRate = 0.1;       // of the first, by a half cosine
// World units and colours a step. Positions and colours go through diffusion, so that what the
// picture does not show follows its neighbours; the movement's Laplacian holds it in shape.
constexpr double kRefinePositionRate = 0.02 * static_cast<double>(kPredictionHalfExtent);
constexpr double kRefineColorRate = 0.06, kTexelRate = 0.005, kRefineSmoothing = 8,
                 kRefineColorSmoothing = 0.5;
// The outline beside colours, whose loss counts pixels without the object as well: at 1 the shape
// follows highlights and patterns at the outline's cost.
constexpr double kSilhouetteWeight = 10;
constexpr RegularizerWeights kRegularizers = {.smoothness = 1e-4, .laplacian = 1};

const int kOwnView[] = {0};
const int kBothViews[] = {0, 1};

// Both images: the picture, and its mirror image.
TargetImages WithMirrorImage(const TargetImages& picture) {
  TargetImages out = picture;
  const auto width = static_cast<std::ptrdiff_t>(picture.width);
  const auto append = [&](AlignedVector<float>* plane) {
    const std::size_t size = plane->size();
    plane->resize(2 * size);
    std::copy_n(plane->begin(), size, plane->begin() + static_cast<std::ptrdiff_t>(size));
    for (auto row = plane->begin() + static_cast<std::ptrdiff_t>(size); row != plane->end();
         row += width)
      std::reverse(row, row + width);
  };
  append(&out.color);
  append(&out.alpha);
  return out;
}

// The picture at no more than `side` pixels a side, and how much smaller it is.
std::pair<TargetImages, int> AtMost(const TargetImages& picture, int side) {
  int factor = 1;
  while (picture.width / factor > side && picture.width % (2 * factor) == 0) factor *= 2;
  return {factor == 1 ? picture : Reduce(picture, factor), factor};
}

FitterOptions OptionsFor(const FitScene& scene) {
  FitterOptions out;
  const Parameter paint = scene.texture.empty() ? Parameter::kColors : Parameter::kTexture;
  for (const Parameter p : {Parameter::kPositions, paint, Parameter::kCamera})
    out.parameters[p] = true;
  out.rates[Parameter::kPositions] = kRefinePositionRate;
  out.rates[Parameter::kColors] = kRefineColorRate;
  out.rates[Parameter::kTexture] = kTexelRate;
  out.loss.silhouette_weight = kSilhouetteWeight;
  out.regularizers = kRegularizers;
  out.smoothing = kRefineSmoothing;
  out.color_smoothing = kRefineColorSmoothing;
  return out;
}

// A descent from one camera.
class Descent {
 public:
  static Result<Descent> Make(FitScene scene, const Camera& camera, const TargetImages& picture,
                              const Workers& workers) {
    scene.cameras = {camera, MirroredCamera(camera, picture.width)};
    const FitterOptions options = OptionsFor(scene);
    TILEGRAD_ASSIGN(auto fitter, Fitter::Make(std::move(scene), options, workers));
    return Descent(std::move(fitter), picture);
  }

  // Takes steps [first, last) of those of `options`.
  Status Run(int first, int last, const RefineOptions& options) {
    const int steps = options.steps;
    for (int i = first; i < last; ++i) {
      TILEGRAD_TRY(options.watch.At(
          {"refining", static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(steps), ""}));
      TILEGRAD_ASSIGN(const FitValues values,
                      fitter_->Step(StepAt(static_cast<double>(i) / steps)));
      loss_ = values.loss;
    }
    return {};
  }

  double loss() const { return loss_; }  // of the last step
  const FitScene& scene() const { return fitter_->scene(); }

 private:
  Descent(std::unique_ptr<Fitter> fitter, const TargetImages& picture)
      : fitter_(std::move(fitter)), targets_(WithMirrorImage(picture)) {
    auto [small, factor] = AtMost(picture, kRefineSearchSide);
    factor_ = factor;
    if (factor > 1) small_ = WithMirrorImage(small);
  }

  // t: the share of the steps that is done. Coarse first, then with the mirror image, then alone.
  FitStep StepAt(double t) const {
    const bool coarse = t < kSymmetricShare / 2 && small_.has_value();
    FitStep step;
    step.views = t < kSymmetricShare ? std::span<const int>(kBothViews) : kOwnView;
    step.targets = coarse ? &*small_ : &targets_;
    step.job.scale = coarse ? 1.0f / static_cast<float>(factor_) : 1;
    step.job.options.width = step.job.options.height = step.targets->width;
    const double end = kRefineFinalPixels * 2 / targets_.width;
    step.job.options.delta = nn::Geometric(kRefineDeltaStart, end * end, t / kRefineDeltaShare);
    step.job.options.max_alpha_error = kRefineMaxAlphaError;
    step.rate_factor = nn::HalfCosine(kRefineFinalRate, t);
    return step;
  }

  std::unique_ptr<Fitter> fitter_;
  TargetImages targets_;
  std::optional<TargetImages> small_;
  int factor_ = 1;
  double loss_ = 0;
};

Result<PictureMatch> Match(const FitScene& scene, const TargetImages& picture,
                           const Workers& workers) {
  FitRenderer renderer(workers);
  TILEGRAD_ASSIGN(const Picture rendered,
                  DrawView(renderer, scene, kOwnView[0], {picture.width, picture.height}));
  const std::size_t pixels = picture.pixels();
  double both = 0, either = 0, gap = 0, object = 0;
  for (std::size_t p = 0; p < pixels; ++p) {
    const auto a = static_cast<double>(picture.alpha[p]);
    const auto b = static_cast<double>(rendered.alpha[p]);
    both += std::min(a, b);
    either += std::max(a, b);
    object += a;
    for (std::size_t c = 0; c < 3; ++c) {
      gap += a * std::abs(static_cast<double>(picture.color[c * pixels + p]) -
                          b * static_cast<double>(rendered.color[c * pixels + p]));
    }
  }
  return PictureMatch{both / either, gap / (3 * object)};
}

double Apart(double a, double b) { return std::abs(std::remainder(a - b, 360.0)); }

// The best cameras that see the mesh from different sides; of pixels of a picture `factor` times
// as large.
std::vector<FoundCamera> Candidates(const std::vector<FoundCamera>& found, int factor) {
  std::vector<FoundCamera> kept;
  for (const FoundCamera& camera : found) {
    if (kept.size() == kCandidates) break;
    if (std::ranges::all_of(
            kept, [&](const FoundCamera& k) { return Apart(k.azimuth, camera.azimuth) > kApart; }))
      kept.push_back(camera);
  }
  for (FoundCamera& k : kept) k.camera = ScaledCamera(k.camera, static_cast<float>(factor));
  return kept;
}

// The best descent after its share of the steps. What a camera cost before counts as well: a sphere
// can be bent onto any outline, also onto that of a car that faces the other way.
Result<Descent> BestStart(const FitScene& scene, const std::vector<FoundCamera>& cameras,
                          const TargetImages& picture, const RefineOptions& options,
                          const Workers& workers, double* rival) {
  std::optional<Descent> best;
  double best_cost = HUGE_VAL, next_cost = HUGE_VAL;
  const int pilot = static_cast<int>(kPilotShare * options.steps);
  for (const FoundCamera& start : cameras) {
    TILEGRAD_ASSIGN(Descent descent, Descent::Make(scene, start.camera, picture, workers));
    TILEGRAD_TRY(descent.Run(0, pilot, options));
    const double cost = descent.loss() + kSilhouetteWeight * start.cost();
    next_cost = std::min(next_cost, std::max(cost, best_cost));
    if (best && cost >= best_cost) continue;
    best.emplace(std::move(descent));
    best_cost = cost;
  }
  *rival = next_cost / best_cost;
  TILEGRAD_TRY(best->Run(pilot, options.steps, options));
  return std::move(*best);
}

// Centred and of the size of predictions, and the camera that still sees it as before.
Status Normalize(Mesh* mesh, Camera* camera) {
  const Bounds box = MeshBounds(*mesh);
  TILEGRAD_TRY(NormalizeToBox(*mesh, kPredictionHalfExtent));
  const glm::dvec3 low(box.low), high(box.high), half = 0.5 * (high - low);
  Similarity moved;
  moved.scale = static_cast<double>(kPredictionHalfExtent) / std::max({half.x, half.y, half.z});
  for (int i = 0; i < 3; ++i) moved.offset[i] = -moved.scale * 0.5 * (low[i] + high[i]);
  *camera = Moved(*camera, moved);
  return {};
}

}  // namespace

Result<RefinedMesh> RefineMesh(const Mesh& prediction, const TargetImages& picture,
                               const RefineOptions& options, const Workers& workers) {
  const bool coarse = prediction.positions.size() < kCoarseVertices;
  TILEGRAD_ASSIGN(FitScene scene, SceneOfMesh(coarse ? Subdivided(prediction) : prediction));
  scene.wrap = Wrap::kRepeatClamp;  // maps in longitude and latitude
  const auto [small, factor] = AtMost(picture, kRefineSearchSide);
  TILEGRAD_TRY(options.watch.At({"looking for the camera", 0, 0, ""}));
  TILEGRAD_ASSIGN(const auto found, FindCameras(scene, small, options.camera, workers));
  const std::vector<FoundCamera> cameras = Candidates(found, factor);
  scene.cameras = {cameras[0].camera};
  RefinedMesh out;
  out.camera_before = cameras[0].camera;
  TILEGRAD_ASSIGN(out.before, Match(scene, picture, workers));
  if (options.steps > 0) {
    TILEGRAD_ASSIGN(const Descent best,
                    BestStart(scene, cameras, picture, options, workers, &out.rival));
    scene = best.scene();
  }
  TILEGRAD_ASSIGN(out.after, Match(scene, picture, workers));
  out.mesh = MeshOfScene(scene);
  out.camera = scene.cameras[0];
  TILEGRAD_TRY(Normalize(&out.mesh, &out.camera));
  return out;
}

Result<std::vector<FoundCamera>> FindCameras(const FitScene& scene, const TargetImages& picture,
                                             const CameraRule& rule, const Workers& workers) {
  return CameraFinder(scene, picture, rule, workers).Run();
}

}  // namespace tilegrad::train
