// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/find_poses.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>
#include <numeric>

#include "base/error.h"
#include "base/rng.h"
#include "base/text.h"
#include "fit/poses/estimate.h"
#include "fit/score.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {
namespace {

// Chosen on twelve models (docs/lab.md).
constexpr int kPoseSide = 64, kLevel = 3;       // pixels and template of the search
constexpr int kFineSide = 128, kFineLevel = 4;  // of the last refinement
// With a third of these steps half of the pictures are looked for around a mesh that tells nothing.
constexpr int kShapeSteps = 150;
constexpr double kShapeRate = 2;
constexpr int kJointSteps = 40, kWarmUp = 60, kFinalSteps = 150, kFineSteps = 300;
constexpr double kStays = 12;  // degrees: nearer viewpoints are what descent does better
constexpr double kRepulsion = 0.1, kReach = 35;  // at the first sweep; degrees
constexpr double kAgree = 12;                    // degrees, mean
constexpr double kCameraDistance = 1.6;

double MeanGap(std::span<const Camera> a, std::span<const Camera> b) {
  const Similarity alignment = AlignCameras(a, b);
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += AngleBetween(Moved(a[i], alignment), b[i]);
  return sum / static_cast<double>(a.size());
}

class PoseSearch {
 public:
  PoseSearch(const PosePictures& pictures, const Workers& workers, const Watch& watch, Rng rng)
      : pictures_(pictures),
        renderer_(workers),
        unlike_(Unlikeness(pictures)),
        estimate_(pictures, kLevel, workers, watch),
        rng_(rng) {
    all_.resize(pictures.crops.size());
    std::iota(all_.begin(), all_.end(), 0);
    Scatter();
  }

  // Whether a camera moved.
  Result<bool> Sweep(double repulsion) {
    std::vector<int> order = all_;
    for (std::size_t k = 0; k + 1 < order.size(); ++k) {
      std::swap(order[k], order[k + rng_.Below(order.size() - k)]);
    }
    const auto half = order.size() / 2;
    const std::span<const int> parts[] = {std::span(order).first(half),
                                          std::span(order).subspan(half)};
    bool moved = false;
    for (int side = 0; side < 2; ++side) {
      estimate_.ForgetShape();
      TILEGRAD_TRY(estimate_
                       .Refit({.steps = kShapeSteps, .cameras = false, .shape_rate = kShapeRate},
                              parts[side])
                       .status());
      TILEGRAD_ASSIGN(const bool some, LookForPictures(parts[1 - side], repulsion));
      moved = moved || some;
    }
    TILEGRAD_TRY(estimate_.Refit({.steps = kJointSteps}, all_).status());
    return moved;
  }

  Result<PoseStart> Finish() {
    estimate_.ForgetShape();
    TILEGRAD_TRY(estimate_.Refit({.steps = kWarmUp, .cameras = false}, all_).status());
    PoseStart out;
    TILEGRAD_ASSIGN(out.loss, estimate_.Refit({.steps = kFinalSteps}, all_));
    out.cameras = estimate_.cameras();
    return out;
  }

 private:
  // Evenly over the sphere, between the elevations of usual photographs.
  void Scatter() {
    for (std::size_t i = 0; i < all_.size(); ++i) {
      const double elevation = std::asin(rng_.Uniform(-0.4, 0.94)) * 180 / std::numbers::pi;
      const Camera camera = OrbitCamera({}, rng_.Uniform(0, 360), elevation, kCameraDistance);
      Crop sphere;
      sphere.side = 1 / kCameraDistance;
      estimate_.Place(i, Aligned(sphere, pictures_.crops[i], camera));
    }
  }

  Result<bool> LookForPictures(std::span<const int> pictures, double repulsion) {
    estimate_.Normalize();
    TILEGRAD_ASSIGN(const std::vector<Viewpoint> around,
                    LookAround(estimate_.scene(), estimate_.Up(), &renderer_));
    bool moved = false;
    for (const int picture : pictures) {
      const auto n = static_cast<std::size_t>(picture);
      const Viewpoint* best = nullptr;
      double least = HUGE_VAL;
      for (const Viewpoint& v : around) {
        double cost = CropCost(v.crop, pictures_.crops[n], pictures_.color_weight);
        if (repulsion > 0) cost += repulsion * Repulsion(n, v.camera);
        if (cost < least) {
          best = &v;
          least = cost;
        }
      }
      if (best == nullptr) continue;
      const Camera camera = Aligned(best->crop, pictures_.crops[n], best->camera);
      if (AngleBetween(camera, estimate_.cameras()[n]) < kStays) continue;
      estimate_.Place(n, camera);
      moved = true;
    }
    return moved;
  }

  double Repulsion(std::size_t picture, const Camera& there) const {
    double sum = 0;
    for (std::size_t j = 0; j < all_.size(); ++j) {
      const double near = 1 - DirectionGap(there, estimate_.cameras()[j]) / kReach;
      if (j != picture && near > 0) sum += near * unlike_[picture * all_.size() + j];
    }
    return sum;
  }

