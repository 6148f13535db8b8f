// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/rendered_set.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/error.h"
#include "base/try_all.h"
#include "io/image_file.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "render/picture/picture.h"
#include "scene/shapes.h"
#include "scene/shrink_image.h"
#include "train/data/photographs/cmr_writer.h"
#include "train/data/photographs/extreme_points.h"
#include "train/data/photographs/factorization.h"
#include "train/points3.h"
#include "train/similarity.h"

namespace tilegrad::train {
namespace {

using points3::Point, points3::operator+, points3::operator*;

constexpr int kWidth = 208, kHeight = 160, kSide = 144;       // pixels; the object's square
constexpr double kStretch = 0.15, kFov = 30, kHidden = 0.03;  // world units behind what is seen
constexpr std::uint64_t kObjectStream = 0x70686f746f;

struct Drawn {
  Photograph photo;
  ImageU8 picture;
};

// Renders on its own worker; one call at a time.
class Photographer {
 public:
  Photographer(const RenderedSetJob& job, const AnnotationNoise& noise,
               const std::vector<ImageU8>& backgrounds)
      : job_(job), noise_(noise), backgrounds_(backgrounds), alone_(1), exact_(alone_) {}

  Result<Drawn> Take(int index) {
    Rng rng(job_.seed ^ kObjectStream, static_cast<std::uint64_t>(index));
    const bool train = index < job_.train_count;
    const MeshCache& models = train ? job_.train : job_.test;
    TILEGRAD_ASSIGN(const auto model, models.Get(rng.Below(models.size())));
    const Mesh mesh = Stretched(model->mesh(), rng);
    const Camera camera = CameraOf(rng);
    TILEGRAD_ASSIGN(const auto planes, lit_.Render(mesh, {&camera, 1}, kSide));
    const int left = static_cast<int>(rng.Below(kWidth - kSide + 1)),
              top = static_cast<int>(rng.Below(kHeight - kSide + 1));
    Drawn out;
    out.photo.id = fmt::format("car_rendered/{}_{:05}.png", train ? "train" : "test", index);
    out.photo.split = train ? Split::kTrain : Split::kTest;
    Compose(planes, left, top, rng, &out);
    TILEGRAD_TRY(Annotate(mesh, camera, left, top, &out.photo));
    if (train) Disturb(rng, &out.photo);
    SetBox(&out.photo);
    return out;
  }

 private:
  static Mesh Stretched(Mesh mesh, Rng& rng) {
    std::array<glm::vec3, 3> axes = {glm::vec3(0), glm::vec3(0), glm::vec3(0)};
    for (int c = 0; c < 3; ++c)
      axes[static_cast<std::size_t>(c)][c] =
          static_cast<float>(1 + rng.Uniform(-kStretch, kStretch));
    Transform(mesh, axes, glm::vec3(0));
    return mesh;
  }

  static Camera CameraOf(Rng& rng) {
    Lens lens;
    lens.width = lens.height = kSide;
    lens.fov_y = kFov;
    const double azimuth = rng.Uniform(0, 360), elevation = rng.Uniform(-5, 30);
    return OrbitCamera<float>(lens, azimuth, elevation, rng.Uniform(2.3, 3.2));
  }

  // A crop of a background, and the object over it.
  void Compose(const std::vector<std::uint8_t>& planes, int left, int top, Rng& rng,
               Drawn* out) const {
    const ImageU8& background = backgrounds_[rng.Below(backgrounds_.size())];
    const auto u =
        static_cast<int>(rng.Below(static_cast<std::uint64_t>(background.width - kWidth + 1)));
    const auto v =
        static_cast<int>(rng.Below(static_cast<std::uint64_t>(background.height - kHeight + 1)));
    out->picture = ImageU8(kWidth, kHeight, 3);
    out->photo.mask = {kWidth, kHeight, std::vector<bool>(std::size_t{kWidth} * kHeight)};
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const int i = x - left, j = y - top;
        const bool there = i >= 0 && j >= 0 && i < kSide && j < kSide;
        const auto at = [&](int c) {
          return there ? planes[static_cast<std::size_t>((c * kSide + j) * kSide + i)] : 0;
        };
        for (int c = 0; c < 3; ++c)
          out->picture.at(x, y)[c] = static_cast<std::uint8_t>(
              std::min(255, at(c) + (255 - at(3)) * background.at(u + x, v + y)[c] / 255));
        out->photo.mask.inside[static_cast<std::size_t>(y * kWidth + x)] = at(3) >= 128;
      }
    }
  }

  // Where the camera sees the keypoints, and whether something hides them.
  Status Annotate(const Mesh& mesh, const Camera& camera, int left, int top, Photograph* photo) {
    MeshSceneOptions options;
    options.blend = false;
    const MeshScene made(mesh, options);
    Scene scene = made.scene();
    scene.camera = camera;
    Picture seen;
    TILEGRAD_TRY(exact_.Render(
        scene, {.width = kSide, .height = kSide, .color = false, .depth = true}, &seen));
    for (const glm::vec3& p : FindExtremePoints(mesh)) {
      double q[3];
      for (int r = 0; r < 3; ++r)
        q[r] = camera.rotation[3 * r] * p.x + camera.rotation[3 * r + 1] * p.y +
               camera.rotation[3 * r + 2] * p.z + camera.translation[r];
      const double x = camera.cx + camera.fx * q[0] / -q[2],
                   y = camera.cy - camera.fy * q[1] / -q[2];
      const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
      const bool there = i >= 0 && j >= 0 && i < kSide && j < kSide;
      const bool free =
          there && -q[2] < seen.depth[static_cast<std::size_t>(j * kSide + i)] + kHidden;
      photo->keypoints.push_back({x + left, y + top, free});
      photo->points.push_back({p.x, p.y, p.z});
    }
    return {};
  }

