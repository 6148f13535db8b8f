// SPDX-License-Identifier: Apache-2.0
// The yardstick of the benchmarks does the same work as the renderer.
#include "raster/culled.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "raster/bench_scenes.h"
#include "raster/project.h"

namespace tilegrad::bench::culled_test {

constexpr SceneSpec kScene{"small", 3, 96, 3};

// One number of a result that differs: what it stands for, and by how much.
double Norm(const std::vector<float>& v) {
  double sum = 0;
  for (const float x : v) sum += static_cast<double>(x) * x;
  return std::sqrt(sum);
}

double Distance(std::vector<float> a, const std::vector<float>& b) {
  for (std::size_t k = 0; k < a.size(); ++k) a[k] -= b[k];
  return Norm(a);
}

// From dL/d(NDC) to dL/d(positions).
std::vector<float> ToWorld(const BenchBatch& batch, std::size_t image,
                           const std::vector<float>& d_ndc) {
  const Scene& scene = batch.scenes[image];
  raster::ScreenMeshBuffers screen;
  raster::Project(FaceSourceOf(scene, batch.options), batch.options.width, batch.options.height,
                  &screen);
  const std::size_t vertices = screen.x.size();
  std::vector<float> quads(4 * vertices), out(3 * vertices);
  for (std::size_t v = 0; v < vertices; ++v) {
    quads[4 * v] = d_ndc[2 * v] * 2 / static_cast<float>(batch.options.width);
    quads[4 * v + 1] = -d_ndc[2 * v + 1] * 2 / static_cast<float>(batch.options.height);
  }
  raster::ProjectBackwardScratch scratch;
  raster::ProjectBackward(FaceSourceOf(scene, batch.options), screen.View(), {quads, {}}, &scratch,
                          {out, nullptr});
  return out;
}

// The scene drawn and differentiated by the yardstick, and drawn by the renderer.
struct Both {
  BenchBatch batch{kScene};
  CulledBatch culled{batch};
  Workers workers{1};
  Pipeline renderer{workers};
  FrameImages frame;

  Both() {
    culled.Forward({});
    culled.Backward({});
    Draw(batch, {.color = false}, &renderer, &frame);
  }
};

TEST(Culled, AgreesWithTheRenderer) {
  Both both;
  auto& [batch, culled, workers, renderer, frame] = both;
  const std::size_t pixels = culled.frames[0].face_ids.size();
  std::size_t different = 0, covered = 0;
  double alpha = 0, color = 0;
  for (std::size_t i = 0; i < culled.frames.size(); ++i) {
    for (std::size_t p = 0; p < pixels; ++p) {
      const std::int32_t id = frame.face_ids[i * pixels + p];
      covered += id >= 0 ? 1u : 0u;
      if (id != culled.frames[i].face_ids[p]) {
        ++different;  // a centre within 1/2048 pixel of an edge
        continue;
      }
      alpha = std::max(alpha, std::abs(static_cast<double>(frame.alpha[i * pixels + p]) -
                                       culled.frames[i].alpha[p]));
      for (std::size_t c = 0; c < 3; ++c) {
        const double ours = frame.attributes[(3 * i + c) * pixels + p];
        color = std::max(color, std::abs(ours - culled.frames[i].colors[3 * p + c]));
      }
    }
  }
  EXPECT_GT(covered, pixels / 3);
  EXPECT_LE(different, covered / 500);
  // The yardstick leaves out A < 2^-25 of up to 1280 faces, and subtracts NDC of up to 1 (2^-24
  // each) for distances of which 1/delta = 7000 times the square counts: 7000 * 2 * 0.05 * 2^-23.
  EXPECT_LE(alpha, 1e-4);
  // The area of a face of a pixel or so is a difference of products of NDC: 2^-23 / (2 / 96)^2.
  EXPECT_LE(color, 1e-3);
}

TEST(Culled, GradientsAgreeWithTheRenderer) {
  Both both;
  auto& [batch, culled, workers, renderer, frame] = both;
  ASSERT_TRUE(renderer.Backward(batch.views, batch.options, frame,
                                {batch.d_attributes, batch.d_alpha}, batch.d_scenes));
  for (std::size_t i = 0; i < culled.frames.size(); ++i) {
    // Pixels whose face differs move their whole gradient: a share of up to 1/500 of them.
    EXPECT_GT(Norm(batch.d_colors[i]), 1);
    EXPECT_LE(Distance(batch.d_colors[i], culled.d_vertex_colors[i]),
              0.05 * Norm(batch.d_colors[i]));
    EXPECT_GT(Norm(batch.d_positions[i]), 1);
    EXPECT_LE(Distance(batch.d_positions[i], ToWorld(batch, i, culled.d_ndc[i])),
              0.05 * Norm(batch.d_positions[i]));
  }
}

}  // namespace tilegrad::bench::culled_test
