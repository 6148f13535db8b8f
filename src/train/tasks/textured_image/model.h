// SPDX-License-Identifier: Apache-2.0
// The trained network of sections 5.2 and 5.3, ready to predict.
#pragma once

#include "train/tasks/task.h"
#include "train/tasks/textured_image/config.h"

namespace tilegrad::train {

// The prediction from one image.
struct PredictedObject {
  Mesh mesh;                     // with its texture, unlit; the renderer makes smooth normals
  DrawnLight light;              // in the axes of the image's camera
  std::optional<Camera> camera;  // of the image, in its pixels; only with `lookup`
};

// With the network's present weights, in eval mode. images: [N][4][size][size] planar RGBA bytes,
// RGB over black.
Result<std::vector<PredictedObject>> PredictObjects(nn::Context& context, TextureNetwork& network,
                                                    std::span<const std::uint8_t> images,
                                                    int image_size);

class TexturedModel : public Model {
 public:
  TexturedModel(nn::Context& context, const TexturedImageConfig& config, int image_size);
  Status Load(const std::vector<nn::NamedTensor>& state);

  Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) override;
  // As Predict, with the light.
  Result<std::vector<PredictedObject>> PredictObjects(std::span<const std::uint8_t> images);
  TexturedModel* textured() override { return this; }
  const TexturedImageConfig& config() const { return config_; }
  // An error: refinement would bake the picture's light into the colours.
  Status CheckRefinable() const override;

 private:
  nn::Context& context_;
  TexturedImageConfig config_;
  int image_size_;
  TextureNetwork network_;
};

// Meshes have the template's faces, positions of CheckpointInfo::half_extent, centred, and one
// texture. Runs in eval mode. Errors say what does not fit in the checkpoint.
Result<std::unique_ptr<Model>> LoadTexturedModel(nn::Context& context,
                                                 const TexturedImageConfig& config,
                                                 const Checkpoint& checkpoint);

}  // namespace tilegrad::train
