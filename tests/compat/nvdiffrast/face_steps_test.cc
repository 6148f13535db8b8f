// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/face_steps.h"

#include <gtest/gtest.h>

#include <vector>

#include "compat/nvdiffrast/face_steps_ref.h"
#include "compat/nvdiffrast/test_util.h"
#include "support/expect.h"

namespace tilegrad::compat::nvdiffrast::face_steps_test {

constexpr std::size_t kFaces = 5;

// A row of rast with runs of faces, of which some do not exist if `broken`.
Numbers<float> RowOf(std::size_t width, std::uint64_t seed, bool broken) {
  constexpr float kBad[] = {-1, 6, 0.5f, 4e9f, -4e9f};
  Rng rng(seed, 1);
  Numbers<float> out = RandomNumbers<float>(4 * width, seed);
  float id = 0;
  for (std::size_t x = 0; x < width; ++x) {
    if (rng.Uniform() < 0.3) id = std::floor(static_cast<float>(rng.Uniform(0, kFaces + 1)));
    const bool bad = broken && rng.Uniform() < 0.05;
    out[4 * x + 3] = bad ? kBad[static_cast<std::size_t>(rng.Uniform(0, 5))] : id;
  }
  return out;
}

TEST(FaceSteps, EveryTargetIsTheReference) {
  std::size_t bad = 0, steps = 0;
  for (std::size_t width = 1; width < 200; ++width) {
    const auto low = RowOf(width, width, width % 2 == 0), high = RowOf(width, width + 1000, false);
    FaceRow row(width), above(width);
    const std::size_t first = ReadFaceRowRef<float>(low, kFaces, &row);
    ReadFaceRowRef<float>(high, kFaces, &above);
    std::vector<std::uint64_t> expected((width + kStepBits - 1) / kStepBits);
    FindStepsRef(row, above, width, expected);
    for (const std::string target : EveryTarget()) {
      SCOPED_TRACE(target);
      FaceRow got(width), got_above(width);
      EXPECT_EQ(ReadFaceRow(low, kFaces, &got), first) << width;
      EXPECT_EQ(ReadFaceRow(high, kFaces, &got_above), kNoPixel) << width;
      EXPECT_EQ(got.ids, row.ids) << width;
      std::vector<std::uint64_t> bits(expected.size(), ~std::uint64_t{0});
      FindSteps(got, got_above, width, bits);
      EXPECT_EQ(bits, expected) << width;
    }
    bad += first != kNoPixel;
    for (const std::uint64_t word : expected) steps += word != 0;
  }
  EXPECT_GT(bad, 50u);
  EXPECT_GT(steps, 100u);
}

}  // namespace tilegrad::compat::nvdiffrast::face_steps_test
