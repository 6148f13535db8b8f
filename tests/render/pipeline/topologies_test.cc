// SPDX-License-Identifier: Apache-2.0
// Scenes that share their array of faces share what follows from it, and nobody can tell.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "render/pipeline/image_scratch.h"
#include "render/pipeline/test_scenes.h"
#include "render/reference.h"
#include "render/renderer.h"
#include "support/expect.h"
#include "tilegrad/renderer.h"

namespace tilegrad::topologies_test {

using test::TestScene;

constexpr int kWidth = 40, kHeight = 36;

// Scenes with their own positions and attributes, and the arrays of faces that they point to.
struct Pool {
  std::vector<std::vector<std::int32_t>> faces;
  std::vector<TestScene<float>> scenes;
  std::vector<std::size_t> faces_of;  // of each scene

  // Three spheres of the same faces, the last of which has an array of its own; a soup; two scenes
  // that the near plane cuts, with the same faces.
  Pool() {
    Rng rng(5, 1);
    for (int i = 0; i < 3; ++i) scenes.push_back(test::BumpySphere(9, 11, kWidth, kHeight, &rng));
    scenes.push_back(test::TriangleSoup(40, 0.3, kWidth, kHeight, &rng));
    for (int i = 0; i < 2; ++i) {
      scenes.push_back(test::SoupAroundCamera(15, kWidth, kHeight, &rng));
    }
    faces_of = {0, 0, 1, 2, 3, 3};
    for (const std::size_t n : {0, 2, 3, 4}) faces.push_back(scenes[n].faces);
  }
  Scene View(std::size_t n) const {
    Scene view = scenes[n].View();
    view.faces = faces[faces_of[n]];
    return view;
  }
  std::vector<Scene> Views(const std::vector<std::size_t>& which) const {
    std::vector<Scene> out;
    for (const std::size_t n : which) out.push_back(View(n));
    return out;
  }
};

void Update(Topologies* topologies, const std::vector<Scene>& scenes, const Workers& workers) {
  std::vector<PipelineScene> views;
  for (const Scene& scene : scenes) views.push_back({&scene, {}});
  topologies->Update(views, workers);
}

TEST(Topologies, ScenesOfOneArrayShareOne) {
  const Pool pool;
  const Workers workers(2);
  Topologies topologies;
  const auto views = pool.Views({0, 1, 2, 3});
  Update(&topologies, views, workers);
  EXPECT_EQ(&topologies.of(0), &topologies.of(1));
  EXPECT_NE(&topologies.of(1), &topologies.of(2));
  const TopologyId sphere = topologies.of(0).id;
  Update(&topologies, views, workers);
  EXPECT_EQ(topologies.of(0).id, sphere);  // the same faces: it is not made again
  for (std::size_t n = 0; n < views.size(); ++n) {
    const FaceTopology& t = topologies.of(n);
    ASSERT_EQ(3 * t.corners.v0.size(), views[n].faces.size());
    for (std::size_t f = 0; f < t.corners.v0.size(); ++f) {
      EXPECT_EQ(t.corners.v0[f], views[n].faces[3 * f]);
      EXPECT_EQ(t.corners.v1[f], views[n].faces[3 * f + 1]);
      EXPECT_EQ(t.corners.v2[f], views[n].faces[3 * f + 2]);
      EXPECT_EQ(t.corners.source_face[f], static_cast<std::int32_t>(f));
    }
  }
}

RenderOptions Options() { return {.width = kWidth, .height = kHeight, .delta = 1e-3}; }

// Everything that a scene's image and gradients are, as bytes.
std::string Bytes(Renderer* renderer, const std::vector<Scene>& views) {
  Frame frame;
  EXPECT_TRUE(renderer->Render(views, Options(), {.color = false}, &frame).ok());
  const Images& images = frame.images();
  std::vector<std::vector<float>> positions, attributes;
  for (const Scene& view : views) {
    positions.emplace_back(view.positions.size());
    attributes.emplace_back(view.attributes.values.size());
  }
  std::vector<SceneGradients> d_scenes(views.size());
  for (std::size_t n = 0; n < views.size(); ++n) {
    d_scenes[n].positions = positions[n];
    d_scenes[n].attributes = attributes[n];
  }
  EXPECT_TRUE(
      renderer->Backward(frame, {.alpha = images.alpha, .attributes = images.attributes}, d_scenes)
          .ok());
  std::string out;
  const std::size_t count = views.size();
  const auto add = [&](const auto& values, std::size_t n, std::size_t parts) {
    const std::size_t size = values.size() / parts * sizeof(values[0]);
    out.append(reinterpret_cast<const char*>(values.data()) + n * size, size);
  };
  for (std::size_t n = 0; n < count; ++n) {
    add(images.face_ids, n, count);
    add(images.attributes, n, count);
    add(images.alpha, n, count);
    add(positions[n], 0, 1);
    add(attributes[n], 0, 1);
  }
  return out;
}

// A renderer that has seen other batches, of other sizes, of other faces at the same place in
// memory, gives the bits of one that has seen nothing.
TEST(Topologies, WhatWasRenderedBeforeDoesNotMatter) {
  Pool pool;
  Rng rng(6, 1);
  for (const int count : {1, 3}) {
    const Workers workers(count);
    Renderer renderer = RendererOn(workers);
    for (int round = 0; round < 120; ++round) {
      std::vector<std::size_t> which(1 + rng.Below(6));
      for (std::size_t& n : which) n = rng.Below(pool.scenes.size());
      if (round % 3 == 2) {
        auto& faces = pool.faces[rng.Below(pool.faces.size())];
        const std::size_t f = 3 * rng.Below(faces.size() / 3);
        std::swap(faces[f], faces[f + rng.Below(3)]);
      }
      std::string one_by_one;
      for (const std::size_t n : which) {
        Renderer fresh = RendererOn(workers);
        one_by_one += Bytes(&fresh, {pool.View(n)});
      }
      ASSERT_TRUE(Bytes(&renderer, pool.Views(which)) == one_by_one)
          << count << " workers, round " << round;
    }
  }
}

// AlphaRule::kPaper through the Renderer: the reference in double, and that it is what it says it
// is (cut off, and dependent on the order of the faces). Golden numbers:
// tests/python/test_kaolin.py.

constexpr Outputs kImages{.color = false};

RenderOptions PaperOptions() {
  RenderOptions options;
  options.width = 37;
  options.height = 41;
  options.delta = 1e-3;
  options.alpha_rule = AlphaRule::kPaper;
  options.paper_box = 0.1;
  options.paper_faces = 5;
  return options;
}

// One scene, rendered.
struct Drawn {
  TestScene<float> mesh;
  Frame frame;

