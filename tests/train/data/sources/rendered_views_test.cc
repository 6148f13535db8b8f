// SPDX-License-Identifier: Apache-2.0
// Published sets in miniature: made into a dataset, trained on for 20 steps, evaluated by their own
// rule. The mesh that a set was rendered from, through the dataset's cameras, meets its masks.
#include <gtest/gtest.h>

#include <cmath>

#include "io/binvox.h"
#include "io/npz.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "train/data/build/build.h"
#include "train/data/sources/miniatures.h"
#include "train/data/sources/split_list.h"
#include "train/eval/scores.h"
#include "train/metrics/metrics.h"
#include "train/tasks/task.h"
#include "train/tiny_run_fixture.h"

namespace tilegrad::train::rendered_views_test {

using namespace miniatures;

constexpr double kMaskIou = 0.98;

using Source = std::unique_ptr<ModelSource>;

class RenderedSets : public TinyRunTest {
 protected:
  Path Set() const { return folder_ / "set"; }
  Path Data() const { return folder_ / "data"; }

  Result<BuildSummary> Build(const Source& source, bool allow_broken = false) const {
    BuildOptions options;
    options.split.test_share = 0.2;
    options.allow_broken = allow_broken;
    return BuildDataset(*source, options, Data(), Workers(2), {});
  }

  // Of all views of each model together.
  void ExpectMasks(const std::vector<MiniatureModel>& models, double least = kMaskIou) const {
    const Dataset dataset = Ok(Dataset::Open(Data())).value();
    ASSERT_EQ(dataset.models().size(), models.size());
    for (std::size_t m = 0; m < models.size(); ++m) {
      const ModelData data = Ok(dataset.Load(static_cast<int>(m))).value();
      LitRenderer renderer;
      const auto ours = Ok(renderer.Render(models[m].mesh, CamerasOf(dataset.info(), data.cameras),
                                           dataset.info().image_size));
      EXPECT_GE(MaskIou(data.images, *ours, dataset.info().image_size), least) << models[m].id;
    }
  }
  static double MaskIou(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b,
                        int size) {
    const auto pixels = static_cast<std::size_t>(size * size);
    std::size_t both = 0, either = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (i / pixels % 4 != 3) continue;
      both += a[i] >= 128 && b[i] >= 128;
      either += a[i] >= 128 || b[i] >= 128;
    }
    return static_cast<double>(both) / static_cast<double>(either);
  }

  // The set's voxels against those of the meshes by its rule, and surface points against theirs.
  void ExpectTruth(const std::vector<MiniatureModel>& models, VoxelRule rule,
                   double least_iou) const {
    const Dataset dataset = Ok(Dataset::Open(Data())).value();
    const double half_extent = dataset.info().camera.half_extent;
    for (std::size_t m = 0; m < models.size(); ++m) {
      const ModelData data = Ok(dataset.Load(static_cast<int>(m))).value();
      const Shape truth = Ok(TruthShape(data, rule, {rule, half_extent})).value(),
                  mesh = Ok(ShapeOf(models[m].mesh, 1, {rule, half_extent})).value();
      const Score score = Compare(mesh, truth);
      EXPECT_GE(score.iou, least_iou) << models[m].id;
      if (data.points.empty()) continue;
      // Of two draws of 2,500 points each, some three quarters are within 0.02 of one another.
      EXPECT_GT(score.f_score.value(), 0.6) << models[m].id;
    }
  }

  Evaluation TrainAndEvaluate(std::optional<VoxelRule> rule = std::nullopt) const {
    const Path run = folder_ / "run";
    if (!PathExists(run))
      Ok(Train({.config = kTinyConfig, .settings = {"schedule.steps=20"}}).status());
    const auto predictor = Ok(Predictor::Load(run, workers_));
    TaskEvaluation evaluation{.run = run, .data = Data(), .predictor = *predictor};
    evaluation.voxels = rule;
    return Ok(predictor->task().Evaluate(evaluation, workers_, {})).value();
  }
  void ExpectEvaluation(const char* rule) const {
    const Evaluation scores = TrainAndEvaluate();
    EXPECT_EQ(scores.voxels, rule);
    EXPECT_EQ(scores.rows.back().method, "tilegrad");
    EXPECT_GT(scores.rows.back().mean.iou, 0);
    EXPECT_EQ(scores.unusable_predictions, 0);
    EXPECT_EQ(scores.models.size(), 2u);
  }
};

