// SPDX-License-Identifier: Apache-2.0
#include "raster/extremes/bound_check.h"

#include <cmath>
#include <vector>

#include "raster/extremes/scenes.h"
#include "raster/project.h"
#include "render/pipeline/records.h"
#include "render/pipeline/test_scenes.h"

namespace tilegrad::test {
namespace {

constexpr double kErrors[] = {0, 1e-6, 1e-4, 1e-2};

struct BoundScene {
  TestScene<float> scene;
  RenderOptions options;
};

// Small faces, points among them, around one or a few
// places, so that background remains; images so small that all faces for all pixels stay feasible.
BoundScene MakeBoundScene(const BoundSceneNumber& scene) {
  Rng rng(scene.number, 1234);
  BoundScene out;
  out.scene.channels = 0;
  out.scene.camera = {.fx = 1, .fy = 1, .cx = 0, .cy = 0, .near_plane = 0.5f};  // pixels are world
  const auto faces = static_cast<std::size_t>(20 * std::pow(10.0, scene.decades * rng.Uniform()));
  const int side = std::clamp(static_cast<int>(std::sqrt(2e6 / static_cast<double>(faces))), 3, 48);
  out.options.width = 1 + static_cast<int>(rng.Below(static_cast<std::uint64_t>(side)));
  out.options.height = 1 + static_cast<int>(rng.Below(static_cast<std::uint64_t>(side)));
  out.options.delta = std::pow(10.0, rng.Uniform(-6, 0));
  out.options.max_alpha_error = kErrors[rng.Below(4)];
  const double w = out.options.width, h = out.options.height;
  const double size = rng.Uniform() * std::min(w, h) / std::sqrt(static_cast<double>(faces));
  const std::uint64_t places = 1 + rng.Below(4);
  const double spread = rng.Uniform(0.02, 0.7);
  double x[4], y[4];
  for (std::size_t k = 0; k < 4; ++k) {
    x[k] = rng.Uniform(-0.3, 1.3);
    y[k] = rng.Uniform(-0.3, 1.3);
  }
  for (std::size_t f = 0; f < faces; ++f) {
    const std::uint64_t at = rng.Below(places);
    const double cx = w * (x[at] + spread * rng.Uniform(-1, 1));
    const double cy = h * (y[at] + spread * rng.Uniform(-1, 1));
    const double reach = rng.Below(8) == 0 ? 0 : size;
    for (int k = 0; k < 3; ++k) {
      out.scene.faces.push_back(static_cast<std::int32_t>(3 * f) + k);
      out.scene.positions.push_back(static_cast<float>(cx + reach * rng.Uniform(-1, 1)));
      out.scene.positions.push_back(static_cast<float>(-cy - reach * rng.Uniform(-1, 1)));
      out.scene.positions.push_back(-1);
    }
  }
  return out;
}

void Permute(Rng* rng, std::vector<std::int32_t>* faces) {
  for (std::size_t n = faces->size() / 3; n > 1; --n) {
    const std::size_t other = rng->Below(n);
    std::swap_ranges(faces->begin() + static_cast<std::ptrdiff_t>(3 * (n - 1)),
                     faces->begin() + static_cast<std::ptrdiff_t>(3 * n),
                     faces->begin() + static_cast<std::ptrdiff_t>(3 * other));
  }
}

class BoundCheck {
 public:
  BoundCheck(const BoundSceneNumber& scene, Renderer* renderer)
      : rng_(scene.number, 5), scene_(MakeBoundScene(scene)), renderer_(renderer) {}

  double delta() const { return scene_.options.delta; }

  BoundSummary Run() {
    const RenderOptions& o = scene_.options;
    const Scene view = scene_.scene.View();
    raster::ScreenMeshBuffers mesh;
    raster::Project(FaceSourceOf(view, o), o.width, o.height, &mesh);
    const SoftScene soft = SoftSceneOf(mesh, o);
    const SoftTruth truth(soft);
    out_.scenes = 1;
    out_.faces = soft.options.faces;
    Draw(&first_);
    Permute(&rng_, &scene_.scene.faces);
    Draw(&permuted_);
    if (!out_.failed.empty()) return out_;
    for (const std::size_t i : SomeBackground()) Compare(truth.Bound(i), i);
    return out_;
  }

 private:
  void Draw(Frame* frame) {
    const Scene view = scene_.scene.View();
    const Outputs outputs{.color = false, .attributes = false};
    const Status status = renderer_->Render({&view, 1}, scene_.options, outputs, frame);
    if (!status.ok()) out_.failed = status.message();
    const double e = scene_.options.max_alpha_error;
    // exp(-87) per face is what E = 0 means ("Budget").
    const double allowed = e * (1 + 1e-12) + 1.7e-38 * static_cast<double>(out_.faces);
    out_.spent_over = std::max(out_.spent_over, frame->images().alpha_error_bound - allowed);
  }
  // Background pixels, neither empty nor opaque if there are such: two, or more of fewer faces.
  std::vector<std::size_t> SomeBackground() {
    std::vector<std::size_t> all, between, out;
    const Images& images = first_.images();
    for (std::size_t i = 0; i < images.face_ids.size(); ++i) {
      if (images.face_ids[i] >= 0) continue;
      all.push_back(i);
      if (images.alpha[i] > 1e-6f && images.alpha[i] < 1 - 1e-6f) between.push_back(i);
    }
    if (!between.empty()) all = between;
    constexpr std::size_t kPairs = 20000;
    const std::size_t most = std::clamp<std::size_t>(kPairs / (out_.faces + 1), 2, 40);
    for (std::size_t k = 0; k < most && !all.empty(); ++k) {
      out.push_back(all[rng_.Below(all.size())]);
    }
    return out;
  }
  void Compare(const SoftTruth::AlphaBound& truth, std::size_t i) {
    const double e = scene_.options.max_alpha_error;
    ++out_.pixels;
    out_.between += truth.alpha > 1e-6 && truth.alpha < 1 - 1e-6;
    const Images &first = first_.images(), &permuted = permuted_.images();
    for (const Images* images : {&first, &permuted}) {
      const double error = std::abs(static_cast<double>(images->alpha[i]) - truth.alpha);
      const double beyond = error - truth.rounding;
      out_.over_budget = std::max(out_.over_budget, beyond - e - 1e-37);
      out_.over_spent = std::max(out_.over_spent, beyond - images->alpha_error_bound);
      if (e > 0) out_.share = std::max(out_.share, beyond / e);
      const double allowed = images->alpha_error_bound + truth.rounding;
      if (allowed > 0) out_.of_reported = std::max(out_.of_reported, error / allowed);
    }
    const double moved =
        std::abs(static_cast<double>(first.alpha[i]) - static_cast<double>(permuted.alpha[i]));
    out_.order = std::max(out_.order, moved - first.alpha_error_bound - permuted.alpha_error_bound -
                                          2 * truth.rounding);
  }

  Rng rng_;
  BoundScene scene_;
  Renderer* renderer_;
  Frame first_, permuted_;
  BoundSummary out_;
};

}  // namespace

BoundSummary CheckBoundScene(const BoundSceneNumber& scene, Renderer* renderer, double* delta) {
  BoundCheck check(scene, renderer);
  if (delta != nullptr) *delta = check.delta();
  return check.Run();
}

}  // namespace tilegrad::test
