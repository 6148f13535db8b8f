// SPDX-License-Identifier: Apache-2.0
// The examples of a report in one image.
#pragma once

#include "base/parallel.h"
#include "train/data/dataset.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// Fills sheet and sheet_columns from examples that show, as ShowHeldOut makes them, ShownViews of
// the dataset, each as truth and prediction. A row an example: what the network sees, its
// prediction from there, its prediction from the second view, and the truth from there. Predictions
// are drawn in detail, the dataset's pictures pixel by pixel. Nothing without examples.
Status AddSheet(int image_size, const Workers& workers, Showcase* showcase);

}  // namespace tilegrad::train
