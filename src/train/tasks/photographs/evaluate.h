// SPDX-License-Identifier: Apache-2.0
// Table 3 of the paper.
#pragma once

#include "train/tasks/photographs/model.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {

// On the photographs of job.split, uncut by chance. Rows: "mean shape" (with the predicted
// texture), "predicted camera", "tilegrad" through the cameras of the annotations, which is the
// table's. Of each: texture L1, mean |difference| over all pixels of the crop and the channels
// between the prediction and the photograph's object, both over black; 2D IoU loss, 1 - IoU of
// their covers; PCK at 0.1 (metrics/metrics.h), where there are keypoints. Errors: a set
// without cameras, one whose photographs were trained on, a job with a change or an oracle.
Result<Evaluation> EvaluatePhotographs(const TaskEvaluation& job, const Workers& workers,
                                       const ProgressSink& progress, const StopFlag& stop);

// Which photographs a run was trained on, in its folder: written by a new run, compared by a
// resumed one.
Status RememberPhotographs(const Path& run, const PhotographSet& set, bool is_new);
// InvalidArgument if some of that split were trained on.
Status CheckHeldOutPhotographs(const Path& run, const PhotographSet& set, Split split);

// At most `count` of that split, spread over it.
std::vector<int> ChoosePhotographs(const PhotographSet& set, Split split, int count);

// Predictions of photographs in pictures: for scores and for people.

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
