// SPDX-License-Identifier: Apache-2.0
// Images of a model from the views of a dataset, by our own renderer.
//
// Anti-aliasing: each image is rendered at kSupersampling times its size, one sample a pixel, and
// averaged over squares of kSupersampling^2 samples; alpha is the covered share.
// Light, fixed in the world, so that a point has one colour in all views: Lambert with ambient
// 0.45, a key light of 0.45 from (0.35, 0.8, 0.5) and a fill light of 0.2 from (-0.6, 0.3, -0.75),
// both directions normalised; results above 1 are cut. Surfaces are two-sided, since real models
// are soups of shells: the normal is turned to the side that the camera sees.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "train/data/dataset.h"

namespace tilegrad::train {

inline constexpr int kSupersampling = 4;

// Owns a renderer and its scratch memory; one call at a time.
class ViewRenderer {
 public:
  ViewRenderer();
  ~ViewRenderer();
  ViewRenderer(ViewRenderer&&) noexcept;

  // `mesh` is valid and normalised. Returns [views][4][size][size] as ModelData::images.
  Result<std::vector<std::uint8_t>> Render(const Mesh& mesh, const CameraRule& rule, int views);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad::train
