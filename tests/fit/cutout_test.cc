// SPDX-License-Identifier: Apache-2.0
// Textures that are cut out: closed masks, and alpha that is found again from masks.
#include "fit/cutout.h"

#include <gtest/gtest.h>

#include "fit/views_fixture.h"

namespace tilegrad::train::cutout_test {

constexpr int kSide = 64, kViews = 6;

// One image: a square of 40 pixels with columns of `gap` left out of every `period`.
TargetImages Comb(int period, int gap) {
  TargetImages out{kSide, kSide, {}, {}};
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const bool square = x >= 12 && x < 52 && y >= 12 && y < 52;
      out.alpha.push_back(square && (x - 12) % period >= gap ? 1.0f : 0.0f);
    }
  }
  out.color.assign(3 * out.alpha.size(), 0.5f);
  return out;
}

double Sum(std::span<const float> values) {
  double sum = 0;
  for (const float v : values) sum += static_cast<double>(v);
  return sum;
}

TEST(ClosedMasks, NarrowGapsVanishAndWideOnesStay) {
  const Workers workers(1);
  const TargetImages narrow = Comb(4, 1), wide = Comb(20, 10);
  const ClosedMasks closed = CloseMasks(narrow, workers);
  EXPECT_NEAR(closed.gaps, 1.0 / 3, 0.05);
  for (std::size_t p = 0; p < narrow.alpha.size(); ++p) EXPECT_GE(closed.alpha[p], narrow.alpha[p]);
  EXPECT_LT(CloseMasks(wide, workers).gaps, 0.02);
}

// A square of 32 x 32 texels, seen from both sides of the plane it lies in.
FitScene Sheet() {
  FitScene scene;
  scene.positions = {-0.4f, -0.4f, 0, 0.4f, -0.4f, 0, 0.4f, 0.4f, 0, -0.4f, 0.4f, 0};
  scene.faces = scene.uv_indices = {0, 1, 2, 0, 2, 3};
  scene.uvs = {0, 0, 1, 0, 1, 1, 0, 1};
  scene.texture = Image(32, 32, 3, 0.25f);
  scene.wrap = Wrap::kClamp;
  for (int v = 0; v < kViews; ++v)
    scene.cameras.push_back(OrbitCamera(Lens{45, kSide, kSide}, 50 + 16.0 * v, 10, 1.5));
  return scene;
}

// Bars of four texels and gaps of four.
FitScene Fence() {
  FitScene scene = Sheet();
  for (int t = 0; t < 32 * 32; ++t) scene.cutout.push_back(t % 8 < 4 ? 1.0f : 0.0f);
  return scene;
}

FitJob JobOf(const FitScene& scene) {
  FitJob job;
  job.input.images.width = job.input.images.height = kSide;
  const Workers workers(1);
  CutoutView view(scene, workers);
  for (int v = 0; v < kViews; ++v) {
    const Picture picture = view.Draw(scene.cameras[v], {kSide, kSide}, 3).value();
    job.input.images.alpha.insert(job.input.images.alpha.end(), picture.alpha.begin(),
                                  picture.alpha.end());
    job.input.training.push_back(v);
  }
  job.input.images.color.assign(3 * job.input.images.alpha.size(), 0.25f);
  return job;
}

double Iou(std::span<const float> a, std::span<const float> b) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    both += static_cast<double>(std::min(a[i], b[i]));
    either += static_cast<double>(std::max(a[i], b[i]));
  }
  return both / either;
}

// Of all views, drawn, and the masks.
double Score(const FitScene& scene, const FitJob& job) {
  const Workers workers(1);
  CutoutView view(scene, workers);
  std::vector<float> drawn;
  for (const Camera& camera : scene.cameras) {
    const Picture picture = view.Draw(camera, {kSide, kSide}, 3).value();
    drawn.insert(drawn.end(), picture.alpha.begin(), picture.alpha.end());
  }
  return Iou(drawn, job.input.images.alpha);
}

TEST(Cutout, BarsAreFoundAgainInASheet) {
  const FitJob job = JobOf(Fence());
  FitScene scene = Sheet();
  EXPECT_LT(Score(scene, job), 0.6);
  ASSERT_TRUE(FitCutout(job, Workers(1), {}, &scene).ok());
  EXPECT_GT(Score(scene, job), 0.93);
  FitScene again = Sheet();
  ASSERT_TRUE(FitCutout(job, Workers(3), {}, &again).ok());
  EXPECT_EQ(scene.cutout, again.cutout);
  const StopFlag stop = true;
  const Watch stopped{.stop = &stop};
  EXPECT_EQ(FitCutout(job, Workers(1), stopped, &again).code(), StatusCode::kCancelled);
}

