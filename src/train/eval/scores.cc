// SPDX-License-Identifier: Apache-2.0
#include "train/eval/scores.h"

#include "render/picture/composite.h"
#include "render/picture/mesh_scene.h"
#include "scene/camera_conventions.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

constexpr int kSamples = 3;      // along each side of a pixel
constexpr int kHalfCover = 128;  // of 255

// The mean of what `pick` finds in each score, or nothing.
template <class Pick>
std::optional<double> MeanOf(std::span<const Score> scores, Pick pick) {
  double sum = 0;
  for (const Score& score : scores) {
    if (!(score.*pick)) return std::nullopt;
    sum += *(score.*pick);
  }
  return sum / static_cast<double>(scores.size());
}

}  // namespace

VoxelRule OwnVoxelRule(const std::string& source) {
  if (source == "nmr") return VoxelRule::kNmr;
  return source == "choy" || source == "dibr" ? VoxelRule::kBinvox : VoxelRule::kOurs;
}

Result<Shape> ShapeOf(Mesh mesh, std::uint64_t seed, const VoxelJob& voxels) {
  Shape shape;
  if (voxels.rule == VoxelRule::kNmr) {
    TILEGRAD_ASSIGN(shape.occupancy, VoxelizeNmr(mesh, voxels.half_extent, kOccupancyResolution));
  }
  TILEGRAD_TRY(NormalizeToBox(mesh, static_cast<float>(CameraRule{}.half_extent)));
  if (voxels.rule == VoxelRule::kOurs) {
    TILEGRAD_ASSIGN(shape.occupancy, Voxelize(mesh, kOccupancyResolution));
  }
  TILEGRAD_ASSIGN(shape.carved, VoxelizeCarved(mesh, kOccupancyResolution));
  if (voxels.rule == VoxelRule::kBinvox) shape.occupancy = shape.carved;
  TILEGRAD_ASSIGN(shape.points, SampleSurface(mesh, kTruthPoints, seed));
  return shape;
}

Result<Shape> TruthShape(const ModelData& data, VoxelRule own, const VoxelJob& voxels) {
  Shape shape{data.occupancy, {}, data.points};
  if (data.mesh.faces.empty()) return shape;
  TILEGRAD_ASSIGN(shape.carved, VoxelizeCarved(data.mesh, kOccupancyResolution));
  if (voxels.rule == own) return shape;
  TILEGRAD_ASSIGN(Shape made, ShapeOf(data.mesh, /*seed=*/0, voxels));
  shape.occupancy = std::move(made.occupancy);
  return shape;
}

Score Compare(const Shape& shape, const Shape& truth) {
  Score score{.iou = VoxelIou(shape.occupancy, truth.occupancy), .f_score = {}};
  if (!truth.points.empty() && !shape.points.empty())
    score.f_score = CompareSurfaces(shape.points, truth.points, kFScoreThreshold).f_score;
  if (!truth.carved.empty() && !shape.carved.empty())
    score.carved_iou = VoxelIou(shape.carved, truth.carved);
  return score;
}

Score WorstScore(const Shape& truth) {
  Score score{.iou = 0, .f_score = {}};
  if (!truth.points.empty()) score.f_score = 0;
  if (!truth.carved.empty()) score.carved_iou = 0;
  score.color_l1 = score.shared_color_l1 = 1;
  score.seen_color_l1 = score.hidden_color_l1 = 1;
  return score;
}

Score MeanScore(std::span<const Score> scores) {
  Score mean{.iou = 0, .f_score = {}};
  for (const Score& score : scores) mean.iou += score.iou / static_cast<double>(scores.size());
  for (const ScoreMeasure& measure : kMeasures) {
    if (measure.value) mean.*measure.value = MeanOf(scores, measure.value);
  }
  return mean;
}

void ColorDifference::Add(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                          std::span<const Side> sides) {
  const std::size_t pixels = a.size() / 4;
  has_sides = has_sides || !sides.empty();
  for (std::size_t p = 0; p < pixels; ++p) {
    const int cover_a = a[3 * pixels + p], cover_b = b[3 * pixels + p];
    if (cover_a == 0 && cover_b == 0) continue;
    const bool both = cover_a >= kHalfCover && cover_b >= kHalfCover;
    const Side side = sides.empty() ? Side::kUnknown : sides[p];
    for (std::size_t c = 0; c < 3; ++c) {
      const int x = a[c * pixels + p], y = b[c * pixels + p];
      either.Add(std::abs(x - y) / 255.0);
      if (!both) continue;
      const double apart = std::abs(double(x) / cover_a - double(y) / cover_b);
      shared.Add(apart);
      if (side == Side::kSeen) seen.Add(apart);
      if (side == Side::kHidden) hidden.Add(apart);
    }
  }
}

void ColorDifference::To(Score* score) const {
  score->color_l1 = either.Mean(0);
  score->shared_color_l1 = shared.Mean(1);
  if (!has_sides) return;
  score->seen_color_l1 = seen.Mean(1);
  score->hidden_color_l1 = hidden.Mean(1);
}

PredictionPictures::PredictionPictures(const DatasetInfo& info, std::vector<int> views)
    : info_(info),
      views_(std::move(views)),
      alone_(std::make_unique<Workers>(1)),
      renderer_(*alone_) {}

Result<PredictionPictures::Pictures> PredictionPictures::Draw(const Mesh& mesh,
                                                              std::optional<int> from,
                                                              std::span<const Camera> own) {
  TILEGRAD_TRY(Validate(mesh));
  const MeshScene made(mesh, {.color_space = ColorSpace::kSrgb});
  Scene scene = made.scene();
  std::vector<bool> seen;
  if (from) {
    TILEGRAD_ASSIGN(seen, FacesSeenBy(ViewOf(*from, own), mesh.faces.size(), scene));
  }
  Pictures out;
  Picture picture;
  for (const int view : views_) {
    scene.camera = ViewOf(view, own);
    const PictureRequest request{.width = info_.image_size,
                                 .height = info_.image_size,
                                 .supersampling = kSamples,
                                 .face_ids = from.has_value()};
    TILEGRAD_TRY(renderer_.Render(scene, request, &picture));
    const auto planes = PremultipliedPlanes(picture);
    out.rgba.insert(out.rgba.end(), planes.begin(), planes.end());
    for (const std::int32_t id : picture.face_ids) {
      const bool shown = id >= 0 && seen[static_cast<std::size_t>(id)];
      out.sides.push_back(id < 0 ? Side::kUnknown : shown ? Side::kSeen : Side::kHidden);
    }
  }
  return out;
}

// At the samples of pictures.
Result<std::vector<bool>> PredictionPictures::FacesSeenBy(const Camera& camera, std::size_t faces,
                                                          Scene scene) {
  const int size = kSamples * info_.image_size;
  scene.camera = ScaledCamera(camera, static_cast<float>(kSamples));
  Picture picture;
  const PictureRequest request{.width = size, .height = size, .color = false, .face_ids = true};
  TILEGRAD_TRY(renderer_.Render(scene, request, &picture));
  std::vector<bool> seen(faces);
  for (const std::int32_t id : picture.face_ids) {
    if (id >= 0) seen[static_cast<std::size_t>(id)] = true;
  }
  return seen;
}

}  // namespace tilegrad::train
