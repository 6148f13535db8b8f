// SPDX-License-Identifier: Apache-2.0
// An upper bound for what the template can represent: fits it to all views of an object, with the
// renderer and losses of training, instead of predicting it from one view.
#pragma once

#include "train/eval/evaluate.h"
#include "train/tasks/single_image/config.h"

namespace tilegrad::train {

// `steps` steps of Adam for each object, each over eight of its views, cycling through all. Losses,
// weights, template and soft band are the configuration's; the renderer is always ours. Returns
// meshes like predictions, with colours in [0, 1]; the same bits for any number of workers. An
// error if a loss is not finite.
FitFunction FitTemplates(const SingleImageConfig& config, const DatasetInfo& info, int steps,
                         const Workers& workers);

}  // namespace tilegrad::train
