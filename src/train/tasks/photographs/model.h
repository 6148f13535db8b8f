// SPDX-License-Identifier: Apache-2.0
// The trained network of section 5.4, ready to predict.
#pragma once

#include "train/tasks/photographs/config.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// What one photograph gives, in the world of the cameras.
struct PredictedPhotograph {
  Mesh mesh;               // with its texture
  WeakPerspective camera;  // of the crop, in [-1, 1]
  std::vector<std::array<double, 3>> keypoints;
};

// Of a network with the weights of now. pictures: [B, 3, size, size] in [0, 1].
Result<std::vector<PredictedPhotograph>> PredictPhotographs(nn::Context& context,
                                                            PhotographNetwork& network,
                                                            const nn::Tensor& pictures);

// Predict takes cut-outs: RGBA over black, framed anyhow, which are cropped as training crops
// photographs. Its meshes are brought to the truth's place and size: centred, largest half-extent
// 0.45.
class PhotographModel : public Model {
 public:
  PhotographModel(nn::Context& context, const PhotographsConfig& config,
                  const Checkpoint& checkpoint);
  Status Load(const std::vector<nn::NamedTensor>& state);

  Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes) override;
  PhotographModel* photographs() override { return this; }
  nn::Context& context() { return context_; }
  PhotographNetwork& network() { return network_; }
  const PhotographsConfig& config() const { return config_; }

 private:
  nn::Context& context_;
  PhotographsConfig config_;
  PhotographNetwork network_;
};

// Errors say what does not fit in the checkpoint.
Result<std::unique_ptr<Model>> LoadPhotographModel(nn::Context& context,
                                                   const PhotographsConfig& config,
                                                   const Checkpoint& checkpoint);

}  // namespace tilegrad::train
