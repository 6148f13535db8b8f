// SPDX-License-Identifier: Apache-2.0
// Pictures of a mesh: under the fixed light of datasets, and unlit for people who look at
// predictions. Not differentiable.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "scene/camera.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Pictures of a mesh with its materials under a light that is fixed in the world, so that a point
// has one colour in all views: Lambert with ambient 0.45, a key light of 0.45 from (0.35, 0.8, 0.5)
// and a fill light of 0.2 from (-0.6, 0.3, -0.75), in the numbers of the files, cut at 1. Surfaces
// are two-sided, cut out where they ask for an alpha mask, else opaque, and normals of files are
// turned to the side of the winding, since real models are soups of shells. 4 x 4 samples a pixel.
//
// Owns a renderer and its scratch memory; one call at a time, on the calling thread.
class LitRenderer {
 public:
  LitRenderer();
  ~LitRenderer();
  LitRenderer(LitRenderer&&) noexcept;

  // `cameras` are those of square images of `size` pixels, 1 to 4096. Returns
  // [cameras][4][size][size], planar RGBA, RGB composited over black; alpha is the covered share.
  // Errors: an invalid mesh or one without faces, and those of Renderer::Render.
  Result<std::vector<std::uint8_t>> Render(const Mesh& mesh, std::span<const Camera> cameras,
                                           int size);
  // One such picture as an RGBA image, straight alpha.
  Result<ImageU8> RenderStraight(const Mesh& mesh, const Camera& camera, int size);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Predicted colours hold the light of the training images: unlit, over kPaper, 3 x 3 samples a
// pixel. One RGB picture of size x size for each camera, whose lenses are for `camera_size` pixels
// a side.
struct UnlitPictures {
  std::span<const Camera> cameras;
  int camera_size = 64;
  int size = 256;
};
Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const UnlitPictures& request,
                                      const Workers& workers);

// The unlit colour of each corner, [3F]: factor x texture x vertex colour. `mesh` is valid.
std::vector<glm::vec3> CornerColors(const Mesh& mesh);

}  // namespace tilegrad
