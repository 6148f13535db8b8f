// SPDX-License-Identifier: Apache-2.0
// How time grows. One image of an icosphere each, color and alpha. Names: faces-F, pixels-SIZE,
// delta-D.
#include <fmt/format.h>

#include "raster/render_runs.h"

namespace tilegrad::bench {
namespace {

constexpr int kMeshLevel = 5;  // 20,480 faces, as S3
constexpr int kImageSize = 256;

void AddPoint(const std::string& name, const RunSpec& spec) {
  AddRun({name, "both", "1"}, spec, Who::kRenderer);
  AddRun({name, "both", "culled"}, spec, Who::kCulled);
}

void AddFaces() {
  for (int level = 1, faces = 80; level <= 7; ++level, faces *= 4) {
    AddPoint(fmt::format("faces-{}", faces), {{"faces", 1, kImageSize, level}});
  }
}

void AddPixels() {
  for (int size = 32; size <= 2048; size *= 2) {
    AddPoint(fmt::format("pixels-{}", size), {{"pixels", 1, size, kMeshLevel}});
  }
}

// The scalar baseline visits every pixel of boxes that widen with the kernel, and takes seconds
// from 1e-2 on; it is not run beyond.
void AddDelta() {
  constexpr double kWidestCulled = 1e-2;
  for (const double delta : {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0}) {
    const std::string name = fmt::format("delta-{:g}", delta);
    RunSpec spec{{"delta", 1, kImageSize, kMeshLevel}};
    spec.delta = delta;
    if (delta <= kWidestCulled) AddRun({name, "both", "culled"}, spec, Who::kCulled);
    AddRun({name, "both", "1"}, spec, Who::kRenderer);
    spec.max_alpha_error = 1e-3;
    AddRun({name, "both", "1-E1e-3"}, spec, Who::kRenderer);
  }
}

}  // namespace

void AddGrowthSeries() {
  AddFaces();
  AddPixels();
  AddDelta();
}

}  // namespace tilegrad::bench