TEST(Cutout, WhatMasksShowWholeStaysWhole) {
  const FitJob job = JobOf(Sheet());
  FitScene scene = Sheet();
  ASSERT_TRUE(FitCutout(job, Workers(1), {}, &scene).ok());
  for (const float a : scene.cutout) EXPECT_GE(a, kCutoff);
}

TEST(Cutout, TheMeshHasAMaskedTexture) {
  const Mesh mesh = MeshOfScene(Fence()), plain = MeshOfScene(Sheet());
  EXPECT_EQ(mesh.textures[0].image.channels, 4);
  EXPECT_EQ(mesh.textures[0].image.at(1, 0)[3], 255);
  EXPECT_EQ(mesh.textures[0].image.at(5, 0)[3], 0);
  EXPECT_EQ(mesh.materials[0].alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(plain.textures[0].image.channels, 3);
  EXPECT_EQ(plain.materials[0].alpha_mode, AlphaMode::kOpaque);
}

TEST(Cutout, IsForMasksWithGapsIfAutomatic) {
  FitJob job;
  job.input.images = Comb(4, 1);
  const Workers workers(1);
  EXPECT_FALSE(CutoutJob(job, workers).has_value()) << "one view makes no hull";
  job.config.start = StartShape::kHull;
  const auto cut = CutoutJob(job, workers);
  ASSERT_TRUE(cut.has_value());
  EXPECT_GT(Sum(cut->input.images.outline()), 1.2 * Sum(job.input.images.alpha));
  EXPECT_EQ(cut->input.images.alpha, job.input.images.alpha);
  job.input.images = Comb(20, 10);
  EXPECT_FALSE(CutoutJob(job, workers).has_value());
  job.config.cutout = Cutout::kOff;
  EXPECT_FALSE(CutoutJob(job, workers).has_value());
  job.config.cutout = Cutout::kOn;
  EXPECT_TRUE(CutoutJob(job, workers).has_value());
  EXPECT_TRUE(CheckCutout(job).ok());
  job.config.material = MaterialKind::kLambert;
  EXPECT_FALSE(CheckCutout(job).ok());
  EXPECT_FALSE(CutoutJob(job, workers).has_value());
}

// Whole fits to images of a board.
class CutoutFit : public ViewsTest {
 protected:
  void SetUp() override {
    Views(Box({0, 0, 0}, {0.9f, 0.7f, 0.1f}), {.views = 8, .held_out = 0, .size = 32});
  }
  FitJob Job(const std::string& out) {
    FitJob job;
    job.input = Input();
    // One column of eight, of all images: narrow enough to be closed.
    for (std::size_t p = 0; p < job.input.images.alpha.size(); p += 8)
      job.input.images.alpha[p] = 0;
    job.out = folder_ / out;
    job.config.cutout = Cutout::kOn;
    job.config.steps = 12;
    job.config.template_level = 2;
    job.config.texture_size = 64;
    job.config.timelapse = 0;
    job.config.checkpoint_every = 5;
    return job;
  }
};

TEST_F(CutoutFit, StoppedAndResumedEndsInTheSameBitsForAnyWorkers) {
  for (const StartShape start : {StartShape::kHull, StartShape::kSphere}) {
    FitJob job = Job(start == StartShape::kHull ? "hull" : "sphere");
    job.config.start = start;
    const Path whole = job.out;
    Ok(Run(job, 1).status());
    job.out += "_parts";
    StopAt(job, 3);
    job.existing = ExistingRun::kContinue;
    StopAt(job, 8);
    const auto watch = [&](const Progress& p) {
      stop_ = p.stage == "fitting the cut-out" && p.done == 20;
    };
    EXPECT_EQ(RunFit(job, Workers(2), watch, stop_).status().code(), StatusCode::kCancelled);
    stop_ = false;
    Ok(Run(job).status());
    EXPECT_EQ(ReadFile(whole / "mesh.glb").value(), ReadFile(job.out / "mesh.glb").value());
    EXPECT_EQ(io::LoadMesh(whole / "mesh.glb")->mesh.materials[0].alpha_mode, AlphaMode::kMask);
  }
}

TEST_F(CutoutFit, RefusesAMeshWithoutATexture) {
  FitJob job = Job("given");
  job.start = Icosphere(1, 1);
  EXPECT_EQ(Run(job).status().message(),
            "a cut-out texture takes a texture, which the mesh to start from lacks: add "
            "\"texture\" to --optimize, or leave out --cutout on");
}

}  // namespace tilegrad::train::cutout_test
