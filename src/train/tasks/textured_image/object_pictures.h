// SPDX-License-Identifier: Apache-2.0
// Pictures of predicted objects, as TexturedStream draws true ones.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "scene/image.h"
#include "tilegrad/renderer.h"
#include "train/data/stream/textured_stream.h"
#include "train/tasks/task.h"
#include "train/tasks/textured_image/held_out_views.h"
#include "train/tasks/textured_image/model.h"

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

// Such a picture as bytes for the network.
std::vector<std::uint8_t> ToBytes(std::span<const float> rgba);

// Rows of pictures as in the paper's figures 5 and 6.

struct ShownObject {
  std::string name;
  const PredictedObject& object;  // from the first view
  const HeldOutViews::Views& truth;
};

// input | texture + light | texture | light | the true texture and light | for each other view
// texture and true texture | map.
Result<std::vector<ShownPicture>> PicturesOf(const ShownObject& shown, ObjectPictures& pictures,
                                             int size);
// Stacks such rows, all cells of one size.
ImageU8 SheetOf(const std::vector<std::vector<ShownPicture>>& rows, int size);

}  // namespace tilegrad::train
