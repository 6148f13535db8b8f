// SPDX-License-Identifier: Apache-2.0
// Pictures of predicted objects as TexturedStream has them of true ones.
#pragma once

#include <memory>
#include <vector>

#include "scene/image.h"
#include "tilegrad/renderer.h"
#include "train/data/stream/textured_stream.h"

namespace tilegrad::train {

// One call at a time.
class ObjectPictures {
 public:
  ObjectPictures(const LightConfig& light, int size, int samples);

  // [4][size][size], planar, RGB over black (or normals) and the covered share of each pixel.
  // `mesh` is valid; its normals are smooth, as in training.
  Result<std::vector<float>> Draw(const Mesh& mesh, const TexturedView& view,
                                  Appearance appearance);

 private:
  LightConfig light_;
  int size_, samples_;
  std::unique_ptr<Workers> alone_;
  Renderer renderer_;
  Frame frame_;
};

// Such a picture for people: over grey paper.
ImageU8 OnPaper(std::span<const float> rgba, int size);
// For the network: bytes.
std::vector<std::uint8_t> ToBytes(std::span<const float> rgba);

}  // namespace tilegrad::train
