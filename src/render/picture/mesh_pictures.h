// SPDX-License-Identifier: Apache-2.0
// Pictures of a mesh: under the fixed light of datasets, and unlit for viewing predictions. Not
// differentiable.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "scene/camera.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "tilegrad/scene.h"
#include "tilegrad/status.h"

namespace tilegrad {

// The light of datasets: Lambert with ambient 0.45, a key light of 0.45 from (0.35, 0.8, 0.5) and a
// fill light of 0.2 from (-0.6, 0.3, -0.75), on sRGB values. It is fixed in the world,
// so that a point has the same colour in all views.
inline constexpr float kDatasetAmbient = 0.45f;

std::array<Light, 2> DatasetLights();  // key, fill; directions are unit

// White, with that ambient light.
Surface DatasetSurface();

// Pictures of a mesh with its materials under the light of datasets, clamped at 1. Surfaces are
// two-sided, cut out by their alpha mask if they have one, else opaque; the file's normals are
// flipped to the side of the winding, since real models are soups of shells. 4 x 4 samples per
// pixel.
//
// Owns a renderer and its scratch memory; one call at a time, on the calling thread.
class LitRenderer {
 public:
  LitRenderer();
  ~LitRenderer();
  LitRenderer(LitRenderer&&) noexcept;

  // `cameras` are for square images of `size` pixels, 1 to 4096. Returns [cameras][4][size][size],
  // planar RGBA, RGB composited over black; alpha is coverage. Errors: an invalid mesh or one
  // without faces, and those of Renderer::Render.
  Result<std::vector<std::uint8_t>> Render(const Mesh& mesh, std::span<const Camera> cameras,
                                           int size);
  // One picture as an RGBA image, straight alpha.
  Result<ImageU8> RenderStraight(const Mesh& mesh, const Camera& camera, int size);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Predicted colours include the light of the training images, so these pictures are unlit, over
// kPaper, with 3 x 3 samples per pixel. One RGB picture of size x size per camera; the lenses are
// for `camera_size` pixels a side.
struct UnlitPictures {
  std::span<const Camera> cameras;
  int camera_size = 64;
  int size = 256;
};
Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const UnlitPictures& request,
                                      const Workers& workers);

}  // namespace tilegrad