  Drawn(TestScene<float> scene, const RenderOptions& options) : mesh(std::move(scene)) {
    const Scene view = mesh.View();
    Ok(Renderer({.threads = 2}).Render({&view, 1}, options, kImages, &frame));
  }
  std::span<const float> alpha() const { return frame.images().alpha; }
};

struct Gradients {
  std::vector<float> positions;
  Camera camera;
};

Gradients BackwardOf(const Drawn& drawn, const FrameGradients& d_frame, int threads) {
  Gradients out{std::vector<float>(drawn.mesh.positions.size()), {}};
  const SceneGradients d{.positions = out.positions, .camera = &out.camera};
  Ok(Renderer({.threads = threads}).Backward(drawn.frame, d_frame, {&d, 1}));
  return out;
}

// Not smooth: a face more or less in a box, or another nearest corner, changes things. Float and
// double disagree about that in few pixels, which are counted.
void CheckAgainstReference(const RenderOptions& options, std::size_t most_different) {
  Rng rng(4);
  const Drawn drawn(test::TriangleSoup(40, 0.15, options.width, options.height, &rng), options);
  const auto alpha = drawn.alpha();
  EXPECT_TRUE(std::isinf(drawn.frame.images().alpha_error_bound));
  const auto wide = MeshCast<double>(drawn.mesh);
  const SceneT<double> truth_scene = wide.View();
  FrameImagesT<double> truth;
  const auto ids = drawn.frame.images().face_ids;
  ReferenceRender(truth_scene, options, kImages, ids, &truth);
  std::vector<float> d_alpha(alpha.size());
  std::size_t different = 0, between = 0;
  for (std::size_t i = 0; i < alpha.size(); ++i) {
    // Distances err by 8 eps in NDC, so exp(-z) by at most 0.86 * 8 eps / sqrt(delta) = 3e-5.
    const bool same = std::abs(static_cast<double>(alpha[i]) - truth.alpha[i]) < 1e-4;
    different += !same;
    between += alpha[i] > 0 && alpha[i] < 1;
    if (same) d_alpha[i] = static_cast<float>(rng.Uniform(-1, 1));
  }
  EXPECT_LE(different, most_different);
  EXPECT_GT(between, 100u);
  const std::vector<double> t_d_alpha(d_alpha.begin(), d_alpha.end());
  std::vector<double> t_positions(drawn.mesh.positions.size());
  CameraT<double> t_camera;
  ReferenceRenderBackward<double>(truth_scene, options, ids, {.alpha = t_d_alpha},
                                  {.positions = t_positions, .camera = &t_camera});
  const Gradients got = BackwardOf(drawn, {.alpha = d_alpha}, 2);
  double largest = 0;
  for (const double d : t_positions) largest = std::max(largest, std::abs(d));
  EXPECT_GT(largest, 0);
  for (std::size_t i = 0; i < t_positions.size(); ++i) {
    EXPECT_NEAR(got.positions[i], t_positions[i], 1e-3 * largest);
  }
  EXPECT_NEAR(got.camera.fx / t_camera.fx, 1, 1e-2);
  for (const int threads : {1, 3}) {
    EXPECT_EQ(BackwardOf(drawn, {.alpha = d_alpha}, threads).positions, got.positions);
  }
}

TEST(PaperAlpha, RendererIsTheReference) { CheckAgainstReference(PaperOptions(), 10); }

// Several bins, some of them narrower than others.
TEST(PaperAlpha, RendererIsTheReferenceOnLargeImages) {
  RenderOptions options = PaperOptions();
  options.width = 150;
  options.height = 133;
  CheckAgainstReference(options, 100);
}

// Two gradients in one call are the sum of both.
TEST(PaperAlpha, AddsToTheGradientOfAttributes) {
  const RenderOptions options = PaperOptions();
  Rng rng(5);
  const Drawn drawn(test::BumpySphere(4, 6, options.width, options.height, &rng), options);
  const std::vector<float> d_alpha(drawn.alpha().size(), 1.0f),
      d_attributes(3 * d_alpha.size(), 0.5f);
  const auto both = BackwardOf(drawn, {.alpha = d_alpha, .attributes = d_attributes}, 1).positions;
  const auto one = BackwardOf(drawn, {.attributes = d_attributes}, 1).positions;
  const auto alpha = BackwardOf(drawn, {.alpha = d_alpha}, 1).positions;
  for (std::size_t i = 0; i < both.size(); ++i) EXPECT_EQ(both[i], one[i] + alpha[i]);
}

TEST(PaperAlpha, IsCutOffAndDependsOnTheOrderOfFaces) {
  RenderOptions options = PaperOptions();
  options.paper_box = 0.2;
  options.paper_faces = 1;
  Rng rng(6);
  const auto scene = test::TriangleSoup(30, 0.1, options.width, options.height, &rng);
  auto reversed = scene;
  std::reverse(reversed.faces.begin(), reversed.faces.end());
  const Drawn forward(scene, options), backward(reversed, options);
  double most = 0;
  for (std::size_t i = 0; i < forward.alpha().size(); ++i) {
    most = std::max(most, std::abs(static_cast<double>(forward.alpha()[i] - backward.alpha()[i])));
  }
  EXPECT_GT(most, 0.1);
}

}  // namespace tilegrad::topologies_test
