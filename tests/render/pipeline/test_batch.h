// SPDX-License-Identifier: Apache-2.0
// A batch with its gradients, for tests of what the renderer promises besides numbers.
#pragma once

#include <cstddef>
#include <vector>

#include "render/pipeline/pipeline.h"
#include "render/pipeline/test_scenes.h"

namespace tilegrad::test {

inline constexpr int kWidth = 40, kHeight = 36;

inline RenderOptions Options(int width = kWidth, int height = kHeight) {
  RenderOptions options;
  options.width = width;
  options.height = height;
  options.delta = 1e-3;
  return options;
}

struct Batch {
  RenderOptions options;
  std::vector<TestScene<float>> scenes;
  std::vector<PipelineScene> views;
  std::vector<float> d_attributes, d_alpha;
  std::vector<std::vector<float>> positions, attributes;
  std::vector<PipelineGradients> d_scenes;

  // A sphere, soups, one of them cut by the near plane; each image is one task.
  Batch() : options(Options()) {
    Rng rng(21, 1);
    scenes = {BumpySphere(10, 12, kWidth, kHeight, &rng),
              TriangleSoup(40, 0.3, kWidth, kHeight, &rng),
              SoupAroundCamera(20, kWidth, kHeight, &rng)};
    Finish(&rng);
  }

  // Images of several bins and bands, which are not whole, and a mesh of several chunks of faces
  // and vertices: each image is many tasks.
  static Batch Large() {
    constexpr int kLargeWidth = 150, kLargeHeight = 139;
    Rng rng(22, 1);
    Batch out(Options(kLargeWidth, kLargeHeight));
    out.scenes = {BumpySphere(110, 90, kLargeWidth, kLargeHeight, &rng),
                  SoupAroundCamera(30, kLargeWidth, kLargeHeight, &rng),
                  TriangleSoup(200, 0.2, kLargeWidth, kLargeHeight, &rng)};
    out.Finish(&rng);
    return out;
  }

 private:
  explicit Batch(const RenderOptions& o) : options(o) {}

  void Finish(Rng* rng) {
    for (const auto& scene : scenes) {
      views.push_back(scene.View());
      positions.emplace_back(scene.positions.size());
      attributes.emplace_back(scene.attributes.size());
    }
    for (std::size_t n = 0; n < scenes.size(); ++n) {
      d_scenes.push_back({positions[n], attributes[n], true, {}});
    }
    d_alpha.resize(scenes.size() * static_cast<std::size_t>(options.width * options.height));
    d_attributes.resize(3 * d_alpha.size());
    for (float& d : d_attributes) d = static_cast<float>(rng->Uniform(-1, 1));
    for (float& d : d_alpha) d = static_cast<float>(rng->Uniform(-1, 1));
  }
};

}  // namespace tilegrad::test
