// SPDX-License-Identifier: Apache-2.0
// Holds the Renderer's images and gradients of one scene to the references, within the tolerance
// that the references state themselves when they are run on numbers with error bounds (bounded.h)
// and that docs/numerics.md derives for alpha.
//
// Each stage is compared on the input that it got: projection on the scene, everything behind on
// the screen coordinates that raster::Project made, bit for bit. So the ill condition of one stage
// (a scene of 1e30 seen through a lens of 1e10) does not hide errors of the next.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "raster/extremes/scenes.h"
#include "render/renderer.h"

namespace tilegrad::test {

struct CheckCounts {
  std::size_t compared = 0;   // numbers held to a finite tolerance
  std::size_t sharp = 0;      // of those, tolerance below 1 % of the size of the number, or 1e-6
  std::size_t left_out = 0;   // numbers with no finite tolerance: only that they are finite
  std::size_t gradients = 0;  // scenes whose gradients could be compared
  std::size_t overflows = 0;  // scenes whose gradient does not fit into float, and was refused
  double worst = 0;           // error / tolerance

  void Add(const CheckCounts& other);
};

// What is wrong, or an empty string. `number` seeds the gradients and the choice of pixels.
std::string CheckExtremeScene(const ExtremeScene& scene, std::uint64_t number, Renderer* renderer,
                              CheckCounts* counts);

}  // namespace tilegrad::test