TEST_F(RenderedSets, Choy) {
  const auto models = MiniatureModels(0.45f);
  WriteChoy(Set(), models);
  Ok(Build(Ok(ChoySource(Set(), {}, 137)).value()).status());
  ExpectMasks(models);
  std::filesystem::remove_all(Data());
  const auto summary = Ok(Build(Ok(ChoySource(Set(), {}, 64)).value()));
  EXPECT_EQ(summary->info.classes, (std::vector<std::string>{"car", "chair"}));
  // The first four of five of a class, by name.
  for (std::size_t m = 0; m < models.size(); ++m)
    EXPECT_EQ(summary->models[m].split, m % 5 < 4 ? Split::kTrain : Split::kTest);
  // Averaged down, thin legs of chairs are otherwise on the border of half a pixel.
  ExpectMasks(models, 0.94);
  ExpectTruth(models, VoxelRule::kBinvox, 0.98);
  ExpectEvaluation("binvox");
}

TEST_F(RenderedSets, ChoyBySplitListsOfPixel2Mesh) {
  std::vector<MiniatureModel> models = MiniatureModels(0.45f);
  models.resize(3);
  WriteChoy(Set(), models);
  const auto line = [&](std::size_t m) {
    return "Data/ShapeNetP2M/" + models[m].synset + "/" + models[m].id + "/rendering/00.dat\n";
  };
  const SplitList list =
      Ok(SplitList::Read({Write("train_list.txt", line(0)), Write("test_list.txt", line(2))}))
          .value();
  const auto summary = Ok(Build(Ok(ChoySource(Set(), list, 32)).value()));
  ASSERT_EQ(summary->models.size(), 2u);
  EXPECT_EQ(summary->models[0].split, Split::kTrain);
  EXPECT_EQ(summary->models[1].split, Split::kTest);
  EXPECT_EQ(summary->info.image_size, 32);
}

TEST_F(RenderedSets, Dvr) {
  const auto models = MiniatureModels(0.5f);
  WriteDvr(Set(), models);
  const auto summary = Ok(Build(Ok(DvrSource(Set(), {}, 64)).value()));
  EXPECT_EQ(summary->models[2].split, Split::kTrain);
  EXPECT_EQ(summary->models[3].split, Split::kValidation);
  EXPECT_EQ(summary->models[4].split, Split::kTest);
  ExpectMasks(models);
  ExpectTruth(models, VoxelRule::kOurs, 0.95);
  ExpectEvaluation("ours");
}

TEST_F(RenderedSets, Dibr) {
  const auto models = MiniatureModels(0.45f);
  WriteDibr(Set(), models);
  std::string train, test;
  for (std::size_t m = 0; m < models.size(); ++m)
    (m % 5 < 4 ? train : test) += models[m].synset + "_" + models[m].id + "_0.png\n";
  const SplitList list =
      Ok(SplitList::Read({Write("train_list.txt", train), Write("test_list.txt", test)})).value();
  Ok(Build(Ok(DibrSource(Set(), list, 64)).value()).status());
  ExpectMasks(models);
  ExpectTruth(models, VoxelRule::kBinvox, 0.98);
  ExpectEvaluation("binvox");
  // With a mesh, any rule has a truth.
  const Evaluation ours = TrainAndEvaluate(VoxelRule::kOurs),
                   nmr = TrainAndEvaluate(VoxelRule::kNmr);
  EXPECT_EQ(ours.voxels, "ours");
  EXPECT_NE(ours.rows.back().mean.iou, nmr.rows.back().mean.iou);
}

