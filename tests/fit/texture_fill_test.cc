// SPDX-License-Identifier: Apache-2.0
// Colours of texels that no view shows.
#include "fit/texture_fill.h"

#include <gtest/gtest.h>

#include "scene/camera.h"
#include "support/expect.h"

namespace tilegrad::train::texture_fill_test {

// Squares in the plane z = 0, two faces each: `from` to `to` in x and y, and the same place in the
// texture but for `uv_from`. A texture of 8 x 8 grey texels.
FitScene Blank() {
  FitScene scene;
  scene.texture = Image(8, 8, 3, 0.5f);
  scene.wrap = Wrap::kClamp;
  scene.filter = Filter::kNearest;
  return scene;
}
void AddSquare(glm::vec2 from, glm::vec2 to, glm::vec2 uv_from, FitScene* scene) {
  const auto first = static_cast<std::int32_t>(scene->vertices());
  for (const glm::vec2 p : {from, glm::vec2(to.x, from.y), to, glm::vec2(from.x, to.y)}) {
    scene->positions.insert(scene->positions.end(), {p.x, p.y, 0});
    scene->uvs.insert(scene->uvs.end(), {p.x - from.x + uv_from.x, p.y - from.y + uv_from.y});
  }
  for (const std::int32_t k : {0, 1, 2, 0, 2, 3}) {
    scene->faces.push_back(first + k);
    scene->uv_indices.push_back(first + k);
  }
}
float& Red(FitScene* scene, int column, int row) { return scene->texture.at(column, row)[0]; }

TEST(TextureFill, ChartsAreFacesWithCommonCoordinates) {
  FitScene scene = Blank();
  AddSquare({0, 0}, {0.25f, 0.5f}, {0, 0}, &scene);     // columns 0 and 1 of rows 4 to 7
  AddSquare({2, 0}, {2.25f, 0.5f}, {0.5f, 0}, &scene);  // columns 4 and 5
  const auto charts = ChartsOfTexels(scene);
  for (std::size_t t = 0; t < charts.size(); ++t) {
    const std::size_t x = t % 8, y = t / 8;
    const std::int32_t expected = y < 4 ? -1 : x < 2 ? 0 : x == 4 || x == 5 ? 4 : -1;
    EXPECT_EQ(charts[t], expected) << x << " " << y;
  }
}

// A column of seen texels at the left of a chart: the chart gets their colours, row by row at the
// same distance, and so does what lies around it.
TEST(TextureFill, UnseenTexelsTakeTheColoursOfTheirChart) {
  FitScene scene = Blank();
  AddSquare({0, 0}, {0.5f, 1}, {0, 0}, &scene);       // columns 0 to 3
  AddSquare({2, 0}, {2.25f, 1}, {0.75f, 0}, &scene);  // columns 6 and 7
  std::vector<bool> seen(64, false);
  for (int row = 0; row < 8; ++row) {
    Red(&scene, 0, row) = 1;
    Red(&scene, 7, row) = 0;
    seen[static_cast<std::size_t>(8 * row)] = seen[static_cast<std::size_t>(8 * row + 7)] = true;
  }
  FillUnseenTexels(seen, &scene);
  for (int row = 0; row < 8; ++row) {
    for (const int column : {0, 1, 2, 3, 4}) EXPECT_EQ(Red(&scene, column, row), 1) << column;
    for (const int column : {5, 6, 7}) EXPECT_EQ(Red(&scene, column, row), 0) << column;
    EXPECT_EQ(scene.texture.at(2, row)[1], 0.5f);
  }
}

// The chart that lies between does not carry another's colour; texels nobody sees, of a chart of
// their own, take what is next to them in the end.
TEST(TextureFill, ColoursDoNotCrossCharts) {
  FitScene scene = Blank();
  AddSquare({0, 0}, {0.5f, 1}, {0, 0}, &scene);     // columns 0 to 3
  AddSquare({2, 0}, {2.5f, 1}, {0.5f, 0}, &scene);  // columns 4 to 7
  std::vector<bool> seen(64, false);
  seen[0] = true;
  Red(&scene, 0, 0) = 1;
  seen[63] = true;
  Red(&scene, 7, 7) = 0;
  FillUnseenTexels(seen, &scene);
  for (int at = 0; at < 64; ++at)
    EXPECT_EQ(Red(&scene, at % 8, at / 8), at % 8 < 4 ? 1 : 0) << at % 8 << " " << at / 8;
}

TEST(TextureFill, ARepeatedTextureGoesOnBeyondItsBorder) {
  FitScene scene = Blank();
  AddSquare({0, 0}, {1, 1}, {0.5f, 0}, &scene);  // columns 4 to 7, then 0 to 3
  scene.wrap = Wrap::kRepeat;
  std::vector<bool> seen(64, false);
  for (int row = 0; row < 8; ++row) {
    for (const int column : {2, 3}) {
      seen[static_cast<std::size_t>(8 * row + column)] = true;
      Red(&scene, column, row) = column == 2 ? 0 : 1;
    }
  }
  FillUnseenTexels(seen, &scene);
  // Three texels from column 2 on to the left, 1, 0, and over the border 7; three to the right.
  for (const int column : {1, 0, 7}) EXPECT_EQ(Red(&scene, column, 3), 0) << column;
  for (const int column : {4, 5, 6}) EXPECT_EQ(Red(&scene, column, 3), 1) << column;
}

TEST(TextureFill, NothingSeenChangesNothing) {
  FitScene scene = Blank();
  AddSquare({0, 0}, {1, 1}, {0, 0}, &scene);
  FillUnseenTexels(std::vector<bool>(64, false), &scene);
  for (const float v : scene.texture.pixels) EXPECT_EQ(v, 0.5f);
}

// Also of a surface that light or colours make black.
TEST(TextureFill, SeenTexelsAreThoseInPixels) {
  FitScene scene = Blank();
  AddSquare({0, 0}, {1, 1}, {0, 0}, &scene);
  scene.colors.assign(scene.positions.size(), 0.0f);
  scene.shading.lighting = Lighting::kLambert;
  scene.light = {0, 0, -1};
  // From one unit above (0.25, 0.5) it sees a quarter to each side.
  const float eye[] = {0.25f, 0.5f, 1}, target[] = {0.25f, 0.5f, 0}, up[] = {0, 1, 0};
  const Camera camera =
      LookAtCamera<float>({.fov_y = 28.0724869, .width = 64, .height = 64}, eye, target, up);
  scene.cameras = {camera};
  const Workers workers(1);
  const int view = 0;
  const auto seen = Ok(SeenTexels(scene, {&view, 1}, {64, 64}, workers));
  for (std::size_t t = 0; t < 64; ++t) {
    const std::size_t column = t % 8, row = t / 8;
    EXPECT_EQ((*seen)[t], column < 4 && row >= 2 && row < 6) << column << " " << row;
  }
}

}  // namespace tilegrad::train::texture_fill_test