  const PosePictures& pictures_;
  FitRenderer renderer_;
  std::vector<double> unlike_;
  PoseEstimate estimate_;
  Rng rng_;
  std::vector<int> all_;
};

// The cameras again, with more pixels and vertices; in the frame that FoundPoses promises.
Result<std::vector<Camera>> Refine(const PosePictures& pictures, std::span<const Camera> cameras,
                                   const Workers& workers, const Watch& watch) {
  PoseEstimate estimate(pictures, kFineLevel, workers, watch);
  for (std::size_t i = 0; i < cameras.size(); ++i) estimate.Place(i, cameras[i]);
  std::vector<int> all(cameras.size());
  std::iota(all.begin(), all.end(), 0);
  constexpr int kAllSteps = kShapeSteps + kFineSteps;
  TILEGRAD_TRY(
      estimate.Refit({.steps = kShapeSteps, .cameras = false, .told = kAllSteps}, all).status());
  TILEGRAD_TRY(
      estimate.Refit({.steps = kFineSteps, .first = kShapeSteps, .told = kAllSteps}, all).status());
  estimate.Normalize();
  const auto up = estimate.Up();
  const glm::dvec3 y(up[0], up[1], up[2]);
  const glm::dvec3 any = std::abs(y.z) < 0.7 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 x = glm::normalize(glm::cross(y, any)), z = glm::cross(x, y);
  Similarity turn;  // of the world, so that y is up
  const glm::dvec3 rows[] = {x, y, z};
  for (int i = 0; i < 9; ++i) turn.rotation[i] = rows[i / 3][i % 3];
  std::vector<Camera> out;
  for (const Camera& camera : estimate.cameras()) out.push_back(Moved(camera, turn));
  return out;
}

Status CheckPoses(const TargetImages& images, std::span<const Camera> lenses,
                  const PoseOptions& options) {
  if (options.starts < 1 || options.sweeps < 1) {
    return InvalidArgument("{} starts of {} sweeps: needs one or more", options.starts,
                           options.sweeps);
  }
  if (lenses.size() < static_cast<std::size_t>(kLeastPictures)) {
    return InvalidArgument("{} are too few to find cameras; {} or more are needed",
                           Count(lenses.size(), "image"), kLeastPictures);
  }
  if (images.alpha.size() != lenses.size() * images.pixels()) {
    return InvalidArgument("needs a lens for each image");
  }
  for (const PoseStart& start : options.done) {
    if (start.cameras.size() != lenses.size())
      return InvalidArgument("an earlier search was for {} images", start.cameras.size());
  }
  return {};
}

void CopyLens(const Camera& from, Camera* to) {
  to->fx = from.fx;
  to->fy = from.fy;
  to->cx = from.cx;
  to->cy = from.cy;
  to->near_plane = from.near_plane;
}

class Searches {
 public:
  Searches(const PosePictures& pictures, const PoseOptions& options, const Workers& workers,
           const Watch& watch)
      : pictures_(pictures), options_(options), workers_(workers), watch_(watch) {}

  // The best, once two agree or all are done.
  Result<PoseStart> Run() {
    for (const PoseStart& start : options_.done) Add(start);
    while (starts() < options_.starts && agreement_ > kAgree) {
      TILEGRAD_ASSIGN(PoseStart start, Next());
      Add(std::move(start));
      if (options_.keep) TILEGRAD_TRY(options_.keep(done_));
    }
    return done_[best_];
  }
  double agreement() const { return agreement_; }
  int starts() const { return static_cast<int>(done_.size()); }

 private:
  void Add(PoseStart start) {
    done_.push_back(std::move(start));
    best_ = static_cast<std::size_t>(std::ranges::min_element(done_, {}, &PoseStart::loss) -
                                     done_.begin());
    agreement_ = Agreement();
  }

  Result<PoseStart> Next() {
    const Rng rng(static_cast<std::uint64_t>(options_.seed), static_cast<std::uint64_t>(starts()));
    PoseSearch search(pictures_, workers_, watch_, rng);
    bool moved = true;
    for (int sweep = 0; sweep < options_.sweeps && moved; ++sweep) {
      TILEGRAD_TRY(Tell(sweep));
      TILEGRAD_ASSIGN(moved,
                      search.Sweep(kRepulsion * (options_.sweeps - sweep) / options_.sweeps));
    }
    return search.Finish();
  }

  Status Tell(int sweep) const {
    const auto total = static_cast<std::uint64_t>(options_.starts * options_.sweeps);
    const auto done = static_cast<std::uint64_t>(starts() * options_.sweeps + sweep);
    std::string note;
    if (starts() == 1) note = fmt::format("loss {:.3f}", done_[best_].loss);
    if (starts() > 1) {
      note = fmt::format("loss {:.3f}, the two best searches differ by {:.0f} degrees",
                         done_[best_].loss, agreement_);
    }
    return watch_.At({"looking for cameras", done, total, note});
  }