TEST_F(RenderedSets, Nmr) {
  const auto models = MiniatureModels(0.5f);
  WriteNmr(Set(), models);
  Ok(Build(Ok(NmrSource(Set())).value()).status());
  // The dataset has them by split: only their order differs.
  const Dataset dataset = Ok(Dataset::Open(Data())).value();
  EXPECT_EQ(dataset.Select(Split::kTest).size(), 2u);
  EXPECT_EQ(dataset.info().classes, (std::vector<std::string>{"car", "chair"}));
  EXPECT_DOUBLE_EQ(dataset.info().camera.lens.fov_y, 30);
  const ModelData first = Ok(dataset.Load(0)).value();
  EXPECT_TRUE(first.points.empty() && first.mesh.faces.empty());
  std::vector<MiniatureModel> sorted = {models[4], models[0], models[1], models[2], models[3],
                                        models[9], models[5], models[6], models[7], models[8]};
  ExpectMasks(sorted);
  ExpectTruth(sorted, VoxelRule::kNmr, 1);
  ExpectEvaluation("nmr");
}

// --- Broken members: each costs itself ---

// A truncated picture, a missing file, and a class without models.
class BrokenMembersOfSets : public RenderedSets {
 protected:
  // `renders` is the folder of the classes.
  void WriteSet(void (*write)(const Path&, const std::vector<MiniatureModel>&), float half_extent,
                const char* renders = "") {
    models_ = MiniatureModels(half_extent);
    write(Set(), models_);
    std::filesystem::create_directories(Set() / renders / "04256520");
  }
  Path OfModel(const char* folder, std::size_t m) const {
    return Set() / folder / models_[m].synset / models_[m].id;
  }
  static void Truncate(const Path& file) {
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  }
  void ExpectTwoBroken(Result<Source> opened, const std::string& truncated,
                       const std::string& missing) const {
    const Source source = Ok(std::move(opened)).value();
    const auto refused = Build(source);
    ExpectMessage(refused.status(), "2 of 10 cannot be used, more than 1 %");
    ExpectMessage(refused.status(), "--allow-broken");
    const auto summary = Ok(Build(source, true));
    EXPECT_EQ(summary->models.size(), 8u);
    ASSERT_EQ(summary->rejected.size(), 2u);
    ExpectIn(summary->rejected[0].reason, truncated);
    ExpectIn(summary->rejected[1].reason, missing);
    ExpectIn(summary->broken.Summary(), "car/", "chair/");
    ASSERT_EQ(summary->ignored.size(), 1u);
    ExpectIn(summary->ignored[0].file + " " + summary->ignored[0].reason, "04256520",
             "holds no model");
  }

  std::vector<MiniatureModel> models_;
};

TEST_F(BrokenMembersOfSets, Choy) {
  WriteSet(WriteChoy, 0.45f, "ShapeNetRendering");
  Truncate(OfModel("ShapeNetRendering", 1) / "rendering/07.png");
  std::filesystem::remove(OfModel("ShapeNetVox32", 7) / "model.binvox");
  ExpectTwoBroken(ChoySource(Set(), {}, 64), "07.png", "model.binvox");
}

TEST_F(BrokenMembersOfSets, Dvr) {
  WriteSet(WriteDvr, 0.5f);
  Truncate(OfModel("", 1) / "mask/0007.png");
  std::filesystem::remove(OfModel("", 7) / "cameras.npz");
  ExpectTwoBroken(DvrSource(Set(), {}, 64), "0007.png", "cameras.npz");
}

TEST_F(BrokenMembersOfSets, Dibr) {
  WriteSet(WriteDibr, 0.45f);
  Truncate(OfModel("", 1) / "7.png");
  std::filesystem::remove(OfModel("", 7) / "7.npy");
  ExpectTwoBroken(DibrSource(Set(), {}, 64), "7.png", "7.npy");
}

