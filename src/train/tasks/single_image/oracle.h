// SPDX-License-Identifier: Apache-2.0
// What the template can do at best: fitted to all views of one object, with the renderer and the
// losses of training, instead of predicted from one of them.
#pragma once

#include "train/eval/evaluate.h"
#include "train/tasks/single_image/config.h"

namespace tilegrad::train {

// `steps` of Adam for each object, each over eight of its views, all in turn. The losses, their
// weights, the template and the soft band are the configuration's, the renderer is always ours. The
// mesh is as a prediction, with colours in [0, 1]; same bits for any number of workers. An error if
// a loss is not finite.
FitFunction FitTemplates(const SingleImageConfig& config, const DatasetInfo& info, int steps,
                         const Workers& workers);

}  // namespace tilegrad::train
