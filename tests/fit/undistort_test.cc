// SPDX-License-Identifier: Apache-2.0
// Pictures that a bent lens took of a formula, held to the formula.
#include "fit/undistort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fit/input.h"
#include "io/image_file.h"
#include "support/temp_folder.h"

namespace tilegrad::train::undistort_test {

constexpr int kWidth = 120, kHeight = 90;
constexpr double kFocal = 80, kCx = 58, kCy = 47;

// On the plane at distance 1 before the lens: a pattern, and a disc of it that is the object.
double Pattern(const Vec2Array& at) {
  return 0.5 + 0.4 * std::sin(6 * at[0]) * std::cos(5 * at[1]);
}
constexpr Vec2Array kMiddle = {0.06, -0.04};
// Pixels inside the outline, of a straight lens with this focal length.
double Inside(const Vec2Array& at, double focal, double radius) {
  return focal * (radius - std::hypot(at[0] - kMiddle[0], at[1] - kMiddle[1]));
}

class Undistorted : public TempFolderTest {
 protected:
  // The lens's own picture: of each pixel's centre, the place that it shows.
  void TakePicture(const LensDistortion& lens, double focal, double radius) {
    const double largest = LargestRadius(lens);
    ImageU8 image(kWidth, kHeight, 4);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto at = Unbent(lens, {(x + 0.5 - kCx) / focal, (y + 0.5 - kCy) / focal}, largest);
        if (!at) continue;
        std::fill_n(image.at(x, y), 3, static_cast<std::uint8_t>(std::lround(255 * Pattern(*at))));
        image.at(x, y)[3] = Inside(*at, focal, radius) > 0 ? 255 : 0;
      }
    }
    ASSERT_TRUE(io::SavePng(folder_ / "d/0.png", image).ok());
  }

  FitInput Read(const std::string& lens, double focal) {
    Write("d/transforms.json", "{" + lens + R"("fl_x":)" + std::to_string(focal) +
                                   R"(,"cx":58,"cy":47,"w":120,"h":90,)" +
                                   R"("frames":[{"file_path":"0.png","transform_matrix":)" +
                                   "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]}");
    return Ok(ReadFitFolder(folder_ / "d", 0)).value();
  }

  // The largest error of colours and how many pixels of the mask are wrong, away from the outline.
  struct Errors {
    double color = 0;
    int mask = 0, looked_at = 0;
  };
  Errors Compare(const FitInput& input, double radius) {
    Errors errors;
    const auto fx = static_cast<double>(input.cameras[0].fx);
    for (std::size_t p = 0; p < input.images.pixels(); ++p) {
      const Vec2Array at = {(static_cast<double>(p % kWidth) + 0.5 - kCx) / fx,
                            (static_cast<double>(p / kWidth) + 0.5 - kCy) / fx};
      const double inside = Inside(at, fx, radius);
      if (std::abs(inside) < 3) continue;  // pixels that are mixed with what is beyond
      ++errors.looked_at;
      errors.mask += (input.images.alpha[p] >= 0.5f) != (inside > 0);
      if (inside < 0) continue;
      const double error = static_cast<double>(input.images.color[p]) - Pattern(at);
      errors.color = std::max(errors.color, std::abs(error));
    }
    return errors;
  }
};

// Colours are rounded to 1/255, and interpolated between pixels: h^2 / 8 of the pattern's second
// derivatives, 0.4 * 36 and 0.4 * 25, with pixels of the lens up to 1.6 / 80 wide on the plane.
constexpr double kRounding = 0.5 / 255;
constexpr double kStep = 1.6 / kFocal;
constexpr double kTolerance = kRounding + kStep * kStep / 8 * 0.4 * (36 + 25);

