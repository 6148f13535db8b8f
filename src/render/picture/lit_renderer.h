// SPDX-License-Identifier: Apache-2.0
// Pictures of a mesh with its materials under the fixed light of shade/lit_surface.h: for datasets
// and for people. Not differentiable.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "scene/camera.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Anti-aliasing: each picture is rendered at that many times its size, one sample a pixel, and
// averaged over squares; alpha is the covered share.
inline constexpr int kSupersampling = 4;

// Owns a renderer and its scratch memory; one call at a time, on the calling thread.
class LitRenderer {
 public:
  LitRenderer();
  ~LitRenderer();
  LitRenderer(LitRenderer&&) noexcept;

  // `cameras` are those of square images of `size` pixels, 1 to 4096. Returns
  // [cameras][4][size][size], planar RGBA, RGB composited over black. Errors: an invalid mesh or
  // one without faces, and those of Renderer::Render.
  Result<std::vector<std::uint8_t>> Render(const Mesh& mesh, std::span<const Camera> cameras,
                                           int size);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The unlit colour of each corner, [3F]: factor x texture x vertex colour. `mesh` is valid.
std::vector<glm::vec3> CornerColors(const Mesh& mesh);

}  // namespace tilegrad
