// SPDX-License-Identifier: Apache-2.0
// The reference renderer's gradients, proven by complex step: no subtraction, so agreement reaches
// rounding.
#include "render/pipeline/pipeline_ref.h"

#include <gtest/gtest.h>

#include <complex>
#include <functional>

#include "render/pipeline/test_scenes.h"

namespace tilegrad::pipeline_ref_test {

using Complex = std::complex<double>;
using test::TestScene;

constexpr double kStep = 1e-50;

struct Case {
  const char* name;
  TestScene<float> (*make)(Rng*);
  RenderOptions options;
};

RenderOptions Options(int width, int height, Interpolation mode, double delta) {
  RenderOptions options;
  options.width = width;
  options.height = height;
  options.interpolation = mode;
  options.delta = delta;
  return options;
}

const Case kCases[] = {
    {"soup", [](Rng* r) { return test::TriangleSoup(20, 0.5, 11, 8, r); },
     Options(11, 8, Interpolation::kPerspective, 2e-2)},
    {"sphere", [](Rng* r) { return test::BumpySphere(4, 6, 9, 9, r); },
     Options(9, 9, Interpolation::kScreenLinear, 1e-2)},
    {"corners",
     [](Rng* r) {
       auto scene = test::TriangleSoup(8, 0.5, 8, 8, r);
       test::RandomAttributes(2, Rate::kCorner, r, &scene);
       return scene;
     },
     Options(8, 8, Interpolation::kPerspective, 1e-2)},
    {"near_clip", [](Rng* r) { return test::SoupAroundCamera(24, 9, 7, r); },
     Options(9, 7, Interpolation::kPerspective, 1e-1)},
    {"near_clip_corners",
     [](Rng* r) {
       auto scene = test::SoupAroundCamera(24, 9, 7, r);
       test::RandomAttributes(2, Rate::kCorner, r, &scene);
       return scene;
     },
     Options(9, 7, Interpolation::kScreenLinear, 1e-1)},
};

// A loss that is linear in the images, with fixed random weights.
struct Loss {
  std::vector<double> d_attributes, d_alpha;

  Loss(std::size_t attributes, std::size_t pixels, Rng* rng)
      : d_attributes(attributes), d_alpha(pixels) {
    for (double& d : d_attributes) d = rng->Uniform(-1, 1);
    for (double& d : d_alpha) d = rng->Uniform(-1, 1);
  }
  Complex operator()(const PipelineFrameT<Complex>& frame) const {
    Complex sum = 0;
    for (std::size_t i = 0; i < d_attributes.size(); ++i)
      sum += d_attributes[i] * frame.attributes[i];
    for (std::size_t i = 0; i < d_alpha.size(); ++i) sum += d_alpha[i] * frame.alpha[i];
    return sum;
  }
};

// Pixels whose face was cut at the near plane.
int CutPixels(const TestScene<double>& scene, const RenderOptions& options,
              std::span<const std::int32_t> ids) {
  PreparedScene<double> prepared;
  PrepareRef(scene.View(), options, &prepared);
  int count = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] < 0) continue;
    const auto f = static_cast<std::size_t>(raster::PieceAt(prepared.mesh, ids[i],
                                                            static_cast<int>(i) % options.width,
                                                            static_cast<int>(i) / options.width));
    bool cut = false;
    for (int k = 0; k < 3; ++k) cut |= prepared.mesh.vertex(f, k) >= prepared.mesh.source_vertices;
    count += cut;
  }
  return count;
}

class ReferenceGradient : public testing::TestWithParam<Case> {};

TEST_P(ReferenceGradient, EqualsComplexStep) {
  Rng rng(7, 1);
  const auto base = GetParam().make(&rng);
  const RenderOptions& options = GetParam().options;
  const auto scene = MeshCast<double>(base);
  auto stepped = MeshCast<Complex>(base);
  const std::size_t pixels = static_cast<std::size_t>(options.width) * options.height;
  const Loss loss(pixels * static_cast<std::size_t>(scene.channels), pixels, &rng);

  const auto ids = FaceIdsRef(scene.View(), options, {0, options.height});
  EXPECT_GT(std::count_if(ids.begin(), ids.end(), [](int id) { return id >= 0; }), 10);
  if (std::string(GetParam().name).find("clip") != std::string::npos) {
    EXPECT_GT(CutPixels(scene, options, ids), 5);
  }
  std::vector<double> d_positions(scene.positions.size()), d_attributes(scene.attributes.size());
  PipelineGradientsT<double> d{d_positions, d_attributes, true, {}};
  RenderRefBackward<double>(scene.View(), options, ids, {loss.d_attributes, loss.d_alpha},
                            {0, options.height}, &d);

  const auto derivative = [&](Complex* input) {
    const Complex kept = *input;
    *input += Complex(0, kStep);
    PipelineFrameT<Complex> frame;
    RenderRefWithFaces<Complex>(stepped.View(), options, {}, ids, {0, options.height}, &frame);
    *input = kept;
    return loss(frame).imag() / kStep;
  };
  // Sums of a few thousand terms: rounding stays below 1e-12 of the largest gradient of the array.
  const auto check = [&](const char* array, std::vector<double> analytic, Complex* inputs) {
    double scale = 0;
    for (const double a : analytic) scale = std::max(scale, std::abs(a));
    EXPECT_GT(scale, 0) << array;
    for (std::size_t i = 0; i < analytic.size(); ++i) {
      EXPECT_NEAR(analytic[i], derivative(inputs + i), 1e-12 * scale) << array << "[" << i << "]";
    }
  };
  check("positions", d_positions, stepped.positions.data());
  check("attributes", d_attributes, stepped.attributes.data());
  check("rotation", {d.d_camera.rotation, d.d_camera.rotation + 9}, stepped.camera.rotation);
  check("translation", {d.d_camera.translation, d.d_camera.translation + 3},
        stepped.camera.translation);
  check("fx", {d.d_camera.fx}, &stepped.camera.fx);
  check("fy", {d.d_camera.fy}, &stepped.camera.fy);
  check("cx", {d.d_camera.cx}, &stepped.camera.cx);
  check("cy", {d.d_camera.cy}, &stepped.camera.cy);
}

INSTANTIATE_TEST_SUITE_P(Scenes, ReferenceGradient, testing::ValuesIn(kCases),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace tilegrad::pipeline_ref_test
