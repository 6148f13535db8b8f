// SPDX-License-Identifier: Apache-2.0
// The trained network of section 5.4, ready to predict.
#pragma once

#include "train/tasks/photographs/config.h"
#include "train/tasks/task.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {

// The prediction from one photograph, in the cameras' world coordinates.
struct PredictedPhotograph {
  Mesh mesh;               // with its texture
  WeakPerspective camera;  // of the crop, in [-1, 1]
  std::vector<std::array<double, 3>> keypoints;
};

// With the network's present weights. pictures: [B, 3, size, size] in [0, 1].
Result<std::vector<PredictedPhotograph>> PredictPhotographs(nn::Context& context,
                                                            PhotographNetwork& network,
                                                            const nn::Tensor& pictures);

// Predict takes cut-outs, RGBA over black in any framing, and crops them as training crops
// photographs. It moves and scales its meshes like the truth: centred, largest half-extent 0.45.
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

// Table 3 of the paper.

// On the photographs of job.split, without random crops. Rows: "mean shape" (with the predicted
// texture), "predicted camera", and the table's "tilegrad", through the annotated cameras. Of each:
// texture L1, mean |difference| of prediction and object, both over black, over all pixels and
// channels of the crop; 2D IoU loss, 1 - IoU of their covers; PCK at 0.1 (metrics/metrics.h).
// Errors: a set without cameras, photographs that were trained on, a job with a change or an
// oracle.
Result<Evaluation> EvaluatePhotographs(const TaskEvaluation& job, const Workers& workers,
                                       const Watch& watch);

// At most `count` of that split, spread over it.
std::vector<int> ChoosePhotographs(const PhotographSet& set, Split split, int count);

// Renders predictions from photographs, for scores and for people.

class PhotographPictures {
 public:
  explicit PhotographPictures(int size);
  // The mesh as a camera sees it (of a crop, in [-1, 1]): [4][size][size], RGB over black and the
  // covered share, in [0, 1].
  Result<std::vector<float>> Draw(const Mesh& mesh, const WeakPerspective& camera);
  // photograph | the same with keypoints, predicted (rings) and annotated | prediction | from the
  // other side | from the front | texture. `rgb` [3][size][size]: the photograph.
  Result<std::vector<ShownPicture>> Row(const std::string& name,
                                        const PredictedPhotograph& predicted,
                                        const CroppedPhoto& crop, std::span<const float> rgb);

 private:
  int size_;
  ObjectPictures pictures_;
};

}  // namespace tilegrad::train
