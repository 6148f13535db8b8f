// SPDX-License-Identifier: Apache-2.0
// What the benchmarks of the whole renderer have in common: one pass over a batch by the renderer,
// by the scalar baseline ("culled") or by the naive reference, with the work counted.
#pragma once

#include <string>

#include "raster/bench_scenes.h"

namespace tilegrad::bench {

// What is rendered, and on how many workers.
struct RunSpec {
  SceneSpec scene;
  bool color = true, alpha = true;
  int workers = 1;
  Interpolation interpolation = Interpolation::kScreenLinear;
  double delta = 1.0 / 7000;
  double max_alpha_error = 1e-7;
};

enum class Who { kRenderer, kCulled, kNaive };
enum class Direction { kForward, kBackward };

// Registers `name`/<forward|backward>/.../<who>. Counters, of the whole batch: images, pixels,
// faces, pairs and exps (background pixels by faces with A >= 2^-25), bytes (that have to be
// written or read), limit_ms and limit_high_ms (work_count.h), and share, the part of the batch
// that was run: the naive reference runs sampled rows of the first image.
struct RunName {
  std::string scene, what, who;
};
void AddRun(const RunName& name, const RunSpec& spec, Who who);

// Time against faces, pixels and the width of the kernel.
void AddGrowthSeries();

}  // namespace tilegrad::bench
