// SPDX-License-Identifier: Apache-2.0
// Scenes at the limits of float, and ones that rasterizers get wrong. A scene is a pure function of
// its number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/pipeline/test_scenes.h"

namespace tilegrad::test {

struct ExtremeScene {
  const char* kind = "";
  TestScene<float> scene;
  RenderOptions options;

  std::size_t pixels() const {
    return static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  }
};

// `most_faces`: how many may lie on one pixel (kind "heap").
ExtremeScene MakeExtremeScene(std::uint64_t number, std::size_t most_faces);
// So many faces on one pixel, of an image of a few.
ExtremeScene MakeHeap(std::uint64_t number, std::size_t faces);

}  // namespace tilegrad::test
