// SPDX-License-Identifier: Apache-2.0
#include "fit/refine.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <optional>
#include <utility>

#include "base/error.h"
#include "fit/find_camera.h"
#include "fit/fitter.h"
#include "fit/input.h"
#include "fit/score.h"
#include "render/picture/composite.h"
#include "scene/camera_conventions.h"
#include "scene/subdivide.h"
#include "train/data/batches.h"
#include "train/models/mesh_network.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kCoarse = 2000;     // vertices below which faces are divided
constexpr int kSearchSide = 64;           // pixels a side of pictures that cameras are searched in
constexpr std::size_t kCandidates = 3;    // cameras that are tried by descent
constexpr double kApart = 30;             // degrees between them
constexpr double kPilotShare = 0.2;       // of the steps, for each candidate
constexpr double kSymmetricShare = 0.75;  // of the steps that see the mirror image, too
constexpr double kDeltaStart = 2e-3, kFinalPixels = 0.15;  // softness of outlines
constexpr double kFinalRate = 0.1;
constexpr int kSamples = 3;  // a side of a pixel, to measure

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
  append(&out.color), append(&out.alpha);
  return out;
}

// The picture at no more than `side` pixels a side, and how much smaller it is.
std::pair<TargetImages, int> AtMost(const TargetImages& picture, int side) {
  int factor = 1;
  while (picture.width / factor > side && picture.width % (2 * factor) == 0) factor *= 2;
  return {factor == 1 ? picture : Reduce(picture, factor), factor};
}

FitterOptions OptionsOf(const FitScene& scene) {
  float extent = 0;
  for (const float x : scene.positions) extent = std::max(extent, std::abs(x));
  FitterOptions out;
  for (const Parameter p : {Parameter::kPositions, Parameter::kColors, Parameter::kCamera})
    out.parameters[p] = true;
  out.rates[Parameter::kPositions] = 0.02 * static_cast<double>(extent);
  out.regularizers = {.laplacian = 1, .flatness = 1e-4};
  out.rates[Parameter::kColors] = 0.06;
  out.smoothing = 20, out.color_smoothing = 0.5;
  return out;
}

// A descent from one camera.
class Descent {
 public:
  static Result<Descent> Make(FitScene scene, const Camera& camera, const TargetImages& picture,
                              const Workers& workers) {
    scene.cameras = {camera, MirroredCamera(camera, picture.width)};
    const FitterOptions options = OptionsOf(scene);
    TILEGRAD_ASSIGN(Fitter fitter, Fitter::Make(std::move(scene), options, workers));
    return Descent(std::move(fitter), picture);
  }

  // Takes steps [first, last) of `steps`.
  Status Run(int first, int last, int steps) {
    for (int i = first; i < last; ++i) {
      const double t = static_cast<double>(i) / steps;
      const bool coarse = t < kSymmetricShare / 2 && small_.has_value();
      FitStep step;
      step.views = t < kSymmetricShare ? std::span<const int>(kBothViews) : kOwnView;
      step.targets = coarse ? &*small_ : &targets_;
      step.job.scale = coarse ? 1.0f / static_cast<float>(factor_) : 1;
      step.job.options.width = step.job.options.height = step.targets->width;
      const double pixel = kFinalPixels * 2 / targets_.width;
      step.job.options.delta =
          kDeltaStart * std::pow(pixel * pixel / kDeltaStart, std::min(1.0, t / 0.9));
      step.job.options.max_alpha_error = 1e-4;
      step.rate_factor = kFinalRate + (1 - kFinalRate) * 0.5 * (1 + std::cos(std::numbers::pi * t));
      TILEGRAD_ASSIGN(const FitValues values, fitter_.Step(step));
      loss_ = values.total;
    }
    return {};
  }

  double loss() const { return loss_; }  // of the last step
  const FitScene& scene() const { return fitter_.scene(); }

 private:
  Descent(Fitter fitter, const TargetImages& picture)
      : fitter_(std::move(fitter)), targets_(WithMirrorImage(picture)) {
    auto [small, factor] = AtMost(picture, kSearchSide);
    factor_ = factor;
    if (factor > 1) small_ = WithMirrorImage(small);
  }

  Fitter fitter_;
  TargetImages targets_;
  std::optional<TargetImages> small_;
  int factor_ = 1;
  double loss_ = 0;
};

Result<PictureMatch> Match(const FitScene& scene, const TargetImages& picture,
                           const Workers& workers) {
  FitRenderer renderer(workers);
  FitRenderer::Job job;
  job.views = kOwnView, job.scale = kSamples, job.alpha = false;
  job.options.width = job.options.height = kSamples * picture.width;
  TILEGRAD_TRY(renderer.Render(scene, job));
  Picture rendered;
  AverageSamples(renderer.images(), kSamples, &rendered);
  const std::size_t pixels = picture.pixels();
  double both = 0, either = 0, gap = 0, object = 0;
  for (std::size_t p = 0; p < pixels; ++p) {
    const auto a = static_cast<double>(picture.alpha[p]);
    const auto b = static_cast<double>(rendered.alpha[p]);
    both += std::min(a, b), either += std::max(a, b), object += a;
    for (std::size_t c = 0; c < 3; ++c) {
      gap += a * std::abs(static_cast<double>(picture.color[c * pixels + p]) -
                          b * static_cast<double>(rendered.color[c * pixels + p]));
    }
  }
  return PictureMatch{both / either, gap / (3 * object)};
}