  // Of the search nearest to the best.
  double Agreement() const {
    double least = kNone;
    for (std::size_t i = 0; i < done_.size(); ++i) {
      if (i != best_) least = std::min(least, MeanGap(done_[i].cameras, done_[best_].cameras));
    }
    return least;
  }

  static constexpr double kNone = 180;

  const PosePictures& pictures_;
  const PoseOptions& options_;
  const Workers& workers_;
  const Watch& watch_;
  std::vector<PoseStart> done_;
  std::size_t best_ = 0;
  double agreement_ = kNone;
};

}  // namespace

Result<FoundPoses> FindPoses(const TargetImages& images, std::span<const Camera> lenses,
                             const PoseOptions& options, const Workers& workers,
                             const Watch& watch) {
  TILEGRAD_TRY(CheckPoses(images, lenses, options));
  TILEGRAD_ASSIGN(const PosePictures pictures, PreparePictures(images, lenses, kPoseSide));
  Searches searches(pictures, options, workers, watch);
  TILEGRAD_ASSIGN(const PoseStart best, searches.Run());
  FoundPoses out{{}, best.loss, searches.starts(), searches.agreement()};
  std::vector<Camera> cameras = best.cameras;
  for (std::size_t i = 0; i < lenses.size(); ++i) CopyLens(lenses[i], &cameras[i]);
  TILEGRAD_ASSIGN(out.cameras, RefinePoses(images, cameras, workers, watch));
  return out;
}

Result<std::vector<Camera>> RefinePoses(const TargetImages& images, std::span<const Camera> cameras,
                                        const Workers& workers, const Watch& watch) {
  TILEGRAD_ASSIGN(const PosePictures fine, PreparePictures(images, cameras, kFineSide));
  TILEGRAD_ASSIGN(std::vector<Camera> out, Refine(fine, cameras, workers, watch));
  for (std::size_t i = 0; i < out.size(); ++i) CopyLens(cameras[i], &out[i]);
  return out;
}

namespace {

constexpr int kSide = 64;  // pixels of a look around
constexpr double kDistance = 1.6, kFov = 45;
constexpr int kAround = 24;  // viewpoints on the horizon
constexpr double kLowestElevation = -45, kElevationStep = 12.5, kHighestElevation = 80;
constexpr int kLeastAround = 6;

std::vector<Camera> CamerasAround(const glm::dvec3& up) {
  const glm::dvec3 any = std::abs(up.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
  const glm::dvec3 east = glm::normalize(any - glm::dot(any, up) * up);
  const glm::dvec3 south = glm::cross(east, up);
  const double target[3] = {0, 0, 0}, upward[3] = {up.x, up.y, up.z};
  std::vector<Camera> out;
  for (double e = kLowestElevation; e <= kHighestElevation; e += kElevationStep) {
    const double height = std::sin(e * std::numbers::pi / 180),
                 flat = std::sqrt(1 - height * height);
    const int count = std::max(kLeastAround, static_cast<int>(std::lround(kAround * flat)));
    for (int i = 0; i < count; ++i) {
      const double azimuth = 2 * std::numbers::pi * i / count;
      const glm::dvec3 ring = std::cos(azimuth) * east + std::sin(azimuth) * south;
      const glm::dvec3 eye = kDistance * (flat * ring + height * up);
      const double from[3] = {eye.x, eye.y, eye.z};
      out.push_back(CameraCast<float>(LookAtCamera({kFov, kSide, kSide}, from, target, upward)));
    }
  }
  return out;
}

}  // namespace

Result<std::vector<Viewpoint>> LookAround(const FitScene& scene, const std::array<double, 3>& up,
                                          FitRenderer* renderer) {
  FitScene seen = scene;
  seen.cameras = CamerasAround({up[0], up[1], up[2]});
  std::vector<int> views(seen.cameras.size());
  std::iota(views.begin(), views.end(), 0);
  FitRenderer::Job job;
  job.views = views;
  job.alpha = false;
  job.options.width = job.options.height = kSide;
  TILEGRAD_TRY(renderer->Render(seen, job));
  const Images& images = renderer->images();
  constexpr std::size_t kPlane = std::size_t{kSide} * kSide;
  std::vector<Viewpoint> found;
  std::vector<float> alpha(kPlane);
  for (std::size_t n = 0; n < views.size(); ++n) {
    const auto ids = images.face_ids.subspan(n * kPlane, kPlane);
    std::ranges::transform(ids, alpha.begin(), [](auto id) { return id >= 0 ? 1.0f : 0.0f; });
    const auto color = images.color.subspan(3 * n * kPlane, 3 * kPlane);
    auto crop = CropOf({kSide, kSide, color, alpha}, seen.cameras[n]);
    if (crop) found.push_back({seen.cameras[n], std::move(*crop)});
  }
  return found;
}

double DirectionGap(const Camera& a, const Camera& b) {
  double dot = 0;
  for (int k = 6; k < 9; ++k) {
    dot += static_cast<double>(a.rotation[k]) * static_cast<double>(b.rotation[k]);
  }
  return std::acos(std::clamp(dot, -1.0, 1.0)) * 180 / std::numbers::pi;
}

}  // namespace tilegrad::train
