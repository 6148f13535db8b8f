// SPDX-License-Identifier: Apache-2.0
// Scenes that share their array of faces share what follows from it, and nobody can tell.
#include "render/pipeline/topologies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "render/pipeline/test_scenes.h"
#include "render/renderer.h"

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
  for (std::size_t n = 0; n < views.size(); ++n) {
    const Topology& t = topologies.of(n);
    ASSERT_EQ(3 * t.corners.v0.size(), views[n].faces.size());
    for (std::size_t f = 0; f < t.corners.v0.size(); ++f) {
      EXPECT_EQ(t.corners.v0[f], views[n].faces[3 * f]);
      EXPECT_EQ(t.corners.v1[f], views[n].faces[3 * f + 1]);
      EXPECT_EQ(t.corners.v2[f], views[n].faces[3 * f + 2]);
      EXPECT_EQ(t.corners.source_face[f], static_cast<std::int32_t>(f));
    }
  }
}

TEST(Topologies, KnowWhenFacesHaveChanged) {
  Pool pool;
  const Workers workers(1);
  Topologies topologies;
  auto views = pool.Views({0, 3});
  Update(&topologies, views, workers);
  const TopologyId sphere = topologies.of(0).id, soup = topologies.of(1).id;
  Update(&topologies, views, workers);
  EXPECT_EQ(topologies.of(0).id, sphere);
  std::swap(pool.faces[0][0], pool.faces[0][1]);  // where the view points to
  Update(&topologies, views, workers);
  EXPECT_NE(topologies.of(0).id, sphere);
  EXPECT_EQ(topologies.of(1).id, soup);
  std::reverse(pool.faces[2].begin(), pool.faces[2].end());
  Update(&topologies, pool.Views({0, 3}), workers);
  EXPECT_NE(topologies.of(1).id, soup);
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

}  // namespace tilegrad::topologies_test