double Apart(double a, double b) { return std::abs(std::remainder(a - b, 360.0)); }

// The best cameras that see the mesh from different sides.
std::vector<Camera> Candidates(const std::vector<FoundCamera>& found) {
  std::vector<FoundCamera> kept;
  for (const FoundCamera& camera : found) {
    if (kept.size() == kCandidates) break;
    if (std::ranges::all_of(
            kept, [&](const FoundCamera& k) { return Apart(k.azimuth, camera.azimuth) > kApart; }))
      kept.push_back(camera);
  }
  std::vector<Camera> out;
  for (const FoundCamera& camera : kept) out.push_back(camera.camera);
  return out;
}

// The descent that has come furthest after its share of the steps.
Result<Descent> BestStart(const FitScene& scene, const std::vector<Camera>& cameras,
                          const TargetImages& picture, const RefineOptions& options,
                          const Workers& workers) {
  std::optional<Descent> best;
  const int pilot = static_cast<int>(kPilotShare * options.steps);
  for (const Camera& camera : cameras) {
    TILEGRAD_ASSIGN(Descent descent, Descent::Make(scene, camera, picture, workers));
    TILEGRAD_TRY(descent.Run(0, pilot, options.steps));
    if (!best || descent.loss() < best->loss()) best.emplace(std::move(descent));
  }
  TILEGRAD_TRY(best->Run(pilot, options.steps, options.steps));
  return std::move(*best);
}

// Centred and of the size of predictions, and the camera that still sees it as before.
Status Normalize(Mesh* mesh, Camera* camera) {
  const Mesh before = *mesh;
  TILEGRAD_TRY(NormalizeToBox(*mesh, kPredictionHalfExtent));
  std::size_t far = 0;  // a vertex that is not the first, to read the scale from
  for (std::size_t v = 1; v < before.positions.size(); ++v) {
    if (glm::distance(before.positions[v], before.positions[0]) >
        glm::distance(before.positions[far], before.positions[0]))
      far = v;
  }
  Alignment moved;
  moved.scale = static_cast<double>(glm::distance(mesh->positions[far], mesh->positions[0]) /
                                    glm::distance(before.positions[far], before.positions[0]));
  for (int i = 0; i < 3; ++i) {
    moved.offset[i] = static_cast<double>(mesh->positions[0][i]) -
                      moved.scale * static_cast<double>(before.positions[0][i]);
  }
  *camera = Moved(*camera, moved);
  return {};
}

}  // namespace

TargetImages TargetOfCutout(std::span<const std::uint8_t> planar, int size) {
  TargetImages out;
  out.width = out.height = size;
  const std::size_t pixels = out.pixels();
  out.color.resize(3 * pixels), out.alpha.resize(pixels);
  for (std::size_t p = 0; p < pixels; ++p) {
    const float alpha = static_cast<float>(planar[3 * pixels + p]) / 255;
    out.alpha[p] = alpha;
    for (std::size_t c = 0; c < 3; ++c) {
      const float over_black = static_cast<float>(planar[c * pixels + p]) / 255;
      out.color[c * pixels + p] = alpha > 0 ? std::min(1.0f, over_black / alpha) : 0;
    }
  }
  return out;
}

Result<RefinedMesh> RefineMesh(const Mesh& prediction, const TargetImages& picture,
                               const RefineOptions& options, const Workers& workers) {
  const bool coarse = prediction.positions.size() < kCoarse;
  TILEGRAD_ASSIGN(FitScene scene, SceneOfMesh(coarse ? Subdivided(prediction) : prediction));
  const auto [small, factor] = AtMost(picture, kSearchSide);
  TILEGRAD_ASSIGN(const auto found, FindCameras(scene, small, options.camera, workers));
  std::vector<Camera> cameras = Candidates(found);
  for (Camera& camera : cameras) camera = ScaledCamera(camera, static_cast<float>(factor));
  scene.cameras = {cameras[0]};
  RefinedMesh out;
  out.camera_before = cameras[0];
  TILEGRAD_ASSIGN(out.before, Match(scene, picture, workers));
  if (options.steps > 0) {
    TILEGRAD_ASSIGN(const Descent best, BestStart(scene, cameras, picture, options, workers));
    scene = best.scene();
  }
  TILEGRAD_ASSIGN(out.after, Match(scene, picture, workers));
  out.mesh = MeshOfScene(scene), out.camera = scene.cameras[0];
  TILEGRAD_TRY(Normalize(&out.mesh, &out.camera));
  return out;
}

}  // namespace tilegrad::train
