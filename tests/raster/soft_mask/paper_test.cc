// SPDX-License-Identifier: Apache-2.0
// The paper's rule by hand and against a complex step. Golden numbers of a published
// implementation: tests/python/test_kaolin.py, GoldenSoftMask.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "base/rng.h"
#include "raster/soft_mask/paper_ref.h"

namespace tilegrad::raster::paper_test {

// At most as many faces as the box admits, in order: the second face cannot matter.
TEST(SoftMaskPaper, TakesTheFirstFacesOnly) {
  std::vector<NdcFace<double>> faces(2);
  faces[0] = {{0.10, 0.11, 0.10}, {0, 0, 0.01}};
  faces[1] = {{0.01, 0.02, 0.01}, {0, 0, 0.01}};
  PaperSoftMask rule;
  rule.box = 0.2;
  rule.max_faces = 1;
  EXPECT_NEAR(PaperAlphaRef<double>(faces, 0.0, 0.0, rule), std::exp(-7000 * 0.01), 1e-15);
  rule.max_faces = 2;
  EXPECT_NEAR(PaperAlphaRef<double>(faces, 0.0, 0.0, rule), std::exp(-7000 * 0.0001), 1e-9)
      << "eps is 1e-9 of the squared edge";
  rule.box = 0.005;
  EXPECT_EQ(PaperAlphaRef<double>(faces, 0.0, 0.0, rule), 0);
}

TEST(SoftMaskPaper, GradientIsThatOfAComplexStep) {
  using Complex = std::complex<double>;
  Rng rng(3);
  const PaperSoftMask rule{.inverse_delta = 70, .box = 0.3};
  for (int scene = 0; scene < 50; ++scene) {
    std::vector<NdcFace<double>> faces(4), d_faces(4);
    std::vector<NdcFace<Complex>> stepped(4);
    for (std::size_t f = 0; f < 4; ++f) {
      for (std::size_t k = 0; k < 3; ++k) {
        stepped[f].x[k] = faces[f].x[k] = rng.Uniform(-0.3, 0.3);
        stepped[f].y[k] = faces[f].y[k] = rng.Uniform(-0.3, 0.3);
      }
    }
    PaperAlphaRefBackward<double>(faces, 0.05, -0.02, rule, 1.0, d_faces);
    for (std::size_t f = 0; f < 4; ++f) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Complex x = stepped[f].x[k];
        stepped[f].x[k] += Complex(0, 1e-100);
        const Complex a = PaperAlphaRef<Complex>(stepped, Complex(0.05), Complex(-0.02), rule);
        stepped[f].x[k] = x;
        EXPECT_NEAR(d_faces[f].x[k], a.imag() * 1e100, 1e-11);
      }
    }
  }
}

// The pixel is in the box of a face whose boundary is farther away than `farthest`: A is that of
// `farthest`, and has no gradient.
TEST(SoftMaskPaper, FartherThanFarthest) {
  const std::vector<NdcFace<double>> faces = {{{-200, 200, 0}, {-150, -150, 250}}};
  const PaperSoftMask rule{.inverse_delta = 0.5};
  EXPECT_NEAR(PaperAlphaRef<double>(faces, 0, 0, rule), std::exp(-2.0), 1e-15);
  std::vector<NdcFace<double>> d_faces(1);
  PaperAlphaRefBackward<double>(faces, 0, 0, rule, 1, d_faces);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(d_faces[0].x[k], 0);
    EXPECT_EQ(d_faces[0].y[k], 0);
  }
}

}  // namespace tilegrad::raster::paper_test
