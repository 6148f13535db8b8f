// SPDX-License-Identifier: Apache-2.0
// Pictures of predicted meshes for people: anti-aliased, unlit (the predicted colours hold the
// light of the training images), over light grey.
#pragma once

#include <span>
#include <vector>

#include "base/parallel.h"
#include "scene/camera.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

inline constexpr float kPaper = 0.88f;  // the grey behind pictures, 0..1

// One RGB picture of size x size a camera. The cameras' lenses are for `camera_size` pixels a side;
// vertex colours (white where the mesh has none) are interpolated.
struct PictureRequest {
  std::span<const Camera> cameras;
  int camera_size = 64;
  int size = 256;
};
Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const PictureRequest& request,
                                      const Workers& workers);

// Planar RGBA bytes [4][size][size], RGB over black, as datasets hold them, composited over the
// grey.
ImageU8 CompositeOverPaper(std::span<const std::uint8_t> planar, int size);

// Images of one size in rows of `columns`, with a white gap.
ImageU8 TileImages(std::span<const ImageU8> images, int columns);

}  // namespace tilegrad::train
