// SPDX-License-Identifier: Apache-2.0
// The scenes that renderers are compared on: random rotations of an icosphere of radius 0.5, smooth
// or displaced by up to 15 %, seen with a field of view of 30 degrees from 2.732 away; random
// upstream gradients.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "raster/culled.h"
#include "render/pipeline/pipeline.h"
#include "scene/mesh.h"

namespace tilegrad::bench {

struct SceneSpec {
  const char* name;
  int images, size, level;  // icosphere level: 20 * 4^level faces
  bool displaced = false;
  const Mesh* mesh = nullptr;  // instead of an icosphere
};
inline constexpr SceneSpec kScenes[] = {{"S1", 64, 64, 3},
                                        {"S2", 8, 256, 3},
                                        {"S3", 4, 256, 5},
                                        {"S4", 1, 1024, 6, true},
                                        {"Training", 128, 64, 3}};

// A batch with everything that a forward and backward pass reads and writes.
struct BenchBatch {
  explicit BenchBatch(const SceneSpec& spec);

  RenderOptions options;
  std::vector<std::int32_t> faces;
  std::vector<float> colors;
  std::vector<std::vector<float>> positions;  // per image
  std::vector<Scene> scenes;                  // whose attributes are the colors
  std::vector<PipelineScene> views;
  std::vector<float> d_attributes, d_alpha;
  std::vector<std::vector<float>> d_positions, d_colors;
  std::vector<PipelineGradients> d_scenes;
};

// What Pipeline::Render does for a batch, into `frame`.
void Draw(const BenchBatch& batch, const Outputs& outputs, Pipeline* renderer, FrameImages* frame);

// The same batch for the yardstick, which starts on the screen.
struct CulledBatch {
  explicit CulledBatch(const BenchBatch& batch);

  void Forward(const CulledParts& parts);
  void Backward(const CulledParts& parts);  // after Forward; gradients are overwritten

  std::vector<std::int32_t> faces;
  std::vector<float> colors;
  std::vector<CulledScene> scenes;
  std::vector<CulledFrame> frames;
  std::vector<std::vector<float>> ndc, depth;  // per image
  std::vector<float> d_colors, d_alpha;        // [N,H,W,3], [N,H,W]
  std::vector<std::vector<float>> d_ndc, d_vertex_colors;
};

}  // namespace tilegrad::bench