  void Disturb(Rng& rng, Photograph* photo) const {
    SetBox(photo);
    const double deviation = noise_.keypoint * photo->box.longer_side();
    auto visible = std::ranges::count_if(photo->keypoints, &Keypoint::visible);
    for (Keypoint& k : photo->keypoints) {
      k.x += deviation * rng.Normal();
      k.y += deviation * rng.Normal();
      if (rng.Uniform() >= noise_.hidden || !k.visible || visible <= 5) continue;
      k.visible = false;
      --visible;
    }
    photo->mask = DisturbedMask(photo->mask, noise_.mask, rng);
  }

  static void SetBox(Photograph* photo) {
    PhotoBox box{1e9, 1e9, -1e9, -1e9};
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (!photo->mask.at(x, y)) continue;
        box = {std::min(box.left, x + 0.0), std::min(box.top, y + 0.0),
               std::max(box.right, x + 1.0), std::max(box.bottom, y + 1.0)};
      }
    }
    photo->box = box;
  }

  const RenderedSetJob& job_;
  const AnnotationNoise& noise_;
  const std::vector<ImageU8>& backgrounds_;
  Workers alone_;
  LitRenderer lit_;
  PictureRenderer exact_;
};

// About twice a photograph's size, so that crops show something.
Result<std::vector<ImageU8>> LoadBackgrounds(const std::vector<Path>& files) {
  std::vector<ImageU8> out;
  for (const Path& file : files) {
    TILEGRAD_ASSIGN(ImageU8 read, io::LoadImage(file));
    const ImageU8 image = ShrunkImage(io::ToColor(std::move(read)), 3 * kWidth);
    if (image.width < kWidth || image.height < kHeight) continue;
    out.push_back(image);
  }
  if (out.empty())
    return InvalidArgument("no background of at least {} x {} pixels", kWidth, kHeight);
  return out;
}

Status FindCameras(PhotographSet* set) {
  KeypointViews job;
  job.mirror = set->mirror;
  for (const Photograph& photo : set->photographs) job.views.push_back(photo.keypoints);
  for (int k = 0; k < 12; k += 2) job.left.emplace_back(k + 1, k);
  for (int k = 0; k < 2; ++k) {
    job.up.emplace_back(k, 8 + k);
    job.up.emplace_back(2 + k, 10 + k);
  }
  for (int k = 0; k < 2; ++k) job.front.emplace_back(6 + k, 4 + k);
  TILEGRAD_ASSIGN(const Structure found, FactorizeKeypoints(job));
  set->mean_keypoints = found.shape;
  for (std::size_t i = 0; i < set->photographs.size(); ++i)
    set->photographs[i].camera = found.cameras[i];
  return {};
}

// From the world of the models to that of the cameras, by the means of keypoints in both.
Similarity WorldOfCameras(const PhotographSet& set) {
  std::vector<Point> mean(set.mean_keypoints.size());
  const std::vector<int> train = set.Select(Split::kTrain);
  for (const int i : train) {
    const std::vector<Point>& points = set.photographs[static_cast<std::size_t>(i)].points;
    for (std::size_t k = 0; k < mean.size(); ++k)
      mean[k] = mean[k] + (1 / static_cast<double>(train.size())) * points[k];
  }
  return FitSimilarity(mean, set.mean_keypoints);
}

// For the test part only: nothing else uses the true models.
void TellTruth(PhotographSet* set) {
  const Similarity to_cameras = WorldOfCameras(*set);
  for (Photograph& photo : set->photographs) {
    if (photo.split != Split::kTest) {
      photo.points.clear();
      continue;
    }
    std::vector<Keypoint> all = photo.keypoints;
    for (std::size_t k = 0; k < all.size(); ++k) {
      photo.points[k] = to_cameras(photo.points[k]);
      all[k].visible = true;
    }
    photo.camera = FitWeakCamera(photo.points, all, *photo.camera);
  }
}

}  // namespace

Status MakeRenderedSet(const RenderedSetJob& job, const AnnotationNoise& noise, const Path& folder,
                       const Workers& workers, const Watch& watch) {
  if (job.train.size() == 0 || job.test.size() == 0)
    return InvalidArgument("photographs need models to train on and models to test on");
  TILEGRAD_ASSIGN(const auto backgrounds, LoadBackgrounds(job.backgrounds));
  const auto count = static_cast<std::size_t>(job.train_count + job.test_count);
  std::vector<std::unique_ptr<Photographer>> photographers;
  for (int w = 0; w < workers.count(); ++w)
    photographers.push_back(std::make_unique<Photographer>(job, noise, backgrounds));
  PhotographSet set;
  set.source = "pascal3d";
  set.class_name = "car";
  set.mirror = ExtremeMirror();
  for (const ExtremePoint& point : kExtremePoints) set.keypoint_names.emplace_back(point.name);
  std::vector<Photograph> all(count);
  const auto take = [&](std::size_t i, std::size_t worker) -> Status {
    TILEGRAD_ASSIGN(auto drawn, photographers[worker]->Take(static_cast<int>(i)));
    TILEGRAD_TRY(io::SavePng(folder / "Images" / drawn.photo.id, drawn.picture));
    all[i] = std::move(drawn.photo);
    return {};
  };
  TILEGRAD_TRY(TryAll(workers, count, {"rendering photographs", watch}, take));
  // A camera needs four keypoints, and its fit is poor below five.
  for (Photograph& photo : all) {
    if (std::ranges::count_if(photo.keypoints, &Keypoint::visible) >= 5)
      set.photographs.push_back(std::move(photo));
  }
  TILEGRAD_TRY(FindCameras(&set));
  TellTruth(&set);
  return WriteCmrLayout(folder, set);
}

}  // namespace tilegrad::train
