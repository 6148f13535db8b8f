// SPDX-License-Identifier: Apache-2.0
// Scores a shape against the truth.
#pragma once

#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "render/picture/picture.h"
#include "train/data/dataset.h"
#include "train/eval/evaluation.h"

namespace tilegrad::train {

// One side of a comparison; both are normalised to fill the same cube.
struct Shape {
  std::vector<std::uint8_t> occupancy;  // of Voxelize
  std::vector<std::uint8_t> carved;     // of VoxelizeCarved; empty: unknown
  std::vector<glm::vec3> points;        // of the surface; empty: unknown
};

// The rule behind the voxels that come with a set, by DatasetInfo::source.
VoxelRule OwnVoxelRule(const std::string& source);

struct VoxelJob {
  VoxelRule rule = VoxelRule::kOurs;
  double half_extent = CameraRule{}.half_extent;  // of meshes; N3MR's rule does not move them
};

// `seed`: of the points.
Result<Shape> ShapeOf(Mesh mesh, std::uint64_t seed, const VoxelJob& voxels = {});
// The truth of a dataset, whose voxels follow its `own` rule; another rule needs a mesh to
// voxelise. An error for a mesh without extent.
Result<Shape> TruthShape(const ModelData& data, VoxelRule own = VoxelRule::kOurs,
                         const VoxelJob& voxels = {});

Score Compare(const Shape& shape, const Shape& truth);
// The score of a prediction without a shape.
Score WorstScore(const Shape& truth);
// The mean; it lacks any measure that one of the scores lacks.
Score MeanScore(std::span<const Score> scores);

// Whether the input picture shows the part of the prediction at a pixel.
enum class Side : std::uint8_t { kUnknown, kSeen, kHidden };

// Accumulates the colour measures of a Score, picture by picture.
struct ColorDifference {
  struct Sum {
    double sum = 0;
    std::size_t count = 0;
    void Add(double difference) {
      sum += difference;
      ++count;
    }
    double Mean(double of_nothing) const {
      return count == 0 ? of_nothing : sum / static_cast<double>(count);
    }
  };
  bool has_sides = false;
  Sum either, shared, seen, hidden;

  // Planar RGBA bytes, [4][pixels] each; sides [pixels] of a, or empty.
  void Add(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
           std::span<const Side> sides = {});
  void To(Score* score) const;
};

// Draws predictions like a dataset's pictures of its models: unlit, RGB over black.
class PredictionPictures {
 public:
  PredictionPictures(const DatasetInfo& info, std::vector<int> views);
  struct Pictures {
    std::vector<std::uint8_t> rgba;  // [views][4][size][size]
    std::vector<Side> sides;         // [views][size][size], at centres of pixels
  };
  // `from`: the view that the mesh was predicted from; none: no sides. `own`: the cameras of the
  // model's views; empty: the dataset's.
  Result<Pictures> Draw(const Mesh& mesh, std::optional<int> from = std::nullopt,
                        std::span<const Camera> own = {});

 private:
  Camera ViewOf(int view, std::span<const Camera> own) const {
    return own.empty() ? info_.camera.View(view) : own[static_cast<std::size_t>(view)];
  }
  Result<std::vector<bool>> FacesSeenBy(const Camera& camera, std::size_t faces, Scene scene);

  const DatasetInfo& info_;
  std::vector<int> views_;
  std::unique_ptr<Workers> alone_;
  PictureRenderer renderer_;
};

// All measures of a Score, in the order of files and tables.

struct ScoreMeasure {
  const char* key;                      // of eval.json
  std::optional<double> Score::*value;  // null: `iou`, which every score has
  const char* heading;
  double factor;  // for the number shown to people
  int digits;     // of that, after the point
  bool column;    // has its own column in tables; else shown in the cells of classes
  bool less_is_better;

  std::optional<double> Of(const Score& score) const {
    return value ? score.*value : std::optional(score.iou);
  }
  void Set(std::optional<double> number, Score* score) const {
    if (value) score->*value = number;
    if (!value && number) score->iou = *number;
  }
};

inline constexpr ScoreMeasure kMeasures[] = {
    {"iou", nullptr, "3D IoU", 100, 1, false, false},
    {"f_score", &Score::f_score, "F-score", 100, 1, false, false},
    {"accuracy", &Score::accuracy, "accuracy", 100, 1, false, false},
    {"carved_iou", &Score::carved_iou, "carved IoU", 100, 1, true, false},
    {"color_l1", &Score::color_l1, "colour L1", 1, 3, true, true},
    {"shared_color_l1", &Score::shared_color_l1, "where both are", 1, 3, true, true},
    {"seen_color_l1", &Score::seen_color_l1, "seen sides", 1, 3, true, true},
    {"hidden_color_l1", &Score::hidden_color_l1, "hidden sides", 1, 3, true, true},
    {"texture_l1", &Score::texture_l1, "texture L1", 1, 4, true, true},
    {"light_angle", &Score::light_angle, "light, degrees", 1, 1, true, true},
    {"lit_l1", &Score::lit_l1, "texture + light L1", 1, 4, true, true},
    {"mask_loss", &Score::mask_loss, "2D IoU loss", 1, 3, true, true},
    {"pck", &Score::pck, "PCK@0.1", 1, 3, true, false},
};

constexpr const ScoreMeasure& MeasureOf(std::string_view key) {
  for (const ScoreMeasure& measure : kMeasures) {
    if (key == measure.key) return measure;
  }
  std::abort();
}

}  // namespace tilegrad::train
