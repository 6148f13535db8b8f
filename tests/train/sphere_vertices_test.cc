// SPDX-License-Identifier: Apache-2.0
// N3MR's vertex parameterisation: values worked out by hand, independent numbers, differences.
#include "train/models/sphere_vertices.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/rng.h"
#include "nn/nn.h"
#include "support/shared_data.h"

namespace tilegrad::train::sphere_vertices_test {

using Numbers = std::vector<double>;

struct Setting {
  nn::Context& context;
  nn::Var bias, centroid;
  nn::Tensor sphere;

  Setting(nn::Context& c, std::int64_t batch, const Numbers& s, const Numbers& b, const Numbers& m)
      : context(c),
        bias(nn::Parameter(c, c.From({batch, Vertices(s), 3}, std::span<const double>(b)))),
        centroid(nn::Parameter(c, c.From({batch, 1, 3}, std::span<const double>(m)))),
        sphere(c.From({Vertices(s), 3}, std::span<const double>(s))) {}
  static std::int64_t Vertices(const Numbers& s) { return static_cast<std::int64_t>(s.size() / 3); }
  nn::Var Out() const { return SphereVertices(bias, centroid, sphere); }
};

void ExpectNear(const nn::Var& got, const Numbers& want, double tolerance) {
  nn::Tensor value = got.value();
  ASSERT_EQ(value.elements(), want.size());
  for (std::size_t i = 0; i < want.size(); ++i)
    EXPECT_NEAR(value.span<double>()[i], want[i], tolerance) << i;
}

Numbers Flat(const nlohmann::json& from) {
  if (!from.is_array()) return {from.get<double>()};
  Numbers out;
  for (const auto& part : from) {
    const Numbers numbers = Flat(part);
    out.insert(out.end(), numbers.begin(), numbers.end());
  }
  return out;
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
  const auto path = SharedFile("vectors/11_n3mr_vertex_parameterisation.json");
  if (!path) GTEST_SKIP() << "vectors/11_n3mr_vertex_parameterisation.json is not there";
  std::ifstream stream(*path);
  const auto file = nlohmann::json::parse(stream);
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  const Setting at(context, 2, Flat(file["template"]), Flat(file["bias_out"]),
                   Flat(file["centroid_out"]));
  const nn::Var out = at.Out();
  ExpectNear(out, Flat(file["vertices"]), 1e-12);
  const Numbers push = Flat(file["grad_out"]);
  const nn::Var d = nn::Constant(context, context.From(out.shape(), std::span<const double>(push)));
  const auto gradients = nn::Grad(nn::Sum(out * d), {at.bias, at.centroid});
  ExpectNear(gradients[0], Flat(file["grad_bias"]), 1e-12);
  ExpectNear(gradients[1], Flat(file["grad_centroid"]), 1e-12);
}

// Central differences: truncation 1e-10, rounding 1e-16 / 1e-5; values and slopes of order 1.
TEST(SphereVertices, GradientsAreDerivatives) {
  const Workers workers(1);
  nn::Context context(workers, nn::DType::kF64);
  Rng rng(4);
  const auto random = [&](std::size_t n) {
    Numbers out(n);
    for (double& x : out) x = rng.Uniform(-1, 1);
    return out;
  };
  const Numbers sphere = random(12);
  Setting at(context, 2, sphere, random(24), random(6));
  const auto loss = [&] {
    const nn::Var out = at.Out();
    return nn::Sum(out * out * out + out);
  };
  const auto gradients = nn::Grad(loss(), {at.bias, at.centroid});
  nn::Var* const parameters[] = {&at.bias, &at.centroid};
  for (std::size_t p = 0; p < 2; ++p) {
    nn::Tensor gradient = gradients[p].value();
    for (std::size_t i = 0; i < gradient.elements(); ++i) {
      double& number = parameters[p]->value().data<double>()[i];
      const double before = number, h = 1e-5;
      number = before + h;
      const double up = loss().item();
      number = before - h;
      const double down = loss().item();
      number = before;
      EXPECT_NEAR(gradient.span<double>()[i], (up - down) / (2 * h), 1e-9);
    }
  }
}

}  // namespace tilegrad::train::sphere_vertices_test
