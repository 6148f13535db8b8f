// SPDX-License-Identifier: Apache-2.0
// The paper's rule against golden numbers of a published implementation (see the README beside
// them), and against a complex step.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "base/rng.h"
#include "raster/soft_mask/paper_ref.h"
#include "support/shared_data.h"

namespace tilegrad::raster::paper_test {

// One image of the vectors: faces, ids and pixel centres in NDC.
template <class T>
struct Image {
  std::vector<NdcFace<T>> faces;
  Json ids;
  int width, height;

  Image(const Json& v, std::size_t batch)
      : ids(v["selected_face_idx"][batch]), width(v["width"]), height(v["height"]) {
    for (const Json& corners : v["face_vertices_image"][batch]) {
      NdcFace<T> face;
      for (std::size_t k = 0; k < 3; ++k) {
        face.x[k] = T(corners[k][0].get<double>());
        face.y[k] = T(corners[k][1].get<double>());
      }
      faces.push_back(face);
    }
  }
  bool background(int i, int j) const { return ids[i][j].get<int>() < 0; }
  T X(int j) const { return T(2 * j + 1 - width) / T(width); }
  T Y(int i) const { return T(height - 2 * i - 1) / T(height); }
  T Alpha(int i, int j, const PaperSoftMask& rule) const {
    return background(i, j) ? PaperAlphaRef<T>(faces, X(j), Y(i), rule) : T(1);
  }
};

// Per-pixel gradient of the loss of the vectors: 1 - mean over images of sum(ab) / sum(a+b-ab).
template <class T>
std::vector<T> IouGradient(const Image<T>& image, const PaperSoftMask& rule, int batch) {
  T inside = T(0), all = T(1e-10);
  std::vector<T> target;
  for (int i = 0; i < image.height; ++i) {
    for (int j = 0; j < image.width; ++j) {
      const bool hit = j + 5 < image.width && !image.background(i, j + 5);
      const T a = image.Alpha(i, j, rule), b = T(hit ? 1 : 0);
      target.push_back(b);
      inside += a * b;
      all += a + b - a * b;
    }
  }
  for (T& b : target) b = -(b * all - inside * (T(1) - b)) / (all * all) / T(batch);
  return target;
}

template <class T>
void CheckCase(const Json& v, const Json& c, double mask_tolerance, double gradient_tolerance) {
  PaperSoftMask rule;
  rule.inverse_delta = c["sigmainv"];
  rule.box = c["boxlen"];
  rule.max_faces = v["knum"];
  const auto batch = v["face_vertices_image"].size();
  double largest = 0;
  for (const Json& g : c["grad_face_vertices_image_golden"].flatten()) {
    largest = std::max(largest, std::abs(g.get<double>()));
  }
  ASSERT_GT(largest, 0);
  for (std::size_t b = 0; b < batch; ++b) {
    const Image<T> image(v, b);
    std::vector<NdcFace<T>> d_faces(image.faces.size());
    const auto d_alpha = IouGradient(image, rule, static_cast<int>(batch));
    for (int i = 0; i < image.height; ++i) {
      for (int j = 0; j < image.width; ++j) {
        EXPECT_NEAR(image.Alpha(i, j, rule), c["soft_mask_golden"][b][i][j].get<double>(),
                    mask_tolerance);
        if (!image.background(i, j)) continue;
        PaperAlphaRefBackward<T>(image.faces, image.X(j), image.Y(i), rule,
                                 d_alpha[static_cast<std::size_t>(i * image.width + j)], d_faces);
      }
    }
    for (std::size_t f = 0; f < d_faces.size(); ++f) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Json& golden = c["grad_face_vertices_image_golden"][b][f][k];
        EXPECT_NEAR(d_faces[f].x[k], golden[0].get<double>(), gradient_tolerance * largest);
        EXPECT_NEAR(d_faces[f].y[k], golden[1].get<double>(), gradient_tolerance * largest);
      }
    }
  }
}

TEST(SoftMaskPaper, GoldenNumbers) {
  TILEGRAD_VECTORS_OR_SKIP(vectors, "01_dibr_soft_mask_simple.json");
  ASSERT_EQ(vectors["cases"].size(), 4u);
  for (const Json& c : vectors["cases"]) {
    SCOPED_TRACE("sigmainv " + c["sigmainv"].dump() + " boxlen " + c["boxlen"].dump());
    CheckCase<double>(vectors, c, 1e-10, 1e-8);
    CheckCase<float>(vectors, c, 1e-5, 1e-3);
  }
}

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
