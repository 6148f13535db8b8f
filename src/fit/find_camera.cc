// SPDX-License-Identifier: Apache-2.0
#include "fit/find_camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/error.h"

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
    if (!wanted) return InvalidArgument("the picture shows no object: no pixel is opaque");
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

}  // namespace

Result<std::vector<FoundCamera>> FindCameras(const FitScene& scene, const TargetImages& picture,
                                             const CameraRule& rule, const Workers& workers) {
  return CameraFinder(scene, picture, rule, workers).Run();
}

}  // namespace tilegrad::train
