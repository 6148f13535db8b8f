// SPDX-License-Identifier: Apache-2.0
// N3MR's vertex parameterisation: values worked out by hand, independent numbers, differences.
#include <gtest/gtest.h>

#include "base/rng.h"
#include "nn/gradient_check.h"
#include "nn/nn.h"
#include "support/shared_data.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train::sphere_vertices_test {

using Vector = std::vector<double>;

struct Setting {
  nn::Context& context;
  nn::Var bias, centroid;
  nn::Tensor sphere;

  Setting(nn::Context& c, std::int64_t batch, const Vector& s, const Vector& b, const Vector& m)
      : context(c),
        bias(nn::Parameter(c, c.From({batch, Vertices(s), 3}, std::span<const double>(b)))),
        centroid(nn::Parameter(c, c.From({batch, 1, 3}, std::span<const double>(m)))),
        sphere(c.From({Vertices(s), 3}, std::span<const double>(s))) {}
  static std::int64_t Vertices(const Vector& s) { return static_cast<std::int64_t>(s.size() / 3); }
  nn::Var Out() const { return SphereVertices(bias, centroid, sphere); }
};

void ExpectNear(const nn::Var& got, const Vector& want, double tolerance) {
  nn::Tensor value = got.value();
  ASSERT_EQ(value.elements(), want.size());
  for (std::size_t i = 0; i < want.size(); ++i)
    EXPECT_NEAR(value.span<double>()[i], want[i], tolerance) << i;
}

// Without bias and centroid a quarter of the sphere; far biases reach the cube's side and middle; a
// centroid at the side takes both halves there; a coordinate of 0 stays at the centroid.
TEST(SphereVertices, ValuesByHand) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  ExpectNear(Setting(context, 1, {0.6, -0.8, 0}, {0, 0, 0}, {0, 0, 0}).Out(), {0.15, -0.2, 0},
             1e-15);
  ExpectNear(Setting(context, 1, {0.6, -0.8, 0}, {40, -40, 40}, {0, 0, 0}).Out(), {0.5, 0, 0},
             1e-15);
  ExpectNear(Setting(context, 1, {0.6, -0.8, 0}, {0, 0, 0}, {400, 400, 400}).Out(),
             {0.5, 0.5 - 0.4, 0.5}, 1e-15);
}

// 1e-12: both sides compute in double, on numbers near 1.
TEST(SphereVertices, GivesTheIndependentNumbers) {
  TILEGRAD_VECTORS_OR_SKIP(file, "11_n3mr_vertex_parameterisation.json");
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const Setting at(context, 2, tilegrad::Numbers(file["template"]),
                   tilegrad::Numbers(file["bias_out"]), tilegrad::Numbers(file["centroid_out"]));
  const nn::Var out = at.Out();
  ExpectNear(out, tilegrad::Numbers(file["vertices"]), 1e-12);
  const Vector push = tilegrad::Numbers(file["grad_out"]);
  const nn::Var d = nn::Constant(context, context.From(out.shape(), std::span<const double>(push)));
  const auto gradients = nn::Grad(nn::Sum(out * d), {at.bias, at.centroid});
  ExpectNear(gradients[0], tilegrad::Numbers(file["grad_bias"]), 1e-12);
  ExpectNear(gradients[1], tilegrad::Numbers(file["grad_centroid"]), 1e-12);
}

TEST(SphereVertices, GradientsAreDerivatives) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  Rng rng(4);
  const auto random = [&](std::size_t n) {
    Vector out(n);
    for (double& x : out) x = rng.Uniform(-1, 1);
    return out;
  };
  const Vector sphere = random(12);
  Setting at(context, 2, sphere, random(24), random(6));
  const auto loss = [&] {
    const nn::Var out = at.Out();
    return nn::Sum(out * out * out + out);
  };
  nn::ExpectGradientBy({at.bias, at.centroid}, loss, rng);
}

}  // namespace tilegrad::train::sphere_vertices_test