// Meshes and points of renders are only for scores, but they are the model's.
TEST_F(BrokenMembersOfSets, MeshesOfDibr) {
  WriteSet(WriteDibr, 0.45f);
  Ok(WriteTextAtomic(OfModel("", 1) / "model-0.45.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"));
  Ok(WriteTextAtomic(OfModel("", 7) / "model-0.45.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  ExpectTwoBroken(DibrSource(Set(), {}, 64), "no triangles", "finite");
}

TEST_F(BrokenMembersOfSets, PointsOfDvr) {
  WriteSet(WriteDvr, 0.5f);
  const std::pair<std::size_t, std::vector<float>> points[] = {{1, {0, NAN, 0}}, {7, {0, 0, 7e9f}}};
  for (const auto& [m, point] : points)
    Ok(io::SaveNpz(OfModel("", m) / "pointcloud.npz",
                   {{"points", io::MakeNpy<float>({1, 3}, point)}}));
  ExpectTwoBroken(DvrSource(Set(), {}, 64), "not within", "not within");
}

// Pictures of nothing, and a class without models.
TEST_F(BrokenMembersOfSets, Nmr) {
  WriteNmr(Set(), MiniatureModels(0.5f));
  const Path file = Set() / "03001627_train_images.npz";
  io::NpzArrays arrays = Ok(io::LoadNpz(file)).value();
  Bytes& images = arrays["arr_0"].data;
  std::fill_n(images.begin(), images.size() / 4, std::uint8_t{0});  // the first of four
  Ok(io::SaveNpz(file, arrays));
  const std::vector<std::uint8_t> none;
  Ok(io::SaveNpz(Set() / "04256520_val_voxels.npz",
                 {{"arr_0", io::MakeNpy<std::uint8_t>({0, 32, 32, 32}, none)}}));
  Ok(io::SaveNpz(Set() / "04256520_val_images.npz",
                 {{"arr_0", io::MakeNpy<std::uint8_t>({0, 24, 4, 64, 64}, none)}}));
  const Source source = Ok(NmrSource(Set())).value();
  ExpectMessage(Build(source).status(), "1 of 10 cannot be used, more than 1 %: chair/train-00000");
  const auto summary = Ok(Build(source, true));
  EXPECT_EQ(summary->models.size(), 9u);
  ASSERT_EQ(summary->ignored.size(), 1u);
  ExpectIn(summary->ignored[0].file, "04256520_val");
}

// A header of another scale than the renders: no cameras are better than wrong ones.
TEST_F(BrokenMembersOfSets, VoxelsOfAnotherSize) {
  std::vector<MiniatureModel> models = MiniatureModels(0.45f);
  models.resize(2);
  WriteChoy(Set(), models);
  const Path file = Set() / "ShapeNetVox32" / models[0].synset / models[0].id / "model.binvox";
  const Source source = Ok(ChoySource(Set(), {}, 64)).value();
  io::BinvoxGrid grid = Ok(io::LoadBinvox(file)).value();
  EXPECT_TRUE(source->Load(0).ok());
  grid.scale *= 1.5;
  Ok(WriteFileAtomic(file, io::EncodeBinvox(grid)));
  ExpectMessage(source->Load(0).status(), "or of another size");
  std::fill(grid.voxels.begin(), grid.voxels.end(), std::uint8_t{0});
  Ok(WriteFileAtomic(file, io::EncodeBinvox(grid)));
  ExpectMessage(source->Load(0).status(), "or of another size");
}

// What is there, but makes no sense.
TEST_F(BrokenMembersOfSets, NumbersThatAreNoCamera) {
  std::vector<MiniatureModel> models = MiniatureModels(0.45f);
  models.resize(2);
  WriteChoy(Set(), models);
  const std::string folder = "set/ShapeNetRendering/" + models[0].synset + "/" + models[0].id;
  const Source source = Ok(ChoySource(Set(), {}, 64)).value();
  Write(folder + "/rendering/rendering_metadata.txt", "1 2 0 nan 25\n");
  ExpectMessage(source->Load(0).status(), "line 1: expected five numbers");
  Write(folder + "/rendering/rendering_metadata.txt", "1 2 0 0.7 25\n");
  ExpectMessage(source->Load(0).status(), "1 views, expected 24");
  EXPECT_TRUE(source->Load(1).ok());
  const Source large = Ok(ChoySource(Set(), {}, 256)).value();
  ExpectMessage(large->Load(1).status(), "137 x 137 pixels");
  EXPECT_EQ(ChoySource(folder_, {}, 64).status().code(), StatusCode::kNotFound);
}

}  // namespace tilegrad::train::rendered_views_test
