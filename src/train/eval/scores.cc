// SPDX-License-Identifier: Apache-2.0
#include "train/eval/scores.h"

#include <cstdlib>

#include "base/error.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_scene.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

constexpr int kSamples = 3;  // along each side of a pixel

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

Result<Shape> ShapeOf(Mesh mesh, std::uint64_t seed) {
  TILEGRAD_TRY(NormalizeToBox(mesh, static_cast<float>(CameraRule{}.half_extent)));
  Shape shape;
  TILEGRAD_ASSIGN(shape.occupancy, Voxelize(mesh, kOccupancyResolution));
  TILEGRAD_ASSIGN(shape.carved, VoxelizeCarved(mesh, kOccupancyResolution));
  TILEGRAD_ASSIGN(shape.points, SampleSurface(mesh, kTruthPoints, seed));
  return shape;
}

Result<Shape> TruthShape(const ModelData& data) {
  Shape shape{data.occupancy, {}, data.points};
  if (data.mesh.faces.empty()) return shape;
  TILEGRAD_ASSIGN(shape.carved, VoxelizeCarved(data.mesh, kOccupancyResolution));
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
  score.color_l1 = 1;
  return score;
}

Score MeanScore(std::span<const Score> scores) {
  Score mean{.iou = 0, .f_score = MeanOf(scores, &Score::f_score)};
  for (const Score& score : scores) mean.iou += score.iou / static_cast<double>(scores.size());
  mean.accuracy = MeanOf(scores, &Score::accuracy);
  mean.carved_iou = MeanOf(scores, &Score::carved_iou);
  for (const auto measure : {&Score::color_l1, &Score::texture_l1, &Score::lit_l1,
                             &Score::light_angle, &Score::mask_loss, &Score::pck})
    mean.*measure = MeanOf(scores, measure);
  return mean;
}

void ColorDifference::Add(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) {
  const std::size_t pixels = a.size() / 4;
  for (std::size_t p = 0; p < pixels; ++p) {
    if (a[3 * pixels + p] == 0 && b[3 * pixels + p] == 0) continue;
    for (std::size_t c = 0; c < 3; ++c)
      sum += std::abs(int{a[c * pixels + p]} - int{b[c * pixels + p]}) / 255.0;
    count += 3;
  }
}

PredictionPictures::PredictionPictures(const DatasetInfo& info, std::vector<int> views)
    : info_(info),
      views_(std::move(views)),
      alone_(std::make_unique<Workers>(1)),
      renderer_(*alone_) {}

Result<std::vector<std::uint8_t>> PredictionPictures::Draw(const Mesh& mesh) {
  TILEGRAD_TRY(Validate(mesh));
  const MeshScene made(mesh, {.color_space = ColorSpace::kSrgb});
  Scene scene = made.scene();
  std::vector<std::uint8_t> out;
  Picture picture;
  for (const int view : views_) {
    scene.camera = info_.camera.View(view);
    const PictureRequest request{
        .width = info_.image_size, .height = info_.image_size, .supersampling = kSamples};
    TILEGRAD_TRY(renderer_.Render(scene, request, &picture));
    const auto planes = PremultipliedPlanes(picture);
    out.insert(out.end(), planes.begin(), planes.end());
  }
  return out;
}

}  // namespace tilegrad::train
