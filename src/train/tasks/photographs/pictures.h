// SPDX-License-Identifier: Apache-2.0
// Predictions of photographs in pictures: for scores and for people.
#pragma once

#include "train/tasks/photographs/model.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {

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
