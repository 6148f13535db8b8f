// SPDX-License-Identifier: Apache-2.0
// Pictures of what a network does now: rows of input | prediction | truth ... for a few objects.
#pragma once

#include <span>

#include "base/file.h"
#include "scene/image.h"
#include "train/tasks/single_image/step.h"

namespace tilegrad::train {

// One row an object: input view, its prediction, then each other view as prediction and truth; RGB
// composited over light grey, `zoom` screen pixels a pixel. Uses the statistics of training (eval
// mode) and no gradient; the weights are those of the last
// step, also where a moving average of them predicts.
Result<ImageU8> SampleSheet(nn::Context& context, TrainStep& step, const ImageStore& store,
                            std::span<const Sample> samples, std::int64_t at_step);

}  // namespace tilegrad::train
