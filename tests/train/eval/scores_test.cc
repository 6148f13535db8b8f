// SPDX-License-Identifier: Apache-2.0
// Scores, and the search for the nearest picture, on numbers worked out by hand.
#include "train/eval/scores.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "scene/shapes.h"
#include "train/eval/retrieval.h"

namespace tilegrad::train::scores_test {

TEST(Scores, AShapeIsLikeItself) {
  const Mesh ball = Icosphere(3, 0.2f);
  const Shape shape = ShapeOf(ball, 1).value();
  const Score score = Compare(shape, shape);
  EXPECT_EQ(score.iou, 1);
  EXPECT_EQ(score.carved_iou, 1);
  EXPECT_EQ(score.f_score, 1);
  EXPECT_FALSE(score.color_l1);
}

TEST(Scores, WithoutAMeshOnlyTheVoxelsCount) {
  ModelData data;
  data.occupancy.assign(std::size_t{32} * 32 * 32, 1);
  const Shape truth = TruthShape(data).value();
  const Score score = Compare(ShapeOf(Box({0, 0, 0}, {2, 2, 2}), 1).value(), truth);
  EXPECT_EQ(score.iou, 1);
  EXPECT_FALSE(score.f_score || score.carved_iou);
  EXPECT_FALSE(WorstScore(truth).f_score);
  EXPECT_EQ(WorstScore(truth).iou, 0);
}

TEST(Scores, TheMeanHasWhatAllHave) {
  const Score a{.iou = 0.5, .f_score = 0.2, .carved_iou = 0.4, .color_l1 = 0.25};
  Score b{.iou = 0.75, .f_score = 0.4, .carved_iou = std::nullopt, .color_l1 = 0.75};
  const Score both[] = {a, b};
  const Score mean = MeanScore(both);
  EXPECT_EQ(mean.iou, 0.625);
  EXPECT_NEAR(*mean.f_score, 0.3, 1e-15);
  EXPECT_FALSE(mean.carved_iou);
  EXPECT_EQ(mean.color_l1, 0.5);
}

// Two pixels: one covered by both, one by neither.
TEST(Scores, ColoursCountWhereEitherCovers) {
  const std::vector<std::uint8_t> a = {255, 0, 51, 0, 0, 0, 255, 0};
  const std::vector<std::uint8_t> b = {0, 0, 51, 0, 102, 0, 255, 0};
  ColorDifference difference;
  difference.Add(a, b);
  Score score;
  difference.To(&score);
  EXPECT_EQ(difference.either.count, 3u);
  EXPECT_NEAR(*score.color_l1, (1.0 + 0 + 0.4) / 3, 1e-12);
  EXPECT_EQ(score.shared_color_l1, score.color_l1);  // both cover all of it
  EXPECT_FALSE(score.seen_color_l1 || score.hidden_color_l1);
  ColorDifference{}.To(&score);
  EXPECT_EQ(score.color_l1, 0);
  EXPECT_EQ(score.shared_color_l1, 1);
}

// Four pixels: both cover the first; parts of the second, painted 1/2 and 1; a alone the third, and
// b nearly alone the fourth, of which `shared` knows nothing.
TEST(Scores, WhereBothAreOutlinesDoNotCount) {
  const auto planes = [](std::array<std::uint8_t, 4> grey, std::array<std::uint8_t, 4> alpha) {
    std::vector<std::uint8_t> out;
    for (int c = 0; c < 3; ++c) out.insert(out.end(), grey.begin(), grey.end());
    out.insert(out.end(), alpha.begin(), alpha.end());
    return out;
  };
  const std::vector<Side> sides = {Side::kSeen, Side::kHidden, Side::kSeen, Side::kHidden};
  ColorDifference difference;
  difference.Add(planes({255, 100, 255, 5}, {255, 200, 255, 10}),
                 planes({204, 128, 0, 255}, {255, 128, 0, 255}), sides);
  Score score;
  difference.To(&score);
  EXPECT_NEAR(*score.color_l1, (51 + 28 + 255 + 250) / 255.0 / 4, 1e-12);
  EXPECT_NEAR(*score.shared_color_l1, (0.2 + 0.5) / 2, 1e-12);
  EXPECT_NEAR(*score.seen_color_l1, 0.2, 1e-12);
  EXPECT_NEAR(*score.hidden_color_l1, 0.5, 1e-12);
}

TEST(PredictionPictures, ShowUnlitColours) {
  DatasetInfo info;
  info.image_size = info.camera.lens.width = info.camera.lens.height = 16;
  PredictionPictures pictures(info, {0, 5});
  Mesh ball = Icosphere(3, 0.45f);
  ball.colors.assign(ball.positions.size(), {1.0f, 0.2f, 0.0f, 1.0f});
  const auto images = pictures.Draw(ball).value().rgba;
  ASSERT_EQ(images.size(), 2u * 4 * 16 * 16);
  const std::size_t centre = 8 * 16 + 8;
  for (std::size_t v = 0; v < 2; ++v) {
    const std::uint8_t* image = &images[v * 4 * 256];
    EXPECT_EQ(image[centre], 255);
    EXPECT_EQ(image[256 + centre], 51);
    EXPECT_EQ(image[512 + centre], 0);
    EXPECT_EQ(image[768 + centre], 255);
    EXPECT_EQ(image[768], 0);
  }
  Mesh broken;
  broken.positions = {glm::vec3(0)};
  broken.faces = {{0, 0, 9}};
  EXPECT_FALSE(pictures.Draw(broken).ok());
}

// Of a ball, the view itself shows all that it sees, and the one from behind nearly nothing.
TEST(PredictionPictures, KnowWhichSidesAViewSees) {
  DatasetInfo info;
  info.image_size = info.camera.lens.width = info.camera.lens.height = 16;
  info.camera.elevation = 0;
  PredictionPictures pictures(info, {0, 12});
  Mesh ball = Icosphere(3, 0.45f);
  ball.colors.assign(ball.positions.size(), glm::vec4(1));
  const auto drawn = pictures.Draw(ball, 0).value();
  ASSERT_EQ(drawn.sides.size(), 2u * 16 * 16);
  const auto count = [&](std::size_t view, Side side) {
    const auto from = drawn.sides.begin() + static_cast<std::ptrdiff_t>(view * 256);
    return std::count(from, from + 256, side);
  };
  EXPECT_GT(count(0, Side::kSeen), 80);
  // But for pixels of faces at the outline.
  EXPECT_LE(count(0, Side::kHidden), 2);
  EXPECT_LE(count(1, Side::kSeen), 2);
  EXPECT_NEAR(count(1, Side::kHidden), count(0, Side::kSeen), 4);
  EXPECT_TRUE(pictures.Draw(ball).value().sides.empty());
}

std::vector<std::uint8_t> Flat(std::uint8_t value, int size) {
  return std::vector<std::uint8_t>(std::size_t{4} * static_cast<std::size_t>(size * size), value);
}

TEST(ImageIndex, FindsTheNearestAndSaysHowFarItIs) {
  ImageIndex index;
  std::vector<std::uint8_t> two = Flat(10, 32), more = Flat(200, 32);
  two.insert(two.end(), more.begin(), more.end());
  index.Add(two, 2, 32);
  index.Add(Flat(100, 32), 1, 32);
  EXPECT_EQ(index.size(), 3u);
  const auto match = index.Nearest(Flat(190, 64), 64);  // of another size
  EXPECT_EQ(match.model, 0);
  EXPECT_EQ(match.view, 1);
  EXPECT_NEAR(match.distance, 10 / 255.0, 1e-9);
  EXPECT_EQ(index.Nearest(Flat(100, 16), 16).model, 1);
  EXPECT_EQ(index.Nearest(Flat(100, 16), 16).distance, 0);
}

TEST(ImageIndex, ThumbnailsAreMeans) {
  std::vector<std::uint8_t> image = Flat(0, 32);
  image[0] = 255;
  image[1] = 1;  // two of the four pixels of the first mean: 64
  const auto small = Thumbnail(image, 32);
  EXPECT_EQ(small.size(), 4u * 16 * 16);
  EXPECT_EQ(small[0], 64);
  EXPECT_EQ(small[1], 0);
  EXPECT_EQ(Thumbnail(Flat(7, 5), 5), std::vector<std::uint8_t>(4 * 256, 7));  // fewer than it has
}

}  // namespace tilegrad::train::scores_test