TEST_F(Undistorted, BrownsLensIsMadeStraight) {
  TakePicture(BrownLens({-0.3, 0.08, 0.01, -0.008, 0.01, 0, 0, 0}), kFocal, 0.4);
  const FitInput input = Read(R"("k1":-0.3,"k2":0.08,"p1":0.01,"p2":-0.008,"k3":0.01,)", kFocal);
  EXPECT_EQ(input.cameras[0].fx, 80);
  const Errors errors = Compare(input, 0.4);
  EXPECT_LT(errors.color, kTolerance);
  EXPECT_EQ(errors.mask, 0);
  EXPECT_GT(errors.looked_at, 8000);
  // As if the lens were straight, or bent the other way, it is wrong by far.
  EXPECT_GT(Compare(Read("", kFocal), 0.4).color, 5 * kTolerance);
  EXPECT_GT(Compare(Read(R"("k1":0.3,)", kFocal), 0.4).color, 10 * kTolerance);
}

TEST_F(Undistorted, FisheyesAreMadeStraight) {
  TakePicture(FisheyeLens({0.05, -0.01, 0.003, -0.001}), kFocal, 0.4);
  const std::string k = R"("k1":0.05,"k2":-0.01,"k3":0.003,"k4":-0.001,)";
  const Errors errors = Compare(Read(R"("camera_model":"OPENCV_FISHEYE",)" + k, kFocal), 0.4);
  EXPECT_LT(errors.color, kTolerance);
  EXPECT_EQ(errors.mask, 0);
  EXPECT_EQ(Compare(Read(R"("is_fisheye":true,)" + k, kFocal), 0.4).color, errors.color);
}

// A fisheye that sees 110 degrees of an object: with the same focal length it would be cut.
TEST_F(Undistorted, AnObjectThatWouldLeaveThePictureStaysWhole) {
  constexpr double kWide = 40, kRadius = 1.3;
  TakePicture(FisheyeLens({0, 0, 0, 0}), kWide, kRadius);
  const FitInput input = Read(R"("is_fisheye":true,)", kWide);
  const auto fx = static_cast<double>(input.cameras[0].fx);
  EXPECT_LT(fx, 0.9 * kWide);
  EXPECT_EQ(Compare(input, kRadius).mask, 0);
  EXPECT_GT(Inside({kMiddle[0], (0.5 - kCy) / fx}, fx, kRadius), -3);  // it reaches the border
  for (int x = 0; x < kWidth; ++x) {
    EXPECT_LT(input.images.alpha[static_cast<std::size_t>(x)], 1) << x;
  }
}

// An alpha channel that is opaque throughout is no mask, and makes none of the borders.
TEST_F(Undistorted, OpaquePicturesHaveNoMask) {
  TakePicture(BrownLens({}), kFocal, 10);
  const FitInput input = Read(R"("k1":-0.3,"k2":0.08,)", kFocal);
  EXPECT_FALSE(input.masked);
  EXPECT_EQ(input.cameras[0].fx, 80);
  EXPECT_TRUE(std::ranges::all_of(input.images.alpha, [](float a) { return a == 1; }));
}

TEST_F(Undistorted, WildLensesLeaveFinitePictures) {
  TakePicture(BrownLens({}), kFocal, 0.4);
  for (const std::string lens : {R"("k1":1e300,)", R"("k1":-1e300,"k2":1e300,)", R"("p1":-1e200,)",
                                 R"("k1":-40,)", R"("is_fisheye":true,"k1":1e300,)"}) {
    Write("d/transforms.json",
          "{" + lens + R"("fl_x":80,"frames":[{"file_path":"0.png","transform_matrix":)" +
              "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]}");
    const auto input = ReadFitFolder(folder_ / "d", 0);
    if (!input.ok()) {  // nothing of the object is left
      ExpectMessage(input.status(), "masks are empty");
      continue;
    }
    for (const float x : input->images.color) EXPECT_TRUE(x >= 0 && x <= 1);
    for (const float x : input->images.alpha) EXPECT_TRUE(x >= 0 && x <= 1);
  }
}

}  // namespace tilegrad::train::undistort_test
