// SPDX-License-Identifier: Apache-2.0
// Every gradient of the public interface in double against central differences of its own images,
// and in float against those in double.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "api/test_scene.h"

namespace tilegrad::gradients_test {

using test::kTestOptions;
using test::TestCotangents;
using test::TestGradients;
using test::TestScene;

constexpr Outputs kOutputs{true, true, true, true, true, true, false};

double Loss(RendererT<double>* renderer, const TestScene<double>& s,
            const TestCotangents<double>& d) {
  FrameT<double> frame;
  EXPECT_TRUE(renderer->Render({&s.scene, 1}, kTestOptions, kOutputs, &frame).ok());
  const ImagesT<double>& i = frame.images();
  double sum = 0;
  const auto add = [&](std::span<const double> image, const std::vector<double>& d_image) {
    for (std::size_t p = 0; p < image.size(); ++p) {
      if (std::isfinite(image[p])) sum += d_image[p] * image[p];
    }
  };
  add(i.color, d.color);
  add(i.alpha, d.alpha);
  add(i.attributes, d.attributes);
  add(i.depth, d.depth);
  add(i.normals, d.normals);
  add(i.uv, d.uv);
  return sum;
}

// A number of the scene, and where its gradient is.
struct Input {
  std::string name;
  double* x;
  const double* d_x;
};

std::vector<Input> InputsOf(TestScene<double>& s, const TestGradients<double>& g) {
  std::vector<Input> out;
  const auto add = [&](const char* name, double* x, const double* d_x, std::size_t count,
                       std::size_t step) {
    for (std::size_t i = 0; i < count; i += step) {
      out.push_back({name + std::to_string(i), x + i, d_x + i});
    }
  };
  add("positions", s.positions.data(), g.positions.data(), 48, 1);
  add("colors", s.colors.data(), g.colors.data(), 48, 7);
  add("uvs", s.uvs.data(), g.uvs.data(), s.uvs.size(), 11);
  add("attributes", s.attributes.data(), g.attributes.data(), 32, 5);
  add("texels", s.texels.data(), g.texels.data(), 60, 7);
  add("sh", s.sh.data(), g.sh.data(), g.sh.size(), 1);
  CameraT<double>& camera = s.scene.camera;
  add("rotation", camera.rotation, g.camera.rotation, 9, 1);
  add("translation", camera.translation, g.camera.translation, 3, 1);
  add("fx", &camera.fx, &g.camera.fx, 1, 1);
  add("cy", &camera.cy, &g.camera.cy, 1, 1);
  add("base_color", s.surfaces[0].base_color.data(), g.surfaces[0].base_color.data(), 3, 1);
  add("ambient", s.surfaces[0].ambient.data(), g.surfaces[0].ambient.data(), 3, 1);
  add("specular", s.surfaces[0].specular.data(), g.surfaces[0].specular.data(), 3, 1);
  add("shininess", &s.surfaces[0].shininess, &g.surfaces[0].shininess, 1, 1);
  if (g.lights.empty()) return out;
  add("direction", s.lights[0].direction.data(), g.lights[0].direction.data(), 3, 1);
  add("intensity", &s.lights[0].intensity, &g.lights[0].intensity, 1, 1);
  return out;
}

// Central differences with step h: the error is h^2 f'''/6, about 1e-12 * 1e6 (the third derivative
// of alpha is of the order of delta^-1.5 times pixels per unit), and a rounding of the loss over h,
// 1e-13 / 1e-6. Gradients are of the order of 1 to 1000.
TEST(ApiGradients, DoubleIsTheDerivativeOfItsImages) {
  for (const Lighting lighting :
       {Lighting::kNone, Lighting::kLambert, Lighting::kPhong, Lighting::kSphericalHarmonics}) {
    TestScene<double> s(lighting);
    RendererT<double> renderer;
    FrameT<double> frame;
    ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, kOutputs, &frame).ok());
    const TestCotangents<double> cotangents(frame.images());
    TestGradients<double> g(s);
    ASSERT_TRUE(renderer.Backward(frame, cotangents.d, {&g.d, 1}).ok());
    int moving = 0;
    for (const Input& input : InputsOf(s, g)) {
      constexpr double kStep = 1e-6;
      const double x = *input.x;
      *input.x = x + kStep;
      const double up = Loss(&renderer, s, cotangents);
      *input.x = x - kStep;
      const double down = Loss(&renderer, s, cotangents);
      *input.x = x;
      const double difference = (up - down) / (2 * kStep);
      EXPECT_NEAR(*input.d_x, difference, 1e-5 * (1 + std::abs(difference)))
          << input.name << ", lighting " << static_cast<int>(lighting);
      moving += std::abs(difference) > 1e-3;
    }
    EXPECT_GT(moving, 60);  // the scene is not empty
  }
}

