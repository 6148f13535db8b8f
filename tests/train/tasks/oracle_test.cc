// SPDX-License-Identifier: Apache-2.0
// The template fitted to all views of an object whose shape is known.
#include "train/tasks/single_image/oracle.h"

#include <gtest/gtest.h>

#include "scene/shapes.h"
#include "train/eval/scores.h"

namespace tilegrad::train::oracle_test {

DatasetInfo SmallInfo() {
  DatasetInfo info;
  info.source = "folder";
  info.image_size = info.camera.lens.width = info.camera.lens.height = 32;
  info.views = 12;
  info.camera.azimuth_step = -30;
  info.camera.elevation = 0;  // all of an ellipsoid is seen, and its outlines decide its shape
  return info;
}

// A red ellipsoid, half as high and a third as deep as it is wide.
Mesh Ellipsoid() {
  Mesh mesh = Icosphere(3, 0.45f);
  for (glm::vec3& p : mesh.positions) p = {p.x, p.y / 2, p.z / 3};
  mesh.colors.assign(mesh.positions.size(), {0.8f, 0.1f, 0.1f, 1});
  return mesh;
}

ModelData PicturesOf(const Mesh& mesh, const DatasetInfo& info) {
  std::vector<int> views;
  for (int view = 0; view < info.views; ++view) views.push_back(view);
  ModelData data;
  data.mesh = mesh;
  data.images = PredictionPictures(info, views).Draw(mesh).value().rgba;
  return data;
}

SingleImageConfig Config() {
  SingleImageConfig config;
  config.network.sphere = {.level = 2, .radius = 0.175, .smoothing = 2};
  config.loss.iou = 10;
  config.loss.color = 3;
  config.render = {.sharpness = 8000, .sharpness_start = 200};
  return config;
}

// Far better than the template. Not perfect: needles and
// folds that are thinner than a pixel are not seen.
TEST(Oracle, FindsAShapeAndItsColor) {
  const Workers workers(2);
  const DatasetInfo info = SmallInfo();
  const ModelData data = PicturesOf(Ellipsoid(), info);
  const FitFunction fit = FitTemplates(Config(), info, 150, workers);
  const Result<Mesh> found = fit(data);
  ASSERT_TRUE(found.ok()) << found.status().message();
  const Shape truth = ShapeOf(Ellipsoid(), 1).value(), fitted = ShapeOf(*found, 1).value();
  EXPECT_GT(Compare(fitted, truth).iou, 0.6);
  EXPECT_LT(Compare(ShapeOf(Icosphere(2, 0.45f), 1).value(), truth).iou, 0.4);
  glm::vec4 mean(0);
  for (const glm::vec4& color : found->colors)
    mean += color / static_cast<float>(found->colors.size());
  EXPECT_NEAR(mean.r, 0.8, 0.2);
  EXPECT_LT(mean.g, 0.25);
}

TEST(Oracle, SameBitsForAnyNumberOfWorkers) {
  const DatasetInfo info = SmallInfo();
  const ModelData data = PicturesOf(Ellipsoid(), info);
  const auto fit = [&](int count) {
    const Workers workers(count);
    return FitTemplates(Config(), info, 10, workers)(data).value();
  };
  const Mesh one = fit(1), three = fit(3);
  EXPECT_EQ(one.positions, three.positions);
  EXPECT_EQ(one.colors, three.colors);
}

// Two objects in turn: the second fit knows nothing of the first.
TEST(Oracle, EachFitStartsAnew) {
  const Workers workers(1);
  const DatasetInfo info = SmallInfo();
  const ModelData red = PicturesOf(Ellipsoid(), info),
                  sphere = PicturesOf(Icosphere(2, 0.45f), info);
  const FitFunction fit = FitTemplates(Config(), info, 5, workers);
  const Mesh first = fit(red).value();
  (void)fit(sphere).value();
  EXPECT_EQ(fit(red)->positions, first.positions);
}

}  // namespace tilegrad::train::oracle_test
