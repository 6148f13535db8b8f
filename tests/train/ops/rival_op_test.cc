// SPDX-License-Identifier: Apache-2.0
// The rivals on the tape: which images there are, what reaches the inputs, errors. Gradients
// through a whole step: chain_test.cc.
#include "train/ops/rival_op.h"

#include <gtest/gtest.h>

#include "nn/nn.h"
#include "scene/shapes.h"

namespace tilegrad::train::rival_op_test {

constexpr int kSide = 12;

struct Setting {
  Workers workers{1};
  nn::Context context{workers};
  RivalRenderer renderer{workers};
  Mesh ball = Icosphere(1, 0.5f);
  nn::Var positions, colors;
  RivalJob job;

  Setting() {
    const auto v = static_cast<std::int64_t>(ball.positions.size());
    const std::span<const float> flat(&ball.positions[0].x, 3 * ball.positions.size());
    positions = nn::Parameter(context, context.From({1, v, 3}, flat));
    colors = nn::Parameter(context, context.Full({1, v, 3}, 0.5));
    job.faces = {ball.faces[0].data(), 3 * ball.faces.size()};
    job.size = kSide;
    for (int n = 0; n < 2; ++n)
      job.cameras.push_back(OrbitCamera({50, kSide, kSide}, 30.0 + 70 * n, 10, 1.9));
  }
  RenderedImages Draw(const nn::Var& with_colors) {
    return RenderRival(renderer, positions, with_colors, job);
  }
  // The error that was noted, if there is one.
  std::string Error() { return context.TakeStatus().message(); }
};

double SizeOf(const nn::Var& x) { return nn::Sum(nn::Abs(x)).item(); }

TEST(RenderRival, DrawsColorsWhereThereAreSome) {
  for (const rivals::Rule rule : {rivals::Rule::kSoftRas, rivals::Rule::kN3mr}) {
    Setting s;
    s.job.options.rule = rule;
    s.job.options.softras.near_plane = 0.1;
    const RenderedImages alone = s.Draw({});
    EXPECT_FALSE(alone.colors.valid());
    EXPECT_EQ(alone.alpha.shape(), (nn::Shape{2, kSide, kSide}));
    const RenderedImages both = s.Draw(s.colors);
    EXPECT_EQ(both.colors.shape(), (nn::Shape{2, 3, kSide, kSide}));
    EXPECT_EQ(SizeOf(both.alpha - alone.alpha), 0);
    EXPECT_GT(SizeOf(both.colors), 10);
  }
}

// A loss of one image leaves the adjoint of the other empty.
TEST(RenderRival, EachImageMayPushAlone) {
  for (const rivals::Rule rule : {rivals::Rule::kSoftRas, rivals::Rule::kN3mr}) {
    Setting s;
    s.job.options.rule = rule;
    s.job.options.softras.near_plane = 0.1;
    const auto of_alpha = nn::Grad(nn::Sum(s.Draw(s.colors).alpha), {s.positions, s.colors});
    EXPECT_GT(SizeOf(of_alpha[0]), 0.01);
    EXPECT_EQ(SizeOf(of_alpha[1]), 0);
    const auto of_color = nn::Grad(nn::Sum(s.Draw(s.colors).colors), {s.positions, s.colors});
    EXPECT_GT(SizeOf(of_color[0]), 0);  // little: all is grey, and the face has all of the weight
    EXPECT_GT(SizeOf(of_color[1]), 1);
    EXPECT_EQ(s.Error(), "");
  }
}

// Cubes of one colour each, that of their face's corners in the mean, draw the same and get the
// same gradient.
TEST(RenderTextured, CubesOfOneColorAreColorsOfFaces) {
  Setting s;
  s.job.options.rule = rivals::Rule::kN3mr;
  Rng rng(3);
  std::vector<float> at_vertices(3 * s.ball.positions.size());
  for (float& x : at_vertices) x = static_cast<float>(rng.Uniform());
  const auto v = static_cast<std::int64_t>(s.ball.positions.size());
  const auto f = static_cast<std::int64_t>(s.ball.faces.size());
  s.colors =
      nn::Parameter(s.context, s.context.From({1, v, 3}, std::span<const float>(at_vertices)));
  nn::Var faces;
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<std::int32_t> corners;
    for (const Face& face : s.ball.faces) corners.push_back(face[k]);
    const nn::Var corner = nn::Gather(s.colors, 1, s.context.Indices(corners));
    faces = k == 0 ? corner : faces + corner;
  }
  const nn::Var cubes = nn::BroadcastTo(nn::Reshape(faces * (1.0 / 3), {1, f, 1, 3}), {1, f, 8, 3});
  const auto images = s.Draw(s.colors);
  const nn::Var value = images.colors;
  const auto want = nn::Grad(nn::Sum(nn::Square(images.colors)), {s.positions, s.colors});
  const auto drawn = RenderTextured(s.renderer, s.positions, cubes, s.job);
  EXPECT_LT(SizeOf(drawn.colors - nn::Detach(value)), 1e-3);
  const auto got = nn::Grad(nn::Sum(nn::Square(drawn.colors)), {s.positions, s.colors});
  EXPECT_GT(SizeOf(want[1]), 1);
  EXPECT_LT(SizeOf(got[1] - want[1]), 1e-3 * SizeOf(want[1]));
  EXPECT_LT(SizeOf(got[0] - want[0]), 1e-2 * SizeOf(want[0]));
  EXPECT_EQ(s.Error(), "");
  s.job.options.rule = rivals::Rule::kSoftRas;
  EXPECT_FALSE(RenderTextured(s.renderer, s.positions, cubes, s.job).alpha.valid());
  EXPECT_NE(s.Error().find("only N3MR"), std::string::npos);
}

TEST(RenderRival, ErrorsReachTheContext) {
  Setting s;
  const auto expect = [&](const std::string& part) {
    const std::string error = s.Error();
    EXPECT_NE(error.find(part), std::string::npos) << error;
  };
  s.job.options.softras.sigma = -1;
  EXPECT_FALSE(s.Draw({}).alpha.valid());
  expect("SoftRas: sigma is -1");
  s.job.options = {};
  s.job.size = 0;
  s.Draw({});
  expect("for images of 0 pixels a side");
  s.job.size = kSide;
  s.Draw(nn::Constant(s.context, s.context.Full({1, 7, 3}, 0.5)));
  expect("colors has 21 numbers, expected 126");
  s.positions = nn::Constant(s.context, s.context.Full({42, 3}, 0.5));
  s.Draw({});
  expect("positions have the shape [42, 3]");
}

}  // namespace tilegrad::train::rival_op_test
