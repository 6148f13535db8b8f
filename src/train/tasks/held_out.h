// SPDX-License-Identifier: Apache-2.0
// Evaluation and examples on held-out models, shared by the tasks that learn from a dataset's
// images and predict a mesh from one.
#pragma once

#include <vector>

#include "base/parallel.h"
#include "train/data/dataset.h"
#include "train/eval/evaluate.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

inline constexpr int kShownViews = 3;

// Makes a function that fits, in `steps` steps on the workers, what a task predicts.
using MakeFitFunction = std::function<FitFunction(const DatasetInfo&, int steps, const Workers&)>;

// The dataset that a run is scored on or shown with. Errors: as CheckHeldOut, except for the
// training models, which may be scored; images of another size than the predictor's.
Result<Dataset> OpenHeldOut(const TaskEvaluation& job);
Result<Dataset> OpenHeldOut(const ShowcaseRequest& request);

// Scores of eval/evaluate.h. Errors: as CheckHeldOut and Evaluate; images of another size.
// `fit`: for TaskEvaluation::oracle_steps, which are an error without it.
Result<Evaluation> EvaluateOnDataset(const TaskEvaluation& job, const Workers& workers,
                                     const Watch& watch, const MakeFitFunction& fit = nullptr);

// Showcase::data ("It learned from 299 models in 11 classes ..."), note, credits, camera and
// examples of the test split: the truth of each shown view beside the prediction from the first.
Result<Showcase> ShowHeldOut(const ShowcaseRequest& request, const Workers& workers,
                             const Watch& watch);

// Its parts. Showcase::data, credits and camera:
Showcase AboutDataset(const Dataset& dataset, const RunHeader& header);
// An example of one model, with its names only.
Example NamedExample(const Dataset& dataset, int model);

// At most `count` models of the test split, spread over the classes: one of each class, then a
// second of each, ...; where a round has more classes than are left to choose, evenly spaced ones.
std::vector<int> ChooseModels(const Dataset& dataset, int count);

// Which of `views` around a model are shown, kShownViews at most: the first at five sixths of the
// circle, which sees models that face +z obliquely from the front; the others spread from there.
std::vector<int> ShownViews(int views);

}  // namespace tilegrad::train
