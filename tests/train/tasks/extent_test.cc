// SPDX-License-Identifier: Apache-2.0
// Objects are predicted in the size that a dataset has them in: N3MR's renders, half-extent 0.5,
// are learned as well as the same objects at 0.45. A shape of another size than its pictures is
// pushed out of its proportions.
#include <gtest/gtest.h>

#include "scene/shapes.h"
#include "support/temp_folder.h"
#include "train/data/dataset_files.h"
#include "train/data/sources/model_source.h"
#include "train/eval/scores.h"
#include "train/metrics/metrics.h"
#include "train/predictor.h"
#include "train/tasks/task.h"
#include "train/trainer.h"

namespace tilegrad::train::extent_test {

constexpr const char* kConfig = R"(name = "extent"
[network]
channels = 8
code = 32
hidden1 = 32
hidden2 = 32
template_level = 2
smoothing = 2
symmetric = true
fc_norm = false
fc_deviation = 0.0
[loss]
color = 0.1
[render]
sharpness = 3000
sharpness_start = 300
[optimizer]
learning_rate = 2e-3
final_factor = 0.1
[schedule]
steps = 300
batch = 8
views = 2
log_every = 100
sample_every = 1000
checkpoint_every = 300
)";

// In NMR's camera.
DatasetInfo InfoOf(double half_extent) {
  DatasetInfo info;
  info.source = "nmr";
  info.image_size = 32;
  info.views = 8;
  info.camera.azimuth_step = 45;
  info.camera.elevation = 30;
  info.camera.distance = 2.732;
  info.camera.lens.fov_y = 30;
  info.camera.lens.width = info.camera.lens.height = info.image_size;
  info.camera.half_extent = half_extent;
  info.classes = {"box"};
  info.recipe = "0000000000000000";
  return info;
}

// Long and flat, tall and thin, ...
Mesh BoxOf(int model, double half_extent) {
  constexpr glm::vec3 kSides[] = {{1, 0.3f, 0.5f}, {0.4f, 1, 0.4f}, {0.6f, 0.4f, 1}, {1, 1, 0.4f}};
  Mesh mesh = Box(glm::vec3(0), static_cast<float>(2 * half_extent) * kSides[model]);
  mesh.colors.assign(mesh.positions.size(), {0.8f, 0.5f, 0.2f, 1});
  return mesh;
}

Status WriteBoxes(const Path& folder, double half_extent, double said) {
  const DatasetInfo info = InfoOf(said);
  PredictionPictures pictures(info, {0, 1, 2, 3, 4, 5, 6, 7});
  std::filesystem::create_directories(ModelFilePath(folder, "box", "0").parent_path());
  std::vector<ModelInfo> models;
  for (int m = 0; m < 4; ++m) {
    const Mesh mesh = BoxOf(m, half_extent);
    ModelData data;
    TILEGRAD_ASSIGN(auto drawn, pictures.Draw(mesh));
    data.images = std::move(drawn.rgba);
    TILEGRAD_ASSIGN(data.occupancy, Voxelize(mesh, kOccupancyResolution));
    ModelInfo& model = models.emplace_back();
    model.id = std::to_string(m);
    TILEGRAD_TRY(
        SaveModelFile(ModelFilePath(folder, "box", model.id), info, data, {info.recipe, 0, 0}));
  }
  TILEGRAD_TRY(WriteDatasetInfo(folder, info));
  return WriteModels(folder, info, models);
}

// 3D IoU on what was trained on: boxes of `half_extent`, of which the dataset says that it is
// `said`.
Result<double> LearnBoxes(const Path& folder, double half_extent, double said) {
  const Workers workers(2);
  const StopFlag stop = false;
  TILEGRAD_TRY(WriteBoxes(folder / "data", half_extent, said));
  TrainJob job;
  job.data = folder / "data";
  job.run = folder / "run";
  TILEGRAD_ASSIGN(job.config, ParseConfig(kConfig, "boxes"));
  TILEGRAD_TRY(Train(job, workers, {}, stop).status());
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(job.run, workers));
  EXPECT_EQ(predictor.half_extent(), said);
  EXPECT_NEAR(MeshBounds(predictor.template_mesh()).high.x, said, 1e-6);
  const TaskEvaluation evaluation{
      .run = job.run, .data = job.data, .predictor = predictor, .split = Split::kTrain};
  TILEGRAD_ASSIGN(const Evaluation scores,
                  predictor.task().Evaluate(evaluation, workers, {}, stop));
  return scores.rows.back().mean.iou;
}

using Extent = TempFolderTest;

TEST_F(Extent, NmrIsLearnedInItsOwnSize) {
  const auto nmr = LearnBoxes(folder_ / "nmr", 0.5, 0.5),
             control = LearnBoxes(folder_ / "own", 0.45, 0.45),
             wrong = LearnBoxes(folder_ / "wrong", 0.5, 0.45);
  for (const auto& found : {nmr, control, wrong})
    ASSERT_TRUE(found.ok()) << found.status().message();
  EXPECT_GT(*control, 0.6);
  EXPECT_GT(*nmr, *control - 0.05);
  EXPECT_LT(*wrong, *nmr - 0.1);
}

}  // namespace tilegrad::train::extent_test
