// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/rendered_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>

#include "base/error.h"
#include "base/try_all.h"
#include "io/image_file.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "render/picture/picture.h"
#include "scene/shapes.h"
#include "scene/shrink_image.h"
#include "train/data/photographs/distance_barrier.h"
#include "train/data/photographs/factorization.h"
#include "train/data/photographs/photographs.h"
#include "train/points3.h"
#include "train/similarity.h"

namespace tilegrad::train {
namespace {

// A sum of waves, of unit variance.
class SmoothNoise {
 public:
  explicit SmoothNoise(Rng& rng) {
    for (Wave& wave : waves_) {
      const double turn = rng.Uniform(0, 2 * std::numbers::pi), length = rng.Uniform(12, 50);
      wave = {2 * std::numbers::pi * std::cos(turn) / length,
              2 * std::numbers::pi * std::sin(turn) / length, rng.Uniform(0, 2 * std::numbers::pi)};
    }
  }
  double At(int x, int y) const {
    double sum = 0;
    for (const Wave& wave : waves_) sum += std::cos(wave.x * x + wave.y * y + wave.phase);
    return sum * std::sqrt(2.0 / static_cast<double>(waves_.size()));
  }

 private:
  struct Wave {
    double x, y, phase;
  };
  std::array<Wave, 8> waves_;
};

// Distances are of squares: the mask in the upper left corner of one.
std::vector<float> InSquare(const PhotoMask& mask, int side) {
  std::vector<float> out(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 0.0f);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x)
      out[static_cast<std::size_t>(y * side + x)] = mask.at(x, y) ? 1.0f : 0.0f;
  }
  return out;
}

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

// Of the training part's objects, in the world of the models.
std::vector<Point> MeanPoints(const PhotographSet& set) {
  std::vector<Point> mean(set.mean_keypoints.size());
  const std::vector<int> train = set.Select(Split::kTrain);
  for (const int i : train) {
    const std::vector<Point>& points = set.photographs[static_cast<std::size_t>(i)].points;
    for (std::size_t k = 0; k < mean.size(); ++k)
      mean[k] = mean[k] + (1 / static_cast<double>(train.size())) * points[k];
  }
  return mean;
}

void MakeCameraExact(const Similarity& to_cameras, Photograph* photo) {
  std::vector<Keypoint> all = photo->keypoints;
  for (std::size_t k = 0; k < all.size(); ++k) {
    photo->points[k] = to_cameras(photo->points[k]);
    all[k].visible = true;
  }
  photo->camera = FitWeakCamera(photo->points, all, *photo->camera);
}

// For the test part: keypoints and cameras of the true models. For the training part cameras, if
// they are exact, whose mean shape is then the true one too.
void TellTruth(bool exact_cameras, PhotographSet* set) {
  std::vector<Point> mean = MeanPoints(*set);
  const Similarity to_cameras = FitSimilarity(mean, set->mean_keypoints);
  for (Photograph& photo : set->photographs) {
    const bool test = photo.split == Split::kTest;
    if (test || exact_cameras) MakeCameraExact(to_cameras, &photo);
    if (!test) photo.points.clear();
  }
  if (!exact_cameras) return;
  for (std::size_t k = 0; k < mean.size(); ++k) set->mean_keypoints[k] = to_cameras(mean[k]);
}

}  // namespace

PhotoMask DisturbedMask(const PhotoMask& mask, double deviation, Rng& rng) {
  const int side = std::max(mask.width, mask.height);
  const std::vector<float> square = InSquare(mask, side);
  const auto to_object = SquaredDistances(square, side, true),
             to_rest = SquaredDistances(square, side, false);
  const double shift = deviation * rng.Normal() / 2;
  const SmoothNoise noise(rng);
  PhotoMask out = mask;
  bool any = false;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      const auto i = static_cast<std::size_t>(y * side + x);
      const double outside = std::sqrt(to_object[i]) - std::sqrt(to_rest[i]);
      const bool inside = outside < shift + deviation * noise.At(x, y);
      out.inside[static_cast<std::size_t>(y) * static_cast<std::size_t>(mask.width) +
                 static_cast<std::size_t>(x)] = inside;
      any = any || inside;
    }
  }
  return any ? out : mask;
}

const std::array<ExtremePoint, 12> kExtremePoints = {{{"left front bumper", {1, -1, 1}},
                                                      {"right front bumper", {-1, -1, 1}},
                                                      {"left back bumper", {1, -1, -1}},
                                                      {"right back bumper", {-1, -1, -1}},
                                                      {"left front light", {1, 0.2f, 1.5f}},
                                                      {"right front light", {-1, 0.2f, 1.5f}},
                                                      {"left trunk", {1, 0.2f, -1.5f}},
                                                      {"right trunk", {-1, 0.2f, -1.5f}},
                                                      {"left windshield", {0.6f, 1.5f, 0.4f}},
                                                      {"right windshield", {-0.6f, 1.5f, 0.4f}},
                                                      {"left rear window", {0.6f, 1.5f, -0.4f}},
                                                      {"right rear window", {-0.6f, 1.5f, -0.4f}}}};

std::vector<int> ExtremeMirror() {
  std::vector<int> out;
  for (int k = 0; k < static_cast<int>(kExtremePoints.size()); ++k) out.push_back(k ^ 1);
  return out;
}

std::vector<glm::vec3> FindExtremePoints(const Mesh& mesh) {
  const Bounds bounds = MeshBounds(mesh);
  const glm::vec3 centre = 0.5f * (bounds.low + bounds.high);
  const glm::vec3 half = glm::max(0.5f * (bounds.high - bounds.low), glm::vec3(1e-6f));
  std::vector<glm::vec3> out;
  for (const ExtremePoint& point : kExtremePoints) {
    const glm::vec3 along =
        glm::vec3(point.direction[0], point.direction[1], point.direction[2]) / half;
    float farthest = -1e30f;
    for (const glm::vec3& p : mesh.positions)
      farthest = std::max(farthest, glm::dot(along, p - centre));
    glm::vec3 sum(0);
    float count = 0;
    for (const glm::vec3& p : mesh.positions) {
      if (glm::dot(along, p - centre) < farthest - 0.01f) continue;
      sum += p;
      count += 1;
    }
    out.push_back(sum / count);
  }
  return out;
}

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
  TellTruth(noise.exact_cameras, &set);
  return WriteCmrLayout(folder, set);
}

}  // namespace tilegrad::train