template <class T>
double NormOf(const std::vector<T>& v) {
  double sum = 0;
  for (const T x : v) sum += static_cast<double>(x) * static_cast<double>(x);
  return std::sqrt(sum);
}

void ExpectClose(const std::vector<float>& a, const std::vector<double>& b, const char* name) {
  ASSERT_EQ(a.size(), b.size());
  std::vector<double> difference(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) difference[i] = static_cast<double>(a[i]) - b[i];
  // A rounding of a coordinate is 4e-6 of a pixel here, and alpha falls by its whole within one:
  // 1e-3 leaves room for its sums, and is far below what a wrong array would give.
  EXPECT_LE(NormOf(difference), 1e-3 * NormOf(b)) << name;
}

TEST(ApiGradients, FloatAgreesWithDouble) {
  const TestScene<float> s(Lighting::kPhong);
  const TestScene<double> t(Lighting::kPhong);
  Renderer renderer;
  RendererT<double> reference;
  Frame frame;
  FrameT<double> truth;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, kOutputs, &frame).ok());
  ASSERT_TRUE(reference.Render({&t.scene, 1}, kTestOptions, kOutputs, &truth).ok());
  const TestCotangents<float> d(frame.images());
  const TestCotangents<double> dd(truth.images());
  TestGradients<float> g(s);
  TestGradients<double> h(t);
  ASSERT_TRUE(renderer.Backward(frame, d.d, {&g.d, 1}).ok());
  ASSERT_TRUE(reference.Backward(truth, dd.d, {&h.d, 1}).ok());
  ExpectClose(g.positions, h.positions, "positions");
  ExpectClose(g.colors, h.colors, "colors");
  ExpectClose(g.uvs, h.uvs, "uvs");
  ExpectClose(g.attributes, h.attributes, "attributes");
  ExpectClose(g.texels, h.texels, "texels");
  ExpectClose({g.camera.fx, g.camera.fy, g.camera.cx, g.camera.cy, g.camera.rotation[0],
               g.camera.rotation[7], g.camera.translation[2]},
              {h.camera.fx, h.camera.fy, h.camera.cx, h.camera.cy, h.camera.rotation[0],
               h.camera.rotation[7], h.camera.translation[2]},
              "camera");
  ExpectClose({g.lights[0].intensity, g.lights[0].direction[1], g.surfaces[0].shininess,
               g.surfaces[0].specular[2], g.surfaces[0].base_color[0]},
              {h.lights[0].intensity, h.lights[0].direction[1], h.surfaces[0].shininess,
               h.surfaces[0].specular[2], h.surfaces[0].base_color[0]},
              "light and surface");
}

TEST(ApiGradients, DoubleRefusesWhatFloatCannotHold) {
  TestScene<double> s(Lighting::kNone);
  s.positions[4] = 1e300;
  RendererT<double> renderer;
  FrameT<double> frame;
  EXPECT_EQ(renderer.Render({&s.scene, 1}, kTestOptions, {}, &frame).message(),
            "scene 0: positions[4] is inf");
}

}  // namespace tilegrad::gradients_test
