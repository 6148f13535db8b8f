// SPDX-License-Identifier: Apache-2.0
// A classifier on models that it never saw: scores, and pictures of a report.
#pragma once

#include "train/tasks/classify/model.h"

namespace tilegrad::train {

// Accuracy of classes, beside always naming the most frequent class and naming that of the nearest
// training picture. Errors: as CheckHeldOut; images of another size or other classes than it was
// trained on; an empty split; meshes that are to be changed, of which there are none.
Result<Evaluation> EvaluateClassifier(const TaskEvaluation& job, ClassifierModel& model,
                                      const Workers& workers, const ProgressSink& progress,
                                      const StopFlag& stop);

// Showcase of the test split: three views of each model and what the network calls them.
Result<Showcase> ShowClassified(const ShowcaseRequest& request, ClassifierModel& model,
                                const ProgressSink& progress, const StopFlag& stop);

}  // namespace tilegrad::train
