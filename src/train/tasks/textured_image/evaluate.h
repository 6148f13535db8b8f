// SPDX-License-Identifier: Apache-2.0
// Table 2 of the paper, beside baselines that know no light.
#pragma once

#include "train/tasks/task.h"
#include "train/tasks/textured_image/config.h"

namespace tilegrad::train {

// On held-out models in views_per_model views each (HeldOutViews), whose cameras the renders of
// predictions share. Of each view: texture L1, angle of the light, texture + light L1 as
// evaluation.h says (means over the whole image), and the scores of the shape. Rows with the
// predicted shape and texture: "without light", "mean light" (of training: what a constant scores),
// "tilegrad". Before the last stand four of the light that LightSearch finds in the same picture,
// given the predicted or the true shape and the predicted or the true texture: they split the error
// of a light into what each of these adds. Without a light model only the last row. Errors: as
// CheckHeldOut and OpenTexturedMeshes; a job with a change.
Result<Evaluation> EvaluateTextured(const TexturedImageConfig& config, const TaskEvaluation& job,
                                    const Workers& workers, const ProgressSink& progress,
                                    const StopFlag& stop);

}  // namespace tilegrad::train
